"""Loads: what the user says, and the dead ones as terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.fem.programme import CONSTANT, PROPORTIONAL, Programme
from turgor.fem.section import Section, surface_areas
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, Unlagged
from turgor.mesh.cells import body_cell, face_cell

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


Load = Pressure | Gravity | Traction | Force


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


def body_force(cells: Ints, dV: Floats, density: float, acceleration: Floats, out: Floats) -> None:
    """Add the nodal forces ``∫ ρ g N dV`` of `cells` ``(m, n)`` to ``out (n_points, d)``.

    `dV` ``(m, q)`` are the volumes at the quadrature points and `density` is in t/mm³.
    """
    share = dV @ body_cell(cells).shape_at_quadrature
    mass = density * np.bincount(cells.ravel(), share.ravel(), minlength=len(out))
    out += mass[:, None] * acceleration


def surface_force(points: Floats, faces: Ints, traction: Floats, section: Section | None, out: Floats) -> float:
    """Add the nodal forces ``∫ t N dA`` of a dead traction to ``out (n_points, d)`` and return the area, mm²."""
    _, area = surface_areas(points, faces, section)
    share = area @ face_cell(faces).shape_at_quadrature
    lumped = np.bincount(faces.ravel(), share.ravel(), minlength=len(out))
    out += lumped[:, None] * traction
    return float(area.sum())
