"""Closed cavities under air pressure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.enclosed import EdgeVolume, EnclosedVolume, FaceVolume, RevolvedVolume
from turgor.fem.section import Axisymmetric, Section
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes, pack_symmetric
from turgor.mesh.cells import face_cell
from turgor.mesh.opening import volume_field

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Cavity(Unlagged):
    """−p V(u): the air in a closed cavity of volume V at pressure p.

    V is a flux through the deformed wall, ∫ x · n/3 dA where nothing cuts it, so that force and stiffness are its exact
    derivatives: the pressure follows the surface, and because the cavity is closed its stiffness is symmetric (Rumpel
    and Schweizerhof 2003). Symmetry planes may close it (:func:`turgor.mesh.opening.volume_field`), and so may the
    axis of a body of revolution.

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

    Raises
    ------
    InputError
        If the cavity leaks.
    """

    def __init__(self, points: Floats, faces: Ints, channel: int, name: str, section: Section | None = None) -> None:
        self.name = name
        self.channel = channel
        self.field = volume_field(points, faces, name, isinstance(section, Axisymmetric))
        self.points = points
        # Reversed, so that the normals point out of the air and the enclosed volume is positive.
        self.nodes = np.ascontiguousarray(faces[:, face_cell(faces).mirrored], dtype=np.int32)
        self._enclosed: EnclosedVolume
        if section is None:
            self._enclosed = FaceVolume(self.nodes, self.field)
        elif isinstance(section, Axisymmetric):
            self._enclosed = RevolvedVolume(self.nodes)
        else:
            self._enclosed = EdgeVolume(self.nodes, self.field, section.thickness)

    def volume(self, u: Floats) -> float:
        """Return the enclosed volume at displacement `u`, mm³."""
        return self._enclosed.volume(self.points + u)

    def energy(self, state: State) -> float:
        """Return −p V, N mm."""
        return -float(state.loads[self.channel]) * self.volume(state.u)

    def force(self, state: State, out: Floats) -> None:
        """Add −p ∂V/∂u, N."""
        pressure = state.loads[self.channel]
        if pressure != 0.0:
            add_at_nodes(self.nodes, -pressure * self._enclosed.gradient(self.points + state.u), out)

    def conjugate(self, state: State) -> float:
        """Return V, mm³."""
        return self.volume(state.u)

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add −∂V/∂u, mm²."""
        add_at_nodes(self.nodes, -self._enclosed.gradient(self.points + state.u), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill −p ∂²V/∂u², N/mm."""
        del lagged
        hessian = self._enclosed.hessian(self.points + state.u)
        hessian *= -state.loads[self.channel]
        pack_symmetric(hessian, out)
