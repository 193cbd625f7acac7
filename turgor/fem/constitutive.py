"""From the deformation gradient to Kirchhoff stress and spatial tangent, for isotropic laws with isochoric split.

A law gives the derivatives of its energy with respect to its own variables (two invariants, or three principal
stretches); the kernels here turn them into tensors. Symmetric tensors and tangents are stored as told in
:mod:`turgor.fem.kernels`; ``p`` counts points.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from turgor.fem.kernels import PACK, SYM, inlined, parallel

# Components (i, j) in the stored order of a symmetric tensor.
ROW = np.array([0, 1, 2, 0, 1, 0])
COL = np.array([0, 1, 2, 1, 2, 2])


@parallel
def isochoric_invariants(F, J, I1, I2):  # type: ignore[no-untyped-def]
    """Fill the invariants ``I1, I2 (p,)`` of the isochoric left Cauchy–Green tensor, from ``F (p, 3, 3)``."""
    for p in nb.prange(len(F)):
        b = np.empty(6)
        left_cauchy_green(F[p], J[p], b)
        trace = b[0] + b[1] + b[2]
        square = b[0] ** 2 + b[1] ** 2 + b[2] ** 2 + 2 * (b[3] ** 2 + b[4] ** 2 + b[5] ** 2)
        I1[p] = trace
        I2[p] = 0.5 * (trace * trace - square)


@inlined
def left_cauchy_green(F, J, b):  # type: ignore[no-untyped-def]
    """Write the isochoric ``J^(-2/3) F Fᵀ`` into ``b (6,)``."""
    scale = J ** (-2.0 / 3.0)
    for r in range(6):
        i, j = ROW[r], COL[r]
        b[r] = scale * (F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2])


@inlined
def add_projected(fictitious, tau, tangent):  # type: ignore[no-untyped-def]
    """Project a fictitious stress and tangent onto the isochoric part, in place.

    ``tau = dev τ̄`` and ``c = P : c̄ : P + 2/3 tr(τ̄) P − 2/3 (τ ⊗ 1 + 1 ⊗ τ)`` (Holzapfel 2000, eqs. 6.101 and 6.168,
    pushed forward); `fictitious` is τ̄, `tangent` holds c̄ on entry.
    """
    trace = fictitious[0] + fictitious[1] + fictitious[2]
    column = np.empty(6)
    total = 0.0
    for r in range(6):
        column[r] = tangent[PACK[r, 0]] + tangent[PACK[r, 1]] + tangent[PACK[r, 2]]
        tau[r] = fictitious[r] - (trace / 3.0 if r < 3 else 0.0)
    total = column[0] + column[1] + column[2]
    at = 0
    for r in range(6):
        for s in range(r, 6):
            value = tangent[at]
            if s < 3:
                value += (-column[r] - column[s] + total / 3.0) / 3.0
                value -= 2.0 / 3.0 * (tau[r] + tau[s]) + 2.0 / 9.0 * trace
            elif r < 3:
                value -= column[s] / 3.0 + 2.0 / 3.0 * tau[s]
            if r == s:
                value += 2.0 / 3.0 * trace * (1.0 if r < 3 else 0.5)
            tangent[at] = value
            at += 1


@parallel
def invariant_response(F, J, W1, W2, W11, W12, W22, tau, tangent):  # type: ignore[no-untyped-def]
    """Fill ``tau (p, 6)`` and ``tangent (p, 21)`` of a law in the isochoric invariants.

    `W1` … `W22` ``(p,)`` are the derivatives of the energy. Formulas: Holzapfel (2000), eqs. 6.127 and 6.193.
    """
    for p in nb.prange(len(F)):
        b = np.empty(6)
        bb = np.empty(6)
        fictitious = np.empty(6)
        left_cauchy_green(F[p], J[p], b)
        for r in range(6):
            i, j = ROW[r], COL[r]
            bb[r] = b[SYM[i, 0]] * b[SYM[0, j]] + b[SYM[i, 1]] * b[SYM[1, j]] + b[SYM[i, 2]] * b[SYM[2, j]]
        I1 = b[0] + b[1] + b[2]
        first = 2.0 * (W1[p] + I1 * W2[p])
        for r in range(6):
            fictitious[r] = first * b[r] - 2.0 * W2[p] * bb[r]
        on_bb = 4.0 * (W11[p] + 2.0 * I1 * W12[p] + W2[p] + I1 * I1 * W22[p])
        on_mixed = -4.0 * (W12[p] + I1 * W22[p])
        on_square = 4.0 * W22[p]
        on_identity = -4.0 * W2[p]
        at = 0
        for r in range(6):
            i, j = ROW[r], COL[r]
            for s in range(r, 6):
                k, m = ROW[s], COL[s]
                tangent[p, at] = (
                    on_bb * b[r] * b[s]
                    + on_mixed * (b[r] * bb[s] + bb[r] * b[s])
                    + on_square * bb[r] * bb[s]
                    + on_identity * 0.5 * (b[SYM[i, k]] * b[SYM[j, m]] + b[SYM[i, m]] * b[SYM[j, k]])
                )
                at += 1
        add_projected(fictitious, tau[p], tangent[p])


@parallel
def stretch_response(stretches, directions, dW, d2W, tau, tangent):  # type: ignore[no-untyped-def]
    """Fill ``tau (p, 6)`` and ``tangent (p, 21)`` of a law in the isochoric principal stretches.

    `dW` ``(p, 3)`` and `d2W` ``(p, 3, 3)`` are derivatives as if the three stretches were independent. With
    β_i = λ_i W_i the fictitious principal stress, the principal tangent is ∂β_i/∂ln λ_j − 2 β_i δ_ij, and the shear
    terms are (β_i λ_j² − β_j λ_i²)/(λ_i² − λ_j²) (Ogden 1984, sec. 6.1), whose limit at equal stretches is
    ½(∂β_i/∂ln λ_i − ∂β_i/∂ln λ_j) − β_i.
    """
    for p in nb.prange(len(stretches)):
        beta = np.empty(3)
        slope = np.empty((3, 3))
        fictitious = np.zeros(6)
        dyad = np.empty((3, 6))
        for i in range(3):
            beta[i] = stretches[p, i] * dW[p, i]
            for r in range(6):
                dyad[i, r] = directions[p, ROW[r], i] * directions[p, COL[r], i]
                fictitious[r] += beta[i] * dyad[i, r]
        for i in range(3):
            for j in range(3):
                slope[i, j] = stretches[p, i] * d2W[p, i, j] * stretches[p, j]
            slope[i, i] += beta[i]
        tangent[p] = 0.0
        for i in range(3):
            for j in range(3):
                add_dyad(slope[i, j] - (2.0 * beta[i] if i == j else 0.0), dyad[i], dyad[j], tangent[p])
        shear = np.empty(6)
        for i in range(3):
            for j in range(i):
                for r in range(6):
                    k, m = ROW[r], COL[r]
                    shear[r] = 0.5 * (
                        directions[p, k, i] * directions[p, m, j] + directions[p, k, j] * directions[p, m, i]
                    )
                stiffness = shear_modulus(stretches[p, i], stretches[p, j], beta, slope, i, j)
                add_dyad(4.0 * stiffness, shear, shear, tangent[p])
        add_projected(fictitious, tau[p], tangent[p])


@inlined
def shear_modulus(first, second, beta, slope, i, j):  # type: ignore[no-untyped-def]
    """Return the tangent's shear term between principal directions `i` and `j`, also where their stretches meet.

    Closer than 1e-4 the difference quotient is replaced by the mean of its limits at both ends, which is
    of second order in the distance and keeps all digits that the quotient would lose.
    """
    gap = first / second - 1.0
    if abs(gap) < 1e-4:
        here = 0.5 * (slope[i, i] - slope[i, j]) - beta[i]
        there = 0.5 * (slope[j, j] - slope[j, i]) - beta[j]
        return 0.5 * (here + there)
    square, other = first * first, second * second
    return (beta[i] * other - beta[j] * square) / (square - other)


@inlined
def add_dyad(scale, left, right, tangent):  # type: ignore[no-untyped-def]
    """Add the upper triangle of ``scale · left ⊗ right`` to the packed `tangent` (the sum over pairs is symmetric)."""
    at = 0
    for r in range(6):
        for s in range(r, 6):
            tangent[at] += scale * left[r] * right[s]
            at += 1
