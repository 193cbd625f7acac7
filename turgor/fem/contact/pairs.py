"""Kernels of contact between curved faces: closest points, gaps and their derivatives.

A pair is a point of one face (the slave, at a quadrature point) and the closest point of another (the master), both
faces curved. Its gap is ``g = n · (x − y)``, n the master's unit normal at the closest point y: negative where they
overlap. Shapes: ``k`` faces of ``n`` nodes, ``q`` quadrature points a face, ``d`` displacement components; the nodes of
a pair are the slave's, then the master's.

Faces are six-node triangles or nine-node quadrilaterals (d = 3) or, in the plane z = 0, three-node edges (d = 2). One
set of kernels serves all, by the shape functions of :mod:`turgor.fem.contact.shapes`: the second tangent of an edge is
the unit vector out of the plane. Positions always have three components.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.shapes import (
    EDGE,
    control_weights,
    flat_projection,
    inside,
    middle,
    second_derivatives,
    shape_functions,
)
from turgor.fem.kernels import inlined, jit, parallel
from turgor.mesh.cells import CELLS

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FACING = -0.5
"""Two faces meet where the cosine between their normals is below this."""

OUTSIDE = 0.05
"""A closest point may lie so far outside the master (in its local coordinates), so that no gap opens between faces."""

SURE = 2.0
"""A point whose projection on the flat face of the corners lies so far outside is not looked at further."""

BULGE = 1.2
"""What lies so little outside a face is within so many radii of the ball that the face itself lies in."""

NOWHERE = -1


@inlined
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return the scalar product of two vectors ``(3,)``."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def surface_frame(x, face, N, D, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Write position, tangents ``(2, 3)`` and unit normal of a face where its shape functions are `N` and `D`."""
    position[:] = 0.0
    tangent[:] = 0.0
    for a in range(len(N)):
        for i in range(3):
            value = x[face[a], i]
            position[i] += N[a] * value
            tangent[0, i] += D[a, 0] * value
            tangent[1, i] += D[a, 1] * value
    if len(N) == EDGE:
        tangent[1, 2] = 1.0
    first, second = tangent[0], tangent[1]
    normal[0] = first[1] * second[2] - first[2] * second[1]
    normal[1] = first[2] * second[0] - first[0] * second[2]
    normal[2] = first[0] * second[1] - first[1] * second[0]
    normal /= np.sqrt(dot(normal, normal))


def balls(x: Floats, faces: Ints) -> tuple[Floats, Floats, Floats]:
    """Return centre ``(k, 3)``, unit normal ``(k, 3)`` and radius ``(k,)`` of balls that the faces lie in."""
    centre, normal, radius = np.empty((len(faces), 3)), np.empty((len(faces), 3)), np.empty(len(faces))
    _fill_balls(x, faces, _CONTROL[faces.shape[1]], centre, normal, radius)
    return centre, normal, radius


_CONTROL = {CELLS[name].n_nodes: control_weights(CELLS[name]) for name in ("line3", "tri6", "quad9")}


@parallel
def _fill_balls(x, faces, control, centre, normal, radius):  # type: ignore[no-untyped-def]
    n = faces.shape[1]
    for f in nb.prange(len(faces)):
        N, D, tangent = np.empty(n), np.empty((n, 2)), np.empty((2, 3))
        shape_functions(middle(n), middle(n), N, D)
        surface_frame(x, faces[f], N, D, centre[f], tangent, normal[f])
        square = 0.0
        for p in range(n):
            away = 0.0
            for i in range(3):
                place = -centre[f, i]
                for a in range(n):
                    place += control[p, a] * x[faces[f, a], i]
                away += place * place
            square = max(square, away)
        radius[f] = np.sqrt(square)


@jit
def closest_point(x, face, point, local, N, D, second, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Find the closest point of a curved face by Newton's method from `local` on; False if there is none near.

    Writes its local coordinates, shape functions and frame.
    """
    for _ in range(12):
        shape_functions(local[0], local[1], N, D)
        second_derivatives(local[0], local[1], second)
        surface_frame(x, face, N, D, position, tangent, normal)
        away = point - position
        r0, r1 = dot(away, tangent[0]), dot(away, tangent[1])
        m00, m01, m11 = dot(tangent[0], tangent[0]), dot(tangent[0], tangent[1]), dot(tangent[1], tangent[1])
        a00, a01, a11 = m00, m01, m11
        for a in range(len(face)):
            along = dot(away, x[face[a]])
            a00 -= second[a, 0] * along
            a11 -= second[a, 1] * along
            a01 -= second[a, 2] * along
        determinant = a00 * a11 - a01 * a01
        if a00 <= 0.0 or determinant <= 0.01 * (m00 * m11 - m01 * m01):
            # Too far off for the curvature to be of use: as if the face were flat.
            a00, a01, a11 = m00, m01, m11
            determinant = m00 * m11 - m01 * m01
            if determinant <= 0.0:
                return False
        d0, d1 = (a11 * r0 - a01 * r1) / determinant, (a00 * r1 - a01 * r0) / determinant
        size = max(abs(d0), abs(d1))
        if size > 0.5:
            d0, d1 = 0.5 * d0 / size, 0.5 * d1 / size
        if size < 1e-13:
            return True
        local[0] += d0
        local[1] += d1
        if not inside(len(face), local, SURE):
            return False
        if size < 1e-8:
            # Newton's method squares the error: one more evaluation is exact.
            shape_functions(local[0], local[1], N, D)
            surface_frame(x, face, N, D, position, tangent, normal)
            return True
    return False


@parallel
def find_partners(  # type: ignore[no-untyped-def]
    x, faces, centre, radius, rule, start, candidates, depth, margin, reach, partner, local, gap
):
    """Find for each quadrature point the face that it overlaps, or is within a margin of, or else the one in front.

    Parameters
    ----------
    x, faces
        Positions ``(n_points, 3)`` and faces ``(k, n)``.
    centre, radius
        Balls around the faces, ``(k, 3)`` and ``(k,)``; see :func:`balls`.
    rule
        Local coordinates of the quadrature points ``(q, 2)``.
    start, candidates
        The candidates for face ``f`` are ``candidates[start[f]:start[f + 1]]``.
    depth, margin, reach
        How far a point may lie behind a face ``(k,)`` (the smaller of the two counts), how far in front of it it counts
        as overlapping it all the same, and how far in front it is looked for.
    partner, local, gap
        Results: the master ``(k, q)`` (:data:`NOWHERE` if there is none), the closest point ``(k, q, 2)``, the gap
        ``(k, q)``. An overlapped face comes before one in front, the nearer before the farther.
    """
    n = faces.shape[1]
    for f in nb.prange(len(faces)):
        N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
        point, outward, trial, second = np.empty(3), np.empty(3), np.empty(2), np.empty((n, 3))
        for q in range(len(rule)):
            partner[f, q] = NOWHERE
            gap[f, q] = np.inf
            if start[f] == start[f + 1]:
                continue
            shape_functions(rule[q, 0], rule[q, 1], N, D)
            surface_frame(x, faces[f], N, D, point, tangent, outward)
            for c in range(start[f], start[f + 1]):
                m = candidates[c]
                square = 0.0
                for i in range(3):
                    square += (point[i] - centre[m, i]) ** 2
                far = BULGE * radius[m] + max(reach, min(depth[f], depth[m]))
                if square > far * far:
                    continue
                if not flat_projection(x, faces[m], point, trial) or not inside(n, trial, 0.5):
                    continue
                if not closest_point(x, faces[m], point, trial, N, D, second, position, tangent, normal):
                    continue
                if not inside(n, trial, OUTSIDE) or dot(outward, normal) > FACING:
                    continue
                g = dot(normal, point - position)
                if g < -min(depth[f], depth[m]) or g > reach:
                    continue
                best = gap[f, q]
                if (g < margin and (best >= margin or g > best)) or (g >= margin and best >= margin and g < best):
                    partner[f, q] = m
                    gap[f, q] = g
                    local[f, q] = trial


@parallel
def gap_gradients(x, slaves, masters, at, local, gradient):  # type: ignore[no-untyped-def]
    """Fill the derivatives of gaps with respect to their nodes, ``gradient (n_pairs, 2 n, d)``.

    `slaves` and `masters` are ``(n_pairs, n)``; `at` and `local` ``(n_pairs, 2)`` are the points on them. The closest
    point's own motion has no part in it, for the gap is normal to the master.
    """
    n, d = slaves.shape[1], gradient.shape[2]
    for p in nb.prange(len(slaves)):
        N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
        shape_functions(local[p, 0], local[p, 1], N, D)
        surface_frame(x, masters[p], N, D, position, tangent, normal)
        for a in range(n):
            for i in range(d):
                gradient[p, n + a, i] = -N[a] * normal[i]
        shape_functions(at[p, 0], at[p, 1], N, D)
        for a in range(n):
            for i in range(d):
                gradient[p, a, i] = N[a] * normal[i]


@parallel
def pair_stiffness(x, slaves, masters, at, local, gap, normal_stiffness, force, d, packed):  # type: ignore[no-untyped-def]
    """Fill the packed upper triangles ``packed (n_pairs, …)``, of ``2 n d`` rows, of ``k ∇g ⊗ ∇g + F ∇²g``.

    With ``T_α = ∂(x − y)·a_α`` and ``N_α = n · ∂a_α`` (a_α the tangents, m the metric, b the curvature of the master,
    A = m − g b) the second derivative of the gap is (as in Wriggers 2006, sec. 4.1, in another notation)
    ``−(N A⁻¹ T + T A⁻¹ N + g N A⁻¹ N + T m⁻¹ b A⁻¹ T)``, symmetric.

    `normal_stiffness` k and `force` F (negative in compression, lagged) are ``(n_pairs,)``.
    """
    n = slaves.shape[1]
    rows = 2 * n * d
    for p in nb.prange(len(slaves)):
        N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
        second, shape_at = np.empty((n, 3)), np.empty(2 * n)
        m, b, A = np.empty((2, 2)), np.zeros((2, 2)), np.empty((2, 2))
        G, T, S = np.empty(rows), np.empty((2, rows)), np.zeros((2, rows))
        shape_functions(at[p, 0], at[p, 1], N, D)
        shape_at[:n] = N
        shape_functions(local[p, 0], local[p, 1], N, D)
        shape_at[n:] = -N
        second_derivatives(local[p, 0], local[p, 1], second)
        surface_frame(x, masters[p], N, D, position, tangent, normal)
        for a in range(n):
            height = dot(normal, x[masters[p, a]])
            b[0, 0] += second[a, 0] * height
            b[1, 1] += second[a, 1] * height
            b[0, 1] += second[a, 2] * height
        b[1, 0] = b[0, 1]
        for r in range(2):
            for s in range(2):
                m[r, s] = dot(tangent[r], tangent[s])
                A[r, s] = m[r, s] - gap[p] * b[r, s]
        for a in range(2 * n):
            for i in range(d):
                G[d * a + i] = shape_at[a] * normal[i]
                for r in range(2):
                    T[r, d * a + i] = shape_at[a] * tangent[r, i]
                    if a >= n:
                        S[r, d * a + i] = D[a - n, r] * normal[i]
        inverse = np.linalg.inv(A)
        curved = np.linalg.inv(m) @ b @ inverse
        AT, AS, CT = inverse @ T, inverse @ S, curved @ T
        F = force[p]
        entry = 0
        for row in range(rows):
            for col in range(row, rows):
                value = 0.0
                for r in range(2):
                    value += S[r, row] * (AT[r, col] + gap[p] * AS[r, col]) + T[r, row] * (AS[r, col] + CT[r, col])
                packed[p, entry] = normal_stiffness[p] * G[row] * G[col] - F * value
                entry += 1
