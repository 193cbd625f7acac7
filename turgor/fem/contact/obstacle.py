"""Contact of the skin with a rigid body, which feels force and torque: a dynamometer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.skin import STIFFNESS, Skin
from turgor.fem.contact.term import GROWTH_OF_OVERLAP, TRIALS, Touch
from turgor.fem.pattern import packed_size
from turgor.fem.rigid import RigidBody
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, add_at_nodes, pack_symmetric

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Obstacle:
    """½ Σ ε w min(0, d)² over the quadrature points of the skin, d the signed distance from a rigid body.

    The body stands still, or moves by ``factor · motion``, the factor being a load. Force and torque on it are the
    derivatives of −Π by its position. What lags are the overlaps, as in
    :class:`turgor.fem.contact.surfaces.SurfaceContact`.

    Parameters
    ----------
    skin
        The faces that may touch the body.
    body
        Its shape and place.
    motion
        Its displacement at factor one, ``(3,)``, mm.
    channel
        Place of the factor in ``State.loads``; ``None``: the body stands still.
    name
        Of the contact.

    Attributes
    ----------
    moves
        Whether the body moves.
    """

    nodes = NO_NODES

    def __init__(self, skin: Skin, body: RigidBody, motion: Floats, channel: int | None, name: str) -> None:
        self.skin = skin
        self.body = body
        self.motion = motion
        self.moves = channel is not None
        self.channel = -1 if channel is None else channel
        self.name = name

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        gap, _, _ = self._gaps(state.u, state.loads)
        return 0.5 * float(np.sum(self._normal_stiffness(state) * np.minimum(gap, 0.0) ** 2))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy."""
        del lagged
        return self.energy(state)

    def force(self, state: State, out: Floats) -> None:
        """Add the contact forces, N."""
        push = self._pushes(state)
        touching = np.flatnonzero(push.any(axis=(1, 2)))
        add_at_nodes(self.skin.faces[touching], np.einsum("qa,fqi->fai", self.skin.shape, push[touching]), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: all of the stiffness is in :meth:`blocks`."""

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the six nodes of each face that overlaps the body and the packed stiffnesses."""
        gap, normal, curvature = self._gaps(state.u, state.loads)
        touching = np.flatnonzero((gap < 0.0).any(axis=1))
        stiffness = self._normal_stiffness(state)[touching] * (gap[touching] < 0.0)
        force = stiffness * np.minimum(lagged[touching], 0.0)
        n, N = normal[touching], self.skin.shape
        at_points = stiffness[:, :, None, None] * n[:, :, :, None] * n[:, :, None, :]
        at_points += force[:, :, None, None] * curvature[touching]
        full = np.einsum("qa,qb,fqij->faibj", N, N, at_points, optimize=True).reshape(len(touching), 18, 18)
        packed = np.empty((len(touching), packed_size(18)))
        pack_symmetric(full, packed)
        return self.skin.faces[touching], packed

    def couplings(self, u: Floats) -> Ints:
        """Return nothing: the nodes of a face are coupled anyway."""
        del u
        return self.skin.faces[:0]

    def lagged_at(self, u: Floats, loads: Floats) -> Floats:
        """Return the distance of every quadrature point inside the body, else zero, ``(k, q)``, mm."""
        return np.minimum(self._gaps(u, loads)[0], 0.0)

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return the distances that the step `du` predicts, ``(k, q)``, mm, never positive."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        rate = np.einsum("fqi,fqi->fq", normal, self._at_points(du))
        return np.where(gap < 0.0, np.minimum(gap + rate, 0.0), 0.0)

    def conjugate(self, state: State) -> float:
        """Return the body's force times its motion, N mm."""
        return float(self._pushes(state).sum(axis=(0, 1)) @ self.motion)

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add the derivative of the contact forces by the factor, N."""
        gap, normal, curvature = self._gaps(state.u, state.loads)
        stiffness = self._normal_stiffness(state) * (gap < 0.0)
        change = (normal @ self.motion)[:, :, None] * normal + gap[:, :, None] * (curvature @ self.motion)
        values = np.einsum("qa,fqi->fai", self.skin.shape, -stiffness[:, :, None] * change)
        add_at_nodes(self.skin.faces, values, out)

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du` up to which no overlap grows too much."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        growth = GROWTH_OF_OVERLAP * self.skin.depth[:, None]
        rate = np.einsum("fqi,fqi->fq", normal, self._at_points(du))
        room = np.maximum(gap, 0.0) + growth
        step = 1.0 / max(1.0, float((-rate / room).max()))
        before = np.minimum(gap, 0.0)
        for _ in range(TRIALS):
            after, _, _ = self._gaps(state.u + step * du, state.loads)
            if ((before - after) / (2.0 * growth)).max() <= 1.0:
                break
            step *= 0.5
        return step

    def touch(self, state: State) -> Touch:
        """Return area, overlaps, and force and torque on the body."""
        gap, _, _ = self._gaps(state.u, state.loads)
        push = self._pushes(state).reshape(-1, 3)
        place = self.body.reference_point + self._shift(state.loads)
        arm = (self.skin.points + state.u)[self.skin.faces]
        torque = np.cross(np.einsum("qa,fai->fqi", self.skin.shape, arm).reshape(-1, 3) - place, push).sum(axis=0)
        force = push.sum(axis=0)
        overlap = np.maximum(-gap, 0.0)
        return Touch(
            self.name,
            area=float(self.skin.area[gap < 0.0].sum()),
            overlap=float(overlap.max()),
            overlap_per_wall=float((overlap / self.skin.wall[:, None]).max()),
            force=(float(force[0]), float(force[1]), float(force[2])),
            torque=(float(torque[0]), float(torque[1]), float(torque[2])),
        )

    def _shift(self, loads: Floats) -> Floats:
        return self.motion * (loads[self.channel] if self.moves else 0.0)

    def _at_points(self, field: Floats) -> Floats:
        return np.asarray(np.einsum("qa,fai->fqi", self.skin.shape, field[self.skin.faces]))

    def _gaps(self, u: Floats, loads: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distance ``(k, q)``, normal ``(k, q, 3)`` and curvature ``(k, q, 3, 3)`` at the quadrature points."""
        shape = self.skin.area.shape
        x = self._at_points(self.skin.points + u).reshape(-1, 3)
        gap, normal, curvature = self.body.distance(x - self._shift(loads))
        return gap.reshape(shape), normal.reshape(*shape, 3), curvature.reshape(*shape, 3, 3)

    def _normal_stiffness(self, state: State) -> Floats:
        return np.asarray(state.penalty * STIFFNESS * (self.skin.load / self.skin.grip)[:, None] * self.skin.area)

    def _pushes(self, state: State) -> Floats:
        """Return what each point pushes the body with, ``(k, q, 3)``, N."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        return np.asarray((self._normal_stiffness(state) * np.minimum(gap, 0.0))[:, :, None] * normal)
