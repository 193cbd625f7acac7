"""Lines that move with a body: which nodes carry their stations, and with what shares.

A station is a weighted mean of material points, so its place is linear in the displacement, and the shares of the nodes
follow from the mesh at rest.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from turgor.common.errors import InputError
from turgor.fem.locate import locate
from turgor.mesh.cells import Cell
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.results.sections import CENTRELINE
from turgor.results.skin import six_node_triangles
from turgor.results.symmetry import MOUNT, TIP_FACE, surface_middle, symmetry_of

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

INSIDE = 1e-6
"""The first and the last cross-section lie so far from the end faces, in parts of the body's length."""

_SIMPLICES = {
    "tri6": [[0, 1, 2]],
    "quad9": [[0, 1, 2], [0, 2, 3]],
    "tet10": [[0, 1, 2, 3]],
    "hex27": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
}
"""The corners of the triangles or tetrahedra that a cell is cut into."""

_CUTS = {
    (2, 1): [[(2, 0), (2, 1)]],
    (2, 2): [[(0, 1), (0, 2)]],
    (3, 1): [[(3, 0), (3, 1), (3, 2)]],
    (3, 2): [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    (3, 3): [[(0, 1), (0, 2), (0, 3)]],
}
"""Dimension and number of corners above the cutting plane → pieces of the section: the edge that each of their corners
lies on, between two corners of the simplex in ascending order of height."""

_SIMPSON = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]]), np.array([1.0, 4.0, 1.0]) / 6.0
_MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]]), np.full(3, 1.0 / 3.0)


def axis_stations(mesh: Mesh, count: int) -> tuple[FloatArray, FloatArray]:
    """Return places ``(count, d)`` at equal distances from the mount's middle to the tip face's, and the axis.

    A plane across the axis that met an end face would cut off a part of the section. So the first lies where it clears
    the whole mount, the last where it clears the whole tip face, however these are tilted.

    Raises
    ------
    InputError
        If there is no room between the two.
    """
    start, end = (surface_middle(mesh, name) for name in (MOUNT, TIP_FACE))
    length = float(np.linalg.norm(end - start))
    axis = (end - start) / length
    mount, tip = ((mesh.points[mesh.surface_nodes(name)] - start) @ axis for name in (MOUNT, TIP_FACE))
    first, last = mount.max() + INSIDE * length, tip.min() - INSIDE * length
    if first >= last:
        raise InputError("no plane across the axis clears both end faces", key="by", expected="marker")
    return start + np.linspace(first, last, count)[:, None] * axis, axis


def at_points(mesh: Mesh, places: FloatArray) -> sp.csr_matrix:
    """Return the shares ``(k, n)`` of the nodes in material points at `places` ``(k, d)`` at rest.

    Raises
    ------
    InputError
        If a place lies outside the body.
    """
    try:
        cell, local = locate(mesh.points, mesh.cells, places, "at")
    except InputError as error:
        problem = error.problem.replace("the curve leaves the body", "the point lies outside the body")
        raise InputError(problem, key="at", expected="a place inside the body or on its surface") from error
    return _shares(mesh.cells[cell], mesh.cell.shape(local), np.arange(len(places)), len(places), mesh.n_points)


def section_centroids(mesh: Mesh, count: int) -> sp.csr_matrix:
    """Return the shares ``(count, n)`` of the nodes in the centroids of cross-sections at equal distances.

    A cross-section is the material that lay, at rest, in a plane across the line from the mount to the tip face; its
    centroid is the mean over its area at rest. Of half a body it is that of the half.

    Raises
    ------
    InputError
        If a plane meets no material.
    """
    stations, axis = axis_stations(mesh, count)
    heights = mesh.points @ axis
    simplices = np.array(_SIMPLICES[mesh.cell_type])
    shares = [_cut(mesh, heights - float(station @ axis), simplices) for station in stations]
    empty = [number for number, row in enumerate(shares) if row is None]
    if empty:
        where = ", ".join(f"{x:.4g}" for x in stations[empty[0]])
        raise InputError(f"the plane through ({where}) mm across the axis meets no material", key="by")
    return sp.vstack(shares).tocsr()


def along_marker(mesh: Mesh, count: int) -> sp.csr_matrix:
    """Return the shares ``(count, n)`` of the nodes in points at equal distances along the marker ``centreline``.

    Raises
    ------
    InputError
        If the mesh has no such marker, or it is a single node.
    """
    line = mesh.points[mesh.marker(CENTRELINE)]
    if len(line) < 2:
        raise InputError("the marker 'centreline' is a single node", key="by", expected="sections or opposite")
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    wanted = np.linspace(0.0, lengths[-1], count)
    places = np.column_stack([np.interp(wanted, lengths, coordinate) for coordinate in line.T])
    return at_points(mesh, places)


def between_opposite(mesh: Mesh, count: int, across: FloatArray) -> sp.csr_matrix:
    """Return the shares ``(count, n)`` of the nodes in the means of two opposite points of the outside.

    The two points of a station are where the line through it along `across` leaves the body, or an image of it, on
    either side.

    Raises
    ------
    InputError
        If `across` runs along the axis, or such a line meets the outside fewer than two times.
    """
    stations, axis = axis_stations(mesh, count)
    direction = across[: mesh.dimension] - (across[: mesh.dimension] @ axis) * axis
    length = float(np.linalg.norm(direction))
    if length < 1e-6 * np.linalg.norm(across):
        raise InputError("this direction runs along the axis", key="across", expected="a direction across the axis")
    faces = boundary_faces(mesh.cells)
    flat = six_node_triangles(faces) if mesh.dimension == 3 else faces
    pieces = flat[:, _FLAT[flat.shape[1]]].reshape(-1, mesh.dimension)
    ends = [_ends_across(mesh, pieces, station, direction / length) for station in stations]
    shares = at_points(mesh, np.concatenate(ends))
    return 0.5 * (shares[::2] + shares[1::2])


_FLAT = {6: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]), 3: np.array([[0, 2], [2, 1]])}
"""The flat pieces of a curved face between its nodes."""


def _ends_across(mesh: Mesh, pieces: IntArray, station: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the two outermost places ``(2, d)`` where a line meets flat pieces or their images.

    Where it meets images of the pieces, its own images meet the pieces: these places in the body are returned.
    """
    whole = symmetry_of(mesh)
    starts, directions = whole.places(station[None]), whole.vectors(direction[None])
    found = [_hits(mesh, pieces, *line) for line in zip(starts, directions, strict=True)]
    image, distance = np.repeat(np.arange(len(found)), [len(hits) for hits in found]), np.concatenate(found)
    if not len(distance) or np.ptp(distance) < 1e-6 * np.ptp(mesh.points, axis=0).max():
        where = ", ".join(f"{x:.4g}" for x in station)
        raise InputError(f"the line across the body through ({where}) mm leaves it on one side only", key="across")
    ends = [np.argmin(distance), np.argmax(distance)]
    return np.asarray(starts[image[ends]] + distance[ends, None] * directions[image[ends]])


def _hits(mesh: Mesh, pieces: IntArray, start: FloatArray, direction: FloatArray) -> FloatArray:
    """Return at which distances ``(k,)`` from `start` along `direction` a line meets flat pieces."""
    d = mesh.dimension
    # Shares λ of a piece's corners and the distance t along the line: Σ λ_i X_i − t a = start, Σ λ_i = 1.
    system = np.ones((len(pieces), d + 1, d + 1))
    system[:, :d, :d] = mesh.points[pieces].swapaxes(1, 2)
    system[:, :d, d] = -direction
    system[:, d, d] = 0.0
    size = np.ptp(mesh.points[pieces], axis=1).max(axis=1)
    steep = np.abs(np.linalg.det(system)) > 1e-9 * size ** (d - 1)
    found = np.linalg.solve(system[steep], np.append(start, 1.0)[:, None])[:, :, 0]
    return np.asarray(found[(found[:, :d] >= -1e-9).all(axis=1), d])


def _cut(mesh: Mesh, height: FloatArray, simplices: npt.NDArray[np.integer]) -> sp.csr_matrix | None:
    """Return the shares ``(1, n)`` in the centroid of the section at height 0; ``None`` where there is no material."""
    kind = mesh.cell
    corners = mesh.cells[:, : kind.n_corners]
    near = (height[corners].min(axis=1) <= 0.0) & (height[corners].max(axis=1) >= 0.0)
    cells = np.repeat(np.flatnonzero(near), len(simplices))
    parts = np.tile(simplices, (int(near.sum()), 1))
    levels = height[np.take_along_axis(mesh.cells[cells], parts, axis=1)]
    order = np.argsort(levels, axis=1, kind="stable")
    parts, levels = np.take_along_axis(parts, order, axis=1), np.take_along_axis(levels, order, axis=1)
    above = (levels > 0.0).sum(axis=1)
    nodes, shares = [], []
    for (dimension, count), pieces in _CUTS.items():
        here = np.flatnonzero(above == count) if dimension == mesh.dimension else np.empty(0, np.intp)
        for piece in pieces:
            if len(here):
                local = _corners_of_piece(kind, parts[here], levels[here], piece)
                shares.append(_mean_shares(mesh, kind, cells[here], local))
                nodes.append(mesh.cells[cells[here]])
    total = sum(float(part.sum()) for part in shares)
    if total <= 0.0:
        return None
    weights = np.vstack(shares) / total
    return _shares(np.vstack(nodes), weights, np.zeros(len(weights), np.int64), 1, mesh.n_points)


def _corners_of_piece(
    kind: Cell, parts: npt.NDArray[np.integer], levels: FloatArray, piece: list[tuple[int, int]]
) -> FloatArray:
    """Return reference coordinates ``(k, corners, d)`` of a piece of the section through each simplex."""
    places = []
    for low, high in piece:
        first, second = levels[:, low, None], levels[:, high, None]
        share = first / (first - second)
        places.append((1.0 - share) * kind.nodes[parts[:, low]] + share * kind.nodes[parts[:, high]])
    return np.stack(places, axis=1)


def _mean_shares(mesh: Mesh, kind: Cell, cells: npt.NDArray[np.integer], local: FloatArray) -> FloatArray:
    """Return the integrals of the shape functions over pieces of a section, ``(k, n_nodes)``, mm² (mm)."""
    rule, weights = _SIMPSON if kind.dimension == 2 else _MIDDLES
    places = (rule @ local).reshape(-1, kind.dimension)
    shape = kind.shape(places).reshape(len(cells), len(rule), -1)
    gradient = kind.gradient(places).reshape(*shape.shape, kind.dimension)
    # A piece with a side on a curved face is curved itself.
    sides = local[:, 1:] - local[:, :1]
    tangents = np.einsum("kni,kqnj,ksj->sqki", mesh.points[mesh.cells[cells]], gradient, sides, optimize=True)
    sizes = np.linalg.norm(tangents[0], axis=-1)
    if kind.dimension == 3:
        sizes = 0.5 * np.linalg.norm(np.cross(tangents[0], tangents[1]), axis=-1)
    return np.asarray(np.einsum("q,qk,kqn->kn", weights, sizes, shape))


def _shares(
    nodes: npt.NDArray[np.integer], values: FloatArray, rows: npt.NDArray[np.integer], count: int, n_points: int
) -> sp.csr_matrix:
    """Return a matrix ``(count, n_points)`` of shares from `nodes` and `values` ``(k, w)`` that belong to `rows`."""
    row = np.repeat(rows, nodes.shape[1])
    return sp.csr_matrix((values.ravel(), (row, nodes.ravel())), shape=(count, n_points))
