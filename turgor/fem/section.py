"""What a plane mesh stands for: a slice in plane strain or plane stress, or the section of a body of revolution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.geometry.section import PlaneSection
from turgor.mesh.cells import face_cell, face_frames
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class PlaneStrain:
    """A slice of a long body that keeps its thickness, mm; energies and forces are those of the slice."""

    thickness: float = 1.0


@dataclass(frozen=True)
class PlaneStress:
    """A thin sheet whose faces are free, so that it changes its `thickness`, mm, given in the reference state.

    The air in a cavity acts on the thickness at rest: normal to the edge the Cauchy stress is −p/λ₃ there, λ₃ the
    stretch across the sheet.
    """

    thickness: float = 1.0


@dataclass(frozen=True)
class Axisymmetric:
    """A body of revolution about the y axis, x the radius; energies, volumes and forces are those of the full turn."""


Section = PlaneStrain | PlaneStress | Axisymmetric

ON_AXIS = 1e-9
"""A node lies on the axis of revolution if its distance is no more than this part of the body's size."""


def section_of(plane: PlaneSection | None) -> Section | None:
    """Return what the mechanics make of a plane drawing; None for a body in space."""
    if plane is None:
        return None
    if plane.kind == "axisymmetric":
        return Axisymmetric()
    kind = PlaneStrain if plane.kind == "plane-strain" else PlaneStress
    return kind() if plane.thickness is None else kind(plane.thickness)


def depth(section: Section | None, places: Floats) -> Floats:
    """Return what an area of the section at `places` ``(..., d)`` is multiplied by to give a volume, ``(...)``.

    The thickness in mm, the circumference in mm, or 1 for a body in space (no section).
    """
    if section is None:
        return np.ones(places.shape[:-1])
    if isinstance(section, Axisymmetric):
        return np.asarray(2.0 * math.pi * places[..., 0])
    return np.full(places.shape[:-1], section.thickness)


def surface_areas(points: Floats, faces: Ints, section: Section | None) -> tuple[Floats, Floats]:
    """Return the unit normals ``(k, q, d)`` of faces and the areas ``(k, q)`` at their quadrature points, mm²."""
    places, normals = face_frames(points[faces])
    length = np.linalg.norm(normals, axis=2)
    return normals / length[:, :, None], length * face_cell(faces).weights * depth(section, places)


def on_axis(mesh: Mesh, section: Section | None) -> Ints:
    """Return the nodes on the axis of revolution, which cannot leave it."""
    if not isinstance(section, Axisymmetric):
        return np.empty(0, np.int32)
    near = np.abs(mesh.points[:, 0]) <= ON_AXIS * np.ptp(mesh.points, axis=0).max()
    return np.flatnonzero(near).astype(np.int32)


def check_section(mesh: Mesh, section: Section | None) -> None:
    """Refuse a section that does not fit the mesh.

    Raises
    ------
    InputError
        If a plane mesh has no section, a mesh in space has one, a thickness is not positive, or a body of revolution
        reaches across its axis.
    """
    if (section is None) != (mesh.dimension == 3):
        raise InputError(
            f"a mesh of {mesh.cell_type} " + ("has no section" if mesh.dimension == 3 else "needs a section"),
            key="section",
            expected="plane strain, plane stress or axisymmetric for a plane mesh, nothing for one in space",
        )
    if isinstance(section, (PlaneStrain, PlaneStress)):
        if not (math.isfinite(section.thickness) and section.thickness > 0.0):
            raise InputError("the thickness must be positive", key="section.thickness", value=section.thickness)
    elif section is not None and mesh.points[:, 0].min() < -ON_AXIS * np.ptp(mesh.points, axis=0).max():
        raise InputError(
            "the section reaches across the axis of revolution",
            key="section",
            value=f"x = {mesh.points[:, 0].min():.4g} mm",
            expected="a section on the side x ≥ 0 of the y axis",
        )


def in_section(vector: tuple[float, ...], mesh: Mesh, section: Section | None, key: str, total: bool) -> Floats:
    """Return the components ``(d,)`` of a load's vector that have a meaning in the model.

    Parameters
    ----------
    vector
        As the user gave it.
    mesh, section
        The model.
    key
        Name of the load, for the message.
    total
        Whether it is one vector for the whole body (weight, a force), not one per area, which in a body of revolution
        may point outward all around.

    Raises
    ------
    InputError
        If it leaves the plane of a plane model, or points across the axis of a body of revolution.
    """
    components = np.asarray(vector, dtype=float)
    d = mesh.dimension
    across = total and isinstance(section, Axisymmetric) and components[0] != 0.0
    if len(components) < d or components[d:].any() or across:
        where = ", none out of the plane" if section is not None else ""
        expected = "a vector along y, the axis of revolution" if across else f"{d} components{where}"
        raise InputError("the vector does not fit the model", key=key, value=vector, expected=expected)
    return components[:d]
