"""Loads: what the user says, and the dead ones as terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.programme import CONSTANT, PROPORTIONAL, Programme
from turgor.fem.section import Section, in_section, surface_areas
from turgor.fem.solid import Solid
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, Unlagged
from turgor.mesh.cells import body_cell, face_cell
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Vector = tuple[float, ...]
"""Components along x, y and z; in a plane model two are enough."""


@dataclass(frozen=True)
class Pressure:
    """Air pressure in a closed cavity, MPa above the surroundings, along its programme."""

    cavity: str
    value: float
    programme: Programme = PROPORTIONAL


@dataclass(frozen=True)
class Gravity:
    """Weight of every region: `acceleration` in mm/s², acting in full from the start."""

    acceleration: Vector

    @property
    def programme(self) -> Programme:
        """How it follows the load fraction: not at all."""
        return CONSTANT


@dataclass(frozen=True)
class Traction:
    """A dead force per reference area on a surface, MPa; it keeps its direction and grows with the load fraction."""

    surface: str
    vector: Vector
    programme: Programme = PROPORTIONAL


@dataclass(frozen=True)
class Force:
    """A dead force, N in total, spread evenly over the reference area of a surface; grows with the load fraction."""

    surface: str
    vector: Vector
    programme: Programme = PROPORTIONAL


Dead = Gravity | Traction | Force
Load = Pressure | Dead


class DeadLoad(Unlagged):
    """−factor · f · u with constant nodal forces f: gravity and dead tractions.

    Parameters
    ----------
    nodal
        The forces at factor one, ``(n_points, d)``, N.
    channel
        Place of the factor in ``State.loads``.
    """

    nodes = NO_NODES

    def __init__(self, nodal: Floats, channel: int) -> None:
        self.nodal = nodal
        self.channel = channel

    def energy(self, state: State) -> float:
        """Return −factor · f · u, N mm."""
        return -float(state.loads[self.channel] * np.vdot(self.nodal, state.u))

    def force(self, state: State, out: Floats) -> None:
        """Add −factor · f, N."""
        out -= state.loads[self.channel] * self.nodal

    def conjugate(self, state: State) -> float:
        """Return f · u, N mm."""
        return float(np.vdot(self.nodal, state.u))

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add −f, N."""
        del state
        out -= self.nodal

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: a dead load has no stiffness."""


def add_nodal_forces(load: Dead, mesh: Mesh, section: Section | None, solids: Sequence[Solid], out: Floats) -> None:
    """Add the nodal forces of a dead load at factor one to ``out (n_points, d)``, N.

    Raises
    ------
    InputError
        If gravity acts on a solid without density, or the load's vector does not fit the section.
    """
    if isinstance(load, Gravity):
        acceleration = in_section(load.acceleration, mesh, section, "gravity", total=True)
        for solid in solids:
            if solid.material.density is None:
                raise InputError("gravity acts on a material without density", key="density")
            _add_body_force(solid.nodes, solid.dV, solid.material.density * acceleration, out)
        return
    total = isinstance(load, Force)
    vector = in_section(load.vector, mesh, section, f"loads.{load.surface}", total)
    faces = mesh.surface(load.surface)
    if total:
        vector = vector / float(surface_areas(mesh.points, faces, section)[1].sum())
    _add_surface_force(mesh.points, faces, vector, section, out)


def _add_surface_force(points: Floats, faces: Ints, traction: Floats, section: Section | None, out: Floats) -> None:
    """Add the nodal forces ``∫ t N dA`` of a dead traction to ``out (n_points, d)``."""
    _, area = surface_areas(points, faces, section)
    share = area @ face_cell(faces).shape_at_quadrature
    lumped = np.bincount(faces.ravel(), share.ravel(), minlength=len(out))
    out += lumped[:, None] * traction


def _add_body_force(cells: Ints, dV: Floats, density: Floats, out: Floats) -> None:
    """Add the nodal forces ``∫ f N dV`` of `cells` ``(m, n)`` under a force density ``(d,)``, N/mm³."""
    share = dV @ body_cell(cells).shape_at_quadrature
    volume = np.bincount(cells.ravel(), share.ravel(), minlength=len(out))
    out += volume[:, None] * density
