"""The equations of the elements' volumes, where their pressures are unknowns beside the displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class VolumeEquations:
    """B δu − E⁻¹ δp = 0 of the ``m`` elements of a solid, and what a preconditioner should know of them.

    Its stiffness is A + Bᵀ E B; A keeps a part of the bulk modulus (an augmented Lagrangian), E is the rest.

    Attributes
    ----------
    nodes
        ``(m, n)``.
    volume
        V of each element, ``(m,)``, mm³.
    gradient
        B, ``b_k = ∫ ψ_k ∂J/∂u dV``, ``(m, k, d, n)``, mm².
    bulk
        E, ``(m, k, k)``, MPa/mm³.
    modulus
        What resists a change of volume in A, ``(m,)``, MPa.
    """

    nodes: Ints
    volume: Floats
    gradient: Floats
    bulk: Floats
    modulus: Floats
