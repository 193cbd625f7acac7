"""Contact of the skin with a rigid body, which feels force and torque: a dynamometer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.friction import PLACE, Rubbing, grips_in, make_rows, points_of, renewed, rubbing
from turgor.fem.contact.skin import STIFFNESS, Skin
from turgor.fem.contact.term import GROWTH_OF_OVERLAP, TRIALS, Touch
from turgor.fem.pattern import packed_size
from turgor.fem.rigid import RigidBody
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, Triple, Unlagged, add_at_nodes, pack_symmetric, resultants, triple
from turgor.mesh.mesh import in_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

PART_OF_DEPTH = 0.5
"""Part of its depth by which a body that moves may get into another at once: beyond the middle it would push it on."""


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
        Its displacement at factor one, ``(d,)``, mm.
    channel
        Place of the factor in ``State.loads``; ``None``: the body stands still.
    name
        Of the contact.
    turned
        Whether the model is a body of revolution, around whose axis y all forces across it cancel.
    friction
        Coefficient of friction.
    number
        Place of what it remembers in ``State.grips``.
    node
        Row of ``State.u`` that is the displacement of the body on its spring; ``None``: it is on none.
    across
        Directions ``(k, 3)`` in which the forces of the body's other halves cancel its own (:func:`resultants`).

    Attributes
    ----------
    moves
        Whether the body moves.
    """

    nodes = NO_NODES

    def __init__(
        self,
        skin: Skin,
        body: RigidBody,
        motion: Floats,
        channel: int | None,
        name: str,
        turned: bool = False,
        friction: float = 0.0,
        number: int = 0,
        node: int | None = None,
        across: Floats | None = None,
    ) -> None:
        self.skin = skin
        self.body = body
        self.motion = motion
        self.moves = channel is not None
        self.channel = -1 if channel is None else channel
        self.name = name
        self.friction = friction
        self._turned, self._across = turned, across
        self._number = number
        self._node = node
        # What counts is where points are as seen from the body: its displacement goes in with minus one.
        seen = [] if node is None else [-1.0]
        self._shape = np.hstack([skin.shape, np.tile(seen, (len(skin.shape), 1))])
        self._nodes = np.hstack([skin.faces, np.full((len(skin.faces), len(seen)), node or 0, np.int32)])

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        gap, _, _ = self._gaps(state.u, state.loads)
        normal = 0.5 * float(np.sum(self._normal_stiffness(state) * np.minimum(gap, 0.0) ** 2))
        return normal + self._rubbing(state).energy

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy."""
        del lagged
        return self.energy(state)

    def force(self, state: State, out: Floats) -> None:
        """Add the contact forces, N."""
        push = self._pushes(state)
        touching = np.flatnonzero(push.any(axis=(1, 2)))
        self._rubbing(state).add_force(out)
        add_at_nodes(self._nodes[touching], np.einsum("qa,fqi->fai", self._shape, push[touching]), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: all of the stiffness is in :meth:`blocks`."""

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the nodes of each face that overlaps the body and the packed stiffnesses."""
        gap, normal, curvature = self._gaps(state.u, state.loads)
        touching = np.flatnonzero((gap < 0.0).any(axis=1))
        stiffness = self._normal_stiffness(state)[touching] * (gap[touching] < 0.0)
        force = stiffness * np.minimum(lagged[touching], 0.0)
        n, N = normal[touching], self._shape
        at_points = stiffness[:, :, None, None] * n[:, :, :, None] * n[:, :, None, :]
        at_points += force[:, :, None, None] * curvature[touching]
        full = np.einsum("qa,qb,fqij->faibj", N, N, at_points, optimize=True)
        rows = full.shape[1] * full.shape[2]
        full = full.reshape(len(touching), rows, rows)
        packed = np.empty((len(touching), packed_size(rows)))
        pack_symmetric(full, packed)
        rubbing = self._rubbing(state)
        return np.vstack([self._nodes[touching], rubbing.nodes]), np.vstack([packed, rubbing.blocks()])

    def couplings(self, u: Floats) -> Ints:
        """Return every face's nodes with a body on a spring; without one nothing: a face's are coupled anyway."""
        del u
        return self._nodes[:0] if self._node is None else self._nodes

    def lagged_at(self, state: State) -> Floats:
        """Return the distance of every quadrature point inside the body, else zero, ``(k, q)``, mm."""
        return np.minimum(self._gaps(state.u, state.loads)[0], 0.0)

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return the distances that the step `du` predicts, ``(k, q)``, mm, never positive."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        rate = np.einsum("fqi,fqi->fq", normal, self._at_points(du))
        return np.where(gap < 0.0, np.minimum(gap + rate, 0.0), 0.0)

    def conjugate(self, state: State) -> float:
        """Return the body's force times its motion, N mm."""
        push = self._pushes(state).sum(axis=(0, 1)) + self._rubbing(state).drag.sum(axis=0)
        return float(push @ self.motion)

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add the derivative of the contact forces by the factor, N."""
        gap, normal, curvature = self._gaps(state.u, state.loads)
        stiffness = self._normal_stiffness(state) * (gap < 0.0)
        change = (normal @ self.motion)[:, :, None] * normal + gap[:, :, None] * (curvature @ self.motion)
        values = np.einsum("qa,fqi->fai", self._shape, -stiffness[:, :, None] * change)
        add_at_nodes(self._nodes, values, out)
        rubbing = self._rubbing(state)
        add_at_nodes(rubbing.nodes, -rubbing.weights[:, :, None] * (rubbing.tangent @ self.motion)[:, None, :], out)

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du` up to which no overlap grows too much."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        growth = GROWTH_OF_OVERLAP * np.minimum(self.skin.depth, self.body.depth)[:, None]
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

    def longest_motion(self, state: State) -> float:
        """Return how much its factor may grow before the body could be past what it is to meet."""
        way = float(np.linalg.norm(self.motion))
        gap, _, _ = self._gaps(state.u, state.loads)
        room = max(float(gap.min()), 0.0) + PART_OF_DEPTH * self.body.depth
        return room / way if way > 0.0 else np.inf

    def touch(self, state: State) -> Touch:
        """Return area, overlaps, and force and torque on the body."""
        gap, _, _ = self._gaps(state.u, state.loads)
        force, torque = self._resultants(state)
        overlap = np.maximum(-gap, 0.0)
        return Touch(
            self.name,
            area=float(self.skin.area[gap < 0.0].sum()),
            overlap=float(overlap.max()),
            overlap_per_wall=float((overlap / self.skin.wall[:, None]).max()),
            force=force,
            torque=torque,
            displacement=self._displacement(state),
        )

    def intersects(self, state: State) -> None:
        """Say nothing: there is no independent look at overlaps with a rigid body."""
        del state

    def gripped(self, state: State, *, dragged: bool) -> Floats:
        """Return what friction remembers; see :class:`turgor.fem.contact.term.Contact`."""
        rows = grips_in(state, self._number)
        if self.friction == 0.0:
            return rows
        gap, normal, _ = self._gaps(state.u, state.loads)
        face, quad = np.nonzero(gap < 0.0)
        force = -(self._normal_stiffness(state) * gap)[face, quad]
        place = self._places(state.u, state.loads)[face, quad]
        rubs = self._rubbing(state)
        slip = rubs.elastic_slip if dragged else rubs.slip
        return renewed(rows, slip, make_rows(face, quad, force, normal[face, quad], place))

    def _rubbing(self, state: State) -> Rubbing:
        rows, d = grips_in(state, self._number), self.skin.dimension
        face, quad, _ = points_of(rows, self.skin)
        nodes, weights = self._nodes[face], self._shape[quad]
        apart = self._places(state.u, state.loads)[face, quad] - rows[:, PLACE][:, :d]
        stiffness = self._normal_stiffness(state)[face, quad]
        return rubbing(rows, nodes, weights, apart, self.friction, stiffness, d)

    def _resultants(self, state: State) -> tuple[Triple, Triple]:
        """Return force and torque on the body, of three components also in a plane model."""
        push = self._pushes(state)
        rows = grips_in(state, self._number)
        face, quad, _ = points_of(rows, self.skin)
        np.add.at(push, (face, quad), self._rubbing(state).drag)
        arm = self._places(state.u, state.loads) - self.body.reference_point
        push, arm = (in_space(v.reshape(-1, v.shape[2])) for v in (push, arm))
        return resultants(push, arm, turned=self._turned, across=self._across)

    def _displacement(self, state: State) -> Triple | None:
        """Return how far the body is from its place at rest; nothing if it stands still."""
        if self._node is None and not self.moves:
            return None
        on_spring = 0.0 if self._node is None else state.u[self._node]
        return triple(in_space(self._shift(state.loads) + on_spring))

    def _shift(self, loads: Floats) -> Floats:
        return self.motion * (loads[self.channel] if self.moves else 0.0)

    def _places(self, u: Floats, loads: Floats) -> Floats:
        """Return where the quadrature points are as seen from the body, ``(k, q, d)``."""
        rest = self.skin.points[:, : self.skin.dimension][self.skin.faces]
        at_rest = np.einsum("qa,fai->fqi", self.skin.shape, rest)
        return np.asarray(at_rest + self._at_points(u) - self._shift(loads))

    def _at_points(self, field: Floats) -> Floats:
        return np.asarray(np.einsum("qa,fai->fqi", self._shape, field[self._nodes]))

    def _gaps(self, u: Floats, loads: Floats) -> tuple[Floats, Floats, Floats]:
        """Return distance ``(k, q)``, normal ``(k, q, d)`` and curvature ``(k, q, d, d)`` at the quadrature points."""
        x = self._places(u, loads)
        d = x.shape[2]
        gap, normal, curvature = self.body.distance(x.reshape(-1, d))
        return gap.reshape(x.shape[:2]), normal.reshape(x.shape), curvature.reshape(*x.shape, d)

    def _normal_stiffness(self, state: State) -> Floats:
        return np.asarray(state.penalty * STIFFNESS * (self.skin.load / self.skin.grip)[:, None] * self.skin.area)

    def _pushes(self, state: State) -> Floats:
        """Return what each point pushes the body with, ``(k, q, d)``, N."""
        gap, normal, _ = self._gaps(state.u, state.loads)
        return np.asarray((self._normal_stiffness(state) * np.minimum(gap, 0.0))[:, :, None] * normal)


class BodySpring(Unlagged):
    """½ k |u|²: the spring that a rigid body is on, u its displacement.

    Parameters
    ----------
    node
        Row of ``State.u`` that is the displacement; across the spring it is given as zero.
    stiffness
        k, N/mm.
    dimension
        Number of displacement components.
    """

    def __init__(self, node: int, stiffness: float, dimension: int) -> None:
        self.nodes = np.array([[node]], np.int32)
        self._node, self._stiffness = node, stiffness
        self._block = stiffness * np.eye(dimension)[None]

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        return 0.5 * self._stiffness * float(state.u[self._node] @ state.u[self._node])

    def force(self, state: State, out: Floats) -> None:
        """Add the spring's force, N."""
        out[self._node] += self._stiffness * state.u[self._node]

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill k, N/mm."""
        del state, lagged
        pack_symmetric(self._block, out)
