"""Faces of a mesh (in two dimensions its edges): which cell one belongs to, and which way it looks."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from turgor.common.errors import InputError
from turgor.common.rows import row_numbers
from turgor.mesh.cells import Ints, body_cell, face_cell


def all_faces(cells: Ints) -> Ints:
    """Return the outward faces of every cell ``(m, n_nodes)``, cell by cell: ``(m · n_faces, nodes_per_face)``."""
    faces = body_cell(cells).faces
    return np.asarray(cells[:, faces].reshape(-1, faces.shape[1]))


def boundary_faces(cells: Ints) -> Ints:
    """Return the outward faces that belong to one cell only, shape ``(k, nodes_per_face)``."""
    faces = all_faces(cells)
    _, first, counts = np.unique(row_numbers(_keys(faces)), return_index=True, return_counts=True)
    boundary: Ints = faces[np.sort(first[counts == 1])]
    return boundary


def crowded_faces(cells: Ints) -> Ints:
    """Return the faces that belong to more than two cells, each once, shape ``(k, nodes_per_face)``."""
    faces = all_faces(cells)
    _, first, counts = np.unique(row_numbers(_keys(faces)), return_index=True, return_counts=True)
    crowded: Ints = faces[np.sort(first[counts > 2])]
    return crowded


def host_cells(cells: Ints, faces: Ints) -> Ints:
    """Return the cell whose outward face each of the `faces` is, shape ``(k,)``; −1 where there is none.

    The face must turn the way the cell's face does; which corner comes first does not matter.
    """
    if faces.size == 0:
        return np.zeros(0, dtype=np.int32)
    # Of the many faces of all cells few have nothing but corners of these.
    marked = np.zeros(max(int(cells.max()), int(faces.max())) + 1, np.bool_)
    marked[faces] = True
    of_cells = all_faces(cells)
    corners = of_cells[:, : face_cell(faces).n_corners].T
    near = np.flatnonzero(np.logical_and.reduce([marked[nodes] for nodes in corners]))
    own, wanted = _rotated(of_cells[near]), _rotated(faces)
    _, inverse = np.unique(row_numbers(np.vstack([own, wanted])), return_inverse=True)
    owner = np.full(inverse.max() + 1, -1, dtype=np.int32)
    owner[inverse[: len(own)]] = near // len(body_cell(cells).faces)
    return owner[inverse[len(own) :]]


def shared_faces(first: Ints, second: Ints) -> Ints:
    """Return which of the faces of the `first` cells are faces of the `second` ones too, ``(k,)``.

    The numbers count the rows of ``all_faces(first)``, whose faces look into the second cells.
    """
    own, other = _keys(all_faces(first)), _keys(all_faces(second))
    numbers = row_numbers(np.vstack([own, other]))
    found: Ints = np.flatnonzero(np.isin(numbers[: len(own)], numbers[len(own) :])).astype(np.int32)
    return found


def outward_faces(cells: Ints, corners: Ints) -> Ints:
    """Return the boundary faces, oriented outward, that have the given corner nodes.

    Parameters
    ----------
    cells
        Shape ``(m, n_nodes)``.
    corners
        Shape ``(k, corners_per_face)``, in any order and orientation.

    Returns
    -------
    ndarray
        Shape ``(k, nodes_per_face)``.

    Raises
    ------
    InputError
        If a face is not on the boundary of the mesh.
    """
    boundary = boundary_faces(cells)
    found = places_of_faces(boundary, corners)
    if (found < 0).any():
        nodes = np.sort(corners.reshape(len(found), -1)[np.argmax(found < 0)]).tolist()
        what = {2: "edge", 3: "triangle", 4: "quadrilateral"}[len(nodes)]
        raise InputError(f"the {what} of nodes {nodes} is not a face on the boundary of the mesh")
    return boundary[found]


def places_of_faces(faces: Ints, corners: Ints) -> Ints:
    """Return which of the `faces` has each set of corner nodes ``(k, corners_per_face)``, in any order; −1 for none."""
    own = _keys(faces)
    wanted = np.sort(corners.reshape(-1, own.shape[1]), axis=1)
    _, inverse = np.unique(row_numbers(np.vstack([own, wanted])), return_inverse=True)
    face_of = np.full(inverse.max(initial=-1) + 1, -1, dtype=np.int32)
    face_of[inverse[: len(faces)]] = np.arange(len(faces))
    found: Ints = face_of[inverse[len(faces) :]]
    return found


def connected_faces(faces: Ints) -> list[Ints]:
    """Group the faces that hang together by their sides: the places of each group's faces, by their first face."""
    sides = face_cell(faces).faces
    ends = np.sort(faces[:, sides].reshape(len(faces) * len(sides), -1)[:, :2], axis=1)
    _, side = np.unique(row_numbers(ends), return_inverse=True)
    face = np.repeat(np.arange(len(faces)), len(sides))
    # A graph of faces and sides together, for the faces that share a side.
    graph = sp.coo_matrix((np.ones(len(face)), (face, len(faces) + side)), shape=[len(faces) + side.max() + 1] * 2)
    _, label = connected_components(graph, directed=False)
    label = label[: len(faces)]
    order = np.argsort(label, kind="stable").astype(np.int32)
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def rim_edges(faces: Ints) -> Ints:
    """Return the sides that only one of the faces has: three-node edges ``(e, 3)``, or the ends of edges ``(e, 1)``."""
    sides = face_cell(faces).faces
    edges = faces[:, sides].reshape(-1, sides.shape[1])
    ends = row_numbers(np.sort(edges[:, :2], axis=1))
    _, first, counts = np.unique(ends, return_index=True, return_counts=True)
    rim: Ints = edges[first[counts == 1]]
    return rim


def _keys(faces: Ints) -> Ints:
    keys: Ints = np.sort(faces[:, : face_cell(faces).n_corners], axis=1)
    return keys


def _rotated(faces: Ints) -> Ints:
    """Turn each face so that its lowest corner comes first, keeping the sense of rotation."""
    n = face_cell(faces).n_corners
    if n == 2:
        return faces
    start = np.argmin(faces[:, :n], axis=1)
    turn = (start[:, None] + np.arange(n)) % n
    rotated: Ints = np.take_along_axis(faces, np.hstack([turn, turn + n]), axis=1)
    return np.hstack([rotated, faces[:, 2 * n :]])
