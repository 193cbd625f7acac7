"""Kernels that find the closest point of a curved face, its rim included, and the direction of contact there.

Inside the face the direction is its normal. Over a rim, where two faces meet at an angle, it turns from the one normal
to the other as the point passes: along the line from the closest point. So a gap changes smoothly from face to face.
Shapes are those of :mod:`turgor.fem.contact.pairs`.
"""

from __future__ import annotations

import numpy as np

from turgor.fem.contact.shapes import (
    EDGE,
    RIM,
    SIDES,
    flat_projection,
    free_directions,
    inside,
    on_rim,
    second_derivatives,
    shape_functions,
    side,
)
from turgor.fem.kernels import inlined, jit

SURE = 2.0
"""A point whose projection on the flat face of the corners lies so far outside is not looked at further."""

NEAR = 0.5
"""Faces are looked at on whose flat face of the corners the point is projected no farther outside."""

STEEP = 0.5
"""Over its rim a face is met where the cosine between its normal and the direction of contact is at least this."""

TINY = 1e-9
"""A point so near a rim, in parts of the face, lies on it: the direction of contact is the face's normal."""


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


@jit
def gap_to(x, face, point, local, N, D, second, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Return the gap between a point and a face, infinite if it is not before, behind or near it.

    Writes the closest point of the face: local coordinates, place, tangents ``(2, 3)`` and the direction of contact.
    """
    n = len(face)
    if not flat_projection(x, face, point, local) or not inside(n, local, NEAR):
        return np.inf
    if not closest_point(x, face, point, local, N, D, second, position, tangent, normal):
        return np.inf
    if not contact_normal(point, position, local, tangent, n, normal):
        return np.inf
    return dot(normal, point - position)


@jit
def closest_point(x, face, point, local, N, D, second, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Find the closest point of a curved face by Newton's method from `local` on; False if there is none near.

    Writes its local coordinates, shape functions and frame. It lies in the face, or on one of the sides beyond which it
    would lie if the face went on as it is curved.
    """
    if not _closest_drawn_out(x, face, point, local, N, D, second, position, tangent, normal):
        return False
    if inside(len(face), local, RIM):
        return True
    beyond, best, least = local.copy(), local.copy(), np.inf
    for number in range(SIDES):
        outside, a, b, to_a, to_b = side(len(face), number, beyond)
        if outside:
            _closest_on_side(x, face, point, beyond, a, b, to_a, to_b, local, N, D, second, position, tangent, normal)
            away = point - position
            if dot(away, away) < least:
                least, best[:] = dot(away, away), local
    local[:] = best
    shape_functions(local[0], local[1], N, D)
    surface_frame(x, face, N, D, position, tangent, normal)
    return least < np.inf


@jit
def _closest_drawn_out(x, face, point, local, N, D, second, position, tangent, normal):  # type: ignore[no-untyped-def]
    """Find the closest point of the surface that goes on beyond the face as the face is curved."""
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


@jit
def _closest_on_side(  # type: ignore[no-untyped-def]
    x, face, point, beyond, a, b, to_a, to_b, local, N, D, second, position, tangent, normal
):
    """Find the closest point of the side from (a, b) to (a + to_a, b + to_b), from the local point `beyond` it on."""
    length = to_a**2 + to_b**2
    along = 0.0 if length == 0.0 else ((beyond[0] - a) * to_a + (beyond[1] - b) * to_b) / length
    along = min(max(along, 0.0), 1.0)
    for _ in range(12):
        local[0], local[1] = a + along * to_a, b + along * to_b
        shape_functions(local[0], local[1], N, D)
        second_derivatives(local[0], local[1], second)
        surface_frame(x, face, N, D, position, tangent, normal)
        if length == 0.0:
            return
        away, way = point - position, to_a * tangent[0] + to_b * tangent[1]
        metric = dot(way, way)
        curved = metric
        for k in range(len(face)):
            bend = to_a**2 * second[k, 0] + to_b**2 * second[k, 1] + 2.0 * to_a * to_b * second[k, 2]
            curved -= bend * dot(away, x[face[k]])
        step = dot(away, way) / (curved if curved > 0.01 * metric else metric)
        further = min(max(along + min(max(step, -0.5), 0.5), 0.0), 1.0)
        if abs(further - along) < 1e-13:
            return
        along = further


@jit
def contact_normal(point, position, local, tangent, n_nodes, normal):  # type: ignore[no-untyped-def]
    """Turn `normal` from the face's into the direction of contact at its closest point; False if that is too steep."""
    if not on_rim(n_nodes, local):
        return True
    away = point - position
    distance = np.sqrt(dot(away, away))
    if distance <= TINY * np.sqrt(dot(tangent[0], tangent[0])):
        return True
    cosine = dot(away, normal) / distance
    if abs(cosine) < STEEP:
        return False
    normal[:] = away / (distance if cosine > 0.0 else -distance)
    return True


@jit
def invert(matrix, inverse):  # type: ignore[no-untyped-def]
    """Write the inverse of a ``matrix (2, 2)``."""
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    inverse[0, 0], inverse[1, 1] = matrix[1, 1] / determinant, matrix[0, 0] / determinant
    inverse[0, 1], inverse[1, 0] = -matrix[0, 1] / determinant, -matrix[1, 0] / determinant


@jit
def free_inverse(n_nodes, local, matrix, inverse):  # type: ignore[no-untyped-def]
    """Write the inverse of a symmetric ``matrix (2, 2)`` among the ways that a local point can move within the face."""
    free = np.empty((2, 2))
    count = free_directions(n_nodes, local, free)
    inverse[:] = 0.0
    if count == 2:
        invert(matrix, inverse)
    elif count == 1:
        way = free[0]
        stiffness = way[0] * (matrix[0, 0] * way[0] + 2.0 * matrix[0, 1] * way[1]) + matrix[1, 1] * way[1] ** 2
        for i in range(2):
            for k in range(2):
                inverse[i, k] = way[i] * way[k] / stiffness
