"""What a dimensioned drawing shows: sections of a shape, and where in them each parameter is measured."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turgor.geometry.path import Piece

FloatArray = npt.NDArray[np.float64]
Place = tuple[float, float]
Window = tuple[float, float, float, float]

AIR = "air"
"""Name of the fill of a cavity."""

OUTSIDE = "outside"
"""Name of the fill of open rooms."""


@dataclass(frozen=True)
class Distance:
    """A length between two places; its line runs beside them, on the left from `start` to `end` if `level` > 0.

    Parameters
    ----------
    name
        The parameter that the distance is.
    start, end
        Coordinates in the view, mm.
    level
        How many lines of text it is away; 0 is on the places themselves, negative is on the right.
    """

    name: str
    start: Place
    end: Place
    level: int = 0


@dataclass(frozen=True)
class Pointer:
    """A name that points at a place from the direction of `angle` in degrees, `level` lines of text away."""

    name: str
    place: Place
    angle: float
    level: float = 2.0


@dataclass(frozen=True)
class Turn:
    """An angle at a `corner` between two directions in rad, anticlockwise, drawn at a `radius` in mm."""

    name: str
    corner: Place
    start: float
    end: float
    radius: float


Mark = Distance | Pointer | Turn


@dataclass(frozen=True)
class View:
    """One picture of a drawing, in mm.

    Parameters
    ----------
    title
        What is seen.
    areas
        Pairs of a region's name, `AIR` or `OUTSIDE`, and a closed outline ``(n, 2)``, painted one over the other.
    marks
        What is measured where.
    lines
        Dash-dotted lines ``(n, 2)``: axes and what is hidden.
    fibres
        Lines ``(n, 2)`` of fibres.
    notes
        Text, such as the name of a surface → where it stands.
    window
        Lowest x, highest x, lowest y, highest y of a detail; left out, all is shown.
    """

    title: str
    areas: Sequence[tuple[str, FloatArray]]
    marks: Sequence[Mark]
    lines: Sequence[FloatArray] = ()
    fibres: Sequence[FloatArray] = ()
    notes: Mapping[str, Place] = field(default_factory=dict)
    window: Window | None = None


def rectangle(left: float, right: float, bottom: float, top: float) -> FloatArray:
    """Return the four corners of a rectangle, ``(4, 2)``."""
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def circle(radius: float, begin: float = 0.0, end: float = 2.0 * math.pi, centre: Place = (0.0, 0.0)) -> FloatArray:
    """Return points on a circle, or on its arc between two angles in rad, ``(n, 2)``."""
    angle = np.linspace(begin, end, 121)
    return np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def ring_sector(inner: float, outer: float, begin: float, end: float) -> FloatArray:
    """Return the outline of the part of a ring between two angles in rad, ``(n, 2)``."""
    return np.vstack([circle(outer, begin, end), circle(inner, begin, end)[::-1]])


def along(pieces: Iterable[Piece]) -> FloatArray:
    """Return points along lines and arcs, ``(n, 2)``; every arc is shorter than a half circle."""
    points: list[FloatArray] = []
    for piece in pieces:
        if piece.centre is None:
            points.append(np.array([piece.start, piece.end]))
            continue
        centre = np.array(piece.centre)
        (x0, y0), (x1, y1) = np.array(piece.start) - centre, np.array(piece.end) - centre
        begin, turn = math.atan2(y0, x0), math.remainder(math.atan2(y1, x1) - math.atan2(y0, x0), 2 * math.pi)
        angle = begin + turn * np.linspace(0.0, 1.0, 25)
        points.append(centre + math.hypot(x0, y0) * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.vstack(points)
