"""Measures: numbers that describe a stored state, each one function of the mesh and the displacement.

A measure registers itself with :func:`measure`; by its name it can be asked for in a case file, and its keys, which end
in their unit, are columns of ``history.csv`` and entries of ``summary.json``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.units import from_internal
from turgor.mesh.cells import face_fluxes
from turgor.mesh.mesh import Mesh
from turgor.results.sections import CENTRELINE, MOUNT, TIP_FACE, motion, seen_from_mount

FloatArray = npt.NDArray[np.float64]
Function = Callable[[Mesh, FloatArray], float | FloatArray]

_UNITS = {"deg": ("angle", "deg"), "mm": ("length", "mm")}


@dataclass(frozen=True)
class Measure:
    """A registered measure.

    Parameters
    ----------
    name
        As a case file says it.
    keys
        Keys of its one or more numbers, each ending in its unit.
    surfaces, markers
        What the mesh must have.
    function
        ``(mesh, displacement (n, 3)) → number or array``, in mm and rad.
    """

    name: str
    keys: tuple[str, ...]
    surfaces: tuple[str, ...]
    markers: tuple[str, ...]
    function: Function

    def missing(self, mesh: Mesh) -> list[str]:
        """Return what the measure needs and the mesh lacks."""
        surfaces = [f"surface '{name}'" for name in self.surfaces if name not in mesh.surfaces]
        return surfaces + [f"marker '{name}'" for name in self.markers if name not in mesh.markers]

    def values(self, mesh: Mesh, displacement: FloatArray) -> dict[str, float]:
        """Return key → number in the unit that the key ends in."""
        numbers = np.atleast_1d(self.function(mesh, displacement))
        pairs = zip(self.keys, numbers, strict=True)
        return {key: from_internal(float(number), *_UNITS[key.rsplit("_", 1)[1]]) for key, number in pairs}


MEASURES: dict[str, Measure] = {}
"""Every registered measure by its name."""


def measure(
    *keys: str, surfaces: tuple[str, ...] = (), markers: tuple[str, ...] = ()
) -> Callable[[Function], Function]:
    """Register the decorated function as the measure of its own name."""

    def register(function: Function) -> Function:
        name = function.__name__
        MEASURES[name] = Measure(name, keys, surfaces, markers, function)
        return function

    return register


def available(mesh: Mesh) -> tuple[str, ...]:
    """Return the names of the measures that the mesh has the surfaces and markers for."""
    return tuple(name for name, entry in MEASURES.items() if not entry.missing(mesh))


def check(names: Iterable[str], mesh: Mesh) -> None:
    """Raise InputError if a name is unknown or the mesh lacks what that measure needs."""
    for name in names:
        if name not in MEASURES:
            raise InputError("there is no such measure", key="measures", value=name, expected=_one_of(MEASURES))
        missing = MEASURES[name].missing(mesh)
        if missing:
            there = f"surfaces {_listed(mesh.surfaces)}; markers {_listed(mesh.markers)}"
            raise InputError(
                f"the measure '{name}' needs the {' and the '.join(missing)}, and the mesh has {there}",
                key="measures",
                expected=_one_of(available(mesh)),
            )


def evaluate(names: Iterable[str], mesh: Mesh, displacement: FloatArray) -> dict[str, float]:
    """Return the numbers of the named measures, key → value in the unit that the key ends in.

    Parameters
    ----------
    names
        Keys of :data:`MEASURES`.
    mesh
        The mesh in its reference state.
    displacement
        Shape ``(n, 3)``, mm.

    Raises
    ------
    InputError
        If a name is unknown or the mesh lacks what that measure needs.
    """
    chosen = tuple(names)
    check(chosen, mesh)
    values: dict[str, float] = {}
    for name in chosen:
        values |= MEASURES[name].values(mesh, displacement)
    return values


@measure("bending_angle_deg", surfaces=(MOUNT, TIP_FACE))
def bending_angle(mesh: Mesh, displacement: FloatArray) -> float:
    """Angle in rad by which the tip face has turned against the mount; it counts on beyond 180°."""
    return motion(mesh, displacement).bending


@measure("twist_deg", surfaces=(MOUNT, TIP_FACE))
def twist(mesh: Mesh, displacement: FloatArray) -> float:
    """Rotation of the tip face about the body's axis in rad, right-handed from mount to tip, free of bending."""
    return motion(mesh, displacement).twist


@measure("chord_angle_deg", surfaces=(MOUNT, TIP_FACE))
def chord_angle(mesh: Mesh, displacement: FloatArray) -> float:
    """Angle in rad, 0 to π, between the lines from the mount's centre to the tip face's before and after.

    The mount's own rotation does not count. A straight body bent to a circular arc of angle θ has a chord angle of θ/2.
    """
    mount, tip = mesh.surface_nodes(MOUNT), mesh.surface_nodes(TIP_FACE)
    before = mesh.points[tip].mean(axis=0) - mesh.points[mount].mean(axis=0)
    moved = before + displacement[tip].mean(axis=0) - displacement[mount].mean(axis=0)
    after = seen_from_mount(mesh, displacement, moved)
    return math.atan2(float(np.linalg.norm(np.cross(before, after))), float(before @ after))


@measure("tip_displacement_x_mm", "tip_displacement_y_mm", "tip_displacement_z_mm", markers=("tip",))
def tip_displacement(mesh: Mesh, displacement: FloatArray) -> FloatArray:
    """Displacement of the marker ``tip`` (the mean over its nodes), shape ``(3,)``, mm."""
    return np.asarray(displacement[mesh.marker("tip")].mean(axis=0))


@measure("elongation_mm", surfaces=(MOUNT, TIP_FACE))
def elongation(mesh: Mesh, displacement: FloatArray) -> float:
    """Change in mm of the length of the line through the centres of the body's cross-sections, mount to tip."""
    return motion(mesh, displacement).elongation


def centreline(mesh: Mesh, displacement: FloatArray) -> FloatArray:
    """Return the displaced stations of the marker ``centreline`` in order, shape ``(j, 3)``, mm."""
    nodes = mesh.marker(CENTRELINE)
    return np.asarray(mesh.points[nodes] + displacement[nodes])


def cavity_volume(mesh: Mesh, displacement: FloatArray, cavity: str) -> float:
    """Return the volume in mm³ (in the plane: area in mm²) that the surface `cavity` encloses, ``−⅓ ∫ x·n dA``.

    The surface must be closed, or closed by coordinate planes (see :meth:`Mesh.enclosed_volume`).
    """
    triangles = mesh.surface(cavity)
    flux, _ = face_fluxes(mesh.points[triangles] + displacement[triangles])
    return -float(flux.sum()) / mesh.dimension


def max_displacement(displacement: FloatArray) -> float:
    """Return the largest length of a nodal displacement ``(n, 3)``, mm."""
    return float(np.linalg.norm(displacement, axis=1).max())


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _one_of(names: Iterable[str]) -> str:
    listed = ", ".join(names)
    return f"one of: {listed}" if listed else "no measure: this mesh has the surfaces and markers of none"
