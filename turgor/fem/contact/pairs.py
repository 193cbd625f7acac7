"""Kernels of contact between curved faces: the derivatives of their gaps.

A pair is a point of one face (the slave, at a quadrature point) and the closest point of another (the master), both
faces curved. Its gap is ``g = n · (x − y)``, n the direction of contact at the closest point y
(:mod:`turgor.fem.contact.closest`): negative where they overlap. Shapes: ``k`` faces of ``n`` nodes, ``q`` quadrature
points a face, ``d`` displacement components; the nodes of a pair are the slave's, then the master's.

Faces are six-node triangles or nine-node quadrilaterals (d = 3) or, in the plane z = 0, three-node edges (d = 2). One
set of kernels serves all, by the shape functions of :mod:`turgor.fem.contact.shapes`: the second tangent of an edge is
the unit vector out of the plane. Positions always have three components.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from turgor.fem.contact.closest import contact_normal, dot, free_inverse, invert, surface_frame
from turgor.fem.contact.shapes import on_rim, second_derivatives, shape_functions
from turgor.fem.kernels import jit, parallel


@parallel
def gap_gradients(x, slaves, masters, at, local, margin, gradient):  # type: ignore[no-untyped-def]
    """Fill the derivatives of gaps with respect to their nodes, ``gradient (n_pairs, 2 n, d)``.

    `slaves` and `masters` are ``(n_pairs, n)``; `at` and `local` ``(n_pairs, 2)`` are the points on them. The closest
    point's own motion has no part in it, for the gap is normal to the master.
    """
    for p in nb.prange(len(slaves)):
        _gradient_of(x, slaves[p], masters[p], at[p], local[p], margin, gradient[p])


@jit
def _gradient_of(x, slave, master, at, local, margin, gradient):  # type: ignore[no-untyped-def]
    n, d = len(slave), gradient.shape[1]
    N, D, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty((2, 3)), np.empty(3)
    own, outward, apart = np.empty((2, 3)), np.empty(3), np.empty((2 * n, d, 3))
    _pair_frame(x, slave, master, at, local, margin, N, D, own, outward, tangent, normal, apart)
    for a in range(2 * n):
        for i in range(d):
            gradient[a, i] = dot(apart[a, i], normal)


@jit
def _pair_frame(  # type: ignore[no-untyped-def]
    x, slave, master, at, local, margin, N, D, own, outward, tangent, normal, apart
):
    """Write what a pair looks like: the shape functions of the master last.

    ``own (2, 3)`` and `outward` are the slave's contravariant tangents and its normal, ``tangent (2, 3)`` the master's
    tangents, `normal` the direction of contact, ``apart (2 n, d, 3)`` the derivatives of ``x − y`` by the nodes.
    """
    n, d = len(slave), apart.shape[1]
    position, metric, inverse = np.empty(3), np.empty((2, 2)), np.empty((2, 2))
    shape_functions(at[0], at[1], N, D)
    surface_frame(x, slave, N, D, position, tangent, outward)
    point = position + margin * outward
    _inner_products(tangent, metric)
    invert(metric, inverse)
    for i in range(3):
        for r in range(2):
            own[r, i] = inverse[r, 0] * tangent[0, i] + inverse[r, 1] * tangent[1, i]
    apart[:] = 0.0
    for a in range(n):
        for i in range(d):
            apart[a, i] = -margin * outward[i] * (D[a, 0] * own[0] + D[a, 1] * own[1])
            apart[a, i, i] += N[a]
    shape_functions(local[0], local[1], N, D)
    surface_frame(x, master, N, D, position, tangent, normal)
    contact_normal(point, position, local, tangent, n, normal)
    for a in range(n):
        for i in range(d):
            apart[n + a, i, i] = -N[a]


@jit
def _inner_products(vectors, products):  # type: ignore[no-untyped-def]
    """Write the scalar products of two ``vectors (2, 3)`` with each other, ``products (2, 2)``."""
    for r in range(2):
        for s in range(2):
            products[r, s] = dot(vectors[r], vectors[s])


@jit
def _add_dyad(value, scale, left, right):  # type: ignore[no-untyped-def]
    """Add ``scale · left ⊗ right`` to the upper triangle of `value`."""
    for row in range(len(left)):
        factor = scale * left[row]
        for col in range(row, len(right)):
            value[row, col] += factor * right[col]


@jit
def _add_coating(at, own, outward, normal, factor, N, D, value):  # type: ignore[no-untyped-def]
    """Add ``factor · n · δ²ν`` to ``value (rows, rows)``, ν the slave's normal: the margin is a coating along it.

    With ``U_β = ν · δa_β`` and ``V_β = (n · a^γ) a^β · δa_γ`` (a the slave's tangents) it is ``δν = −a^β U_β`` and
    ``n · δ²ν = 2 U_β V_β − (n · ν) m^βγ U_β U_γ``.
    """
    n, rows = len(N), len(value)
    d = rows // (2 * n)
    shape_functions(at[0], at[1], N, D)
    U, V, metric = np.zeros((2, rows)), np.zeros((2, rows)), np.empty((2, 2))
    along = (dot(normal, own[0]), dot(normal, own[1]))
    for a in range(n):
        for i in range(d):
            for b in range(2):
                U[b, d * a + i] = outward[i] * D[a, b]
                V[b, d * a + i] = own[b, i] * (along[0] * D[a, 0] + along[1] * D[a, 1])
    _inner_products(own, metric)
    facing = dot(normal, outward)
    for b in range(2):
        _add_dyad(value, factor, U[b], V[b])
        _add_dyad(value, factor, V[b], U[b])
        for c in range(2):
            _add_dyad(value, -factor * facing * metric[b, c], U[b], U[c])


@parallel
def pair_stiffness(  # type: ignore[no-untyped-def]
    x, slaves, masters, at, local, margin, gap, normal_stiffness, force, d, packed
):
    """Fill the packed upper triangles ``packed (n_pairs, …)``, of ``2 n d`` rows, of ``k ∇g ⊗ ∇g + F ∇²g``.

    With ``T_α = ∂(x − y)·a_α`` and ``N_α = n · ∂a_α`` (a_α the tangents, m the metric, b the curvature of the master,
    A = m − g b) the second derivative of the gap is (as in Wriggers 2006, sec. 4.1, in another notation)
    ``−(N A⁻¹ T + T A⁻¹ N + g N A⁻¹ N + T m⁻¹ b A⁻¹ T)``, symmetric. On the rim of a face A and m are inverted only
    among the ways in which the closest point moves, and ``∂(x − y)·q ∂(x − y)·q / g`` is added for each direction q
    across them and n: with ``F = k g`` a spring of stiffness k, whatever the gap.

    `gap` is measured from the coating of thickness `margin`; `normal_stiffness` k and `force` F (negative in
    compression, lagged) are ``(n_pairs,)``.
    """
    for p in nb.prange(len(slaves)):
        pair = (slaves[p], masters[p], at[p], local[p])
        _stiffness_of(x, *pair, margin, gap[p], normal_stiffness[p], force[p], d, packed[p])


@jit
def _stiffness_of(x, slave, master, at, local, margin, gap, normal_stiffness, force, d, packed):  # type: ignore[no-untyped-def]
    n = len(slave)
    rows = 2 * n * d
    N, D, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty((2, 3)), np.empty(3)
    own, outward, apart = np.empty((2, 3)), np.empty(3), np.empty((2 * n, d, 3))
    b, S, value = np.empty((2, 2)), np.zeros((2, rows)), np.zeros((rows, rows))
    _pair_frame(x, slave, master, at, local, margin, N, D, own, outward, tangent, normal, apart)
    _curvature(x, master, local, normal, b)
    by_node = apart.reshape(rows, 3)
    G, T = np.empty(rows), np.empty((2, rows))
    for row in range(rows):
        G[row] = dot(by_node[row], normal)
        for r in range(2):
            T[r, row] = dot(by_node[row], tangent[r])
    for a in range(n):
        for i in range(d):
            for r in range(2):
                S[r, d * (n + a) + i] = D[a, r] * normal[i]
    _add_dyad(value, normal_stiffness, G, G)
    inverse_metric = np.empty((2, 2))
    _add_bending(n, local, tangent, b, gap, force, S, T, inverse_metric, value)
    if on_rim(n, local):
        _add_across(normal_stiffness, by_node, normal, tangent, inverse_metric, value)
    if margin > 0.0:
        _add_coating(at, own, outward, normal, margin * force, N, D, value)
    entry = 0
    for row in range(rows):
        for col in range(row, rows):
            packed[entry] = value[row, col]
            entry += 1


@jit
def _curvature(x, face, local, normal, b):  # type: ignore[no-untyped-def]
    """Write the curvature ``b (2, 2)`` of a face."""
    second = np.empty((len(face), 3))
    second_derivatives(local[0], local[1], second)
    b[:] = 0.0
    for a in range(len(face)):
        height = dot(normal, x[face[a]])
        b[0, 0] += second[a, 0] * height
        b[1, 1] += second[a, 1] * height
        b[0, 1] += second[a, 2] * height
    b[1, 0] = b[0, 1]


@jit
def _add_bending(n, local, tangent, b, gap, force, S, T, inverse_metric, value):  # type: ignore[no-untyped-def]
    """Add ``F ∇²g``, less what it is across a rim; writes the inverse metric among the ways of the closest point."""
    rows = S.shape[1]
    m, A, inverse = np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2))
    _inner_products(tangent, m)
    for r in range(2):
        for s in range(2):
            A[r, s] = m[r, s] - gap * b[r, s]
    free_inverse(n, local, A, inverse)
    free_inverse(n, local, m, inverse_metric)
    AT, AS, on_S, on_T = np.empty((2, rows)), np.empty((2, rows)), np.empty((2, rows)), np.empty((2, rows))
    for row in range(rows):
        for r in range(2):
            AT[r, row] = inverse[r, 0] * T[0, row] + inverse[r, 1] * T[1, row]
            AS[r, row] = inverse[r, 0] * S[0, row] + inverse[r, 1] * S[1, row]
        bent = (b[0, 0] * AT[0, row] + b[0, 1] * AT[1, row], b[1, 0] * AT[0, row] + b[1, 1] * AT[1, row])
        for r in range(2):
            on_S[r, row] = AT[r, row] + gap * AS[r, row]
            on_T[r, row] = AS[r, row] + inverse_metric[r, 0] * bent[0] + inverse_metric[r, 1] * bent[1]
    for r in range(2):
        _add_dyad(value, -force, S[r], on_S[r])
        _add_dyad(value, -force, T[r], on_T[r])


@jit
def _add_across(stiffness, by_node, normal, tangent, inverse_metric, value):  # type: ignore[no-untyped-def]
    """Add ``k ∂(x − y)·Q ∂(x − y)``, Q the projection on the directions across the rim and the normal."""
    across, moved = np.empty((3, 3)), np.empty((3, len(by_node)))
    for i in range(3):
        for k in range(3):
            across[i, k] = (1.0 if i == k else 0.0) - normal[i] * normal[k]
            for r in range(2):
                for s in range(2):
                    across[i, k] -= tangent[r, i] * inverse_metric[r, s] * tangent[s, k]
    for row in range(len(by_node)):
        for i in range(3):
            moved[i, row] = dot(across[i], by_node[row])
    for i in range(3):
        _add_dyad(value, stiffness, by_node[:, i], moved[i])
