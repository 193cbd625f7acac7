"""The Gent solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import InvariantModel, modulus, number
from turgor.materials.kinematics import Array


@dataclass(frozen=True, kw_only=True)
class Gent(InvariantModel):
    """W̄ = −μ Jm/2 ln(1 − (Ī₁ − 3)/Jm); initial shear modulus μ (Gent 1996, Rubber Chem. Technol. 69, 59).

    The chains are fully stretched at Ī₁ − 3 = Jm: beyond, the energy is infinite and its derivatives are NaN.
    Stable for every deformation below that limit.
    """

    name: ClassVar[str] = "gent"

    mu: float = modulus()
    Jm: float = number((0.3, 1.0, 3.0, 8.0, 20.0, 50.0, 120.0, 300.0, 1000.0), (1e-3, 1e6))

    @property
    @override
    def shear_modulus(self) -> float:
        return self.mu

    @override
    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        x = I1 - 3.0
        zero = np.zeros_like(x)
        within = x < self.Jm
        share = np.where(within, x, 0.0) / self.Jm
        W = np.where(within, -0.5 * self.mu * self.Jm * np.log1p(-share), np.inf)
        W1 = np.where(within, 0.5 * self.mu / (1.0 - share), np.nan)
        W11 = np.where(within, 0.5 * self.mu / self.Jm / (1.0 - share) ** 2, np.nan)
        return W, W1, zero, W11, zero, zero
