"""Hencky's solid: Hooke's law in logarithmic strains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import StretchModel, modulus
from turgor.materials.kinematics import Array, diagonal_matrices


@dataclass(frozen=True, kw_only=True)
class Hencky(StretchModel):
    """W̄ = μ Σ (ln λ̄_a)²; initial shear modulus μ (Hencky 1928).

    Linear elasticity made fit for large rotations: for stiff inserts at moderate strain. Its nominal stress falls
    beyond a uniaxial stretch of e.
    """

    name: ClassVar[str] = "hencky"
    aliases: ClassVar[tuple[str, ...]] = ("hookean",)

    mu: float = modulus()

    @property
    @override
    def shear_modulus(self) -> float:
        return self.mu

    @override
    def derivatives(self, stretches: Array) -> tuple[Array, Array, Array]:
        logarithm = np.log(stretches)
        W = self.mu * (logarithm**2).sum(axis=-1)
        slope = 2.0 * self.mu * logarithm / stretches
        diagonal = 2.0 * self.mu * (1.0 - logarithm) / stretches**2
        return W, slope, diagonal_matrices(diagonal)
