"""Measures along a slender body: the centreline with its curvature and torsion, and the coil that it makes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.interpolate import make_lsq_spline

from turgor.common.errors import InputError
from turgor.common.names import Name
from turgor.mesh.mesh import Mesh, in_space
from turgor.results.material_line import along_marker, between_opposite, section_centroids
from turgor.results.measures.registry import curve, measure
from turgor.results.stored import StoredState
from turgor.results.symmetry import MOUNT, TIP_FACE, symmetry_of

FloatArray = npt.NDArray[np.float64]

Stations = Annotated[int, Field(strict=True, ge=7, le=1000)]
By = Literal["sections", "marker", "opposite"]
Vector = tuple[float, float, float]

_DEGREE, _STATIONS_PER_PIECE, _FEWEST_PIECES = 5, 4, 2
"""Of the spline along the stations. Torsion takes its third derivative, and pieces of several stations leave out what
the elements add to a line from one to the next. A single polynomial cannot follow an arc of much more than 180°."""

STRAIGHT = 1e-3
"""A line that leaves its chord by no more than this part of its length is no coil."""

_Y: Vector = (0.0, 1.0, 0.0)


@curve(
    "s_mm", "x_mm", "y_mm", "z_mm", "curvature_per_mm", "torsion_per_mm",
    surfaces=(MOUNT, TIP_FACE), models=("space", "plane"),
)  # fmt: skip
def centreline(
    state: StoredState, *, stations: Stations = 20, by: By = "sections", across: Vector = _Y, name: Name | None = None
) -> FloatArray:
    """Arc length from the first station, place, curvature κ and torsion τ of each station, mm and 1/mm.

    By ``sections`` a station is the centroid of a cross-section, by ``marker`` a point of the marker ``centreline``, by
    ``opposite`` the mean of the two points on the outside that are opposite along `across` (as Geer 2019 finds the axis
    of a tube). They lie at equal distances at rest. κ = |r′×r″|/|r′|³ and τ = (r′×r″)·r‴/|r′×r″|² are those of the
    spline of degree 5 that fits the stations best; τ is positive where it winds to the right, 0 on a straight line.
    """
    del name
    places = _line(state, stations, by, across)
    return np.column_stack([_lengths(places), places, *_bends(places)])


@measure(
    "coil_{name}_radius_mm", "coil_{name}_pitch_mm", "coil_{name}_turns",
    surfaces=(MOUNT, TIP_FACE), models=("space",),
)  # fmt: skip
def coil(
    state: StoredState, *, stations: Stations = 20, by: By = "sections", across: Vector = _Y, name: Name | None = None
) -> FloatArray:
    """Radius in mm, pitch in mm and number of turns of the helix that fits the centreline best.

    The axis is the direction in which the second differences of the stations are least, the radius that of the circle
    through their projections (Kåsa 1976), the pitch the slope of height over turns, positive where the coil winds to
    the right. A line that is straight has no radius and no pitch: they are not numbers.
    """
    del name
    return np.array(_helix(_line(state, stations, by, across)))


def _line(state: StoredState, stations: int, by: By, across: Vector) -> FloatArray:
    """Return the places of the stations now, ``(stations, 3)``, mm."""
    places = np.asarray(_shares(state.mesh, stations, by, across) @ state.positions)
    # A marker is a line of its own; centroids and means of opposite points are those of the whole.
    return in_space(places if by == "marker" else symmetry_of(state.mesh).middle(places))


@lru_cache(maxsize=8)
def _shares(mesh: Mesh, stations: int, by: By, across: Vector) -> Any:
    """Return the nodes' shares in the stations; a mesh does not change, so that all its states have the same."""
    if by == "sections":
        return section_centroids(mesh, stations)
    if by == "marker":
        return along_marker(mesh, stations)
    if not math.hypot(*across) > 0.0:
        raise InputError("this direction has length 0", key="across", expected="three numbers that are not all 0")
    return between_opposite(mesh, stations, np.array(across))


def _lengths(places: FloatArray) -> FloatArray:
    """Return the arc length from the first station to each, mm."""
    spline, at = _fitted(places)
    nodes, weights = np.polynomial.legendre.leggauss(_DEGREE)
    middles = 0.5 * (at[1:] + at[:-1])[:, None] + 0.5 * np.diff(at)[:, None] * nodes
    speeds = np.linalg.norm(spline.derivative(1)(middles), axis=2)
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(at) * (speeds @ weights))])


def _fitted(places: FloatArray) -> tuple[Any, FloatArray]:
    """Return the spline that fits places best in the mean square, over their chord length, and these lengths."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    pieces = max(_FEWEST_PIECES, len(places) // _STATIONS_PER_PIECE)
    ends = np.interp(np.linspace(0.0, len(places) - 1.0, pieces + 1), np.arange(len(places)), at)
    knots = np.concatenate([np.full(_DEGREE, at[0]), ends, np.full(_DEGREE, at[-1])])
    return make_lsq_spline(at, places, knots, k=_DEGREE), at


def _bends(places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return curvature and torsion at each station, each ``(stations,)``, 1/mm."""
    spline, at = _fitted(places)
    first, second, third = (spline.derivative(order)(at) for order in (1, 2, 3))
    binormal = np.cross(first, second)
    size = np.linalg.norm(binormal, axis=1)
    curvature = size / np.linalg.norm(first, axis=1) ** 3
    curved = curvature * at[-1] > STRAIGHT
    torsion = np.zeros(len(places))
    torsion[curved] = np.einsum("ki,ki->k", binormal, third)[curved] / size[curved] ** 2
    return curvature, torsion


def _helix(places: FloatArray) -> tuple[float, float, float]:
    """Return radius, pitch and turns of the helix that fits places ``(k, 3)``."""
    chord = places[-1] - places[0]
    away = places - places[0] - np.outer((places - places[0]) @ chord / (chord @ chord), chord)
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    if np.linalg.norm(away, axis=1).max() <= STRAIGHT * length:
        return math.nan, math.nan, 0.0
    _, _, directions = np.linalg.svd(np.diff(places, n=2, axis=0))
    x, y, axis = directions * np.linalg.det(directions)
    u, v, height = (places @ direction for direction in (x, y, axis))
    # The circle u² + v² = 2 a u + 2 b v + c by linear least squares.
    a, b, c = np.linalg.lstsq(np.column_stack([2 * u, 2 * v, np.ones_like(u)]), u**2 + v**2, rcond=None)[0]
    turns = np.unwrap(np.arctan2(v - b, u - a)) / (2.0 * math.pi)
    pitch = np.polyfit(turns, height, 1)[0]
    return float(math.sqrt(c + a**2 + b**2)), float(pitch), float(abs(turns[-1] - turns[0]))
