"""The kinds of faces that meet: shape functions, control points and flat projections, for kernels.

A face is a six-node triangle, a nine-node quadrilateral or, in the plane z = 0, a three-node edge; its number of nodes
says which. Nodes and local coordinates are those of :mod:`turgor.mesh.cells`; the second coordinate of an edge is 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import binom

from turgor.fem.kernels import inlined, jit
from turgor.mesh.cells import Cell

Floats = NDArray[np.float64]

EDGE, TRIANGLE, SQUARE = 3, 6, 9
"""Numbers of nodes."""

RIM = 1e-9
"""A local point so little inside a face lies on its rim."""

SIDES = 4
"""A face has no more sides than that."""

# Of each node of a square, which of the three functions of a line it has along either coordinate.
_FIRST = np.array([0, 1, 1, 0, 2, 1, 2, 0, 2])
_SECOND = np.array([0, 0, 1, 1, 0, 2, 1, 2, 2])


@inlined
def shape_functions(a, b, N, D):  # type: ignore[no-untyped-def]
    """Write the ``n`` shape functions at the local point (a, b) into `N` and their derivatives into ``D (n, 2)``."""
    if len(N) == TRIANGLE:
        c = 1.0 - a - b
        N[0], N[1], N[2] = c * (2.0 * c - 1.0), a * (2.0 * a - 1.0), b * (2.0 * b - 1.0)
        N[3], N[4], N[5] = 4.0 * c * a, 4.0 * a * b, 4.0 * b * c
        D[0, 0] = D[0, 1] = 1.0 - 4.0 * c
        D[1, 0], D[1, 1] = 4.0 * a - 1.0, 0.0
        D[2, 0], D[2, 1] = 0.0, 4.0 * b - 1.0
        D[3, 0], D[3, 1] = 4.0 * (c - a), -4.0 * a
        D[4, 0], D[4, 1] = 4.0 * b, 4.0 * a
        D[5, 0], D[5, 1] = -4.0 * b, 4.0 * (c - b)
    elif len(N) == EDGE:
        N[0], N[1], N[2] = (1.0 - a) * (1.0 - 2.0 * a), a * (2.0 * a - 1.0), 4.0 * a * (1.0 - a)
        D[0, 0], D[1, 0], D[2, 0] = 4.0 * a - 3.0, 4.0 * a - 1.0, 4.0 - 8.0 * a
        D[:, 1] = 0.0
    else:
        along = ((1.0 - a) * (1.0 - 2.0 * a), a * (2.0 * a - 1.0), 4.0 * a * (1.0 - a))
        across = ((1.0 - b) * (1.0 - 2.0 * b), b * (2.0 * b - 1.0), 4.0 * b * (1.0 - b))
        along_slope = (4.0 * a - 3.0, 4.0 * a - 1.0, 4.0 - 8.0 * a)
        across_slope = (4.0 * b - 3.0, 4.0 * b - 1.0, 4.0 - 8.0 * b)
        for node in range(SQUARE):
            i, j = _FIRST[node], _SECOND[node]
            N[node] = along[i] * across[j]
            D[node, 0], D[node, 1] = along_slope[i] * across[j], along[i] * across_slope[j]


@inlined
def second_derivatives(a, b, S):  # type: ignore[no-untyped-def]
    """Write the second derivatives ``S (n, 3)`` of the shape functions by (a, a), (b, b) and (a, b)."""
    if len(S) == TRIANGLE:
        S[0, 0], S[0, 1], S[0, 2] = 4.0, 4.0, 4.0
        S[1, 0], S[1, 1], S[1, 2] = 4.0, 0.0, 0.0
        S[2, 0], S[2, 1], S[2, 2] = 0.0, 4.0, 0.0
        S[3, 0], S[3, 1], S[3, 2] = -8.0, 0.0, -4.0
        S[4, 0], S[4, 1], S[4, 2] = 0.0, 0.0, 4.0
        S[5, 0], S[5, 1], S[5, 2] = 0.0, -8.0, -4.0
    elif len(S) == EDGE:
        S[:, 1:] = 0.0
        S[0, 0], S[1, 0], S[2, 0] = 4.0, 4.0, -8.0
    else:
        along = ((1.0 - a) * (1.0 - 2.0 * a), a * (2.0 * a - 1.0), 4.0 * a * (1.0 - a))
        across = ((1.0 - b) * (1.0 - 2.0 * b), b * (2.0 * b - 1.0), 4.0 * b * (1.0 - b))
        along_slope = (4.0 * a - 3.0, 4.0 * a - 1.0, 4.0 - 8.0 * a)
        across_slope = (4.0 * b - 3.0, 4.0 * b - 1.0, 4.0 - 8.0 * b)
        bend = (4.0, 4.0, -8.0)
        for node in range(SQUARE):
            i, j = _FIRST[node], _SECOND[node]
            S[node, 0], S[node, 1] = bend[i] * across[j], along[i] * bend[j]
            S[node, 2] = along_slope[i] * across_slope[j]


@jit
def middle(n_nodes):  # type: ignore[no-untyped-def]
    """Return either local coordinate of a face's middle."""
    return 1.0 / 3.0 if n_nodes == TRIANGLE else 0.5


@jit
def inside(n_nodes, local, tolerance):  # type: ignore[no-untyped-def]
    """Whether local coordinates lie in the face, widened by `tolerance`."""
    if local[0] <= -tolerance or local[1] <= -tolerance:
        return False
    if n_nodes == SQUARE:
        return local[0] < 1.0 + tolerance and local[1] < 1.0 + tolerance
    return local[0] + local[1] < 1.0 + tolerance


@jit
def on_rim(n_nodes, local):  # type: ignore[no-untyped-def]
    """Whether local coordinates in the face lie on its rim."""
    if n_nodes == EDGE:
        return local[0] < RIM or local[0] > 1.0 - RIM
    return not inside(n_nodes, local, -RIM)


@jit
def free_directions(n_nodes, local, free):  # type: ignore[no-untyped-def]
    """Write into the rows of ``free (2, 2)`` how a local point moves within the face or along its rim; return how many.

    Two inside, one on a side, none at a corner. Out of its plane an edge goes on for ever.
    """
    free[:] = 0.0
    if n_nodes == TRIANGLE:
        first, second, third = local[0] < RIM, local[1] < RIM, local[0] + local[1] > 1.0 - RIM
        held = int(first) + int(second) + int(third)
        free[0, 0] = 0.0 if first else 1.0
        free[0, 1] = 1.0 if first else -1.0 if third else 0.0
        free[1, 1] = 1.0
        return max(2 - held, 0)
    count = 0
    for i in range(2):
        held_here = local[i] < RIM or local[i] > 1.0 - RIM
        if not held_here or (i == 1 and n_nodes == EDGE):
            free[count, i] = 1.0
            count += 1
    return count


@jit
def side(n_nodes, number, local):  # type: ignore[no-untyped-def]
    """Return whether a local point lies beyond a side of the face, and where that begins and leads to, (a, b) each.

    The sides of an edge are its ends, which lead nowhere.
    """
    a, b = local[0], local[1]
    if n_nodes == EDGE:
        beyond = (number == 0 and a <= 0.0) or (number == 1 and a >= 1.0)
        return beyond, float(number), 0.0, 0.0, 0.0
    if number == 0:
        return b <= 0.0, 0.0, 0.0, 1.0, 0.0
    if number == 1:
        return a <= 0.0, 0.0, 0.0, 0.0, 1.0
    if n_nodes == TRIANGLE:
        return number == 2 and a + b >= 1.0, 1.0, 0.0, -1.0, 1.0
    if number == 2:
        return b >= 1.0, 0.0, 1.0, 1.0, 0.0
    return a >= 1.0, 1.0, 0.0, 0.0, 1.0


@jit
def flat_projection(x, face, point, local):  # type: ignore[no-untyped-def]
    """Write the local coordinates of `point` projected on the flat face of the corners; False if it has no area.

    The four corners of a square need not lie in a plane: for them stands the parallelogram with their mean sides.
    """
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
        if len(face) == SQUARE:
            opposite, last = second, x[face[3], i] - origin
            origin += 0.25 * (first + last - opposite)
            first, second = 0.5 * (opposite + first - last), 0.5 * (opposite + last - first)
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


def control_weights(cell: Cell) -> Floats:
    """Return what each node counts in each control point of a face, ``(n, n)``.

    With the control points its place is a sum of Bernstein polynomials, which are positive and add up to one: the face
    lies in their convex hull, however it is curved.
    """
    places = cell.nodes
    whole = np.column_stack([places, 1.0 - places.sum(axis=1)])
    values = []
    for powers in np.rint(2 * whole if cell.simplex else 2 * places).astype(int):
        # one polynomial for each node, that with its largest value there
        if cell.simplex:
            count = 2 / np.prod([1 if k < 2 else 2 for k in powers])
            values.append(count * np.prod(whole**powers, axis=1))
        else:
            values.append(np.prod(binom(2, powers) * places**powers * (1.0 - places) ** (2 - powers), axis=1))
    return np.asarray(np.linalg.inv(np.column_stack(values)))
