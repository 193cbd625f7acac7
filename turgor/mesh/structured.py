"""Structured meshes of simple bodies with exact curved geometry, for convergence studies.

Each is a grid of hexahedra (quadrilaterals), which are the cells themselves or are cut into six tetrahedra (two
triangles) around their main diagonal (Kuhn, 1960). The nodes of a grid of twice the fineness are exactly the nodes of
these second-order cells, so mapping that grid places the middle nodes on the exact curved surface too.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.cells import CELLS, body_cell, determinants, jacobians
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]


def box(lengths: tuple[float, float, float], divisions: tuple[int, int, int], cell_type: str = "tet10") -> Mesh:
    """Return a block with one corner at the origin.

    Parameters
    ----------
    lengths
        Edge lengths along x, y, z in mm.
    divisions
        Hexahedra along x, y, z; of tetrahedra each is made of six.
    cell_type
        ``tet10`` or ``hex27``.

    Returns
    -------
    Mesh
        Surfaces ``x0 x1 y0 y1 z0 z1``: the faces at either end of each axis.

    Raises
    ------
    InputError
        If a length is not positive or a division is less than one.
    """
    _check_lengths(lengths)
    unit, cells = unit_grid(divisions, cell_type)
    x, y, z = unit.T
    sides = {"x0": x == 0, "x1": x == 1, "y0": y == 0, "y1": y == 1, "z0": z == 0, "z1": z == 1}
    return _named_mesh(unit * lengths, cells, sides)


def tube_sector(inner_radius: float, outer_radius: float, length: float, n: int, cell_type: str = "tet10") -> Mesh:
    """Return the quarter x ≥ 0, y ≥ 0 of a tube around the z axis, from z = 0 to `length`.

    Parameters
    ----------
    inner_radius, outer_radius, length
        In mm.
    n
        Hexahedra through the wall; along the arc and the axis they are made about as long as thick.
    cell_type
        ``tet10`` or ``hex27``.

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
    unit, cells = unit_grid((n, n * around, n * max(1, round(length / wall))), cell_type)
    s, t, z = unit.T
    across = _arc(inner_radius + wall * s, t)
    sides = {"inner": s == 0, "outer": s == 1, "x0": t == 1, "y0": t == 0, "z0": z == 0, "z1": z == 1}
    return _named_mesh(np.column_stack([across, length * z]), cells, sides)


def shell_octant(inner_radius: float, outer_radius: float, n: int, cell_type: str = "tet10") -> Mesh:
    """Return the octant x, y, z ≥ 0 of a spherical shell around the origin.

    Three blocks of hexahedra, one for each face of a cube seen from the centre, meet along the octant's diagonal.

    Parameters
    ----------
    inner_radius, outer_radius
        In mm.
    n
        Hexahedra through the wall; along the arc they are made about as long as thick.
    cell_type
        ``tet10`` or ``hex27``.

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
    unit, cells = unit_grid((n, along, along), cell_type)
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


def rectangle(
    lengths: tuple[float, float],
    divisions: tuple[int, int],
    cell_type: str = "quad9",
    corner: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """Return a rectangle; turned about y it is a tube.

    Parameters
    ----------
    lengths
        Edge lengths along x and y in mm.
    divisions
        Quadrilaterals along x and y; of triangles each is made of two.
    cell_type
        ``quad9`` or ``tri6``.
    corner
        Its lowest corner in mm.

    Returns
    -------
    Mesh
        Surfaces ``x0 x1 y0 y1``: the edges at either end of each axis.

    Raises
    ------
    InputError
        If a length is not positive or a division is less than one.
    """
    _check_lengths(lengths)
    unit, cells = unit_grid(divisions, cell_type)
    x, y = unit.T
    return _named_mesh(
        np.array(corner) + unit * lengths, cells, {"x0": x == 0, "x1": x == 1, "y0": y == 0, "y1": y == 1}
    )


def quadrilateral(corners: npt.ArrayLike, divisions: tuple[int, int], cell_type: str = "quad9") -> Mesh:
    """Return a quadrilateral with straight sides, its grid mapped bilinearly.

    Parameters
    ----------
    corners
        ``(4, 2)`` in mm, counterclockwise.
    divisions
        Quadrilaterals along the first and the second side; of triangles each is made of two.
    cell_type
        ``quad9`` or ``tri6``.

    Returns
    -------
    Mesh
        Surfaces ``x0 x1 y0 y1``: the sides from the fourth to the first corner, from the second to the third, from the
        first to the second, and from the third to the fourth.
    """
    unit, cells = unit_grid(divisions, cell_type)
    (x, y), (a, b, c, d) = unit.T[:, :, None], np.asarray(corners, dtype=float)
    points = (1 - x) * (1 - y) * a + x * (1 - y) * b + x * y * c + (1 - x) * y * d
    x, y = unit.T
    return _named_mesh(points, cells, {"x0": x == 0, "x1": x == 1, "y0": y == 0, "y1": y == 1})


def quarter_ring(inner_radius: float, outer_radius: float, n: int, cell_type: str = "quad9") -> Mesh:
    """Return the quarter x ≥ 0, y ≥ 0 of a ring: a section of a tube, or, turned about y, half a spherical shell.

    Parameters
    ----------
    inner_radius, outer_radius
        In mm.
    n
        Quadrilaterals through the wall; along the arc they are made about as long as thick.
    cell_type
        ``quad9`` or ``tri6``.

    Returns
    -------
    Mesh
        Surfaces ``inner outer x0 y0``; ``x0`` lies in the line x = 0.

    Raises
    ------
    InputError
        If the radii do not describe a wall or `n` is less than one.
    """
    wall = _wall(inner_radius, outer_radius)
    around = max(1, round(math.pi / 4 * (inner_radius + outer_radius) / wall))
    unit, cells = unit_grid((n, n * around), cell_type)
    s, t = unit.T
    points = _arc(inner_radius + wall * s, t)
    return _named_mesh(points, cells, {"inner": s == 0, "outer": s == 1, "x0": t == 1, "y0": t == 0})


def _arc(radius: FloatArray, turn: FloatArray) -> FloatArray:
    """Return points ``(n, 2)`` at parts `turn` of a quarter turn from x to y, exactly on the axes at its ends."""
    x, y = radius * np.cos(0.5 * math.pi * turn), radius * np.sin(0.5 * math.pi * turn)
    x[turn == 1], y[turn == 0] = 0.0, 0.0
    return np.column_stack([x, y])


def _check_lengths(lengths: tuple[float, ...]) -> None:
    if min(lengths) <= 0.0:
        raise InputError("every length must be positive", key="lengths", value=lengths)


def _wall(inner_radius: float, outer_radius: float) -> float:
    if not 0.0 < inner_radius < outer_radius:
        raise InputError("the radii describe no wall", value=(inner_radius, outer_radius), expected="0 < inner < outer")
    return outer_radius - inner_radius


def unit_grid(divisions: tuple[int, ...], cell_type: str) -> tuple[FloatArray, IntArray]:
    """Return the nodes in the unit cube or square ``(n, d)`` and the cells ``(m, n_nodes)`` of a grid."""
    d = len(divisions)
    kinds = [name for name, cell in CELLS.items() if cell.dimension == d]
    if cell_type not in kinds:
        raise InputError("no cell of this kind fills the body", value=cell_type, expected=" or ".join(kinds))
    if min(divisions) < 1:
        raise InputError("there must be at least one division", value=divisions)
    counts = [2 * k + 1 for k in divisions]
    axes = [np.arange(count) / (count - 1) for count in counts]
    unit = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    origins = 2 * np.stack(np.meshgrid(*(np.arange(k) for k in divisions), indexing="ij"), axis=-1).reshape(-1, d)
    half_steps = np.rint(2 * CELLS[cell_type].nodes).astype(np.int32)
    if CELLS[cell_type].simplex:
        lattices = [_kuhn_lattice(half_steps, order) for order in itertools.permutations(range(d))]
    else:
        lattices = [half_steps]
    lattice = np.concatenate([origins[:, None, :] + part for part in lattices])
    cells = np.ravel_multi_index(tuple(np.moveaxis(lattice, -1, 0)), tuple(counts)).astype(np.int32)
    return unit, cells


def _kuhn_lattice(nodes: IntArray, order: tuple[int, ...]) -> IntArray:
    """Half-step coordinates of the simplex that walks from 0…0 to 1…1 along the axes in `order`, as its `nodes`."""
    corners = np.zeros((len(order) + 1, len(order)), dtype=np.int32)
    for step, axis in enumerate(order):
        corners[step + 1 :, axis] = 1
    return np.asarray(nodes @ corners[1:])


def _named_mesh(points: FloatArray, cells: IntArray, sides: dict[str, BoolArray]) -> Mesh:
    """Turn every cell right side out and name the boundary faces whose nodes all lie on a side."""
    cell = body_cell(cells)
    mirrored = determinants(jacobians(points[cells], cell)).min(axis=1) < 0.0
    cells[mirrored] = cells[mirrored][:, cell.mirrored]
    boundary = boundary_faces(cells)
    surfaces = {name: boundary[on_side[boundary].all(axis=1)] for name, on_side in sides.items()}
    return Mesh(points, cells, surfaces=surfaces)
