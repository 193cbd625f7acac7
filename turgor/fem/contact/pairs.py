"""Kernels of contact between curved faces: closest points, gaps and their derivatives.

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
from numpy.typing import NDArray

from turgor.fem.contact.closest import contact_normal, dot, free_inverse, gap_to, invert, surface_frame
from turgor.fem.contact.shapes import (
    control_weights,
    middle,
    on_rim,
    second_derivatives,
    shape_functions,
)
from turgor.fem.kernels import jit, parallel
from turgor.mesh.cells import CELLS

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FACING = -0.5
"""Two faces meet where the cosine between their normals is below this."""

SAME = 1e-6
"""Places that are nearer to each other than this part of a face are the same."""

NOWHERE = -1


Balls = tuple[Floats, Floats, Floats, Floats]


def balls(x: Floats, faces: Ints) -> Balls:
    """Return centre ``(k, 3)``, unit normal ``(k, 3)`` and radius ``(k,)`` of balls that the faces lie in.

    And how far at most a face leaves the plane through the centre across the normal, ``(k,)``.
    """
    centre, normal = np.empty((len(faces), 3)), np.empty((len(faces), 3))
    radius, rise = np.empty(len(faces)), np.empty(len(faces))
    _fill_balls(x, faces, _CONTROL[faces.shape[1]], centre, normal, radius, rise)
    return centre, normal, radius, rise


_CONTROL = {CELLS[name].n_nodes: control_weights(CELLS[name]) for name in ("line3", "tri6", "quad9")}


@parallel
def _fill_balls(x, faces, control, centre, normal, radius, rise):  # type: ignore[no-untyped-def]
    for f in nb.prange(len(faces)):
        radius[f], rise[f] = _ball(x, faces[f], control, centre[f], normal[f])


@jit
def _ball(x, face, control, centre, normal):  # type: ignore[no-untyped-def]
    """Write centre and normal of a face; return the radius of the ball around it and how far it rises at most."""
    n = len(face)
    N, D, tangent, away = np.empty(n), np.empty((n, 2)), np.empty((2, 3)), np.empty(3)
    shape_functions(middle(n), middle(n), N, D)
    surface_frame(x, face, N, D, centre, tangent, normal)
    square = highest = 0.0
    for p in range(n):
        away[:] = -centre
        for a in range(n):
            for i in range(3):
                away[i] += control[p, a] * x[face[a], i]
        square = max(square, dot(away, away))
        highest = max(highest, abs(dot(away, normal)))
    return np.sqrt(square), highest


@jit
def _nearest_first(place, extent, behind, centre, flat, radius, rise, candidates, depth, reach, near, ahead):  # type: ignore[no-untyped-def]
    """Write the candidates whose slabs a face reaches, the nearest first, and how far it is from them at least.

    The face is in the ball around `place` with the radius `extent`, and `behind` is its depth.

    Return how many there are.
    """
    count = 0
    for m in candidates:
        height = square = 0.0
        for i in range(3):
            away = place[i] - centre[m, i]
            height += away * flat[m, i]
            square += away * away
        if height > rise[m] + extent + reach or -height > rise[m] + extent + min(behind, depth[m]):
            continue
        distance = np.sqrt(square) - extent - radius[m]
        at = count
        while at > 0 and ahead[at - 1] > distance:
            near[at], ahead[at] = near[at - 1], ahead[at - 1]
            at -= 1
        near[at], ahead[at] = m, distance
        count += 1
    return count


@parallel
def find_partners(  # type: ignore[no-untyped-def]
    x, faces, centre, flat, radius, rise, rule, start, candidates, depth, margin, reach, partner, local, gap
):
    """Find for each quadrature point the nearest face that it may meet.

    The nearest place of all faces moves steadily along with the point, over a groove on the rim that two faces share,
    and so the gap does not jump. Only such a rim counts: beyond the rim of one face alone lies the end of the surface,
    or another face that is nearer.

    Parameters
    ----------
    x, faces
        Positions ``(n_points, 3)`` and faces ``(k, n)``.
    centre, flat, radius, rise
        Balls around the faces, their normals and how thick they are; see :func:`balls`.
    rule
        Local coordinates of the quadrature points ``(q, 2)``.
    start, candidates
        The candidates for face ``f`` are ``candidates[start[f]:start[f + 1]]``.
    depth, margin, reach
        How far a point may lie behind a face ``(k,)`` (the smaller of the two counts), how far in front of its own face
        it is taken to lie, and how far in front of the other it then is at most.
    partner, local, gap
        Results: the master ``(k, q)`` (:data:`NOWHERE` if there is none), the closest point ``(k, q, 2)``, the gap
        ``(k, q)``.
    """
    for f in nb.prange(len(faces)):
        here = candidates[start[f] : start[f + 1]]
        near, ahead = np.empty(len(here), np.int32), np.empty(len(here))
        around = (centre, flat, radius, rise)
        ball = (centre[f], radius[f] + margin, depth[f])
        count = _nearest_first(*ball, *around, here, depth, reach, near, ahead)
        found = (partner[f], local[f], gap[f])
        # Nothing here takes f itself, whose type differs inside the loop: all would be compiled twice.
        _partners_of(x, faces[f], depth[f], faces, *around, rule, near, ahead, count, depth, margin, reach, *found)


@jit
def _partners_of(  # type: ignore[no-untyped-def]
    x,
    face,
    behind,
    faces,
    centre,
    flat,
    radius,
    rise,
    rule,
    near,
    ahead,
    count,
    depth,
    margin,
    reach,
    partner,
    local,
    gap,
):
    """Find the partners of the points of one face among `count` faces `near`, from which it is `ahead` at least."""
    n = len(face)
    N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
    point, outward, trial, second = np.empty(3), np.empty(3), np.empty(2), np.empty((n, 3))
    away, rim_place, rim_local = np.empty(3), np.empty(3), np.empty(2)
    partner[:], gap[:] = NOWHERE, np.inf
    for q in range(len(rule) if count > 0 else 0):
        rim_gap, rim_face, sharing = np.inf, NOWHERE, 0
        shape_functions(rule[q, 0], rule[q, 1], N, D)
        surface_frame(x, face, N, D, point, tangent, outward)
        point += margin * outward
        for c in range(count):
            m = near[c]
            if ahead[c] > abs(gap[q]):
                break
            deepest = min(behind, depth[m])
            away[:] = point - centre[m]
            height, far = dot(away, flat[m]), radius[m] + min(max(reach, deepest), abs(gap[q]))
            if dot(away, away) > far * far or height > rise[m] + reach or -height > rise[m] + deepest:
                continue
            g = gap_to(x, faces[m], point, trial, N, D, second, position, tangent, normal)
            if g < -deepest or g > reach or dot(outward, normal) > FACING:
                continue
            rim = on_rim(n, trial)
            if not rim and abs(g) < abs(gap[q]):
                partner[q], gap[q], local[q] = m, g, trial
            elif rim and np.abs(position - rim_place).max() < SAME * radius[m] and rim_face != NOWHERE:
                sharing += 1
            elif rim and abs(g) < abs(rim_gap):
                rim_face, rim_gap, sharing = m, g, 1
                rim_place[:], rim_local[:] = position, trial
        if sharing > 1 and abs(rim_gap) < abs(gap[q]):
            partner[q], gap[q], local[q] = rim_face, rim_gap, rim_local


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
