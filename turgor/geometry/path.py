"""Plane paths of straight lines and tangent arcs, offset to walls of one thickness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError

FloatArray = npt.NDArray[np.float64]

_LONGEST_ARC = math.radians(170)


@dataclass(frozen=True)
class Step:
    """Go straight for `length`, then turn left by `angle` (negative: right) on an arc of the given `radius`."""

    length: float
    angle: float = 0.0
    radius: float = 0.0


@dataclass(frozen=True)
class Piece:
    """One line (no `centre`) or arc of a path, from `start` to `end`."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] | None = None


def offset_path(start: tuple[float, float], steps: Sequence[Step], distance: float) -> list[Piece]:
    """Return the pieces of the path that runs at `distance` to the left of the one that `steps` describe.

    Parameters
    ----------
    start
        Where the described path begins; it sets out along the first axis.
    steps
        Every arc's radius must exceed the distance by which the offset path lies inside its bend.
    distance
        To the left; negative to the right.
    """
    (x, y), heading = start, 0.0
    pieces: list[Piece] = []
    for step in steps:
        left = (-math.sin(heading), math.cos(heading))
        begin = (x + distance * left[0], y + distance * left[1])
        x, y = x + step.length * math.cos(heading), y + step.length * math.sin(heading)
        corner = (x + distance * left[0], y + distance * left[1])
        if step.length > 0.0:
            pieces.append(Piece(begin, corner))
        if step.angle == 0.0:
            continue
        side = math.copysign(step.radius, step.angle)
        centre = (x + side * left[0], y + side * left[1])
        # A half circle or more does not tell by its ends which way it goes, so long arcs come in parts.
        parts = math.ceil(abs(step.angle) / _LONGEST_ARC)
        for _ in range(parts):
            heading += step.angle / parts
            left = (-math.sin(heading), math.cos(heading))
            x, y = centre[0] - side * left[0], centre[1] - side * left[1]
            end = (x + distance * left[0], y + distance * left[1])
            pieces.append(Piece(corner, end, centre))
            corner = end
    return pieces


def polygon(corners: Sequence[tuple[float, float]]) -> list[Piece]:
    """Return the closed outline through the `corners`, straight from each to the next."""
    following = [*corners[1:], corners[0]]
    return [Piece(start, end) for start, end in zip(corners, following, strict=True)]


def rounded_polygon(corners: Sequence[tuple[float, float]], inset: float, radius: float) -> list[Piece]:
    """Return the closed outline of a polygon moved inward by `inset` and rounded at every corner.

    Parameters
    ----------
    corners
        In anticlockwise order; the polygon need not be convex.
    inset
        Distance by which every edge moves inward; negative moves it outward.
    radius
        Of the arc at each corner of the moved polygon.

    Raises
    ------
    InputError
        If an edge vanishes when it is moved, or is too short for the arcs at its ends.
    """
    points = np.asarray(corners, dtype=np.float64)
    edges = np.roll(points, -1, axis=0) - points
    along = edges / np.linalg.norm(edges, axis=1)[:, None]
    before = np.roll(along, 1, axis=0)
    turn = np.arctan2(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], (before * along).sum(axis=1))
    left, left_before = _left(along), _left(before)
    # Both edges at a corner move by the inset, so the corner moves along the bisector of their normals.
    moved = points + inset * (left + left_before) / (1.0 + (left * left_before).sum(axis=1))[:, None]
    lengths = ((np.roll(moved, -1, axis=0) - moved) * along).sum(axis=1)
    if (lengths <= 0.0).any():
        raise InputError("the walls meet: no room is left between them")
    tangents = radius * np.tan(0.5 * np.abs(turn))
    if (lengths < (tangents + np.roll(tangents, -1)) * (1 + 1e-9)).any():
        raise InputError("the edges are too short for this rounding")
    starts, ends = moved - tangents[:, None] * before, moved + tangents[:, None] * along
    centres = starts + np.sign(turn)[:, None] * radius * left_before
    pieces: list[Piece] = []
    for number, (start, end, centre) in enumerate(zip(starts, ends, centres, strict=True)):
        following = starts[(number + 1) % len(starts)]
        pieces += [Piece(_pair(start), _pair(end), _pair(centre)), Piece(_pair(end), _pair(following))]
    return pieces


def _left(directions: FloatArray) -> FloatArray:
    return np.column_stack([-directions[:, 1], directions[:, 0]])


def _pair(point: FloatArray) -> tuple[float, float]:
    return float(point[0]), float(point[1])
