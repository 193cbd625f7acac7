"""Where a point lies in a mesh of curved cells: its host cell and its reference coordinates there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from turgor.common.errors import InputError
from turgor.mesh.cells import Cell, body_cell

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

OUTSIDE = 0.05
"""A point outside its cell by no more than this in reference coordinates counts as inside: a curve given by points on a
curved wall runs straight between them, and the wall itself is made of quadratic faces."""

BULGE = 0.25
"""A curved cell reaches beyond the bounding box of its nodes by less than this part of it."""

ITERATIONS = 25


def locate(points: Floats, cells: Ints, places: Floats, name: str) -> tuple[Ints, Floats]:
    """Find the cell that each place lies in.

    The candidates are the cells whose widened bounding box holds the place; in each, Newton's method inverts the
    quadratic map. Of several hosts the one in which the place lies deepest is taken.

    Parameters
    ----------
    points, cells
        The mesh: positions ``(n_points, d)`` and the body's cells ``(m, n_nodes)``.
    places
        Where to look, ``(k, d)``, mm.
    name
        What the places belong to, for the message.

    Returns
    -------
    cell, local
        The host cells ``(k,)`` and the reference coordinates in them ``(k, d)``.

    Raises
    ------
    InputError
        If a place lies outside every cell.
    """
    place, cell = _candidates(points[cells], places)
    kind = body_cell(cells)
    local, found = _inverted(kind, points[cells[cell]], places[place])
    beyond = 1.0 - (local.sum(axis=1) if kind.simplex else local.max(axis=1))
    depth = np.minimum(local.min(axis=1), beyond)
    depth[~found] = -np.inf
    # The deepest candidate of each place comes last in this order; ties go to the first cell.
    order = np.lexsort((-cell, depth, place))
    last = order[np.flatnonzero(np.diff(place[order], append=len(places)))]
    inside = np.zeros(len(places), bool)
    inside[place[last]] = depth[last] >= -OUTSIDE
    if not inside.all():
        where = ", ".join(f"{x:.4g}" for x in places[np.argmin(inside)])
        raise InputError(
            f"the curve leaves the body at ({where}) mm",
            key=name,
            expected="a curve all of whose points lie inside the mesh",
        )
    return cell[last].astype(np.int32), local[last]


def _candidates(nodes: Floats, places: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of place and cell whose boxes, a little widened, hold the place; pairs ascend by place."""
    low, high = nodes.min(axis=1), nodes.max(axis=1)
    centre, half = 0.5 * (low + high), (0.5 + BULGE) * (high - low)
    near = cKDTree(centre).query_ball_point(places, np.linalg.norm(half, axis=1).max(), return_sorted=True)
    count = np.array([len(cells) for cells in near], np.intp)
    place = np.repeat(np.arange(len(places)), count)
    cell = np.concatenate([np.asarray(cells, np.intp) for cells in near])
    holds = (np.abs(places[place] - centre[cell]) <= half[cell]).all(axis=1)
    return place[holds], cell[holds]


def _inverted(cell: Cell, nodes: Floats, places: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Invert the map of each cell with `nodes` ``(p, n_nodes, d)`` at its place; say where that succeeded."""
    local = np.tile(cell.nodes.mean(axis=0), (len(places), 1))
    size = np.ptp(nodes, axis=1).max(axis=1)
    found = np.zeros(len(places), bool)
    for _ in range(ITERATIONS):
        gap = places - np.einsum("pa,pai->pi", cell.shape(local), nodes)
        found = np.linalg.norm(gap, axis=1) <= 1e-10 * size
        if found.all():
            break
        jacobian = np.einsum("pai,paj->pij", nodes, cell.gradient(local))
        # Far outside the element its map may fold; such a place is no candidate, so keep the iterate near.
        folded = np.abs(np.linalg.det(jacobian)) < 1e-9 * size**cell.dimension
        jacobian[folded] = np.eye(cell.dimension) * size[folded, None, None]
        local = np.clip(local + np.linalg.solve(jacobian, gap[:, :, None])[:, :, 0], -1.0, 2.0)
    return local, found
