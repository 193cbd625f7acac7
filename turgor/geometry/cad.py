"""The gmsh session and the few questions that templates ask of the drawing: which face is which."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from turgor.common.errors import InputError
from turgor.common.optional import require
from turgor.geometry.path import Piece

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
    _take_back_termination()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        gmsh.model.add(name)
        yield gmsh
    finally:
        gmsh.finalize()


def _take_back_termination() -> None:
    """Give the program that called us its handler of SIGTERM back, which gmsh takes away without asking."""
    handler = signal.getsignal(signal.SIGTERM)
    if handler is not None and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, handler)


def prism(corners: Sequence[tuple[float, float, float]], extent: tuple[float, float, float]) -> int:
    """Draw the polygon of the `corners`, sweep it along `extent` and return the volume's tag."""
    draw = occ()
    points = [draw.addPoint(*corner) for corner in corners]
    edges = [draw.addLine(start, end) for start, end in zip(points, points[1:] + points[:1], strict=True)]
    return sweep(int(draw.addPlaneSurface([draw.addCurveLoop(edges)])), extent)


def cylinder(low: float, high: float, radius: float, turn: float = 2.0 * math.pi) -> tuple[int, int]:
    """Draw a cylinder around z between two heights, of a part of a `turn` from x to y; return (dimension, tag)."""
    return 3, int(occ().addCylinder(0, 0, low, 0, 0, high - low, radius, angle=turn))


def plane_face(*outlines: Sequence[Piece]) -> int:
    """Draw a face in the plane y = 0, coordinates (x, z), and return its tag.

    The first outline is the outside, the others are holes. Each is closed, its pieces follow each other, and a piece
    shorter than 1e-9 mm is left out.
    """
    draw = occ()
    return int(draw.addPlaneSurface([draw.addCurveLoop(_edges_along(outline)) for outline in outlines]))


def _edges_along(outline: Sequence[Piece]) -> list[int]:
    draw = occ()
    pieces = [piece for piece in outline if math.dist(piece.start, piece.end) > 1e-9]
    corners = [draw.addPoint(piece.start[0], 0.0, piece.start[1]) for piece in pieces]
    edges = []
    for piece, start, end in zip(pieces, corners, corners[1:] + corners[:1], strict=True):
        if piece.centre is None:
            edges.append(draw.addLine(start, end))
        else:
            centre = draw.addPoint(piece.centre[0], 0.0, piece.centre[1])
            edges.append(draw.addCircleArc(start, centre, end))
            draw.remove([(0, centre)])
    return edges


def sweep(face: int, extent: tuple[float, float, float]) -> int:
    """Sweep a face along `extent`, which it is used up by, and return the volume's tag."""
    draw = occ()
    swept = draw.extrude([(2, face)], *extent)
    draw.remove([(2, face)])
    return next(int(tag) for dimension, tag in swept if dimension == 3)


def boundary(volumes: Collection[int], dimension: int = 3) -> list[int]:
    """Return the faces on the outside of the `volumes` together, in ascending order of their tags.

    With `dimension` 2 this function and the next ones speak of edges on the outside of faces.
    """
    pairs = [(dimension, volume) for volume in volumes]
    return sorted({abs(tag) for _, tag in kernel().model.getBoundary(pairs, combined=True, oriented=False)})


def faces_in_plane(faces: Collection[int], axis: str, value: float, dimension: int = 3) -> list[int]:
    """Return the `faces` that lie in the plane where the coordinate along `axis` has the given `value`."""
    return faces_where(faces, lambda low, high: _close(low, high, AXES[axis], value), dimension)


def faces_where(faces: Collection[int], test: Callable[[Any, Any], bool], dimension: int = 3) -> list[int]:
    """Return the `faces` whose bounding box (lowest corner, highest corner) passes the `test`."""
    return [face for face in faces if test(*bounds(dimension - 1, face))]


def bounds(dimension: int, tag: int) -> tuple[Any, Any]:
    """Return the lowest and the highest corner of an entity's bounding box, each of shape ``(3,)``."""
    box = np.array(kernel().model.getBoundingBox(dimension, tag))
    return box[:3], box[3:]


def skins(faces: Collection[int], dimension: int = 3, walls: Collection[int] = ()) -> list[list[int]]:
    """Group `faces` into sets that hang together by their edges, the one of the largest extent first.

    Of a solid's boundary the first set is the outside and every further one is a closed cavity; where symmetry planes
    cut the solid, leave their faces out and the same holds. Edges in `walls` do not join.
    """
    edges = {face: sides(dimension - 1, face) - set(walls) for face in faces}
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
    return sorted(groups, key=lambda group: extent(group, dimension - 1), reverse=True)


def named_skin(
    faces: Collection[int], axis: str, length: float, cuts: Mapping[str, str], dimension: int = 3
) -> dict[str, list[int]]:
    """Name the boundary of a solid with one cavity whose end faces are the planes 0 and `length` along `axis`.

    Parameters
    ----------
    faces
        The whole boundary.
    axis, length
        Where the end faces lie.
    cuts
        Name → axis of each cut through the solid, which lies in the plane through the origin across that axis.
    dimension
        2 for the edges of a face.

    Returns
    -------
    dict
        ``mount``, ``tip-face``, ``outer``, ``cavity`` and the cuts by their names.
    """
    named_cuts = {name: faces_in_plane(faces, across, 0.0, dimension) for name, across in cuts.items()}
    cut = {face for tags in named_cuts.values() for face in tags}
    outside, cavity = skins([face for face in faces if face not in cut], dimension)
    mount, tip = (faces_in_plane(outside, axis, place, dimension) for place in (0.0, length))
    outer = [face for face in outside if face not in mount + tip]
    return {"mount": mount, "tip-face": tip, "outer": outer, "cavity": cavity, **named_cuts}


def with_points(volume: int, points: Any, dimension: int = 3) -> int:
    """Make the mesh of a `volume` have nodes at `points` ``(k, 3)`` of its skin; synchronise and return its new tag."""
    draw = occ()
    vertices = [(0, draw.addPoint(*point)) for point in points]
    _, pieces = draw.fragment([(dimension, volume)], vertices)
    draw.synchronize()
    return int(pieces[0][0][1])


def vertices(faces: Collection[int]) -> Any:
    """Return the places ``(k, 3)`` of the vertices of `faces`, each once, in ascending order of their tags."""
    model = kernel().model
    found = model.getBoundary([(2, face) for face in faces], combined=False, oriented=False, recursive=True)
    return np.array([model.getValue(0, tag, []) for tag in sorted({tag for _, tag in found})]).reshape(-1, 3)


def sides(dimension: int, tag: int) -> set[int]:
    """Return the tags of the faces of a volume, of the edges of a face or of the ends of an edge."""
    return {abs(side) for _, side in kernel().model.getBoundary([(dimension, tag)], oriented=False)}


def extent(tags: Collection[int], dimension: int = 2) -> float:
    """Return the length of the diagonal of the box around faces, mm."""
    corners = [bounds(dimension, tag) for tag in tags]
    low = np.min([corner[0] for corner in corners], axis=0)
    high = np.max([corner[1] for corner in corners], axis=0)
    return float(np.linalg.norm(high - low))


def _close(low: Any, high: Any, axis: int, value: float) -> bool:
    # OpenCASCADE pads its boxes by about 1e-7.
    tolerance = 1e-5 * max(1.0, abs(value))
    return bool(abs(low[axis] - value) < tolerance and abs(high[axis] - value) < tolerance)
