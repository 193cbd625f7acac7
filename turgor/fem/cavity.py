"""Closed cavities under air pressure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from turgor.fem.enclosed import CapVolume, EdgeVolume, EnclosedVolume, FaceVolume, RevolvedVolume
from turgor.fem.section import Axisymmetric, Section
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes, pack_symmetric
from turgor.mesh.cells import face_cell
from turgor.mesh.opening import VolumeField, volume_field

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class AirPressure(Unlagged):
    """−p V(u) of the part V of a cavity's volume that is the flux through some faces.

    Force and stiffness are its exact derivatives: the pressure follows the surface.

    Parameters
    ----------
    points
        Reference positions ``(n_points, d)``.
    enclosed
        The volume as a function of the nodes' positions.
    channel
        Place of the pressure (MPa) in ``State.loads``.
    """

    def __init__(self, points: Floats, enclosed: EnclosedVolume, channel: int) -> None:
        self.points = points
        self.channel = channel
        self.nodes = enclosed.nodes
        self._enclosed = enclosed

    def energy(self, state: State) -> float:
        """Return −p V, N mm."""
        return -float(state.loads[self.channel]) * self._enclosed.volume(self._places(state.u))

    def force(self, state: State, out: Floats) -> None:
        """Add −p ∂V/∂u, N."""
        pressure = state.loads[self.channel]
        if pressure != 0.0:
            add_at_nodes(self.nodes, -pressure * self._enclosed.gradient(self._places(state.u)), out)

    def force_on_closing(self, state: State, out: Floats) -> None:
        """Add the part of the force that the air's push on the planes that close the cavity has in it, N.

        It acts across these planes on the rim, which is held there. What else holds it feels the push on the wall only.
        """
        x, pressure = self._places(state.u), state.loads[self.channel]
        add_at_nodes(self.nodes, pressure * (self._enclosed.traction(x) - self._enclosed.gradient(x)), out)

    def conjugate(self, state: State) -> float:
        """Return V, mm³."""
        return self._enclosed.volume(self._places(state.u))

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add −∂V/∂u, mm²."""
        add_at_nodes(self.nodes, -self._enclosed.gradient(self._places(state.u)), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill −p ∂²V/∂u², N/mm."""
        del lagged
        pack_symmetric(self._enclosed.hessian(self._places(state.u)), out, -state.loads[self.channel])

    def _places(self, u: Floats) -> Floats:
        """Return where the nodes are; what comes behind them in `u` are rigid bodies."""
        return np.asarray(self.points + u[: len(self.points)])


class Cavity(AirPressure):
    """−p V(u): the air in a closed cavity of volume V at pressure p.

    V is a flux through the deformed wall, ∫ x · n/3 dA where nothing cuts it. As the cavity is closed, its stiffness
    is symmetric (Rumpel and Schweizerhof 2003). Symmetry planes, the axis of a body of revolution and caps may close it
    (:mod:`turgor.mesh.opening`); as a term this is the wall alone, and its :attr:`caps` are terms of their own.

    Parameters
    ----------
    points
        Reference positions ``(n_points, d)``.
    faces
        The wall ``(k, nodes_per_face)`` with normals out of the solid, that is, into the air.
    channel
        Place of the pressure (MPa) in ``State.loads``.
    name
        Name of the surface.
    section
        What a plane mesh stands for.
    caps
        Edges of the rims that caps close, by the caps' names.

    Raises
    ------
    InputError
        If the cavity leaks.
    """

    def __init__(
        self,
        points: Floats,
        faces: Ints,
        channel: int,
        name: str,
        section: Section | None = None,
        caps: Mapping[str, Ints] | None = None,
    ) -> None:
        self.name = name
        self.field = volume_field(points, faces, name, isinstance(section, Axisymmetric), caps)
        # Reversed, so that the normals point out of the air and the enclosed volume is positive.
        nodes = np.ascontiguousarray(faces[:, face_cell(faces).mirrored], dtype=np.int32)
        super().__init__(points, _enclosed(nodes, self.field, section), channel)
        self.caps = tuple(AirPressure(points, CapVolume(cap, self.field), channel) for cap in self.field.caps)

    def volume(self, u: Floats) -> float:
        """Return the volume that wall and caps enclose at displacement `u`, mm³."""
        x = self._places(u)
        return self._enclosed.volume(x) + sum(cap._enclosed.volume(x) for cap in self.caps)


def _enclosed(nodes: Ints, field: VolumeField, section: Section | None) -> EnclosedVolume:
    if section is None:
        return FaceVolume(nodes, field)
    if isinstance(section, Axisymmetric):
        return RevolvedVolume(nodes)
    return EdgeVolume(nodes, field, section.thickness)
