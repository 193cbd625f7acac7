"""Faces of a tetrahedral mesh: which cell a triangle belongs to, and which way it looks."""

from __future__ import annotations

import numpy as np

from turgor.common.errors import InputError
from turgor.mesh.tet10 import FACES, IntArray


def all_faces(cells: IntArray) -> IntArray:
    """Return the four outward six-node faces of every cell, shape ``(4 m, 6)``, cell by cell."""
    faces: IntArray = cells[:, FACES].reshape(-1, 6)
    return faces


def boundary_faces(cells: IntArray) -> IntArray:
    """Return the outward six-node faces that belong to one cell only, shape ``(k, 6)``."""
    faces = all_faces(cells)
    _, first, counts = np.unique(_keys(faces), axis=0, return_index=True, return_counts=True)
    boundary: IntArray = faces[np.sort(first[counts == 1])]
    return boundary


def host_cells(cells: IntArray, triangles: IntArray) -> IntArray:
    """Return the cell whose outward face each six-node triangle is, shape ``(k,)``; −1 where there is none.

    The triangle must turn the way the cell's face does; which corner comes first does not matter.
    """
    if triangles.size == 0:
        return np.zeros(0, dtype=np.int32)
    faces, wanted = _rotated(all_faces(cells)), _rotated(triangles)
    _, inverse = np.unique(np.vstack([faces, wanted]), axis=0, return_inverse=True)
    owner = np.full(inverse.max() + 1, -1, dtype=np.int32)
    owner[inverse[: len(faces)]] = np.arange(len(faces)) // 4
    return owner[inverse[len(faces) :]]


def outward_faces(cells: IntArray, corners: IntArray) -> IntArray:
    """Return the boundary faces, oriented outward, that have the given corner nodes.

    Parameters
    ----------
    cells
        Shape ``(m, 10)``.
    corners
        Shape ``(k, 3)``, in any order and orientation.

    Returns
    -------
    ndarray
        Shape ``(k, 6)``.

    Raises
    ------
    InputError
        If a triangle is not on the boundary of the mesh.
    """
    boundary = boundary_faces(cells)
    wanted = np.sort(corners.reshape(-1, 3), axis=1)
    _, inverse = np.unique(np.vstack([_keys(boundary), wanted]), axis=0, return_inverse=True)
    face_of = np.full(inverse.max(initial=-1) + 1, -1, dtype=np.int64)
    face_of[inverse[: len(boundary)]] = np.arange(len(boundary))
    found = face_of[inverse[len(boundary) :]]
    if (found < 0).any():
        nodes = wanted[np.argmax(found < 0)].tolist()
        raise InputError(f"the triangle of nodes {nodes} is not a face on the boundary of the mesh")
    return boundary[found]


def rim_edges(triangles: IntArray) -> IntArray:
    """Return the three-node edges (two ends, middle) that only one of the triangles has, shape ``(e, 3)``."""
    edges = triangles[:, [[0, 1, 3], [1, 2, 4], [2, 0, 5]]].reshape(-1, 3)
    _, first, counts = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_index=True, return_counts=True)
    rim: IntArray = edges[first[counts == 1]]
    return rim


def _keys(faces: IntArray) -> IntArray:
    keys: IntArray = np.sort(faces[:, :3], axis=1)
    return keys


def _rotated(faces: IntArray) -> IntArray:
    """Turn each triangle so that its lowest corner comes first, keeping the sense of rotation."""
    start = np.argmin(faces[:, :3], axis=1)
    turn = (start[:, None] + np.arange(3)) % 3
    rotated: IntArray = np.take_along_axis(faces, np.hstack([turn, turn + 3]), axis=1)
    return rotated
