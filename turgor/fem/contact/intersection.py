"""Whether surfaces intersect: an independent check of states by the IPC Toolkit, where it is installed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.common.optional import is_available, require
from turgor.fem.contact.skin import Skin
from turgor.fem.contact.term import LARGEST_OVERLAP

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

PARTS = 4
"""Every side of a curved face is cut into so many straight pieces."""

FLAT = 1e-2
"""Squares of sines below this are none: around a corner on a smooth surface all pieces look the same way."""


class IntersectionCheck:
    """Looks whether the faces of a skin, cut into flat pieces and drawn into the body, intersect.

    Each face is drawn in by half of the overlap that is allowed, 1 % of the wall behind it: where two of them still
    intersect, more than that overlaps. Nothing of the search for contact has a part in it.

    Parameters
    ----------
    skin
        The faces.
    """

    def __init__(self, skin: Skin) -> None:
        self.skin = skin
        local, pieces, keys = _lattice(skin.faces, skin.dimension)
        _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        self._face, self._point = np.divmod(first, len(local))
        self._shape = skin.shape_at(local)
        self._pieces = number.reshape(len(skin.faces), -1)[:, pieces].reshape(-1, pieces.shape[1])
        depth = np.full(len(first), np.inf)
        np.minimum.at(depth, number, np.repeat(0.5 * LARGEST_OVERLAP * skin.wall, len(local)))
        self._depth = depth

    @staticmethod
    def is_possible() -> bool:
        """Whether the IPC Toolkit is installed."""
        return is_available("ipctk")

    def intersects(self, u: Floats) -> bool:
        """Say whether more overlaps than is allowed at the displacement `u` ``(n_points, d)``.

        Raises
        ------
        MissingPackageError
            If the IPC Toolkit is not installed.
        """
        ipctk = require("ipctk")
        skin, d = self.skin, self.skin.dimension
        nodes = skin.space(u)[skin.faces[self._face]]
        x = np.einsum("na,nai->ni", self._shape[self._point], nodes)
        x += self._depth[:, None] * self._inward(x)
        x = np.asfortranarray(x[:, :d])
        edges = self._pieces if d == 2 else ipctk.edges(self._pieces)
        pieces = np.empty((0, 3), np.int32) if d == 2 else self._pieces
        return bool(ipctk.has_intersections(ipctk.CollisionMesh(x, edges, pieces), x))

    def _inward(self, x: Floats) -> Floats:
        """Return the ways ``(n, 3)`` that draw in the pieces around each corner of them by one: longer at edges."""
        at = x[self._pieces]
        across = np.array([[0.0, 0.0, 1.0]]) if at.shape[1] == 2 else at[:, 2] - at[:, 0]
        outward = np.cross(at[:, 1] - at[:, 0], across)
        outward /= np.maximum(np.linalg.norm(outward, axis=1), np.finfo(float).tiny)[:, None]
        # the least squares solution of n · v = −1 for the pieces around a corner
        total, square = np.zeros_like(x), np.tile(FLAT * np.eye(3), (len(x), 1, 1))
        products = np.einsum("mi,mj->mij", outward, outward)
        for corner in self._pieces.T:
            np.add.at(total, corner, outward)
            np.add.at(square, corner, products)
        return np.asarray(-np.linalg.solve(square, total[:, :, None])[:, :, 0])


def _lattice(faces: Ints, dimension: int) -> tuple[Floats, Ints, NDArray[np.int64]]:
    """Return the points ``(p, 2)`` that a face is cut at, its pieces ``(m, d)`` and what tells the points apart.

    The last, ``(k p, 4)``, is the same for points that faces share: on a side its two corners and how far along, at a
    corner the corner, inside the face itself.
    """
    n = PARTS
    steps = [(i, j) for j in range(n + 1 if dimension == 3 else 1) for i in range(n + 1 - j)]
    at = {step: number for number, step in enumerate(steps)}
    pieces: list[tuple[int, ...]]
    if dimension == 2:
        pieces = [(i, i + 1) for i in range(n)]
    else:
        pieces = [(at[i, j], at[i + 1, j], at[i, j + 1]) for i, j in steps if i + j < n]
        pieces += [(at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]) for i, j in steps if i + j < n - 1]
    keys = np.empty((len(faces), len(steps), 4), np.int64)
    for number, (i, j) in enumerate(steps):
        # how much of each corner is in the point, in n-ths
        parts = np.array([n - i - j, i, j][:dimension])
        used = np.flatnonzero(parts)
        if len(used) == 3 or (dimension == 2 and len(used) == 2):
            keys[:, number] = np.column_stack([np.arange(len(faces)), *(np.full(len(faces), v) for v in (-1, i, j))])
            continue
        corners, shares = faces[:, used], np.broadcast_to(parts[used], (len(faces), len(used)))
        order = np.argsort(corners, axis=1)
        corners, shares = np.take_along_axis(corners, order, 1), np.take_along_axis(shares, order, 1)
        keys[:, number] = np.column_stack([corners[:, 0], corners[:, -1], shares[:, 0], shares[:, -1]])
    return np.array(steps) / n, np.array(pieces, np.int32), keys.reshape(-1, 4)
