"""Bodies of flat triangles, as STL files hold them: signed distance by a tree of boxes."""

from __future__ import annotations

from pathlib import Path

import meshio
import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.optional import require

Floats = NDArray[np.float64]

LEAF = 4
"""Triangles in a box that is not divided further."""

# What of a triangle is nearest: the face, the edges 01 12 20, the corners 0 1 2.
FACE, EDGE, CORNER = 0, 1, 4


class TriangleBody:
    """A closed body bounded by triangles whose corners turn anticlockwise seen from outside.

    The sign of the distance comes from the normal of what is nearest: face, edge (mean of two faces) or corner (mean
    weighted by angle), which tells inside from outside everywhere (Bærentzen and Aanæs 2005).

    Parameters
    ----------
    points, triangles
        Corners ``(n, 3)``, mm, and their indices ``(k, 3)``.

    Raises
    ------
    InputError
        If the surface is not closed or encloses no volume.
    """

    def __init__(self, points: Floats, triangles: NDArray[np.integer]) -> None:
        corners, same = np.unique(np.asarray(points, float), axis=0, return_inverse=True)
        faces = np.asarray(same.ravel()[np.asarray(triangles)], np.intp)
        ends = [faces[:, [i, (i + 1) % 3]] for i in range(3)]
        area_normal = np.cross(*(corners[faces[:, i]] - corners[faces[:, 0]] for i in (1, 2)))
        size = np.linalg.norm(area_normal, axis=1)
        if not size.all():
            raise InputError("a triangle has no area", key="triangles", value=int(np.argmin(size)))
        opposite = _opposite(np.concatenate(ends), len(corners))
        volume = float(np.einsum("ki,ki->", area_normal, corners[faces[:, 0]])) / 6.0
        if volume <= 0.0:
            raise InputError("the triangles are inside out", key="triangles", value=f"{volume:.4g} mm³ enclosed")
        self._corners = corners[faces]
        self._normals = _normals(faces, self._corners, area_normal / size[:, None], opposite, len(corners))
        self._tree = box_tree(self._corners)
        self._middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._depth = 2.0 * volume / float(size.sum())

    @classmethod
    def from_stl(cls, path: str | Path) -> TriangleBody:
        """Return the body of an STL file in mm; raise InputError if it cannot be read or is not closed."""
        try:
            mesh = meshio.read(path, file_format="stl")
        except (OSError, meshio.ReadError, ValueError) as error:
            raise InputError("the file cannot be read as STL", file=path) from error
        try:
            return cls(mesh.points, mesh.cells_dict.get("triangle", np.empty((0, 3), int)))
        except InputError as error:
            raise InputError(str(error), file=path, expected="a closed surface, normals outward") from error

    @property
    def reference_point(self) -> Floats:
        """The middle of the box around the body."""
        return np.asarray(self._middle)

    @property
    def depth(self) -> float:
        """Volume over surface: of a plate half of its thickness, of a ball a third of its radius."""
        return self._depth

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the signed distance ``(n,)``, mm, negative inside, its gradient and its second derivative."""
        triangle, feature, nearest = np.empty(len(x), np.int64), np.empty(len(x), np.int64), np.empty_like(x)
        _find_nearest(np.ascontiguousarray(x), self._corners, *self._tree, triangle, feature, nearest)
        outward = self._normals[triangle, feature]
        away = x - nearest
        size = np.linalg.norm(away, axis=1)
        side = np.where(np.einsum("ni,ni->n", away, outward) < 0.0, -1.0, 1.0)
        on_it = size < 1e-12
        normal = np.where(on_it[:, None], outward, side[:, None] * away / np.where(on_it, 1.0, size)[:, None])
        face = self._normals[triangle, FACE]
        # On a face, rounding of a tiny distance must not turn the normal.
        normal = np.where((feature == FACE)[:, None], face, normal)
        bent = np.eye(3) - np.einsum("ni,nj->nij", normal, normal)
        along = self._along(triangle, feature)
        bent -= np.einsum("ni,nj->nij", along, along)
        flat = (feature == FACE) | on_it
        curvature = np.where(flat[:, None, None], 0.0, bent / (side * np.where(flat, 1.0, size))[:, None, None])
        return side * size, normal, curvature

    def _along(self, triangle: NDArray[np.int64], feature: NDArray[np.int64]) -> Floats:
        """Return unit vectors along the edges that are nearest, zeros where none is, ``(n, 3)``."""
        first = np.clip(feature - EDGE, 0, 2)
        span = self._corners[triangle, (first + 1) % 3] - self._corners[triangle, first]
        unit = span / np.linalg.norm(span, axis=1)[:, None]
        return np.where(((feature >= EDGE) & (feature < CORNER))[:, None], unit, 0.0)


def agreeing(points: Floats, triangles: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the triangles ``(k, 3)``, in their order, turned so that neighbours look to the same side.

    Raises
    ------
    MissingPackageError
        If pyvista is absent.
    """
    surface = require("pyvista", "repairing a surface").PolyData.from_regular_faces(points, triangles)
    turned = surface.compute_normals(
        cell_normals=True, point_normals=False, consistent_normals=True, split_vertices=False, auto_orient_normals=False
    )
    return np.asarray(turned.regular_faces, dtype=np.int64)


def _opposite(ends: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """Return for each directed edge ``(3 k, 2)`` the number of the one that runs the other way."""
    key, reverse = ends[:, 0] * n + ends[:, 1], ends[:, 1] * n + ends[:, 0]
    order = np.argsort(key)
    at = np.minimum(np.searchsorted(key[order], reverse), max(len(key) - 1, 0))
    closed = len(key) > 0 and len(np.unique(key)) == len(key) and bool((key[order[at]] == reverse).all())
    if not closed:
        raise InputError("the triangles do not close a body", key="triangles", expected="each edge in two triangles")
    return np.asarray(order[at])


def _normals(triangles: NDArray[np.intp], corners: Floats, unit: Floats, opposite: NDArray[np.intp], n: int) -> Floats:
    """Return the normals of face, edges and corners of each triangle, ``(k, 7, 3)``."""
    k = len(triangles)
    normals = np.empty((k, 7, 3))
    normals[:, FACE] = unit
    at_corner = np.zeros((n, 3))
    for i in range(3):
        normals[:, EDGE + i] = unit + unit[opposite[i * k : (i + 1) * k] % k]
        one, two = (corners[:, (i + j) % 3] - corners[:, i] for j in (1, 2))
        sine, cosine = np.linalg.norm(np.cross(one, two), axis=1), np.einsum("ki,ki->k", one, two)
        np.add.at(at_corner, triangles[:, i], np.arctan2(sine, cosine)[:, None] * unit)
    normals[:, CORNER:] = at_corner[triangles]
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300))


def box_tree(corners: Floats) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Return boxes ``(b, 2, 3)``, their links ``(b, 2)`` and the order of the triangles ``(k,)``.

    The links are the two boxes inside, or, of a box that holds triangles itself, minus one less its first place
    in the order, and their number.
    """
    low, high, middle = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
    order = np.arange(len(corners))
    boxes: list[list[Floats]] = []
    links: list[list[int]] = []
    waiting = [(0, len(corners), -1, 0)]
    while waiting:
        begin, end, parent, side = waiting.pop()
        here = order[begin:end]
        if parent >= 0:
            links[parent][side] = len(boxes)
        boxes.append([low[here].min(axis=0), high[here].max(axis=0)])
        if end - begin <= LEAF:
            links.append([-1 - begin, end - begin])
            continue
        half = (end - begin) // 2
        axis = int(np.argmax(np.ptp(middle[here], axis=0)))
        order[begin:end] = here[np.argpartition(middle[here, axis], half)]
        waiting += [(begin, begin + half, len(links), 0), (begin + half, end, len(links), 1)]
        links.append([0, 0])
    return np.array(boxes), np.array(links), order


@nb.njit(cache=True)
def _box_distance(point, box):  # type: ignore[no-untyped-def]
    square = 0.0
    for i in range(3):
        out = max(box[0, i] - point[i], 0.0, point[i] - box[1, i])
        square += out * out
    return square


@nb.njit(cache=True)
def _closest_on_triangle(point, a, b, c):  # type: ignore[no-untyped-def]
    """Return the closest point and what of the triangle it lies on (Ericson 2005, sec. 5.1.5)."""
    ab, ac, ap = b - a, c - a, point - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a, CORNER
    bp = point - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b, CORNER + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return a + d1 / (d1 - d3) * ab, EDGE
    cp = point - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c, CORNER + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return a + d2 / (d2 - d6) * ac, EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b), EDGE + 1
    scale = 1.0 / (va + vb + vc)
    return a + vb * scale * ab + vc * scale * ac, FACE


@nb.njit(cache=True, parallel=True)
def _find_nearest(x, corners, boxes, links, order, triangle, feature, nearest):  # type: ignore[no-untyped-def]
    """Fill the nearest triangle ``(n,)``, what of it is nearest ``(n,)`` and the nearest point ``(n, 3)``."""
    for p in nb.prange(len(x)):
        best = np.inf
        stack = np.empty(128, np.int64)
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            box = stack[depth]
            if _box_distance(x[p], boxes[box]) >= best:
                continue
            first, second = links[box]
            if first < 0:
                for t in order[-1 - first : -1 - first + second]:
                    point, kind = _closest_on_triangle(x[p], corners[t, 0], corners[t, 1], corners[t, 2])
                    square = np.sum((x[p] - point) ** 2)
                    if square < best:
                        best = square
                        triangle[p], feature[p], nearest[p] = t, kind, point
                continue
            if _box_distance(x[p], boxes[first]) < _box_distance(x[p], boxes[second]):
                first, second = second, first
            stack[depth], stack[depth + 1] = first, second
            depth += 2
