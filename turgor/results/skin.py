"""The visible surface of a body, for drawings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import IntArray

CAVITY_PREFIX = "cavity"
"""Surfaces whose name begins so look into a cavity; nobody sees them from outside."""

_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
"""The four flat triangles between the corners and the middles of a six-node triangle."""

_CORNERS = np.array([[0, 1, 2]])


def outside_faces(mesh: Mesh) -> IntArray:
    """Return the six-node boundary faces that do not look into a cavity, shape ``(k, 6)``.

    A body whose every face belongs to a cavity is returned whole.
    """
    faces = boundary_faces(mesh.cells)
    hidden = [corners for name, corners in mesh.surfaces.items() if name.startswith(CAVITY_PREFIX)]
    if not hidden:
        return faces
    inside = np.unique(_keys(np.concatenate(hidden), mesh.n_points))
    visible = ~np.isin(_keys(faces, mesh.n_points), inside)
    return faces[visible] if visible.any() else faces


def flat_triangles(faces: IntArray, *, quartered: bool) -> IntArray:
    """Return three-node triangles of six-node `faces`: four each, or only the one of the corners, shape ``(j, 3)``."""
    return faces[:, _QUARTERS if quartered else _CORNERS].reshape(-1, 3)


def compact(triangles: IntArray) -> tuple[npt.NDArray[np.intp], IntArray]:
    """Return the nodes that `triangles` use, each once, and the triangles in terms of these."""
    nodes, inverse = np.unique(triangles, return_inverse=True)
    return nodes, inverse.reshape(triangles.shape).astype(np.int32)


def _keys(faces: IntArray, n_points: int) -> npt.NDArray[np.int64]:
    """One number for each triangle, the same whatever the order of its corners."""
    corners = np.sort(faces[:, :3].astype(np.int64), axis=1)
    keys: npt.NDArray[np.int64] = (corners[:, 0] * n_points + corners[:, 1]) * n_points + corners[:, 2]
    return keys
