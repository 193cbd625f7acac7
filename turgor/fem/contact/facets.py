"""A surface of flat pieces that follows the curved faces of a skin: what programs for flat meshes are given."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.contact.skin import Skin
from turgor.mesh.cells import Cell

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

PARTS = 4
"""Every side of a curved face is cut into so many straight pieces."""


class Facets:
    """The faces of a skin, cut into triangles (in a plane model: straight edges) whose vertices move with the nodes.

    Faces that share a side share the vertices on it, so that the pieces form a surface as closed as the faces do.

    Parameters
    ----------
    skin
        The faces.

    Attributes
    ----------
    pieces
        Vertices of each piece, ``(m, d)``, outward like the faces.
    face
        A face that each vertex lies on, ``(n,)``.
    number
        The vertices that lie on each face, ``(k, v)``.
    weights
        What each node counts in the place of each vertex, sparse ``(n, n_points)``: constant.
    around
        Which vertices lie on which face, sparse ``(k, n)`` of ones.
    """

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        local, pieces, keys = _lattice(skin.faces, skin.cell)
        _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        self.number = number.reshape(len(skin.faces), -1)
        self.pieces = np.ascontiguousarray(self.number[:, pieces].reshape(-1, pieces.shape[1]), dtype=np.int32)
        self.face, point = np.divmod(first, len(local))
        shape, nodes = skin.shape_at(local)[point], skin.faces[self.face]
        at = np.repeat(np.arange(len(first)), shape.shape[1])
        size = (len(first), len(skin.points))
        self.weights = sp.csr_matrix((shape.ravel(), (at, nodes.ravel())), shape=size)
        self.weights.eliminate_zeros()
        faces = np.repeat(np.arange(len(skin.faces)), len(local))
        ones = np.ones(number.size, np.float32)
        self.around = sp.csr_matrix((ones, (faces, number.ravel())), shape=(len(skin.faces), len(first)))

    def places(self, u: Floats) -> Floats:
        """Return where the vertices are at the displacement `u` ``(n_points, d)``: ``(n, d)``, mm."""
        return np.asarray(self.weights @ (self.skin.space(u)[:, : self.skin.dimension]))

    def normals(self, places: Floats) -> Floats:
        """Return the outward unit normals ``(m, 3)`` of the pieces, their vertices at `places` ``(n, 3)``."""
        at = places[self.pieces]
        across = np.array([[0.0, 0.0, 1.0]]) if at.shape[1] == 2 else at[:, 2] - at[:, 0]
        outward = np.cross(at[:, 1] - at[:, 0], across)
        return np.asarray(outward / np.maximum(np.linalg.norm(outward, axis=1), np.finfo(float).tiny)[:, None])


def _lattice(faces: Ints, cell: Cell) -> tuple[Floats, Ints, NDArray[np.int64]]:
    """Return the points ``(p, 2)`` that a face is cut at, its pieces ``(m, d)`` and what tells the points apart.

    The last, ``(k p, 4)``, is the same for points that faces share: on a side its two corners and how far along, at a
    corner the corner, inside the face itself.
    """
    steps = _steps(cell)
    keys = np.empty((len(faces), len(steps), 4), np.int64)
    for number, (i, j) in enumerate(steps):
        parts = _corner_parts(cell, i, j)
        used = np.flatnonzero(parts)
        if len(used) > cell.dimension:
            keys[:, number] = np.column_stack([np.arange(len(faces)), *(np.full(len(faces), v) for v in (-1, i, j))])
            continue
        corners, shares = faces[:, used], np.broadcast_to(parts[used], (len(faces), len(used)))
        order = np.argsort(corners, axis=1)
        corners, shares = np.take_along_axis(corners, order, 1), np.take_along_axis(shares, order, 1)
        keys[:, number] = np.column_stack([corners[:, 0], corners[:, -1], shares[:, 0], shares[:, -1]])
    return np.array(steps) / PARTS, np.array(_pieces(cell, steps), np.int32), keys.reshape(-1, 4)


def _steps(cell: Cell) -> list[tuple[int, int]]:
    """Return the points that a face is cut at, in steps along its coordinates."""
    n = PARTS
    if cell.dimension == 1:
        return [(i, 0) for i in range(n + 1)]
    return [(i, j) for j in range(n + 1) for i in range(n + 1 - (j if cell.simplex else 0))]


def _corner_parts(cell: Cell, i: int, j: int) -> Ints:
    """Return how much of each corner is in a point of a flat face: in n-ths, in a quadrilateral in parts of n²."""
    n = PARTS
    if cell.simplex:
        return np.array([n - i - j, i, j][: cell.n_corners], np.int32)
    return np.array([(n - i) * (n - j), i * (n - j), i * j, (n - i) * j], np.int32)


def _pieces(cell: Cell, steps: list[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Return the pieces, in places among the `steps`, as the face turns."""
    at = {step: number for number, step in enumerate(steps)}
    if cell.dimension == 1:
        return [(at[i, 0], at[i + 1, 0]) for i in range(PARTS)]
    pieces: list[tuple[int, ...]] = []
    for i, j in steps:
        square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        if not cell.simplex and (i + j) % 2:
            # cut along the other diagonal: a quadrilateral looks the same from all its sides
            square = square[1:] + square[:1]
        halves = square[:2] + square[3:], square[1:]
        pieces += [tuple(at[step] for step in half) for half in halves if set(half) <= set(at)]
    return pieces
