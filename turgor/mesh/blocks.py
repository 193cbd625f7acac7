"""Quadrilaterals in the blocks of a section, and hexahedra where the section is turned about its axis.

Every block is mapped from a grid by transfinite interpolation between its sides (Gordon and Hall, 1973), so that all
nodes of its sides lie on the exact lines and arcs. A block on the axis becomes a disc: a core of squares, and around it
a ring of quadrilaterals up to the circle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from turgor.common.errors import InputError
from turgor.geometry.blocks import AXIS, Block, Blocks
from turgor.geometry.path import Piece
from turgor.geometry.section import CUTS
from turgor.mesh.cells import CELLS, body_cell, determinants, jacobians
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.polyline import nodes_on_polyline
from turgor.mesh.structured import unit_grid
from turgor.mesh.tet10 import FloatArray, IntArray

_CORE = 0.5, 0.4
"""Of the unit disc: where the core's sides meet the axes, and both coordinates of its corner."""
_QUARTERS = {"quarter": 1, "half": 2, "full": 4}


@dataclass(frozen=True)
class _Part:
    """Nodes ``(n, d)``, cells, region, and the name of each node that lies inside a named side ("" elsewhere)."""

    points: FloatArray
    cells: IntArray
    region: str
    names: list[str]


def structured_mesh(blocks: Blocks, model: str, size: float, per_circle: int, most: int) -> Mesh:
    """Mesh a section in blocks with nine-node quadrilaterals, or the body around the axis with 27-node hexahedra.

    Parameters
    ----------
    blocks
        The section of radius and height.
    model
        ``axisymmetric`` for the section, or which part of the body: ``full``, ``half`` or ``quarter``.
    size
        Largest edge length in mm, of arcs and straight sides.
    per_circle
        Edges along a full circle, at least.
    most
        Number of cells beyond which the mesh is refused.

    Raises
    ------
    InputError
        If there would be too many cells, or a cell would be inside out.
    """
    divisions = _divisions(blocks, size, per_circle)
    around = 1 if model == "axisymmetric" else 2.0 * math.pi * _reach(blocks) / size
    if (count := around * sum(first * second for first, second in divisions)) > most:
        problem, expected = f"this element size needs about {count:.1g} elements", f"at most {most:.0g} elements"
        raise InputError(problem, key="size", value=f"{size:g} mm", expected=f"a larger size: {expected}")
    if model == "axisymmetric":
        parts = [_flat(block, counts) for block, counts in zip(blocks.parts, divisions, strict=True)]
        return _joined(parts, {AXIS: 0}, {name: line[:, [0, 2]] for name, line in blocks.markers.items()}, {})
    edges = max(math.ceil(0.5 * math.pi * _reach(blocks) / size), math.ceil(per_circle / 4))
    half = math.ceil(edges / 2)  # the core of a disc takes half of a quarter's edges along each of its sides
    quarter = [
        _disc(block, counts, half) if AXIS in block.names else _ring(block, counts, 2 * half)
        for block, counts in zip(blocks.parts, divisions, strict=True)
    ]
    parts = [_turned(part, number) for number in range(_QUARTERS[model]) for part in quarter]
    cuts = {name: "xyz".index(axis) for name, axis in CUTS[model].items()}
    return _joined(parts, cuts, blocks.markers, blocks.curves)


def _reach(blocks: Blocks) -> float:
    """Return the largest radius, but for what an arc's middle adds to it."""
    return max(max(side.start[0], side.end[0]) for block in blocks.parts for side in block.sides)


def _divisions(blocks: Blocks, size: float, per_circle: int) -> list[tuple[int, int]]:
    """Return how often each block is divided along its first and its second side, the same where blocks meet."""
    sides = [side for block in blocks.parts for side in block.sides]
    tree = cKDTree(np.array([_point(side, np.array([0.5]))[0] for side in sides]))
    group = np.arange(len(sides))
    links = list(tree.query_pairs(1e-6 * size))
    links += [(4 * block + side, 4 * block + side + 2) for block in range(len(blocks.parts)) for side in (0, 1)]
    while any(group[a] != group[b] for a, b in links):
        for a, b in links:
            group[[a, b]] = min(group[a], group[b])
    needed = np.array([_edges(side, size, per_circle) for side in sides])
    counts = [int(needed[group == group[number]].max()) for number in range(len(sides))]
    return list(zip(counts[::4], counts[1::4], strict=True))


def _edges(side: Piece, size: float, per_circle: int) -> int:
    if side.centre is None:
        return max(1, math.ceil(math.dist(side.start, side.end) / size - 1e-9))
    angle = abs(_arc(side)[2])
    return math.ceil(max(math.dist(side.start, side.centre) * angle / size, per_circle * angle / (2 * math.pi)) - 1e-9)


def _arc(side: Piece) -> tuple[float, float, float]:
    """Return the radius of an arc shorter than a half circle, the angle at which it begins and by which it turns."""
    assert side.centre is not None
    (cx, cy), (x0, y0), (x1, y1) = side.centre, side.start, side.end
    begin = math.atan2(y0 - cy, x0 - cx)
    return math.hypot(x0 - cx, y0 - cy), begin, math.remainder(math.atan2(y1 - cy, x1 - cx) - begin, 2 * math.pi)


def _point(side: Piece, t: FloatArray) -> FloatArray:
    """Return the points ``(n, 2)`` at parts `t` ``(n,)`` of a side, its ends exactly."""
    start, end = np.array(side.start), np.array(side.end)
    if side.centre is None:
        return np.asarray((1 - t)[:, None] * start + t[:, None] * end)
    radius, begin, turn = _arc(side)
    angle = begin + turn * t
    points = np.array(side.centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points[t == 0.0], points[t == 1.0] = start, end
    return points


def _map(block: Block, unit: FloatArray) -> FloatArray:
    """Return the places ``(n, 2)`` in a block of points ``(n, 2)`` of the unit square."""
    s, t = unit.T
    bottom, right, top, left = block.sides
    a, b, c, d = (np.array(side.start) for side in block.sides)
    u, v = s[:, None], t[:, None]
    lofted = (1 - v) * _point(bottom, s) + v * _point(top, 1 - s) + (1 - u) * _point(left, 1 - t) + u * _point(right, t)
    return np.asarray(lofted - ((1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d))


def _names(block: Block, s: FloatArray, t: FloatArray) -> list[str]:
    """Return the name of the side on which each node lies, "" inside and at the corners, which belong to two."""
    on = np.array([t == 0.0, s == 1.0, t == 1.0, s == 0.0])
    which = np.where(on.sum(axis=0) == 1, on.argmax(axis=0), 4)
    return [(*(name or "" for name in block.names), "")[k] for k in which]


def _flat(block: Block, counts: tuple[int, int]) -> _Part:
    unit, cells = unit_grid(counts, "quad9")
    return _Part(_map(block, unit), cells, block.region, _names(block, *unit.T))


def _ring(block: Block, counts: tuple[int, int], around: int) -> _Part:
    unit, cells = unit_grid((*counts, around), "hex27")
    radius, height = _map(block, unit[:, :2]).T
    return _Part(_around(radius, unit[:, 2], height), cells, block.region, _names(block, *unit[:, :2].T))


def _disc(block: Block, counts: tuple[int, int], half: int) -> _Part:
    """Fill the quarter of a block whose first or second upright side lies on the axis."""
    from_axis = block.names[3] == AXIS
    plane, squares = _quarter_disc(half, max(1, counts[0] // 2))
    levels = np.arange(2 * counts[1] + 1) / (2 * counts[1])
    share = np.tile(np.hypot(*plane.T), len(levels))
    turn = np.tile(np.arctan2(plane[:, 1], plane[:, 0]) / (0.5 * math.pi), len(levels))
    share[np.abs(share - 1.0) < 1e-12] = 1.0
    t = np.repeat(levels, len(plane))
    s = share if from_axis else 1.0 - share
    radius, height = _map(block, np.column_stack([s, t])).T
    names = _names(block, np.where(share < 1.0, 0.5, s), t)
    layers = [squares + 2 * level * len(plane) for level in range(counts[1])]
    return _Part(_around(radius, turn, height), _thick(np.vstack(layers), len(plane)), block.region, names)


def _quarter_disc(half: int, rings: int) -> tuple[FloatArray, IntArray]:
    """Return nodes and quadrilaterals of the quarter x, y ≥ 0 of the unit disc."""
    edge, corner = _CORE
    core, core_cells = unit_grid((half, half), "quad9")
    x, y = core.T
    # Bilinear between the origin, the two sides' ends on the axes and the corner.
    square = np.column_stack([x * (edge + y * (corner - edge)), y * (edge + x * (corner - edge))])
    strip, strip_cells = unit_grid((rings, half), "quad9")
    r, t = strip.T
    angle = 0.25 * math.pi * t
    inner = np.column_stack([edge + t * (corner - edge), t * corner])
    arc = np.column_stack([np.cos(angle), np.sin(angle)])
    lower = (1 - r)[:, None] * inner + r[:, None] * arc
    points = np.vstack([square, lower, lower[:, ::-1]])
    cells = np.vstack([core_cells, strip_cells + len(core), strip_cells + len(core) + len(strip)])
    return _merged(points, cells)


def _thick(squares: IntArray, step: int) -> IntArray:
    """Make hexahedra of quadrilaterals ``(m, 9)`` whose nodes two and one levels higher are `step` numbers apart."""
    place = {tuple(node): number for number, node in enumerate((2 * CELLS["quad9"].nodes).astype(int).tolist())}
    columns = [squares[:, place[x, y]] + z * step for x, y, z in (2 * CELLS["hex27"].nodes).astype(int).tolist()]
    return np.column_stack(columns).astype(np.int32)


def _around(radius: FloatArray, turn: FloatArray, height: FloatArray) -> FloatArray:
    """Return points at parts `turn` of a quarter turn from x to y, exactly in the planes at its ends."""
    x, y = radius * np.cos(0.5 * math.pi * turn), radius * np.sin(0.5 * math.pi * turn)
    x[turn == 1.0], y[turn == 0.0] = 0.0, 0.0
    return np.column_stack([x, y, height])


def _turned(part: _Part, quarters: int) -> _Part:
    points = part.points
    for _ in range(quarters):
        points = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    return _Part(points, part.cells, part.region, part.names)


def _merged(points: FloatArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
    """Make one node of all that lie on each other; the first stays."""
    first = _first(points)
    kept, place = np.unique(first, return_inverse=True)
    return points[kept], place[cells].astype(np.int32)


def _first(points: FloatArray) -> IntArray:
    """Return for each of the points the first one at the same place, ``(n,)``."""
    pairs = cKDTree(points).query_pairs(1e-9 * float(np.ptp(points, axis=0).max()), output_type="ndarray")
    first = np.arange(len(points), dtype=np.int32)
    np.minimum.at(first, pairs[:, 1], pairs[:, 0].astype(np.int32))
    return first


def _joined(
    parts: list[_Part], cuts: Mapping[str, int], markers: Mapping[str, FloatArray], curves: Mapping[str, FloatArray]
) -> Mesh:
    """Join the parts to one mesh and name its boundary: by the node in the middle of a face, or the cut it lies in."""
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    points = np.vstack([part.points for part in parts])
    points[np.abs(points) < 1e-10 * np.ptp(points, axis=0).max()] = 0.0
    cells = np.vstack([part.cells + start for part, start in zip(parts, starts, strict=False)])
    first = _first(points)
    kept, place = np.unique(first, return_inverse=True)
    names = np.array([name for part in parts for name in part.names])[kept]
    points, cells = points[kept], place[cells].astype(np.int32)
    cell = body_cell(cells)
    mirrored = determinants(jacobians(points[cells], cell)).min(axis=1) < 0.0
    cells[mirrored] = cells[mirrored][:, cell.mirrored]
    if determinants(jacobians(points[cells], cell, cell.nodes)).min() <= 0.0:
        raise InputError("the blocks of this shape make cells that are inside out", key="cells", expected="no cells")
    owner = np.repeat([part.region for part in parts], [len(part.cells) for part in parts])
    regions = {name: np.flatnonzero(owner == name).astype(np.int32) for name in dict.fromkeys(owner.tolist())}
    boundary = boundary_faces(cells)
    cut_of = np.full(len(boundary), "", dtype=object)
    for name, axis in cuts.items():
        cut_of[(points[boundary][:, :, axis] == 0.0).all(axis=1)] = name
    face_names = np.where(cut_of != "", cut_of, names[boundary[:, -1]])
    surfaces = {str(name): boundary[face_names == name] for name in dict.fromkeys(face_names.tolist())}
    lines = {name: nodes_on_polyline(points, line, name) for name, line in markers.items()}
    return Mesh(points, cells, regions, surfaces, lines, curves)
