"""What supports carry: the force and the torque with which each of them holds the body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from turgor.fem.constraints import Condition, conditions_at_nodes
from turgor.fem.section import Axisymmetric, surface_areas
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.fem.term import resultants
from turgor.mesh.cells import face_cell
from turgor.mesh.mesh import in_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Reactions:
    """The reactions at the supports of a system, by the names of the surfaces that they hold.

    At a held node the sum of all other terms, ∂Π/∂u, is what holds it. Where several supports hold one node it is a sum
    λ₁d₁ + λ₂d₂ + … along their directions, and the one with the least Σλ² is taken: along a direction that two of them
    hold, each carries half. A bed of springs carries minus its own force. All reactions together balance the loads and
    the rigid bodies to the tolerance of the solver. The air pushes on the walls of a cavity, not on the planes that
    close it for its volume: the support around an inlet carries what pushes the body off it.

    Parameters
    ----------
    system
        The body with its supports.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._shares = _shares(system)
        self.names = tuple(dict.fromkeys(support.surface for support in system.supports))
        self._about = {name: _centroid(system, name) for name in self.names}

    def facts(self, state: State) -> dict[str, dict[str, Any]]:
        """Return of every surface the force on the body and its torque, in plain values.

        The torque is about ``about_mm``, the centroid of the surface at rest. Added up over the full turn of a body of
        revolution, nothing but a force along the axis is left.
        """
        holding = self._system.forces(state)[0] - self._on_closing(state)
        nodal = {name: np.zeros_like(state.u) for name in self.names}
        for name, nodes, share in self._shares:
            nodal[name][nodes] += np.einsum("kij,kj->ki", share, holding[nodes])
        for name, bed in self._system.beds:
            pull = np.zeros_like(state.u)
            bed.force(state, pull)
            nodal[name] -= pull
        return {name: self._resultants(state, name, force) for name, force in nodal.items()}

    def _on_closing(self, state: State) -> Floats:
        """Return the force that planes have in ∂Π/∂u which close cavities, ``(n_points, d)``, N."""
        force = np.zeros_like(state.u)
        for cavity in self._system.cavities:
            for air in (cavity, *cavity.caps):
                air.force_on_closing(state, force)
        return force

    def _resultants(self, state: State, name: str, nodal: Floats) -> dict[str, Any]:
        about, force = self._about[name], in_space(self._system.body_part(nodal))
        arm = in_space(self._system.mesh.points + self._system.body_part(state.u)) - about
        total, torque = resultants(force, arm, turned=isinstance(self._system.section, Axisymmetric))
        return {"force_N": list(total), "torque_N_mm": list(torque), "about_mm": about.tolist()}


def _shares(system: System) -> list[tuple[str, Ints, Floats]]:
    """Return of each surface nodes ``(k,)`` and what it carries of the force there, a matrix for each ``(k, d, d)``."""
    found: dict[str, list[tuple[Ints, Floats]]] = {}
    for nodes, conditions in conditions_at_nodes(system.mesh, system.held, system.section):
        for name, share in _split(conditions).items():
            found.setdefault(name, []).append((nodes, np.broadcast_to(share, (len(nodes), *share.shape))))
    held = {support.surface for support in system.held}
    return [
        (name, np.concatenate([nodes for nodes, _ in parts]), np.concatenate([shares for _, shares in parts]))
        for name, parts in found.items()
        if name in held
    ]


def _split(conditions: list[Condition]) -> dict[str, Floats]:
    """Return for each surface the matrix ``(d, d)`` that takes what it carries out of the force at a node."""
    directions = np.array([direction for direction, _, _ in conditions])
    sizes = np.linalg.pinv(directions.T)
    surfaces = np.array([surface for _, _, surface in conditions])
    return {name: directions[surfaces == name].T @ sizes[surfaces == name] for name in dict.fromkeys(surfaces.tolist())}


def _centroid(system: System, name: str) -> Floats:
    """Return the centroid ``(3,)`` of a surface at rest, of a body of revolution that of the full turn, mm."""
    points, faces = system.mesh.points, system.mesh.surface(name)
    _, area = surface_areas(points, faces, system.section)
    places = face_cell(faces).shape_at_quadrature @ points[faces]
    centre: Floats = np.einsum("fq,fqi->i", area, places) / area.sum()
    if isinstance(system.section, Axisymmetric):
        centre[0] = 0.0
    return np.asarray(in_space(centre[None])[0])
