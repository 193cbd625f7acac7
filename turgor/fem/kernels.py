"""Element kernels of the solid: plain functions on plain arrays, compiled and run in parallel over elements.

Shapes: ``m`` elements, ``q`` quadrature points, ``n`` nodes per element, ``d`` displacement components (3, or 2 in
plane models), ``k`` pressure modes. Symmetric tensors are stored in the order 00, 11, 22, 01, 12, 02; a fourth-order
tensor with both symmetries as the packed upper triangle (21 entries) of its 6 × 6 matrix in that order. Reference
gradients are kept as ``(m, q, 3, n)`` so that the innermost loops run over nodes that lie side by side in memory.

One set of kernels serves space, plane strain, plane stress and bodies of revolution, because the deformation gradient
is 3 × 3 in all of them: displacement component i reaches it through row s of the gradients at the place
(``ROW[d-2, i, s]``, ``COL[d-2, i, s]``), which in space is simply (i, s). In a plane model row 2 holds the
gradient across the plane (:func:`turgor.fem.elements.reference_gradients`), which only component 0 has, at (2, 2).

Which part of the work is whose: :mod:`turgor.fem.constitutive` turns deformation gradients into Kirchhoff stress and
spatial tangent, point by point; this file knows nothing of materials.
"""

from __future__ import annotations

from collections.abc import Callable

import numba as nb
import numpy as np
from numpy.typing import NDArray

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

NOWHERE = -1
# Where component i reaches the deformation gradient through row s, for plane models and for space.
ROW = np.array([[[0, 0, 2], [1, 1, NOWHERE], [NOWHERE] * 3], [[0] * 3, [1] * 3, [2] * 3]])
COL = np.array([[[0, 1, 2], [0, 1, NOWHERE], [NOWHERE] * 3], [[0, 1, 2]] * 3])
# The same for a symmetric tensor in stored order.
STRESS = np.where(ROW == NOWHERE, NOWHERE, SYM[ROW, COL])


def _pairs(entry: Callable[[int, int, int, int], int]) -> NDArray[np.int64]:
    """Tabulate ``entry(i, j, k, m)`` of the tensor components that the pairs (component, row) stand for."""
    table = np.full((2, 3, 3, 3, 3), NOWHERE, dtype=np.int64)
    for case, i, s, k, t in np.ndindex(table.shape):
        one, other = (int(ROW[case, i, s]), int(COL[case, i, s])), (int(ROW[case, k, t]), int(COL[case, k, t]))
        if NOWHERE not in one and NOWHERE not in other:
            table[case, i, s, k, t] = entry(*one, *other)
    return table


# Of each pair of such places: the entry of the packed tangent, that of the stress where the tensor's rows agree, and
# the coefficient of a pressure.
TANGENT = _pairs(lambda i, j, k, m: PACK[SYM[i, j], SYM[k, m]])
GEOMETRIC = _pairs(lambda i, j, k, m: SYM[j, m] if i == k else NOWHERE)
ON_PRESSURE = _pairs(lambda i, j, k, m: int(i == j and k == m) - int(i == m and j == k)).astype(float)


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


@inlined
def gather(field, nodes, out):  # type: ignore[no-untyped-def]
    """Write the values of a nodal ``field (n_points, d)`` at the `nodes` ``(n,)`` into ``out (d, n)``."""
    for a in range(len(nodes)):
        for i in range(out.shape[0]):
            out[i, a] = field[nodes[a], i]


@inlined
def displacement_gradient(u, G, H):  # type: ignore[no-untyped-def]
    """Write ∂u/∂X into ``H (3, 3)`` from the nodal displacements ``u (d, n)`` and gradients ``G (3, n)``."""
    case = u.shape[0] - 2
    H[:] = 0.0
    for i in range(u.shape[0]):
        for s in range(3):
            if ROW[case, i, s] != NOWHERE:
                value = 0.0
                for a in range(G.shape[1]):
                    value += u[i, a] * G[s, a]
                H[ROW[case, i, s], COL[case, i, s]] = value


@parallel
def reference_gradients(nodes, gradient, weights, G, dV):  # type: ignore[no-untyped-def]
    """Fill d rows of ``G (m, q, 3, n)`` and ``dV (m, q)`` from positions ``(m, n, d)`` and ``∂N/∂ξ (q, n, d)``."""
    d = nodes.shape[2]
    for chunk in nb.prange(CHUNKS):
        # In the plane a third direction stays as it is.
        jacobian, inv = np.eye(3), np.empty((3, 3))
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            for q in range(G.shape[1]):
                for i in range(d):
                    for j in range(d):
                        total = 0.0
                        for a in range(G.shape[3]):
                            total += nodes[e, a, i] * gradient[q, a, j]
                        jacobian[i, j] = total
                dV[e, q] = inverse(jacobian, inv) * weights[q]
                for i in range(d):
                    for a in range(G.shape[3]):
                        total = 0.0
                        for j in range(d):
                            total += inv[j, i] * gradient[q, a, j]
                        G[e, q, i, a] = total


@parallel
def deformation(u, cells, G, dV, modes, F, J, dilatation):  # type: ignore[no-untyped-def]
    """Fill ``F (m, q, 3, 3)``, its determinant ``J (m, q)`` and its projection on the pressure modes.

    ``dilatation (m, k)`` are the coefficients ``∫ ψ_k J dV / V``; the first one is the element's ratio of volumes.
    """
    for chunk in nb.prange(CHUNKS):
        local = np.empty((u.shape[1], cells.shape[1]))
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            gather(u, cells[e], local)
            dilatation[e] = 0.0
            volume = 0.0
            for q in range(G.shape[1]):
                f = F[e, q]
                displacement_gradient(local, G[e, q], f)
                for i in range(3):
                    f[i, i] += 1.0
                J[e, q] = (
                    f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                    + f[0, 1] * (f[1, 2] * f[2, 0] - f[1, 0] * f[2, 2])
                    + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
                )
                volume += dV[e, q]
                for k in range(modes.shape[2]):
                    dilatation[e, k] += modes[e, q, k] * J[e, q] * dV[e, q]
            for k in range(modes.shape[2]):
                dilatation[e, k] /= volume


@parallel
def linear_changes(du, cells, F, G, dV, modes, tangent, dilatation, stress):  # type: ignore[no-untyped-def]
    """Fill ``dilatation (m, k)`` and ``stress (m, q, 6)`` with their changes along `du` ``(n_points, d)``.

    The second Piola–Kirchhoff stress changes with the Green–Lagrange strain: ``F⁻¹ (c : sym(∇du)) F⁻ᵀ``, c the spatial
    ``tangent (m, q, 21)``.
    """
    for chunk in nb.prange(CHUNKS):
        local = np.empty((du.shape[1], cells.shape[1]))
        H = np.empty((3, 3))
        inv = np.empty((3, 3))
        spatial = np.empty((3, 3))
        strain = np.empty(6)
        change = np.empty(6)
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            gather(du, cells[e], local)
            dilatation[e] = 0.0
            volume = 0.0
            for q in range(G.shape[1]):
                volume += dV[e, q]
            for q in range(G.shape[1]):
                displacement_gradient(local, G[e, q], H)
                weight = inverse(F[e, q], inv) * dV[e, q] / volume
                for i in range(3):
                    for j in range(3):
                        spatial[i, j] = H[i, 0] * inv[0, j] + H[i, 1] * inv[1, j] + H[i, 2] * inv[2, j]
                for i in range(3):
                    for j in range(i, 3):
                        strain[SYM[i, j]] = spatial[i, i] if i == j else spatial[i, j] + spatial[j, i]
                for k in range(modes.shape[2]):
                    dilatation[e, k] += modes[e, q, k] * weight * (strain[0] + strain[1] + strain[2])
                for s in range(6):
                    change[s] = 0.0
                    for r in range(6):
                        change[s] += tangent[e, q, PACK[s, r]] * strain[r]
                sandwich(inv, change, stress[e, q])


@parallel
def pulled_back(F, tau, out):  # type: ignore[no-untyped-def]
    """Fill ``out (m, q, 6)`` with the second Piola–Kirchhoff stress ``F⁻¹ τ F⁻ᵀ``, ``F (m, q, 3, 3)``."""
    for e in nb.prange(len(F)):
        inv = np.empty((3, 3))
        for q in range(F.shape[1]):
            inverse(F[e, q], inv)
            sandwich(inv, tau[e, q], out[e, q])


@parallel
def transformed(A, B, out):  # type: ignore[no-untyped-def]
    """Fill ``out (m, q, 6)`` with the symmetric tensors ``A B Aᵀ``, ``A (m, q, 3, 3)`` and ``B (m, q, 6)``."""
    for e in nb.prange(len(A)):
        for q in range(A.shape[1]):
            sandwich(A[e, q], B[e, q], out[e, q])


@inlined
def sandwich(A, B, out):  # type: ignore[no-untyped-def]
    """Write the symmetric tensor ``A B Aᵀ`` of ``A (3, 3)`` and ``B (6,)`` into ``out (6,)``."""
    for i in range(3):
        h0 = A[i, 0] * B[0] + A[i, 1] * B[3] + A[i, 2] * B[5]
        h1 = A[i, 0] * B[3] + A[i, 1] * B[1] + A[i, 2] * B[4]
        h2 = A[i, 0] * B[5] + A[i, 1] * B[4] + A[i, 2] * B[2]
        for j in range(i, 3):
            out[SYM[i, j]] = h0 * A[j, 0] + h1 * A[j, 1] + h2 * A[j, 2]


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
    """Fill the internal forces ``force (m, n, d)`` from the isochoric Kirchhoff stress and the pressure.

    ``f_a = ∫ (tau + p J 1) g_a dV`` with ``tau (m, q, 6)`` and ``pressure (m, q)``.
    """
    n_nodes, d = force.shape[1], force.shape[2]
    for chunk in nb.prange(CHUNKS):
        inv = np.empty((3, 3))
        g = np.empty((3, n_nodes))
        total = np.empty((d, n_nodes))
        t = np.zeros(3)
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            total[:] = 0.0
            for q in range(G.shape[1]):
                p = spatial_gradients(F[e, q], G[e, q], inv, g) * pressure[e, q]
                for i in range(d):
                    for s in range(3):
                        at = STRESS[d - 2, i, s]
                        t[s] = 0.0 if at == NOWHERE else dV[e, q] * (tau[e, q, at] + (p if at < 3 else 0.0))
                    for a in range(n_nodes):
                        total[i, a] += t[0] * g[0, a] + t[1] * g[1, a] + t[2] * g[2, a]
            for a in range(n_nodes):
                for i in range(d):
                    force[e, a, i] = total[i, a]


@inlined
def elasticity(tau, tangent, pressure_J, weight, A):  # type: ignore[no-untyped-def]
    """Fill ``A (d, 3, d, 3)``, blocks on and above the diagonal: weight · (c_ijkm + tau_jm δ_ik), pressure included.

    A pressure p adds p J (1⊗1 − 2 I) to the spatial tangent and p J 1 to the Kirchhoff stress (Bonet and Wood 2008,
    eq. 6.55), in all p J (δ_ij δ_km − δ_im δ_jk).
    """
    d = A.shape[0]
    for i in range(d):
        for k in range(i, d):
            for s in range(3):
                for t in range(3):
                    at = TANGENT[d - 2, i, s, k, t]
                    if at == NOWHERE:
                        A[i, s, k, t] = 0.0
                        continue
                    value = tangent[at] + pressure_J * ON_PRESSURE[d - 2, i, s, k, t]
                    if GEOMETRIC[d - 2, i, s, k, t] != NOWHERE:
                        value += tau[GEOMETRIC[d - 2, i, s, k, t]]
                    A[i, s, k, t] = weight * value


@inlined
def add_products(A, g, half, d, n, K):  # type: ignore[no-untyped-def]
    """Add ``g · A · g`` to the blocks on and above the diagonal of a stiffness matrix, stored as ``K (d, n, d n)``.

    ``K[i, a]`` is the row of component i of node a from the diagonal block on: ``K[i, a, (k - i) n + b]`` couples it to
    component k of node b. The columns of one component lie side by side, so that the loop over them vectorises; two
    rows at a time share what it loads.
    """
    for i in range(d):
        width = (d - i) * n
        for s in range(3):
            for k in range(d - i):
                a0, a1, a2 = A[i, s, i + k, 0], A[i, s, i + k, 1], A[i, s, i + k, 2]
                for a in range(n):
                    half[s, k * n + a] = a0 * g[0, a] + a1 * g[1, a] + a2 * g[2, a]
        for a in range(0, n - 1, 2):
            g0, g1, g2 = g[0, a], g[1, a], g[2, a]
            h0, h1, h2 = g[0, a + 1], g[1, a + 1], g[2, a + 1]
            for c in range(width):
                x, y, z = half[0, c], half[1, c], half[2, c]
                K[i, a, c] += g0 * x + g1 * y + g2 * z
                K[i, a + 1, c] += h0 * x + h1 * y + h2 * z
        if n % 2:
            g0, g1, g2 = g[0, n - 1], g[1, n - 1], g[2, n - 1]
            for c in range(width):
                K[i, n - 1, c] += g0 * half[0, c] + g1 * half[1, c] + g2 * half[2, c]


@inlined
def add_volume_gradients(weight, g, modes, b):  # type: ignore[no-untyped-def]
    """Add ``weight · ψ_k · (∂J/∂u)/J`` to ``b (k, d, n)``."""
    d = b.shape[1]
    for k in range(len(modes)):
        scale = weight * modes[k]
        for i in range(d):
            for a in range(g.shape[1]):
                b[k, i, a] += scale * g[i, a]
        if d == 2:
            for a in range(g.shape[1]):
                b[k, 0, a] += scale * g[2, a]


@inlined
def add_condensed(bulk, b, d, n, K):  # type: ignore[no-untyped-def]
    """Add ``Σ_kl bulk_kl b_k b_lᵀ`` to `K`, stored as in :func:`add_products`; `b` is ``(k, d n)``."""
    for i in range(d):
        for m in range(len(bulk)):
            right = b[m, i * n :]
            for a in range(n):
                scale = 0.0
                for k in range(len(bulk)):
                    scale += bulk[k, m] * b[k, i * n + a]
                row = K[i, a]
                for c in range(len(right)):
                    row[c] += scale * right[c]


def counted(n: int) -> tuple[int, ...]:
    """Return a tuple of `n` numbers, whose length a compiled function knows when it is compiled."""
    return (0,) * n


def packing(n_nodes: int, d: int) -> NDArray[np.uintp]:
    """Return where in the flat `K` of :func:`add_products` each entry of its packed upper triangle stands.

    There rows and columns run node by node: those of node 0, then those of node 1, and so on.
    """
    row, col = np.triu_indices(d * n_nodes)
    # The entry and its mirror image are equal; stored is the one whose row belongs to the lower component.
    swap = col % d < row % d
    row, col = np.where(swap, col, row), np.where(swap, row, col)
    (a, i), (b, k) = divmod(row, d), divmod(col, d)
    return ((i * n_nodes + a) * d * n_nodes + (k - i) * n_nodes + b).astype(np.uintp)


@parallel
def element_stiffness(  # type: ignore[no-untyped-def]
    F, G, dV, tau, tangent, pressure, modes, bulk, components, nodes, places, packed, gradient
):
    """Fill the packed upper triangles ``packed (m, d n (d n + 1)/2)`` of the element stiffness matrices.

    ``K_ab = ∫ g_a · (c + τ) · g_b dV + Σ_kl D_kl b_k b_l`` with the element's pressure condensed (Simo, Taylor and
    Pister 1985), ``b_k = ∫ ψ_k ∂J/∂u dV``. `pressure` ``(m, q)`` is the one that the geometric part uses, `bulk`
    ``(m, k, k)`` is D, ``∫ ψ_k U'' ψ_l dV / V²``, and `places` is :func:`packing`. `components` and `nodes` are
    :func:`counted`: of hexahedra, loops of known lengths take half the time. ``gradient (m, k, d, n)`` is filled with
    the b_k, unless it is empty.
    """
    for chunk in nb.prange(CHUNKS):
        d, n = len(components), len(nodes)
        inv = np.empty((3, 3))
        g = np.empty((3, n))
        A = np.empty((d, 3, d, 3))
        half = np.empty((3, d * n))
        K = np.empty((d, n, d * n))
        b = np.empty((modes.shape[2], d, n))
        for e in range(chunk * len(G) // CHUNKS, (chunk + 1) * len(G) // CHUNKS):
            K[:] = 0.0
            b[:] = 0.0
            for q in range(G.shape[1]):
                J = spatial_gradients(F[e, q], G[e, q], inv, g)
                elasticity(tau[e, q], tangent[e, q], pressure[e, q] * J, dV[e, q], A)
                add_products(A, g, half, d, n, K)
                add_volume_gradients(J * dV[e, q], g, modes[e, q], b)
            add_condensed(bulk[e], b.reshape(modes.shape[2], d * n), d, n, K)
            flat = K.ravel()
            for at in range(len(places)):
                packed[e, at] = flat[places[at]]
            if len(gradient):
                # As a slice, it takes far longer to compile.
                for k in range(modes.shape[2]):
                    for i in range(d):
                        for a in range(n):
                            gradient[e, k, i, a] = b[k, i, a]
