"""The visible surface of a body, for drawings."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from turgor.mesh.cells import face_cell
from turgor.mesh.faces import boundary_faces, places_of_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import IntArray

CAVITY_PREFIX = "cavity"
"""Surfaces whose name begins so look into a cavity; nobody sees them from outside of a whole body."""

_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
"""The four flat triangles between the corners and the middles of a six-node triangle."""

_SHARP_COSINE = float(np.cos(np.radians(40.0)))
"""Faces whose normals differ by more than 40° meet at an edge that stays sharp."""

_CORNERS = np.array([[0, 1, 2]])

_HALVES = np.array([[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]])
"""The two six-node triangles of a nine-node quadrilateral, its centre in the middle of their common side."""


def outside_faces(mesh: Mesh) -> IntArray:
    """Return the boundary faces that can be seen, shape ``(k, nodes_per_face)``.

    Those of a whole body that look into a cavity cannot; if a plane of symmetry cuts it, they can. A body whose every
    face belongs to a cavity is returned whole.
    """
    faces = boundary_faces(mesh.cells)
    hidden = [corners for name, corners in mesh.surfaces.items() if name.startswith(CAVITY_PREFIX)]
    if not hidden or mesh.symmetry_planes:
        return faces
    visible = places_of_faces(np.concatenate(hidden), faces[:, : face_cell(faces).n_corners]) < 0
    return faces[visible] if visible.any() else faces


def six_node_triangles(faces: IntArray) -> IntArray:
    """Return faces as six-node triangles ``(j, 6)``: themselves, or two for each nine-node quadrilateral."""
    return faces if faces.shape[1] == 6 else np.asarray(faces[:, _HALVES].reshape(-1, 6))


def flat_triangles(faces: IntArray, *, quartered: bool) -> IntArray:
    """Return three-node triangles of six-node `faces`: four each, or only the one of the corners, shape ``(j, 3)``."""
    return faces[:, _QUARTERS if quartered else _CORNERS].reshape(-1, 3)


def compact(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the nodes that `triangles` use, each once, and the triangles in terms of these."""
    nodes, inverse = np.unique(triangles, return_inverse=True)
    return nodes, np.asarray(inverse.reshape(triangles.shape), dtype=np.int32)


def smooth_patches(points: npt.NDArray[np.float64], faces: IntArray) -> npt.NDArray[np.int32]:
    """Return for each face the number of the patch it belongs to; patches meet at sharp edges only, shape ``(k,)``.

    Drawn with nodes of its own for every patch, a body keeps its edges under smooth shading.

    Parameters
    ----------
    points
        Nodes at rest, shape ``(n, 3)``.
    faces
        Six-node triangles, shape ``(k, 6)``.
    """
    corners = points[faces[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # The middle node names the edge: the two faces of an edge are neighbours in the sorted list of middle nodes.
    middles = faces[:, 3:].ravel()
    owners = np.repeat(np.arange(len(faces)), 3)[np.argsort(middles, kind="stable")]
    middles = np.sort(middles)
    paired = np.flatnonzero(middles[1:] == middles[:-1])
    first, second = owners[paired], owners[paired + 1]
    smooth = np.einsum("ij,ij->i", normals[first], normals[second]) > _SHARP_COSINE
    links = coo_array((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(links, directed=False)[1])
