"""Polynomials in the isochoric invariants: the form that neo-Hooke, Mooney–Rivlin and Yeoh share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import InvariantModel
from turgor.materials.kinematics import Array


@dataclass(frozen=True, kw_only=True)
class PolynomialModel(InvariantModel):
    """W̄ = Σ C_ij (Ī₁ − 3)^i (Ī₂ − 3)^j, a constant ``Cij`` for every pair in ``powers`` (Rivlin and Saunders 1951).

    Initial shear modulus μ = 2 (C10 + C01).
    """

    powers: ClassVar[tuple[tuple[int, int], ...]] = ()

    @property
    @override
    def shear_modulus(self) -> float:
        return 2.0 * (self.parameters.get("C10", 0.0) + self.parameters.get("C01", 0.0))

    @override
    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        x, y = I1 - 3.0, I2 - 3.0
        W, W1, W2, W11, W12, W22 = (np.zeros_like(x) for _ in range(6))
        for i, j in self.powers:
            c = getattr(self, f"C{i}{j}")
            x0, x1, x2 = _power(x, i)
            y0, y1, y2 = _power(y, j)
            W += c * x0 * y0
            W1 += c * x1 * y0
            W2 += c * x0 * y1
            W11 += c * x2 * y0
            W12 += c * x1 * y1
            W22 += c * x0 * y2
        return W, W1, W2, W11, W12, W22


def _power(x: Array, n: int) -> tuple[Array, Array, Array]:
    """x^n with its first and second derivative, zero powers handled at x = 0."""
    zero = np.zeros_like(x)
    return x**n, n * x ** (n - 1) if n >= 1 else zero, n * (n - 1) * x ** (n - 2) if n >= 2 else zero
