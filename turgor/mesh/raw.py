"""A mesh as another program wrote it, and what becomes of it: second-order cells, names, cavities by topology."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.rows import row_numbers
from turgor.mesh.cells import CELLS, Cell, determinants, face_cell, jacobians
from turgor.mesh.elevate import KINDS, completed
from turgor.mesh.faces import boundary_faces, connected_faces, crowded_faces, places_of_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray, IntArray

LOG = logger("mesh")

_SNAP = 1e-10
"""What is nearer to a coordinate plane than this part of the body's size lies in it, as a symmetry plane must."""


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Points, cells and sets by their places in the file, from 0.

    Attributes
    ----------
    points
        ``(n, 3)``.
    blocks
        Kind of cell (as meshio calls it) and its cells ``(m, n_nodes)``; cells are counted through all blocks.
    cell_sets, node_sets
        Name → cells or nodes.
    face_sets
        Name → the corners ``(k, c)`` of faces.
    """

    points: FloatArray
    blocks: Sequence[tuple[str, IntArray]]
    cell_sets: Mapping[str, IntArray] = field(default_factory=dict)
    node_sets: Mapping[str, IntArray] = field(default_factory=dict)
    face_sets: Mapping[str, IntArray] = field(default_factory=dict)


def assembled(raw: RawMesh) -> Mesh:
    """Return the mesh: cells of second order, regions, surfaces, markers and cavities by name.

    Sets of cells become regions (what is in none is ``body``), faces, sets of faces' cells and sets of nodes that hold
    whole faces of the skin become surfaces, other sets of nodes markers. Names are in small letters with hyphens. Every
    part of the skin that does not hang together with the outside is a cavity: ``cavity``, or ``cavity-1``, … from the
    largest to the smallest, if the file does not name it so itself; surfaces called ``symmetry…`` part the skin. What
    no surface holds is ``outer``.

    Raises
    ------
    InputError
        If there are no cells of a kind that Turgor has, or of several kinds, a cell is there twice, more than two cells
        share a face, or the cells make no valid mesh.
    """
    kind, cells, body = _body(raw)
    cell = CELLS[KINDS[kind].cell]
    if KINDS[kind].linear:
        LOG.warning("the cells of the file have straight edges; they are taken for %s of second order", cell.name)
    points = _in_space_of(cell, raw.points)
    points, cells = completed(points, cells, KINDS[kind])
    _check_single(points, cells, cell)
    cells = _right_side_out(points, cells, cell)
    used, inverse = np.unique(cells, return_inverse=True)
    index = np.full(len(points), -1, dtype=np.int32)
    index[used] = np.arange(len(used))
    points, cells = points[used], inverse.reshape(cells.shape).astype(np.int32)
    points[np.abs(points) < _SNAP * np.ptp(points, axis=0).max()] = 0.0
    surfaces, markers = _surfaces_and_markers(raw, cells, index, cell)
    skin = boundary_faces(cells)
    faces = {name: skin[held] for name, held in _with_cavities(points, skin, surfaces).items()}
    return Mesh(points, cells, _regions(raw, body, len(cells)), faces, markers)


def plain(name: str) -> str:
    """Return a name as Turgor writes them: small letters, digits and hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "unnamed"


def _body(raw: RawMesh) -> tuple[str, IntArray, IntArray]:
    """Return the kind of the cells of the highest dimension, these cells, and the place of each cell among them."""
    known = [(kind, cells) for kind, cells in raw.blocks if kind in KINDS and len(cells)]
    if not known:
        raise InputError("the file holds no cells of a kind that is known", expected=", ".join(KINDS))
    dimension = max(CELLS[KINDS[kind].cell].dimension for kind, _ in known)
    kinds = sorted({kind for kind, _ in known if CELLS[KINDS[kind].cell].dimension == dimension})
    solid = {kind for kind, cells in raw.blocks if re.match("wedge|pyramid", kind) and len(cells)}
    if len(kinds) > 1 or solid:
        raise InputError("the file mixes cells of several kinds", value=", ".join([*kinds, *sorted(solid)]))
    place = np.concatenate([np.full(len(cells), kind == kinds[0]) for kind, cells in raw.blocks])
    body = np.where(place, np.cumsum(place) - 1, -1).astype(np.int32)
    return kinds[0], np.vstack([cells for kind, cells in raw.blocks if kind == kinds[0]]), body


def _in_space_of(cell: Cell, points: FloatArray) -> FloatArray:
    if cell.dimension == 2 and np.ptp(points[:, 2]) > _SNAP * np.ptp(points):
        raise InputError("the plane cells of the file do not lie in the plane of x and y")
    return np.ascontiguousarray(points[:, : cell.dimension])


def _check_single(points: FloatArray, cells: IntArray, cell: Cell) -> None:
    """Refuse cells that fill the same room: their material would count twice, and their faces are no skin."""
    corners = cells[:, : cell.n_corners]
    _, first, counts = np.unique(row_numbers(np.sort(corners, axis=1)), return_index=True, return_counts=True)
    if counts.max() > 1:
        raise InputError(
            f"cells are there more than once: {counts.sum() - len(counts)} of {len(cells)}, the first one around "
            f"{_place(points[corners[first[counts > 1].min()]])}",
            expected="every cell once (files of gmsh's version 2 repeat those of several physical groups)",
        )
    crowded = crowded_faces(cells)
    if len(crowded):
        nodes = crowded[0, : face_cell(crowded).n_corners]
        what = "edges" if cell.dimension == 2 else "faces"
        raise InputError(
            f"{what} belong to more than two cells: {len(crowded)}, the first one around {_place(points[nodes])}",
            expected="cells that do not overlap",
        )


def _place(points: FloatArray) -> str:
    """Write the middle of some points ``(k, d)`` in the numbers of the file."""
    return "(" + ", ".join(f"{x:.6g}" for x in points.mean(axis=0)) + ")"


def _right_side_out(points: FloatArray, cells: IntArray, cell: Cell) -> IntArray:
    volumes = determinants(jacobians(points[cells], cell)) @ cell.weights
    return np.where((volumes < 0.0)[:, None], cells[:, cell.mirrored], cells)


def _regions(raw: RawMesh, body: IntArray, n_cells: int) -> dict[str, IntArray]:
    regions: dict[str, IntArray] = {}
    owner = np.full(n_cells, "", dtype=object)
    for name, members in raw.cell_sets.items():
        cells = body[members]
        cells = np.unique(cells[cells >= 0])
        if not len(cells):
            continue
        twice = owner[cells][owner[cells] != ""]
        if len(twice):
            raise InputError(f"a cell is in the sets '{twice[0]}' and '{name}'", expected="one material a cell")
        owner[cells] = name
        regions[plain(name)] = cells.astype(np.int32)
    rest = np.flatnonzero(owner == "").astype(np.int32)
    if len(rest):
        regions["body"] = np.sort(np.concatenate([regions.get("body", rest[:0]), rest]))
    return regions


def _surfaces_and_markers(
    raw: RawMesh, cells: IntArray, index: IntArray, cell: Cell
) -> tuple[dict[str, IntArray], dict[str, IntArray]]:
    """Return the places of each surface's faces in the skin, and the nodes of each marker."""
    skin = boundary_faces(cells)
    corners_per_face = face_cell(skin).n_corners
    surfaces: dict[str, IntArray] = {}
    for name, corners in {**_faces_of_cells(raw, corners_per_face), **raw.face_sets}.items():
        found = places_of_faces(skin, index[corners])
        if (found < 0).any():
            LOG.warning("%d faces of '%s' are not on the skin and are left out", (found < 0).sum(), name)
        if (found >= 0).any():
            surfaces[plain(name)] = np.unique(found[found >= 0])
    markers: dict[str, IntArray] = {}
    for name, nodes in raw.node_sets.items():
        inside = np.zeros(int(cells.max()) + 1, dtype=bool)
        inside[index[nodes][index[nodes] >= 0]] = True
        held = np.flatnonzero(inside[skin[:, :corners_per_face]].all(axis=1)).astype(np.int32)
        if inside[cells[:, : cell.n_corners]].all() or not inside.any() or plain(name) in surfaces:
            continue
        if len(held):
            surfaces[plain(name)] = held
        else:
            markers[plain(name)] = index[nodes][index[nodes] >= 0]
    return surfaces, markers


def _faces_of_cells(raw: RawMesh, n_corners: int) -> dict[str, IntArray]:
    """Return the corners of the cells of one dimension less that a set holds: shells on the skin, lines around it."""
    kinds = {2: ("line", "line3"), 3: ("triangle", "triangle6"), 4: ("quad", "quad8", "quad9")}[n_corners]
    starts = np.cumsum([0, *(len(cells) for _, cells in raw.blocks)])
    found: dict[str, list[IntArray]] = {}
    for name, members in raw.cell_sets.items():
        for (kind, cells), start in zip(raw.blocks, starts[:-1], strict=True):
            of_block = members[(members >= start) & (members < start + len(cells))] - start
            if kind in kinds and len(of_block):
                found.setdefault(name, []).append(cells[of_block][:, :n_corners])
    return {name: np.vstack(parts) for name, parts in found.items()}


def _with_cavities(points: FloatArray, skin: IntArray, surfaces: dict[str, IntArray]) -> dict[str, IntArray]:
    """Add the cavities that the file does not name, and ``outer`` for what no surface holds."""
    symmetry = [held for name, held in surfaces.items() if name.startswith("symmetry")]
    cut = np.concatenate([np.zeros(0, np.int32), *symmetry])
    left = np.setdiff1d(np.arange(len(skin)), cut)
    named = np.concatenate([np.zeros(0, np.int32), *(h for n, h in surfaces.items() if n.startswith("cavity"))])
    parts = [left[part] for part in connected_faces(skin[left])]
    extent = [float(np.linalg.norm(np.ptp(points[skin[part]].reshape(-1, points.shape[1]), axis=0))) for part in parts]
    order = sorted(range(len(parts)), key=lambda k: -extent[k])[1:]
    found = [parts[k] for k in order if not np.isin(parts[k], named).any()]
    names = ["cavity"] if len(found) == 1 else [f"cavity-{number}" for number in range(1, len(found) + 1)]
    result = surfaces | {name: part for name, part in zip(names, found, strict=True) if name not in surfaces}
    rest = np.setdiff1d(np.arange(len(skin)), np.concatenate([np.zeros(0, np.int32), *result.values()]))
    return result | ({"outer": rest} if len(rest) and "outer" not in result else {})
