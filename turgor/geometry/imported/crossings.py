"""Where a surface of triangles passes through itself."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.geometry.imported.triangles import box_tree

Floats = NDArray[np.float64]

MOST = 10_000
"""Pairs after which the search ends: a surface with so many is not to be repaired."""


def crossings(points: Floats, triangles: NDArray[np.integer]) -> tuple[NDArray[np.int64], Floats]:
    """Return the pairs of triangles that cut through each other.

    Two triangles cut if an edge of one passes from one side of the other to its other side within its bounds;
    neighbours that share a corner are tested by the edge opposite to it, those that share an edge are not. Triangles
    that only touch do not cut.

    Parameters
    ----------
    points, triangles
        Corners ``(n, 3)`` and their indices ``(k, 3)``.

    Returns
    -------
    pairs, places
        ``(p, 2)`` numbers of triangles and ``(p, 3)`` a point where they meet; at most `MOST`.
    """
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    corners = np.ascontiguousarray(points[triangles])
    boxes, links, order = box_tree(corners)
    pairs, places = np.empty((MOST, 2), np.int64), np.empty((MOST, 3))
    found = _find(triangles, corners, boxes, links, order, pairs, places)
    return pairs[:found], places[:found]


@nb.njit(cache=True)
def _find(triangles, corners, boxes, links, order, pairs, places):  # type: ignore[no-untyped-def]
    """Fill the pairs and places and return their number."""
    found = 0
    stack = np.empty(128, np.int64)
    low, high = np.empty(3), np.empty(3)
    for t in range(len(triangles)):
        for i in range(3):
            low[i], high[i] = corners[t, :, i].min(), corners[t, :, i].max()
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            box = stack[depth]
            if _apart(low, high, boxes[box]):
                continue
            first, second = links[box]
            if first >= 0:
                stack[depth], stack[depth + 1] = first, second
                depth += 2
                continue
            for s in order[-1 - first : -1 - first + second]:
                if s > t and found < len(pairs) and _cut(triangles, corners, t, s, places[found]):
                    pairs[found] = t, s
                    found += 1
    return found


@nb.njit(cache=True)
def _apart(low, high, box):  # type: ignore[no-untyped-def]
    apart = False
    for i in range(3):
        apart |= low[i] > box[1, i] or high[i] < box[0, i]
    return apart


@nb.njit(cache=True)
def _cut(triangles, corners, t, s, place):  # type: ignore[no-untyped-def]
    return _edges_pass(triangles[t], corners[t], triangles[s], corners[s], place) or _edges_pass(
        triangles[s], corners[s], triangles[t], corners[t], place
    )


@nb.njit(cache=True)
def _edges_pass(own, x, other, y, place):  # type: ignore[no-untyped-def]
    """Say whether an edge of the triangle `x`, none of whose ends is a corner of `y`, passes through `y`."""
    normal = np.cross(y[1] - y[0], y[2] - y[0])
    area = np.sqrt(normal @ normal)
    if area == 0.0:
        return False
    for i in range(3):
        j = (i + 1) % 3
        if (other == own[i]).any() or (other == own[j]).any():
            continue
        start, end = (x[i] - y[0]) @ normal / area, (x[j] - y[0]) @ normal / area
        tolerance = 1e-9 * (abs(start) + abs(end) + np.sqrt(area))
        if not (min(start, end) < -tolerance and max(start, end) > tolerance):
            continue
        point = x[i] + start / (start - end) * (x[j] - x[i])
        if _within(point, y, normal, area):
            place[:] = point
            return True
    return False


@nb.njit(cache=True)
def _within(point, y, normal, area):  # type: ignore[no-untyped-def]
    within = True
    for i in range(3):
        within &= np.cross(y[(i + 1) % 3] - y[i], point - y[i]) @ normal > -1e-9 * area * area
    return within
