"""From the facets of an STL file to closed shells: small faults repaired with a word in the log, others refused."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.optional import require
from turgor.common.rows import row_numbers
from turgor.geometry.actuator import LARGEST, SMALLEST
from turgor.geometry.imported.crossings import crossings
from turgor.geometry.imported.stl_text import read_facets
from turgor.geometry.imported.triangles import TriangleBody, agreeing

LOG = logger("geometry")

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

StlUnit = Literal["mm", "cm", "m", "um", "inch"]
"""Unit of the numbers of an STL file, which does not say it."""

_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "inch": 25.4}

MERGED = 1e-6
"""Corners nearer to each other than this part of the body's size are one."""

SMALL_HOLE = 0.05
"""A hole is a fault of the export if it has at most four sides, or is smaller than this part of the body's size."""


class BrokenSurfaceError(InputError):
    """A surface that bounds no body; it carries the facets that are wrong, to be drawn.

    Parameters
    ----------
    error
        What is wrong.
    points, triangles
        The surface, corners ``(n, 3)`` in mm and their indices ``(k, 3)``.
    wrong
        Indices of the facets that are wrong, or that lie at the fault.
    """

    def __init__(self, error: InputError, points: Floats, triangles: Ints, wrong: Ints) -> None:
        super().__init__(error.problem, file=error.file, key=error.key, value=error.value, expected=error.expected)
        self.points, self.triangles, self.wrong = points, triangles, wrong


@dataclass(frozen=True, eq=False)
class Shell:
    """A closed part of a surface that hangs together.

    Parameters
    ----------
    triangles
        ``(k, 3)`` indices of corners, anticlockwise seen from outside what the shell encloses.
    name
        That of its solid in the file, empty if it has none.
    volume
        What the shell encloses, mm³, positive.
    """

    triangles: Ints
    name: str
    volume: float


@dataclass(frozen=True, eq=False)
class Surface:
    """A repaired surface: corners ``(n, 3)`` in mm, and its shells from the largest to the smallest."""

    points: Floats
    shells: tuple[Shell, ...]

    @functools.cached_property
    def bodies(self) -> list[list[int]]:
        """Numbers of the shells of each body, its outside first and then its cavities; the largest body first.

        A shell inside another is a cavity of it, a shell inside a cavity is another body; no two cross.
        """
        inside = np.zeros((len(self.shells),) * 2, dtype=bool)
        first = self.points[[shell.triangles[0, 0] for shell in self.shells]]
        for number, shell in enumerate(self.shells if len(self.shells) > 1 else ()):
            inside[:, number] = TriangleBody(self.points, shell.triangles).distance(first)[0] < 0.0
            inside[number, number] = False
        depth = inside.sum(axis=1)
        return [
            [int(shell), *(int(other) for other in np.flatnonzero(inside[:, shell] & (depth == depth[shell] + 1)))]
            for shell in np.flatnonzero(depth % 2 == 0)
        ]

    @functools.cached_property
    def skin(self) -> Ints:
        """All triangles ``(k, 3)``, anticlockwise seen from outside the solid: those of cavities look into them."""
        shells = [
            self.shells[number].triangles[:, [0, 1, 2] if place == 0 else [0, 2, 1]]
            for body in self.bodies
            for place, number in enumerate(body)
        ]
        return np.vstack(shells)

    @functools.cached_property
    def solid(self) -> TriangleBody:
        """The bodies together, without their cavities."""
        return TriangleBody(self.points, self.skin)

    @functools.cached_property
    def extent(self) -> tuple[float, float]:
        """Volume in mm³ and area in mm² of the bodies."""
        corners = self.points[self.skin]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        volume = float(np.einsum("ki,ki->", across, corners[:, 0] - self.points[0])) / 6.0
        return volume, 0.5 * float(np.linalg.norm(across, axis=1).sum())


def read_surface(path: str | Path, unit: StlUnit) -> Surface:
    """Read an STL file and make closed shells of it.

    Corners that nearly coincide are merged, facets that are there twice or have no area dropped, small holes filled and
    facets turned to agree with their neighbours; each repair is logged.

    Parameters
    ----------
    path
        The file.
    unit
        Of the file's numbers.

    Raises
    ------
    InputError
        If it cannot be read, has no size that an actuator can have, or is not watertight and not nearly so; of the
        kind :class:`BrokenSurfaceError` where there is something to draw.
    """
    facets = read_facets(path)
    corners = _MM[unit] * facets.corners
    try:
        _check_size(corners)
        points, triangles = _merged(corners)
        triangles, solid = _cleaned(points, triangles, facets.solid, path)
        triangles, solid = _filled(points, triangles, solid, path)
        triangles = _turned(points, triangles, path)
        shells = _shells(points, triangles, solid, facets.names)
        _check_crossings(points, triangles)
    except BrokenSurfaceError as error:
        raise BrokenSurfaceError(error.at(file=path), error.points, error.triangles, error.wrong) from error
    except InputError as error:
        raise error.at(file=path) from error
    return Surface(points, shells)


def _check_size(corners: Floats) -> None:
    flat = corners.reshape(-1, 3)
    farthest, size = float(np.abs(flat).max()), float(np.ptp(flat, axis=0).max())
    allowed = f"a body of {SMALLEST:g} mm to {LARGEST:g} mm near the origin; check the unit"
    if farthest > LARGEST:
        raise InputError(
            "coordinates this large leave single precision no digits for the shape",
            value=f"{farthest:.3g} mm",
            expected=allowed,
        )
    if size < SMALLEST:
        raise InputError("no actuator has this size", value=f"{size:.3g} mm", expected=allowed)


def _merged(corners: Floats) -> tuple[Floats, Ints]:
    """Return the points, each once, and the triangles between them."""
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    # Single precision, which STL files are written in, rounds by up to 6e-8 of a coordinate.
    reach = max(MERGED * float(np.ptp(points, axis=0).max()), 2.4e-7 * float(np.abs(points).max()))
    near = cKDTree(points).query_pairs(reach, output_type="ndarray")
    graph = coo_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(points),) * 2)
    _, group = connected_components(graph, directed=False)
    _, first = np.unique(group, return_index=True)
    return points[first], group[index.ravel()].reshape(-1, 3).astype(np.int64)


def _cleaned(points: Floats, triangles: Ints, solid: NDArray[np.integer], path: str | Path) -> tuple[Ints, Ints]:
    """Drop facets without area and those that are there more than once; refuse edges of more than two facets."""
    ordered = np.sort(triangles, axis=1)
    flat = (ordered[:, 0] == ordered[:, 1]) | (ordered[:, 1] == ordered[:, 2])
    _, first, same = np.unique(row_numbers(ordered), return_index=True, return_inverse=True)
    if (solid != solid[first[same]]).any():
        raise InputError("two solids of the file share a wall", expected="bodies apart from each other, or a STEP file")
    once = np.isin(np.arange(len(triangles)), first)
    for count, what in ((int(flat.sum()), "without area"), (int((~once & ~flat).sum()), "that are there twice")):
        if count:
            LOG.warning("%s: %d facets %s are left out", path, count, what)
    kept = once & ~flat
    triangles = triangles[kept]
    if len(triangles) < 4:
        raise InputError("the facets enclose nothing", value=f"{len(triangles)} facets")
    edge, number = edges_of(triangles)
    crowded = np.flatnonzero(number > 2)
    if len(crowded):
        wrong = np.flatnonzero(np.isin(edge, crowded).any(axis=1))
        place = _place(points[triangles[wrong[0]]].mean(axis=0))
        error = InputError(
            f"{len(crowded)} edges belong to more than two facets, the first near {place} mm",
            expected="a surface that bounds a body; bodies that share a wall come as STEP",
        )
        raise BrokenSurfaceError(error, points, triangles, wrong)
    return triangles, np.asarray(solid[kept], np.int64)


def _filled(points: Floats, triangles: Ints, solid: Ints, path: str | Path) -> tuple[Ints, Ints]:
    """Fill small holes; refuse others."""
    edge, number = edges_of(triangles)
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)[number[edge] == 1]
    if len(sides) == 0:
        return triangles, solid
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    count, hole = _parts(sides, len(points))
    for k in range(count):
        rim = points[sides[hole == k]].reshape(-1, 3)
        width = float(np.linalg.norm(np.ptp(rim, axis=0)))
        if (hole == k).sum() > 4 and width > SMALL_HOLE * size:
            error = InputError(
                f"the surface is open: a hole {width:.3g} mm wide near {_place(rim.mean(axis=0))} mm",
                expected="a watertight surface, or holes smaller than "
                f"{SMALL_HOLE * size:.3g} mm, which are filled; an open cavity still needs the solid's rim around it",
            )
            wrong = np.flatnonzero(np.isin(triangles, sides[hole == k]).any(axis=1))
            raise BrokenSurfaceError(error, points, triangles, wrong)
    filled = _fill_with_vtk(points, triangles, size)
    new = filled[len(triangles) :]
    LOG.warning("%s: small holes are filled: %d, facets: %d", path, count, len(new))
    if (edges_of(filled)[1] != 2).any():
        raise InputError("a hole of the surface cannot be filled", expected="a watertight surface")
    touched = {int(node): int(solid[row]) for row in range(len(triangles)) for node in triangles[row]}
    return filled, np.concatenate([solid, [touched[int(row[0])] for row in new]]).astype(np.int64)


def _fill_with_vtk(points: Floats, triangles: Ints, size: float) -> Ints:
    """Return the triangles followed by those that close all holes."""
    surface = require("pyvista", "repairing a surface").PolyData.from_regular_faces(points, triangles)
    whole = surface.fill_holes(2.0 * size)
    filled: Ints = np.asarray(whole.regular_faces, dtype=np.int64)
    return np.vstack([triangles, filled[len(triangles) :]])


def _turned(points: Floats, triangles: Ints, path: str | Path) -> Ints:
    """Turn the facets of each shell to agree with each other."""
    found = agreeing(points, triangles)
    start = np.stack([found, np.roll(found, -1, axis=1)], axis=2).reshape(-1, 2)
    if len(np.unique(row_numbers(start))) < len(start):
        raise InputError(
            "the surface has only one side, as a Möbius strip has", expected="a surface that bounds a body"
        )
    flipped = int((_sense(found) != _sense(triangles)).sum())
    if flipped:
        LOG.warning("%s: %d facets are turned to agree with their neighbours", path, min(flipped, len(found) - flipped))
    return found


def _sense(triangles: Ints) -> NDArray[np.bool_]:
    """Return whether the corners of each triangle, begun at the lowest, ascend."""
    start = np.argmin(triangles, axis=1)
    rows = np.arange(len(triangles))
    ascends: NDArray[np.bool_] = triangles[rows, (start + 1) % 3] < triangles[rows, (start + 2) % 3]
    return ascends


def _shells(points: Floats, triangles: Ints, solid: Ints, names: tuple[str, ...]) -> tuple[Shell, ...]:
    """Return the closed shells from the largest to the smallest, each turned outward."""
    edge, _ = edges_of(triangles)
    owner = np.arange(len(triangles)).repeat(3)
    order = np.argsort(edge.ravel(), kind="stable")
    pairs = owner[order].reshape(-1, 2)
    count, part = _parts(pairs, len(triangles), of_nodes=True)
    shells = []
    for k in range(count):
        own = triangles[part == k]
        volume = float(np.linalg.det(points[own] - points[own[0, 0]]).sum()) / 6.0
        if abs(volume) < 1e-9 * float(np.ptp(points, axis=0).max()) ** 3:
            raise InputError("a shell of the surface encloses no volume", value=_place(points[own[0, 0]]))
        name = names[int(solid[part == k][0])]
        shells.append(Shell(own if volume > 0.0 else own[:, [0, 2, 1]], name, abs(volume)))
    return tuple(sorted(shells, key=lambda shell: shell.volume, reverse=True))


def _check_crossings(points: Floats, triangles: Ints) -> None:
    pairs, places = crossings(points, triangles)
    if len(pairs):
        where = f"{len(pairs)} pairs of facets cross, the first near {_place(places[0])} mm"
        expected = "a surface that bounds a body; unite its parts where they were drawn"
        error = InputError(f"the surface passes through itself: {where}", expected=expected)
        raise BrokenSurfaceError(error, points, triangles, np.unique(pairs))


def edges_of(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the number of the edge along each side of the triangles ``(k, 3)``, and how many triangles each has."""
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edge, number = np.unique(row_numbers(sides), return_inverse=True, return_counts=True)
    return edge.reshape(-1, 3).astype(np.int64), number.astype(np.int64)


def _parts(pairs: Ints, count: int, of_nodes: bool = False) -> tuple[int, Ints]:
    """Return the number of parts that the `pairs` join, and the part of each pair, or of each of the `count` nodes."""
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    part = part if of_nodes else part[pairs[:, 0]]
    values, index = np.unique(part, return_inverse=True)
    return len(values), index.ravel().astype(np.int64)


def _place(point: Floats) -> list[float]:
    return [round(float(x), 3) for x in point]
