"""Kernels of contact between curved faces: closest points, gaps and their derivatives.

A pair is a point of one face (the slave, at a quadrature point) and the closest point of another (the master), both
faces curved. Its gap is ``g = n · (x − y)``, n the master's unit normal at the closest point y: negative where they
overlap. Shapes: ``k`` faces of ``n`` nodes, ``q`` quadrature points a face, ``d`` displacement components; the nodes of
a pair are the slave's, then the master's.

Faces are six-node triangles (d = 3) or, in the plane z = 0, three-node edges (d = 2). One set of kernels serves both:
an edge is the side b = 0 of a six-node triangle, and its second tangent is the unit vector out of the plane. Positions
have three components in both.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.kernels import inlined, jit, parallel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FACING = -0.5
"""Two faces meet where the cosine between their normals is below this."""

OUTSIDE = 0.05
"""A closest point may lie so far outside the master (in its local coordinates), so that no gap opens between faces."""

SURE = 2.0
"""A point whose projection on the flat face of the corners lies so far outside is not looked at further."""

BULGE = 1.2
"""A face, and what lies so little outside it, is within so many radii of its ball, which is drawn around its nodes."""

NOWHERE = -1


@inlined
def shape_functions(a, b, N, D):  # type: ignore[no-untyped-def]
    """Write the ``n`` shape functions at the local point (a, b) into `N` and their derivatives into ``D (n, 2)``."""
    if len(N) == EDGE:
        N[0], N[1], N[2] = (1.0 - a) * (1.0 - 2.0 * a), a * (2.0 * a - 1.0), 4.0 * a * (1.0 - a)
        D[0, 0], D[1, 0], D[2, 0] = 4.0 * a - 3.0, 4.0 * a - 1.0, 4.0 - 8.0 * a
        D[:, 1] = 0.0
    else:
        c = 1.0 - a - b
        N[0], N[1], N[2] = c * (2.0 * c - 1.0), a * (2.0 * a - 1.0), b * (2.0 * b - 1.0)
        N[3], N[4], N[5] = 4.0 * c * a, 4.0 * a * b, 4.0 * b * c
        D[0, 0] = D[0, 1] = 1.0 - 4.0 * c
        D[1, 0], D[1, 1] = 4.0 * a - 1.0, 0.0
        D[2, 0], D[2, 1] = 0.0, 4.0 * b - 1.0
        D[3, 0], D[3, 1] = 4.0 * (c - a), -4.0 * a
        D[4, 0], D[4, 1] = 4.0 * b, 4.0 * a
        D[5, 0], D[5, 1] = -4.0 * b, 4.0 * (c - b)


EDGE = 3
"""Nodes of an edge."""

# Second derivatives of the shape functions by (a, a), (b, b) and (a, b).
ON_TRIANGLE = np.array(
    [[4.0, 4.0, 4.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [-8.0, 0.0, -4.0], [0.0, 0.0, 4.0], [0.0, -8.0, -4.0]]
)
ON_EDGE = np.array([[4.0, 0.0, 0.0], [4.0, 0.0, 0.0], [-8.0, 0.0, 0.0]])


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
    """Return centre ``(k, 3)``, unit normal ``(k, 3)`` and radius ``(k,)`` of balls around the faces' nodes."""
    centre, normal, radius = np.empty((len(faces), 3)), np.empty((len(faces), 3)), np.empty(len(faces))
    _fill_balls(x, faces, centre, normal, radius)
    return centre, normal, radius


@parallel
def _fill_balls(x, faces, centre, normal, radius):  # type: ignore[no-untyped-def]
    n = faces.shape[1]
    middle = 1.0 / (2.0 if n == EDGE else 3.0)
    for f in nb.prange(len(faces)):
        N, D, tangent = np.empty(n), np.empty((n, 2)), np.empty((2, 3))
        shape_functions(middle, middle, N, D)
        surface_frame(x, faces[f], N, D, centre[f], tangent, normal[f])
        square = 0.0
        for a in range(n):
            away = x[faces[f, a]] - centre[f]
            square = max(square, dot(away, away))
        radius[f] = np.sqrt(square)


@jit
def flat_projection(x, face, point, local):  # type: ignore[no-untyped-def]
    """Write the local coordinates of `point` projected on the flat face of the corners; False if it has no area."""
    if len(face) == EDGE:
        local[1] = length = along = 0.0
        for i in range(3):
            span = x[face[1], i] - x[face[0], i]
            length += span * span
            along += span * (point[i] - x[face[0], i])
        local[0] = along / length
        return length > 0.0
    m00 = m01 = m11 = r0 = r1 = 0.0
    for i in range(3):
        origin = x[face[0], i]
        first, second = x[face[1], i] - origin, x[face[2], i] - origin
        away = point[i] - origin
        m00 += first * first
        m01 += first * second
        m11 += second * second
        r0 += first * away
        r1 += second * away
    determinant = m00 * m11 - m01 * m01
    if determinant <= 1e-12 * m00 * m11:
        return False
    local[0] = (m11 * r0 - m01 * r1) / determinant
    local[1] = (m00 * r1 - m01 * r0) / determinant
    return True


@jit
def inside(local, tolerance):  # type: ignore[no-untyped-def]
    """Whether local coordinates lie in the face, widened by `tolerance`."""
    return local[0] > -tolerance and local[1] > -tolerance and local[0] + local[1] < 1.0 + tolerance


@jit
def closest_point(x, face, point, local, N, D, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Find the closest point of a curved face by Newton's method from `local` on; False if there is none near.

    Writes its local coordinates, shape functions and frame.
    """
    second = ON_EDGE if len(face) == EDGE else ON_TRIANGLE
    for _ in range(12):
        shape_functions(local[0], local[1], N, D)
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
        if not inside(local, SURE):
            return False
        if size < 1e-8:
            # Newton's method squares the error: one more evaluation is exact.
            shape_functions(local[0], local[1], N, D)
            surface_frame(x, face, N, D, position, tangent, normal)
            return True
    return False


@parallel
def find_partners(  # type: ignore[no-untyped-def]
    x, faces, centre, radius, rule, start, candidates, depth, reach, partner, local, gap
):
    """Find for each quadrature point the face that it overlaps, or else the one in front of it.

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
    depth, reach
        How far a point may lie behind a face ``(k,)`` (the smaller of the two counts), and in front of it.
    partner, local, gap
        Results: the master ``(k, q)`` (:data:`NOWHERE` if there is none), the closest point ``(k, q, 2)``, the gap
        ``(k, q)``. An overlapped face comes before one in front, the nearer before the farther.
    """
    n = faces.shape[1]
    for f in nb.prange(len(faces)):
        N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
        point, outward, trial = np.empty(3), np.empty(3), np.empty(2)
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
                if not flat_projection(x, faces[m], point, trial) or not inside(trial, 0.5):
                    continue
                if not closest_point(x, faces[m], point, trial, N, D, position, tangent, normal):
                    continue
                if not inside(trial, OUTSIDE) or dot(outward, normal) > FACING:
                    continue
                g = dot(normal, point - position)
                if g < -min(depth[f], depth[m]) or g > reach:
                    continue
                best = gap[f, q]
                if (g < 0.0 and (best >= 0.0 or g > best)) or (g >= 0.0 and best >= 0.0 and g < best):
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
    second = ON_EDGE if n == EDGE else ON_TRIANGLE
    for p in nb.prange(len(slaves)):
        N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
        shape_at = np.empty(2 * n)
        m, b, A = np.empty((2, 2)), np.zeros((2, 2)), np.empty((2, 2))
        G, T, S = np.empty(rows), np.empty((2, rows)), np.zeros((2, rows))
        shape_functions(at[p, 0], at[p, 1], N, D)
        shape_at[:n] = N
        shape_functions(local[p, 0], local[p, 1], N, D)
        shape_at[n:] = -N
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
