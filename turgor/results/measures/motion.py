"""Measures of how a body moves as a whole: angles, lengths, tip, extents, enclosed volume."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.mesh import in_space
from turgor.results.measures.registry import measure
from turgor.results.sections import motion, seen_from_mount
from turgor.results.stored import StoredState
from turgor.results.symmetry import MOUNT, TIP_FACE, surface_middle

FloatArray = npt.NDArray[np.float64]

_AXES = "xyz"


@measure("bending_angle_deg", surfaces=(MOUNT, TIP_FACE), models=("space", "plane"), by_default=True)
def bending_angle(state: StoredState) -> float:
    """Angle in rad by which the tip face's axis has turned against the mount; in a plane it counts on beyond 180°."""
    return motion(state.mesh, state.displacement).bending


@measure("twist_deg", surfaces=(MOUNT, TIP_FACE), models=("space",), by_default=True)
def twist(state: StoredState) -> float:
    """Rotation of the tip face about the body's axis in rad, right-handed from mount to tip, free of bending."""
    return motion(state.mesh, state.displacement).twist


@measure("chord_angle_deg", surfaces=(MOUNT, TIP_FACE), models=("space", "plane"), by_default=True)
def chord_angle(state: StoredState, *, base: str | None = None, tip: str | None = None) -> float:
    """Angle in rad, 0 to π, between the lines from the base to the tip before and after.

    The base is the middle of the mount and the tip that of the tip face, or the markers that are named. The mount's own
    rotation does not count. A straight body bent to a circular arc of angle θ has a chord angle of θ/2.
    """
    rest = _place(state, base, MOUNT), _place(state, tip, TIP_FACE)
    before = rest[1][0] - rest[0][0]
    moved = before + rest[1][1] - rest[0][1]
    after = seen_from_mount(state.mesh, state.displacement, moved)
    return math.atan2(float(np.linalg.norm(np.cross(before, after))), float(before @ after))


@measure("elongation_mm", surfaces=(MOUNT, TIP_FACE), by_default=True)
def elongation(state: StoredState) -> float:
    """Change in mm of the length of the line through the centres of the body's cross-sections, mount to tip.

    Of a body of revolution it is the change of the distance between mount and tip face along the axis, each the mean
    over its area.
    """
    if state.body.kind != "axisymmetric":
        return motion(state.mesh, state.displacement).elongation
    at_rest, moved = (
        [surface_middle(state.mesh, name, displacement, state.body.mechanics)[1] for name in (MOUNT, TIP_FACE)]
        for displacement in (None, state.displacement)
    )
    return float(abs(moved[1] - moved[0]) - abs(at_rest[1] - at_rest[0]))


@measure(*(f"tip_displacement_{axis}_mm" for axis in _AXES), markers=("tip",), by_default=True)
def tip_displacement(state: StoredState) -> FloatArray:
    """Displacement of the marker ``tip`` (the mean over its nodes), shape ``(3,)``, mm."""
    return in_space(state.displacement[state.mesh.marker("tip")].mean(axis=0))


@measure(*(f"tip_position_{axis}_mm" for axis in _AXES), markers=("tip",))
def tip_position(state: StoredState) -> FloatArray:
    """Where the marker ``tip`` is, shape ``(3,)``, mm."""
    return in_space(state.positions[state.mesh.marker("tip")].mean(axis=0))


@measure("expansion_{axis}_percent")
def expansion(state: StoredState, *, axis: Literal["x", "y", "z"]) -> float:
    """Growth of the whole body's extent along an axis, in percent of what it is at rest.

    Of a body of revolution ``x`` is the radius and ``y`` the axis.
    """
    number = _AXES.index(axis)
    if number >= state.mesh.dimension:
        raise InputError("a plane model has no such extent", key="axis", value=axis, expected="x or y")
    before, after = (float(np.ptp(places[:, number])) for places in (state.mesh.points, state.positions))
    if state.body.kind == "axisymmetric" and axis == "x":
        before, after = (float(places[:, 0].max()) for places in (state.mesh.points, state.positions))
    return 100.0 * (after / before - 1.0)


@measure("enclosed_volume_{surface}_mm3")
def enclosed_volume(state: StoredState, *, surface: str) -> float:
    """Volume in mm³ that a closed surface encloses, that of the slice or of the full turn; planes may close it."""
    return state.body.enclosed_volume(surface, state.displacement)


def max_displacement(displacement: FloatArray) -> float:
    """Return the largest length of a nodal displacement ``(n, d)``, mm."""
    return float(np.linalg.norm(displacement, axis=1).max())


def _place(state: StoredState, marker: str | None, surface: str) -> tuple[FloatArray, FloatArray]:
    """Return the mean place at rest and displacement, each ``(3,)``, of a marker or, without one, a surface."""
    if marker is None:
        at_rest = surface_middle(state.mesh, surface)
        return in_space(at_rest), in_space(surface_middle(state.mesh, surface, state.displacement) - at_rest)
    nodes = state.mesh.marker(marker)
    return in_space(state.mesh.points[nodes].mean(axis=0)), in_space(state.displacement[nodes].mean(axis=0))
