"""The state of a body: everything that an equilibrium consists of, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """One state of a system.

    Attributes
    ----------
    u
        Displacement ``(n_points, 3)``, mm.
    dilatation
        Mean dilatation of each element as an unknown of its own, ``(n_cells,)``. At an equilibrium it equals the ratio
        of deformed to reference volume; during Newton's iteration it lags behind, and the tangent
        uses the pressure that belongs to it.
    loads
        Value of every load ``(n_loads,)``: a cavity's pressure in MPa, a factor for the others.
    """

    u: Floats
    dilatation: Floats
    loads: Floats

    def with_(self, **changes: Floats) -> State:
        """Return a copy with some of the three arrays replaced."""
        return replace(self, **changes)
