"""Kernels that find which face each point of a skin meets. Shapes are those of :mod:`turgor.fem.contact.pairs`."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.closest import dot, gap_to, surface_frame
from turgor.fem.contact.shapes import control_weights, middle, on_rim, shape_functions
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
def _nearest_first(place, extent, behind, around, candidates, depth, reach, near, ahead):  # type: ignore[no-untyped-def]
    """Write the candidates whose slabs a face reaches, the nearest first, and how far it is from them at least.

    The face is in the ball around `place` with the radius `extent`, and `behind` is its depth.

    Return how many there are.
    """
    centre, flat, radius, rise = around
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
    x, faces, around, rule, start, candidates, depth, margin, reach, partner, local, gap
):
    """Find for each quadrature point the nearest face that it may meet.

    The nearest place of all faces moves steadily along with the point, over a groove on the rim that two faces share,
    and so the gap does not jump. Only such a rim counts: beyond the rim of one face alone lies the end of the surface,
    or another face that is nearer.

    Parameters
    ----------
    x, faces
        Positions ``(n_points, 3)`` and faces ``(k, n)``.
    around
        Balls around the faces; see :func:`balls`.
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
    centre, _, radius, _ = around
    for f in nb.prange(len(faces)):
        here = candidates[start[f] : start[f + 1]]
        near, ahead = np.empty(len(here), np.int32), np.empty(len(here))
        ball = (centre[f], radius[f] + margin, depth[f])
        count = _nearest_first(*ball, around, here, depth, reach, near, ahead)
        found = (partner[f], local[f], gap[f])
        # Nothing here takes f itself, whose type differs inside the loop: all would be compiled twice.
        _partners_of(x, faces[f], depth[f], faces, around, rule, near[:count], ahead, depth, margin, reach, *found)


@jit
def _partners_of(  # type: ignore[no-untyped-def]
    x, face, behind, faces, around, rule, near, ahead, depth, margin, reach, partner, local, gap
):
    """Find the partners of the points of one face among the faces `near`, from which it is `ahead` at least."""
    centre, flat, radius, rise = around
    n = len(face)
    N, D, position, tangent, normal = np.empty(n), np.empty((n, 2)), np.empty(3), np.empty((2, 3)), np.empty(3)
    point, outward, trial, second = np.empty(3), np.empty(3), np.empty(2), np.empty((n, 3))
    away, rim_place, rim_local = np.empty(3), np.empty(3), np.empty(2)
    partner[:], gap[:] = NOWHERE, np.inf
    for q in range(len(rule) if len(near) > 0 else 0):
        rim_gap, rim_face, sharing = np.inf, NOWHERE, 0
        shape_functions(rule[q, 0], rule[q, 1], N, D)
        surface_frame(x, face, N, D, point, tangent, outward)
        point += margin * outward
        for c, m in enumerate(near):
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
