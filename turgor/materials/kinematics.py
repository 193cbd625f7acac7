"""Tensor algebra of the deformation gradient: invariants, their derivatives and the products they need.

Shapes: second-order tensors ``(..., 3, 3)``, fourth-order ones ``(..., 3, 3, 3, 3)``, any leading shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.eye(3)
FOURTH: Array = np.einsum("ik,jl->ijkl", IDENTITY, IDENTITY)
"""The fourth-order identity δ_ik δ_jl."""

AT_REST = 1e-13
"""Ī₁ − 3 or Ī₂ − 3 up to which the body is at rest. Where a second derivative of W̄ grows without bound towards rest, as
that of (Ī₁ − 3)^{3/2} does, what it adds to the tangent vanishes: there it counts as zero."""


def zero_at_rest(derivative: Array, excess: Array) -> Array:
    """Return a second derivative of W̄ by the invariants, zero where their `excess` over 3 is no more than AT_REST."""
    return np.where(excess > AT_REST, derivative, 0.0)


def diagonal_matrices(diagonal: Array) -> Array:
    """Return the matrices ``(..., 3, 3)`` with a given diagonal ``(..., 3)``."""
    matrices = np.zeros((*diagonal.shape, 3))
    matrices.reshape(-1, 9)[:, ::4] = diagonal.reshape(-1, 3)
    return matrices


def tensor(x: Array, rank: int) -> Array:
    """Append `rank` axes of length one."""
    return np.asarray(x, dtype=float).reshape(np.shape(x) + (1,) * rank)


def outer(a: Array, b: Array) -> Array:
    """a_i b_j of two vectors ``(..., n)``."""
    product: Array = a[..., :, None] * b[..., None, :]
    return product


def dyad(A: Array, B: Array) -> Array:
    """A_ij B_kl."""
    product: Array = A[..., :, :, None, None] * B[..., None, None, :, :]
    return product


def twist(G: Array) -> Array:
    """G_il G_kj, minus the derivative of F^(−T)."""
    return np.asarray(np.einsum("...il,...kj->...ijkl", G, G))


class Invariants:
    """Isochoric invariants of `F` and their derivatives by F; G = F^(−T)."""

    def __init__(self, F: Array) -> None:
        self.F = F
        self.J: Array = np.linalg.det(F)
        self.G: Array = np.swapaxes(np.linalg.inv(F), -1, -2)
        self.C: Array = np.swapaxes(F, -1, -2) @ F
        self.full_I1: Array = np.trace(self.C, axis1=-2, axis2=-1)
        self.full_I2: Array = 0.5 * (self.full_I1**2 - np.sum(self.C**2, axis=(-2, -1)))
        self.a: Array = self.J ** (-2.0 / 3.0)
        self.I1 = self.a * self.full_I1
        self.I2 = self.a**2 * self.full_I2
        i1, i2 = tensor(self.full_I1, 2), tensor(self.full_I2, 2)
        self.full_dI2: Array = 2.0 * (i1 * F - F @ self.C)
        self.dI1: Array = tensor(self.a, 2) * (2.0 * F - (2.0 / 3.0) * i1 * self.G)
        self.dI2: Array = tensor(self.a**2, 2) * (self.full_dI2 - (4.0 / 3.0) * i2 * self.G)

    def d2I1(self) -> Array:
        """∂²Ī₁/∂F∂F."""
        i1 = tensor(self.full_I1, 4)
        inner = 2.0 * FOURTH - (4.0 / 3.0) * dyad(self.G, self.F) + (2.0 / 3.0) * i1 * twist(self.G)
        return tensor(self.a, 4) * inner - (2.0 / 3.0) * dyad(self.dI1, self.G)

    def d2I2(self) -> Array:
        """∂²Ī₂/∂F∂F."""
        i1, i2 = tensor(self.full_I1, 4), tensor(self.full_I2, 4)
        b = self.F @ np.swapaxes(self.F, -1, -2)
        d_FC = (
            np.einsum("ik,...lj->...ijkl", IDENTITY, self.C)
            + np.einsum("...il,...kj->...ijkl", self.F, self.F)
            + np.einsum("...ik,jl->...ijkl", b, IDENTITY)
        )
        full_d2I2: Array = 2.0 * (2.0 * dyad(self.F, self.F) + i1 * FOURTH - d_FC)
        inner: Array = full_d2I2 - (4.0 / 3.0) * (dyad(self.G, self.full_dI2) - i2 * twist(self.G))
        return tensor(self.a**2, 4) * inner - (4.0 / 3.0) * dyad(self.dI2, self.G)
