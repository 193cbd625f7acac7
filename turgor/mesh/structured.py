"""Structured meshes of simple bodies with exact curved geometry, for convergence studies.

Each is a grid of hexahedra, every hexahedron cut into six tetrahedra around its main diagonal (Kuhn, 1960). The nodes
of a grid of twice the fineness are exactly the corners and edge middles of these tetrahedra, so mapping that grid
places the middle nodes on the exact curved surface too.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import EDGES, FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]


def box(lengths: tuple[float, float, float], divisions: tuple[int, int, int]) -> Mesh:
    """Return a block with one corner at the origin.

    Parameters
    ----------
    lengths
        Edge lengths along x, y, z in mm.
    divisions
        Hexahedra along x, y, z, each of which becomes six tetrahedra.

    Returns
    -------
    Mesh
        Surfaces ``x0 x1 y0 y1 z0 z1``: the faces at either end of each axis.

    Raises
    ------
    InputError
        If a length is not positive or a division is less than one.
    """
    if min(lengths) <= 0.0:
        raise InputError("every length must be positive", key="lengths", value=lengths)
    unit, cells = _grid(divisions)
    x, y, z = unit.T
    sides = {"x0": x == 0, "x1": x == 1, "y0": y == 0, "y1": y == 1, "z0": z == 0, "z1": z == 1}
    return _named_mesh(unit * lengths, cells, sides)


def tube_sector(inner_radius: float, outer_radius: float, length: float, n: int) -> Mesh:
    """Return the quarter x ≥ 0, y ≥ 0 of a tube around the z axis, from z = 0 to `length`.

    Parameters
    ----------
    inner_radius, outer_radius, length
        In mm.
    n
        Hexahedra through the wall; along the arc and the axis they are made about as long as thick.

    Returns
    -------
    Mesh
        Surfaces ``inner outer x0 y0 z0 z1``; ``x0`` lies in the plane x = 0.

    Raises
    ------
    InputError
        If the radii do not describe a wall, the length is not positive or `n` is less than one.
    """
    wall = _wall(inner_radius, outer_radius)
    if length <= 0.0:
        raise InputError("the length must be positive", key="length", value=length)
    around = max(1, round(math.pi / 4 * (inner_radius + outer_radius) / wall))
    unit, cells = _grid((n, n * around, n * max(1, round(length / wall))))
    radius, angle = inner_radius + wall * unit[:, 0], 0.5 * math.pi * unit[:, 1]
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    x[unit[:, 1] == 1], y[unit[:, 1] == 0] = 0.0, 0.0
    s, t, z = unit.T
    sides = {"inner": s == 0, "outer": s == 1, "x0": t == 1, "y0": t == 0, "z0": z == 0, "z1": z == 1}
    return _named_mesh(np.column_stack([x, y, length * z]), cells, sides)


def shell_octant(inner_radius: float, outer_radius: float, n: int) -> Mesh:
    """Return the octant x, y, z ≥ 0 of a spherical shell around the origin.

    Three blocks of hexahedra, one for each face of a cube seen from the centre, meet along the octant's diagonal.

    Parameters
    ----------
    inner_radius, outer_radius
        In mm.
    n
        Hexahedra through the wall; along the arc they are made about as long as thick.

    Returns
    -------
    Mesh
        Surfaces ``inner outer x0 y0 z0``; ``x0`` lies in the plane x = 0.

    Raises
    ------
    InputError
        If the radii do not describe a wall or `n` is less than one.
    """
    wall = _wall(inner_radius, outer_radius)
    along = n * max(1, round(math.pi / 8 * (inner_radius + outer_radius) / wall))
    unit, cells = _grid((n, along, along))
    tangents = np.tan(0.25 * math.pi * unit[:, 1:])
    tangents[unit[:, 1:] == 1.0] = 1.0
    direction = np.column_stack([np.ones(len(unit)), tangents])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    block = (inner_radius + wall * unit[:, :1]) * direction
    # The place on the grid of the cube's surface tells the nodes that blocks share, exactly.
    place = np.rint(np.column_stack([np.full(len(unit), 2 * along), 2 * along * unit[:, 1:], 2 * n * unit[:, 0]]))
    turns = ([0, 1, 2], [1, 0, 2], [1, 2, 0])
    keys = np.vstack([place[:, [*turn, 3]] for turn in turns])
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    points = np.vstack([block[:, turn] for turn in turns])[first]
    cells = inverse.astype(np.int32)[np.vstack([cells + k * len(unit) for k in range(3)])]
    level = np.empty(len(points))
    level[inverse] = np.tile(unit[:, 0], 3)
    x, y, z = points.T
    sides = {"inner": level == 0, "outer": level == 1, "x0": x == 0, "y0": y == 0, "z0": z == 0}
    return _named_mesh(points, cells, sides)


def _wall(inner_radius: float, outer_radius: float) -> float:
    if not 0.0 < inner_radius < outer_radius:
        raise InputError("the radii describe no wall", value=(inner_radius, outer_radius), expected="0 < inner < outer")
    return outer_radius - inner_radius


def _grid(divisions: tuple[int, int, int]) -> tuple[FloatArray, IntArray]:
    """Nodes in the unit cube ``(n, 3)`` and ten-node tetrahedra ``(m, 10)``."""
    if min(divisions) < 1:
        raise InputError("there must be at least one division", value=divisions)
    counts = [2 * k + 1 for k in divisions]
    axes = [np.arange(count) / (count - 1) for count in counts]
    unit = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    origins = 2 * np.stack(np.meshgrid(*(np.arange(k) for k in divisions), indexing="ij"), axis=-1).reshape(-1, 3)
    tets = [origins[:, None, :] + _kuhn_lattice(order) for order in itertools.permutations(range(3))]
    lattice = np.concatenate(tets)
    cells = np.ravel_multi_index(tuple(np.moveaxis(lattice, -1, 0)), tuple(counts)).astype(np.int32)
    return unit, cells


def _kuhn_lattice(order: tuple[int, ...]) -> IntArray:
    """Half-step coordinates ``(10, 3)`` of the tetrahedron that walks from 000 to 111 along the axes in `order`."""
    corners = np.zeros((4, 3), dtype=np.int32)
    for step, axis in enumerate(order):
        corners[step + 1 :, axis] = 2
    middles = np.array([(corners[a] + corners[b]) // 2 for a, b in EDGES])
    return np.vstack([corners, middles])


def _named_mesh(points: FloatArray, cells: IntArray, sides: dict[str, BoolArray]) -> Mesh:
    """Turn every cell right side out and name the boundary faces whose six nodes lie on a side."""
    corner = points[cells[:, :4]]
    edges = corner[:, 1:] - corner[:, :1]
    mirrored = np.linalg.det(edges) < 0.0
    cells[mirrored] = cells[mirrored][:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    boundary = boundary_faces(cells)
    surfaces = {name: boundary[on_side[boundary].all(axis=1)] for name, on_side in sides.items()}
    return Mesh(points, cells, surfaces=surfaces)
