"""The van der Waals solid of Kilian."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import InvariantModel, modulus, number
from turgor.materials.kinematics import AT_REST, Array, zero_at_rest


@dataclass(frozen=True, kw_only=True)
class VanDerWaals(InvariantModel):
    """W̄ = μ {−(λm² − 3)[ln(1 − η) + η] − ⅔ a ((Ĩ − 3)/2)^{3/2}}, η = √((Ĩ − 3)/(λm² − 3)), Ĩ = (1 − β) Ī₁ + β Ī₂.

    Kilian 1981, Polymer 22, 209, in the form of Abaqus; initial shear modulus μ. `lambda_m` > √3 is the locking stretch
    (beyond it the energy is infinite and its derivatives are NaN), `a` the global interaction, which softens, and
    `beta` the share of Ī₂. The energy has no third derivative in the undeformed state.
    """

    name: ClassVar[str] = "van-der-waals"
    smooth_at_rest: ClassVar[bool] = False

    mu: float = modulus()
    lambda_m: float = number((2.0, 3.0, 5.0, 8.0, 14.0, 30.0), (1.75, 1e5))
    a: float = number((0.0, 0.2, 0.5), (-1e3, 1e3))
    beta: float = number((0.0, 0.5), (0.0, 1.0))

    @property
    @override
    def shear_modulus(self) -> float:
        return self.mu

    @override
    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        share1, share2 = 1.0 - self.beta, self.beta
        m = self.lambda_m**2 - 3.0
        x = np.maximum(share1 * (I1 - 3.0) + share2 * (I2 - 3.0), 0.0)
        within = x < m
        inside = np.where(within, x, 0.0)
        eta, half = np.sqrt(inside / m), np.sqrt(0.5 * inside)
        W = self.mu * (-m * (np.log1p(-eta) + eta) - 2.0 / 3.0 * self.a * half**3)
        slope = 0.5 * self.mu * (1.0 / (1.0 - eta) - self.a * half)
        root = np.sqrt(np.maximum(inside, AT_REST))
        curvature = 0.25 * self.mu / root * (1.0 / (np.sqrt(m) * (1.0 - eta) ** 2) - self.a / np.sqrt(2.0))
        curvature = zero_at_rest(curvature, inside)
        W, slope, curvature = (
            np.where(within, part, beyond) for part, beyond in ((W, np.inf), (slope, np.nan), (curvature, np.nan))
        )
        return (
            W,
            share1 * slope,
            share2 * slope,
            share1**2 * curvature,
            share1 * share2 * curvature,
            share2**2 * curvature,
        )
