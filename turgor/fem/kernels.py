"""Element kernels of the solid: plain functions on plain arrays, compiled and run in parallel over elements.

Shapes: ``m`` elements, ``q`` quadrature points, ``n`` nodes per element, three components. Symmetric tensors are
stored in the order 00, 11, 22, 01, 12, 02; a fourth-order tensor with both symmetries as the packed upper triangle
(21 entries) of its 6 × 6 matrix in that order. Reference gradients are kept as ``(m, q, 3, n)`` so that the
innermost loops run over nodes that lie side by side in memory.

Which part of the work is whose: :mod:`turgor.fem.constitutive` turns deformation gradients into Kirchhoff stress and
spatial tangent, point by point; this file knows nothing of materials.
"""

from __future__ import annotations

import numba as nb
import numpy as np

# No NaN or infinity is assumed away: the solver tests for both.
FASTMATH = {"contract", "reassoc", "nsz", "arcp"}
CHUNKS = 32
"""Elements are handed to the threads in this many portions, each with scratch arrays of its own."""

jit = nb.njit(cache=True, fastmath=FASTMATH, error_model="numpy")
parallel = nb.njit(cache=True, fastmath=FASTMATH, error_model="numpy", parallel=True)
inlined = nb.njit(cache=True, fastmath=FASTMATH, error_model="numpy", inline="always")

# Place of component (i, j) of a symmetric tensor, and of entry (r, s) of a packed symmetric 6 × 6 matrix.
SYM = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
PACK = np.array([[min(r, s) * 6 - min(r, s) * (min(r, s) + 1) // 2 + max(r, s) for s in range(6)] for r in range(6)])


@inlined
def inverse(F, out):  # type: ignore[no-untyped-def]
    """Write the inverse of the 3 × 3 matrix `F` into `out` and return the determinant."""
    c00 = F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]
    c01 = F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2]
    c02 = F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]
    determinant = F[0, 0] * c00 + F[0, 1] * c01 + F[0, 2] * c02
    scale = 1.0 / determinant
    out[0, 0] = c00 * scale
    out[1, 0] = c01 * scale
    out[2, 0] = c02 * scale
    out[0, 1] = (F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2]) * scale
    out[1, 1] = (F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0]) * scale
    out[2, 1] = (F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1]) * scale
    out[0, 2] = (F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1]) * scale
    out[1, 2] = (F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2]) * scale
    out[2, 2] = (F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]) * scale
    return determinant


@parallel
def reference_gradients(points, cells, local_gradient, weights, G, dV):  # type: ignore[no-untyped-def]
    """Fill the gradients ``G (m, q, 3, n)`` of the shape functions and the volumes ``dV (m, q)``.

    `local_gradient` is ``(q, n, 3)``, with respect to the reference coordinates of the element.
    """
    n_nodes = cells.shape[1]
    for e in nb.prange(len(cells)):
        jacobian = np.empty((3, 3))
        inv = np.empty((3, 3))
        for q in range(len(weights)):
            jacobian[:] = 0.0
            for a in range(n_nodes):
                for i in range(3):
                    for j in range(3):
                        jacobian[i, j] += points[cells[e, a], i] * local_gradient[q, a, j]
            dV[e, q] = inverse(jacobian, inv) * weights[q]
            for a in range(n_nodes):
                for i in range(3):
                    G[e, q, i, a] = (
                        local_gradient[q, a, 0] * inv[0, i]
                        + local_gradient[q, a, 1] * inv[1, i]
                        + local_gradient[q, a, 2] * inv[2, i]
                    )


@parallel
def deformation(u, cells, G, dV, F, J, dilatation):  # type: ignore[no-untyped-def]
    """Fill ``F (m, q, 3, 3)``, its determinant ``J (m, q)`` and each element's mean dilatation v/V ``(m,)``."""
    n_nodes = cells.shape[1]
    for e in nb.prange(len(cells)):
        volume = 0.0
        deformed = 0.0
        for q in range(G.shape[1]):
            f = F[e, q]
            for i in range(3):
                for j in range(3):
                    value = 1.0 if i == j else 0.0
                    for a in range(n_nodes):
                        value += u[cells[e, a], i] * G[e, q, j, a]
                    f[i, j] = value
            J[e, q] = (
                f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                + f[0, 1] * (f[1, 2] * f[2, 0] - f[1, 0] * f[2, 2])
                + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
            )
            volume += dV[e, q]
            deformed += J[e, q] * dV[e, q]
        dilatation[e] = deformed / volume


@inlined
def spatial_gradients(F, G, inv, g):  # type: ignore[no-untyped-def]
    """Push the reference gradients ``G (3, n)`` forward: ``g = F^{-T} G``; return det F."""
    determinant = inverse(F, inv)
    for i in range(3):
        for a in range(G.shape[1]):
            g[i, a] = inv[0, i] * G[0, a] + inv[1, i] * G[1, a] + inv[2, i] * G[2, a]
    return determinant


@parallel
def element_forces(F, G, dV, tau, pressure, force):  # type: ignore[no-untyped-def]
    """Fill the internal forces ``force (m, n, 3)`` from the isochoric Kirchhoff stress and the mean pressure.

    ``f_a = ∫ (tau + p J 1) g_a dV`` with ``tau (m, q, 6)`` and ``pressure (m,)``.
    """
    n_nodes = G.shape[3]
    for chunk in nb.prange(CHUNKS):
        inv = np.empty((3, 3))
        g = np.empty((3, n_nodes))
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            force[e] = 0.0
            for q in range(G.shape[1]):
                J = spatial_gradients(F[e, q], G[e, q], inv, g)
                t = tau[e, q]
                w = dV[e, q]
                p = pressure[e] * J
                for a in range(n_nodes):
                    force[e, a, 0] += w * ((t[0] + p) * g[0, a] + t[3] * g[1, a] + t[5] * g[2, a])
                    force[e, a, 1] += w * (t[3] * g[0, a] + (t[1] + p) * g[1, a] + t[4] * g[2, a])
                    force[e, a, 2] += w * (t[5] * g[0, a] + t[4] * g[1, a] + (t[2] + p) * g[2, a])


@parallel
def volume_gradients(F, G, dV, gradient):  # type: ignore[no-untyped-def]
    """Fill ``gradient (m, n, 3)``, the derivative of each element's deformed volume with respect to its nodes."""
    n_nodes = G.shape[3]
    for chunk in nb.prange(CHUNKS):
        inv = np.empty((3, 3))
        g = np.empty((3, n_nodes))
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            gradient[e] = 0.0
            for q in range(G.shape[1]):
                weight = spatial_gradients(F[e, q], G[e, q], inv, g) * dV[e, q]
                for a in range(n_nodes):
                    for i in range(3):
                        gradient[e, a, i] += weight * g[i, a]


@inlined
def elasticity(tau, tangent, pressure_J, weight, A):  # type: ignore[no-untyped-def]
    """Fill ``A (3, 3, 3, 3)``: weight · (c_ijkl + tau_jl δ_ik), the pressure's part included.

    A pressure p adds p J (1⊗1 − 2 I) to the spatial tangent and p J 1 to the Kirchhoff stress (Bonet and Wood 2008,
    eq. 6.55).
    """
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    value = tangent[PACK[SYM[i, j], SYM[k, m]]]
                    if i == j and k == m:
                        value += pressure_J
                    if i == m and j == k:
                        value -= pressure_J
                    if i == k:
                        value += tau[SYM[j, m]]
                        # + p J δ_ik δ_jl of the stress and − p J δ_ik δ_jl of the tangent cancel.
                    A[i, j, k, m] = weight * value


@parallel
def element_stiffness(F, G, dV, tau, tangent, pressure, bulk, packed):  # type: ignore[no-untyped-def]
    """Fill the packed upper triangles ``packed (m, 3n(3n+1)/2)`` of the element stiffness matrices.

    ``K_ab = ∫ g_a · (c + τ) · g_b dV + (U''/V) b_a b_b`` with the element's mean pressure condensed (Simo, Taylor and
    Pister 1985), ``b`` the gradient of its deformed volume. `pressure` ``(m,)`` is the one that the
    geometric part uses, and `bulk` ``(m,)`` is U'' at the element's dilatation.

    Rows and columns run component by component inside (columns of one component lie side by side, so that the
    loops over them vectorise); node by node in the packed result.
    """
    n_nodes = G.shape[3]
    n_dofs = 3 * n_nodes
    for chunk in nb.prange(CHUNKS):
        inv = np.empty((3, 3))
        g = np.empty((3, n_nodes))
        A = np.empty((3, 3, 3, 3))
        half = np.empty((3, 3, n_dofs))
        K = np.empty((n_dofs, n_dofs))
        b = np.empty(n_dofs)
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            K[:] = 0.0
            b[:] = 0.0
            volume = 0.0
            for q in range(G.shape[1]):
                J = spatial_gradients(F[e, q], G[e, q], inv, g)
                elasticity(tau[e, q], tangent[e, q], pressure[e] * J, dV[e, q], A)
                volume += dV[e, q]
                for i in range(3):
                    for a in range(n_nodes):
                        b[i * n_nodes + a] += J * dV[e, q] * g[i, a]
                    for j in range(3):
                        for k in range(3):
                            for a in range(n_nodes):
                                half[i, j, k * n_nodes + a] = (
                                    A[i, j, k, 0] * g[0, a] + A[i, j, k, 1] * g[1, a] + A[i, j, k, 2] * g[2, a]
                                )
                for i in range(3):
                    for a in range(n_nodes):
                        g0, g1, g2 = g[0, a], g[1, a], g[2, a]
                        row = K[i * n_nodes + a]
                        for c in range(n_dofs):
                            row[c] += g0 * half[i, 0, c] + g1 * half[i, 1, c] + g2 * half[i, 2, c]
            pack(K, b, bulk[e] / volume, n_nodes, packed[e])


@inlined
def pack(K, b, scale, n_nodes, out):  # type: ignore[no-untyped-def]
    """Write the upper triangle of ``K + scale b bᵀ``, reordered from component by component to node by node."""
    at = 0
    for a in range(n_nodes):
        for i in range(3):
            row = i * n_nodes + a
            scaled = scale * b[row]
            for k in range(i, 3):
                out[at] = K[row, k * n_nodes + a] + scaled * b[k * n_nodes + a]
                at += 1
            for c in range(a + 1, n_nodes):
                for k in range(3):
                    out[at] = K[row, k * n_nodes + c] + scaled * b[k * n_nodes + c]
                    at += 1
