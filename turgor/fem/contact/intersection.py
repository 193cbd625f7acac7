"""Whether surfaces intersect: an independent check of states by the IPC Toolkit, where it is installed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.common.optional import is_available, require
from turgor.fem.contact.facets import Facets
from turgor.fem.contact.recent import Recent
from turgor.fem.contact.skin import Skin
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.mesh.mesh import in_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

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
        self.facets = facets = Facets(skin)
        depth = np.full(len(facets.face), np.inf)
        allowed = np.repeat(0.5 * LARGEST_OVERLAP * skin.wall, facets.number.shape[1])
        np.minimum.at(depth, facets.number.ravel(), allowed)
        self._depth = depth
        # It is asked when a state is accepted, and once more when that is stored.
        self._recent = Recent(self._look)

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
        return self._recent(u)

    def _look(self, u: Floats) -> bool:
        x = in_space(self.facets.places(u))
        x += self._depth[:, None] * self._inward(x)
        x = np.asfortranarray(x[:, : self.skin.dimension])
        ipctk = require("ipctk")
        return bool(ipctk.has_intersections(ipctk.CollisionMesh(x, *edges_and_triangles(self.facets.pieces)), x))

    def _inward(self, x: Floats) -> Floats:
        """Return the ways ``(n, 3)`` that draw in the pieces around each corner of them by one: longer at edges."""
        outward = self.facets.normals(x)
        # the least squares solution of n · v = −1 for the pieces around a corner
        total, square = np.zeros_like(x), np.tile(FLAT * np.eye(3), (len(x), 1, 1))
        products = np.einsum("mi,mj->mij", outward, outward)
        for corner in self.facets.pieces.T:
            np.add.at(total, corner, outward)
            np.add.at(square, corner, products)
        return np.asarray(-np.linalg.solve(square, total[:, :, None])[:, :, 0])


def edges_and_triangles(pieces: Ints) -> tuple[Ints, Ints]:
    """Return what the IPC Toolkit makes a mesh of: the edges ``(e, 2)`` and triangles ``(m, 3)`` of some pieces."""
    if pieces.shape[1] == 2:
        return np.asfortranarray(pieces), np.empty((0, 3), np.int32)
    return require("ipctk").edges(pieces), np.asfortranarray(pieces)
