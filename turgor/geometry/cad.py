"""The gmsh session and the few questions that templates ask of the drawing: which face is which."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from turgor.common.errors import InputError
from turgor.common.optional import require

AXES = {"x": 0, "y": 1, "z": 2}


def kernel() -> ModuleType:
    """Return gmsh, loaded when first needed; raise MissingPackageError if a system library is absent."""
    return require("gmsh", "drawing and meshing")


def occ() -> Any:
    """Return the OpenCASCADE part of gmsh, with which templates draw into the current model."""
    return kernel().model.occ


@contextlib.contextmanager
def session(name: str) -> Iterator[ModuleType]:
    """Open gmsh with an empty model, quiet, on one thread and with fixed seeds; always close it.

    Raises
    ------
    InputError
        If a gmsh session is already open in this process (its options would leak into the mesh).
    """
    gmsh = kernel()
    if gmsh.isInitialized():
        raise InputError("a gmsh session is already open in this process", expected="gmsh.finalize() before meshing")
    # gmsh's own handler of the interrupt signal would take it away from the program that called us.
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        gmsh.model.add(name)
        yield gmsh
    finally:
        gmsh.finalize()


def prism(corners: Sequence[tuple[float, float, float]], extent: tuple[float, float, float]) -> int:
    """Draw the polygon of the `corners`, sweep it along `extent` and return the volume's tag."""
    draw = occ()
    points = [draw.addPoint(*corner) for corner in corners]
    edges = [draw.addLine(start, end) for start, end in zip(points, points[1:] + points[:1], strict=True)]
    face = draw.addPlaneSurface([draw.addCurveLoop(edges)])
    swept = draw.extrude([(2, face)], *extent)
    draw.remove([(2, face)])
    return next(int(tag) for dimension, tag in swept if dimension == 3)


def boundary(volumes: Collection[int]) -> list[int]:
    """Return the faces on the outside of the `volumes` together, in ascending order of their tags."""
    pairs = [(3, volume) for volume in volumes]
    return sorted({abs(tag) for _, tag in kernel().model.getBoundary(pairs, combined=True, oriented=False)})


def faces_in_plane(faces: Collection[int], axis: str, value: float) -> list[int]:
    """Return the `faces` that lie in the plane where the coordinate along `axis` has the given `value`."""
    return faces_where(faces, lambda low, high: _close(low, high, AXES[axis], value))


def faces_where(faces: Collection[int], test: Callable[[Any, Any], bool]) -> list[int]:
    """Return the `faces` whose bounding box (lowest corner, highest corner) passes the `test`."""
    return [face for face in faces if test(*bounds(2, face))]


def bounds(dimension: int, tag: int) -> tuple[Any, Any]:
    """Return the lowest and the highest corner of an entity's bounding box, each of shape ``(3,)``."""
    box = np.array(kernel().model.getBoundingBox(dimension, tag))
    return box[:3], box[3:]


def skins(faces: Collection[int]) -> list[list[int]]:
    """Group `faces` into sets that hang together by their edges, the one of the largest extent first.

    Of a solid's boundary the first set is the outside and every further one is a closed cavity; where symmetry planes
    cut the solid, leave their faces out and the same holds.
    """
    edges = {face: _edges(face) for face in faces}
    groups: list[list[int]] = []
    left = sorted(faces)
    while left:
        group = [left.pop(0)]
        front = set(edges[group[0]])
        while joined := [face for face in left if edges[face] & front]:
            group += joined
            front |= set().union(*(edges[face] for face in joined))
            left = [face for face in left if face not in joined]
        groups.append(sorted(group))
    return sorted(groups, key=_extent, reverse=True)


def embed_point(point: tuple[float, float, float], face: int) -> None:
    """Make the mesh of a `face` have a node at `point`, which must lie on it."""
    gmsh = kernel()
    tag = gmsh.model.occ.addPoint(*point)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.embed(0, [tag], 2, face)


def _edges(face: int) -> set[int]:
    return {abs(tag) for _, tag in kernel().model.getBoundary([(2, face)], oriented=False)}


def _extent(faces: list[int]) -> float:
    corners = [bounds(2, face) for face in faces]
    low = np.min([corner[0] for corner in corners], axis=0)
    high = np.max([corner[1] for corner in corners], axis=0)
    return float(np.linalg.norm(high - low))


def _close(low: Any, high: Any, axis: int, value: float) -> bool:
    # OpenCASCADE pads its boxes by about 1e-7.
    tolerance = 1e-5 * max(1.0, abs(value))
    return bool(abs(low[axis] - value) < tolerance and abs(high[axis] - value) < tolerance)
