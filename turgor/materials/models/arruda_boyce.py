"""The eight-chain solid of Arruda and Boyce."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.materials.hyperelastic import InvariantModel, modulus, number
from turgor.materials.kinematics import Array

_SERIES = (1.0 / 2.0, 1.0 / 20.0, 11.0 / 1050.0, 19.0 / 7000.0, 519.0 / 673750.0)


@dataclass(frozen=True, kw_only=True)
class ArrudaBoyce(InvariantModel):
    """W̄ = μ Σ C_i/λm^(2i−2) (Ī₁^i − 3^i), i = 1 … 5, with C = 1/2, 1/20, 11/1050, 19/7000, 519/673750.

    The series of the inverse Langevin function (Arruda and Boyce 1993, J. Mech. Phys. Solids 41, 389, eq. 19), as in
    Abaqus and ANSYS. `mu` is the chain modulus; the initial shear modulus is
    μ (1 + 3/(5 λm²) + 99/(175 λm⁴) + 513/(875 λm⁶) + 42039/(67375 λm⁸)). `lambda_m` is the locking stretch of a chain.
    Stable for every deformation.
    """

    name: ClassVar[str] = "arruda-boyce"

    mu: float = modulus()
    lambda_m: float = number((1.05, 1.3, 1.7, 2.2, 3.0, 4.0, 6.0, 10.0, 20.0), (0.5, 1e3))

    @property
    @override
    def shear_modulus(self) -> float:
        n = self.lambda_m**2
        return self.mu * (1.0 + 3.0 / (5.0 * n) + 99.0 / (175.0 * n**2) + 513.0 / (875.0 * n**3)
                          + 42039.0 / (67375.0 * n**4))  # fmt: skip

    @override
    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        zero = np.zeros_like(I1)
        W, W1, W11 = zero.copy(), zero.copy(), zero.copy()
        for i, coefficient in enumerate(_SERIES, 1):
            c = self.mu * coefficient / self.lambda_m ** (2 * i - 2)
            W += c * (I1**i - 3.0**i)
            W1 += c * i * I1 ** (i - 1)
            W11 += c * i * (i - 1) * I1 ** max(i - 2, 0)
        return W, W1, zero, W11, zero, zero
