"""The extended tube solid of Kaliske and Heinrich."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import StretchModel, modulus, number
from turgor.materials.kinematics import Array, diagonal_matrices

_SMALLEST = 1e-5
"""A release of smaller magnitude is taken for this one."""


@dataclass(frozen=True, kw_only=True)
class ExtendedTube(StretchModel):
    """W̄ = Gc/2 [(1 − δ²) y/(1 − δ² y) + ln(1 − δ² y)] + 2 Ge/β² Σ (λ̄_a^(−β) − 1), y = Σ λ̄_a² − 3.

    Kaliske and Heinrich 1999, Rubber Chem. Technol. 72, 602. Cross-links `Gc` with the inextensibility `delta` of their
    chains, topological constraints `Ge` with their release `beta`, physically 0 < β ≤ 1, which a fit may leave. Initial
    shear modulus μ = Gc (1 − 2 δ²) + Ge. Fits all three of Treloar's modes at once. Where δ² y ≥ 1 the energy is
    infinite and its derivatives are NaN.
    """

    name: ClassVar[str] = "extended-tube"

    Gc: float = modulus()
    delta: float = number((0.0, 0.02, 0.05, 0.09, 0.15, 0.3), (0.0, 0.7))
    Ge: float = modulus()
    beta: float = number((-5.0, -3.0, -1.0, 0.1, 0.4, 1.0, 2.0), (-20.0, 20.0))

    @property
    @override
    def shear_modulus(self) -> float:
        return self.Gc * (1.0 - 2.0 * self.delta**2) + self.Ge

    @override
    def derivatives(self, stretches: Array) -> tuple[Array, Array, Array]:
        d = self.delta**2
        y = (stretches**2).sum(axis=-1) - 3.0
        within = d * y < 1.0
        rest = np.where(within, 1.0 - d * y, 1.0)
        chains = 0.5 * self.Gc * ((1.0 - d) * y / rest + np.log(rest))
        slope = np.where(within, 0.5 * self.Gc * ((1.0 - d) / rest**2 - d / rest), np.nan)[..., None]
        bend = np.where(within, 0.5 * self.Gc * d * (2.0 * (1.0 - d) / rest**3 - d / rest**2), np.nan)[..., None]
        logarithm = np.log(stretches)
        # At β = 0 the tube term is the limit Ge Σ (ln λ̄)², which a β that small gives to half the digits.
        beta = self.beta if abs(self.beta) > _SMALLEST else _SMALLEST
        W = np.where(within, chains, np.inf) + 2.0 * self.Ge / beta**2 * np.expm1(-beta * logarithm).sum(-1)
        power = np.exp(-(beta + 2.0) * logarithm)
        dW = 2.0 * slope * stretches - 2.0 * self.Ge / beta * power * stretches
        diagonal = 2.0 * slope + 2.0 * self.Ge * (beta + 1.0) / beta * power
        outer = stretches[..., :, None] * stretches[..., None, :]
        return W, dW, 4.0 * bend[..., None] * outer + diagonal_matrices(diagonal)
