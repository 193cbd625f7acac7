"""Contact between surfaces of the body, self-contact included."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.friction import PLACE, Rubbing, grips_in, make_rows, points_of, renewed, rubbing
from turgor.fem.contact.intersection import IntersectionCheck
from turgor.fem.contact.pairs import gap_gradients, pair_stiffness
from turgor.fem.contact.partners import NOWHERE, balls, find_partners
from turgor.fem.contact.recent import Recent
from turgor.fem.contact.search import Search
from turgor.fem.contact.skin import SOON, STIFFNESS, Skin
from turgor.fem.contact.term import GROWTH_OF_OVERLAP, TRIALS, Touch
from turgor.fem.pattern import packed_size
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, add_at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.intp]

REACH = 3.0
"""Before a step, pairs are watched whose gap is up to so many face sizes."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Points of the skin and the faces they meet.

    ``face`` and ``quad`` ``(n,)`` number the quadrature point, ``masters`` ``(n,)`` the face opposite; ``at`` and
    ``local`` ``(n, 2)`` are the local coordinates on both, ``overlap`` ``(n,)`` is the gap measured from the margin's
    coating, negative where they press on each other, and ``gap`` ``(n,)`` that and the margin, negative where they
    overlap.
    """

    face: Indices
    quad: Indices
    masters: Ints
    at: Floats
    local: Floats
    gap: Floats
    overlap: Floats

    def where(self, keep: NDArray[np.bool_]) -> Pairs:
        """Return some of the pairs."""
        return Pairs(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


class SurfaceContact:
    """½ Σ ε w min(0, g)² over the quadrature points of all faces, w half the reference area of a point, g its gap.

    Every face is slave and master at once, hence the half. A margin, ``State.margin``, mostly zero, is a coating of the
    slave's faces along their normals, on which the points lie: taken off the gap, it would let points press in front of
    grooves, where the closest point jumps from one face to the other. It is one for all points: where it changed with
    the wall opposite, forces would jump as points pass from face to face.

    What lags are the overlaps: the geometric part of the stiffness takes the force that the last step predicted,
    F ← ε w min(0, g + ∂g·δu), so that a first touch or a long step does not throw the iteration off.

    Parameters
    ----------
    skin
        The faces.
    group
        Number of each face's group ``(k,)``: only faces of different groups meet. ``None``: any may meet any.
    name
        Of the contact.
    friction
        Coefficient of friction.
    number
        Place of what it remembers in ``State.grips``.
    """

    nodes = NO_NODES

    def __init__(self, skin: Skin, group: Ints | None, name: str, friction: float = 0.0, number: int = 0) -> None:
        self.skin = skin
        self.name = name
        self.friction = friction
        self._number = number
        self._search = Search(skin, group)
        self._recent = Recent(self._overlapping)

    @cached_property
    def intersection_check(self) -> IntersectionCheck:
        """An independent look at what the faces do."""
        return IntersectionCheck(self.skin)

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        pairs = self._touching(state)
        normal = 0.5 * float(np.sum(self._normal_stiffness(state, pairs) * pairs.overlap**2))
        return normal + self._rubbing(state).energy

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy: the overlaps are not stiff enough to be taken as unknowns in it."""
        del lagged
        return self.energy(state)

    def force(self, state: State, out: Floats) -> None:
        """Add the contact forces, N."""
        pairs = self._touching(state)
        force = self._normal_stiffness(state, pairs) * pairs.overlap
        add_at_nodes(self._nodes(pairs), force[:, None, None] * self._gradients(state.u, pairs, state.margin), out)
        self._rubbing(state).add_force(out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: all of the stiffness is in :meth:`blocks`."""

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the nodes of each pair that overlaps and the packed stiffnesses."""
        skin, pairs = self.skin, self._touching(state)
        nodes = self._nodes(pairs)
        packed = np.empty((len(nodes), packed_size(nodes.shape[1] * skin.dimension)))
        stiffness = self._normal_stiffness(state, pairs)
        force = stiffness * np.minimum(lagged[pairs.face, pairs.quad], 0.0)
        slaves, masters = skin.faces[pairs.face], skin.faces[pairs.masters]
        x, d = skin.space(state.u), skin.dimension
        places = (slaves, masters, pairs.at, pairs.local)
        pair_stiffness(x, *places, state.margin, pairs.overlap, stiffness, force, d, packed)
        rubbing = self._rubbing(state)
        return np.vstack([nodes, rubbing.nodes]), np.vstack([packed, rubbing.blocks()])

    def couplings(self, u: Floats) -> Ints:
        """Return the nodes of all pairs of faces near each other, of which one meets something soon."""
        skin, x = self.skin, self.skin.space(u)
        start, second = self._search.candidates(balls(x, skin.faces), SOON * skin.size)
        pairs = self._pairs(x, SOON * skin.size)
        awake = np.zeros(len(skin.faces), bool)
        awake[pairs.face] = awake[pairs.masters] = True
        first = np.repeat(np.arange(len(skin.faces)), np.diff(start))
        keep = (awake[first] | awake[second]) & (first < second)
        near = np.hstack([skin.faces[first[keep]], skin.faces[second[keep]]])
        return np.concatenate([near, self._nodes(pairs)])

    def lagged_at(self, state: State) -> Floats:
        """Return the gap less the margin of every quadrature point that presses, else zero, ``(k, q)``, mm."""
        pairs = self._touching(state)
        return self._at_points(pairs, pairs.overlap)

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return the gaps less the margin that the step `du` predicts, ``(k, q)``, never positive."""
        pairs = self._touching(state)
        return self._at_points(pairs, np.minimum(pairs.overlap + self._rates(state.u, pairs, du, state.margin), 0.0))

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du` up to which no overlap grows too much to be seen.

        First by the rates of the gaps, from a few points of each face to all that is in reach; then by looking, for
        pairs that were not in sight, or turned on the way.
        """
        # A gap closes by no more than both sides move; between nodes a field may be larger than at them.
        reach = min(REACH * self.skin.size, 4.0 * float(np.sqrt((du**2).sum(axis=1)).max()))
        pairs = self._pairs(self.skin.space(state.u), reach, rule=self.skin.few)
        growth = GROWTH_OF_OVERLAP * self._depth(pairs)
        rate = self._rates(state.u, pairs, du)
        closing = rate < 0.0
        step = 1.0
        if closing.any():
            step = min(1.0, float(((np.maximum(pairs.gap, 0.0) + growth)[closing] / -rate[closing]).min()))
        before = self.lagged_at(state)
        for _ in range(TRIALS):
            after = self._touching(state.moved(step * du))
            grown = before[after.face, after.quad] - after.overlap
            excess = (grown / (2.0 * GROWTH_OF_OVERLAP * self._depth(after))).max(initial=0.0)
            if excess <= 1.0:
                break
            step *= 0.5
        return step

    def touch(self, state: State) -> Touch:
        """Return area and overlaps."""
        pairs = self._touching(state)
        wall = np.minimum(self.skin.wall[pairs.face], self.skin.wall[pairs.masters])
        return Touch(
            self.name,
            area=0.5 * float(self.skin.area[pairs.face, pairs.quad].sum()),
            overlap=float((-pairs.gap).max(initial=0.0)),
            overlap_per_wall=float((-pairs.gap / wall).max(initial=0.0)),
            wall=float(wall.min() if len(wall) else self.skin.wall.min()),
        )

    def intersects(self, state: State) -> bool | None:
        """Say whether more overlaps than is allowed; ``None`` where the IPC Toolkit is not installed."""
        return self.intersection_check.intersects(state.u) if IntersectionCheck.is_possible() else None

    def gripped(self, state: State, *, dragged: bool) -> Floats:
        """Return what friction remembers; see :class:`turgor.fem.contact.term.Contact`.

        A place is a face and the local coordinates of the closest point on it.
        """
        rows = grips_in(state, self._number)
        if self.friction == 0.0:
            return rows
        pairs = self._touching(state)
        force = -self._normal_stiffness(state, pairs) * pairs.overlap
        # The slave's part of the gap's gradient is its normal times shape functions, whose sum is one.
        normal = self._gradients(state.u, pairs, state.margin)[:, : self.skin.faces.shape[1]].sum(axis=1)
        place = np.column_stack([pairs.masters, pairs.local])
        rubs = self._rubbing(state)
        slip = rubs.elastic_slip if dragged else rubs.slip
        return renewed(rows, slip, make_rows(pairs.face, pairs.quad, force, normal, place))

    def _rubbing(self, state: State) -> Rubbing:
        rows, d = grips_in(state, self._number), self.skin.dimension
        face, quad, slaves = points_of(rows, self.skin)
        other = rows[:, PLACE][:, 0].astype(np.int32)
        local = rows[:, PLACE][:, 1:]
        nodes = np.hstack([slaves, self.skin.faces[other]])
        weights = np.hstack([self.skin.shape[quad], -self.skin.shape_at(local)])
        apart = np.einsum("na,nai->ni", weights, self.skin.points[nodes][:, :, :d] + state.u[nodes])
        stiffness = self._stiffness_between(state, face, quad, other)
        return rubbing(rows, nodes, weights, apart, self.friction, stiffness, d)

    def _touching(self, state: State) -> Pairs:
        """Return the pairs that press on each other."""
        return self._recent(state.u, state.margin)

    def _overlapping(self, u: Floats, margin: float) -> Pairs:
        pairs = self._pairs(self.skin.space(u), 0.0, margin)
        return pairs.where(pairs.overlap < 0.0)

    def _pairs(self, x: Floats, reach: float, margin: float = 0.0, rule: Floats | None = None) -> Pairs:
        """Return the pairs whose gap is up to `reach`, of the quadrature points or of those of another `rule`."""
        skin = self.skin
        rule = skin.rule if rule is None else rule
        shape = (len(skin.faces), len(rule))
        partner, local, gap = np.empty(shape, np.int32), np.empty((*shape, 2)), np.empty(shape)
        around = balls(x, skin.faces)
        start, candidates = self._search.candidates(around, reach)
        where = (start, candidates, skin.depth, margin, reach)
        find_partners(x, skin.faces, around, rule, *where, partner, local, gap)
        face, quad = np.nonzero(partner != NOWHERE)
        overlap = gap[face, quad]
        return Pairs(face, quad, partner[face, quad], rule[quad], local[face, quad], overlap + margin, overlap)

    def _nodes(self, pairs: Pairs) -> Ints:
        return np.hstack([self.skin.faces[pairs.face], self.skin.faces[pairs.masters]])

    def _gradients(self, u: Floats, pairs: Pairs, margin: float = 0.0) -> Floats:
        skin = self.skin
        gradient = np.empty((len(pairs.gap), 2 * skin.faces.shape[1], skin.dimension))
        slaves, masters = skin.faces[pairs.face], skin.faces[pairs.masters]
        gap_gradients(skin.space(u), slaves, masters, pairs.at, pairs.local, margin, gradient)
        return gradient

    def _rates(self, u: Floats, pairs: Pairs, du: Floats, margin: float = 0.0) -> Floats:
        return np.asarray(np.einsum("nai,nai->n", self._gradients(u, pairs, margin), du[self._nodes(pairs)]))

    def _normal_stiffness(self, state: State, pairs: Pairs) -> Floats:
        return self._stiffness_between(state, pairs.face, pairs.quad, pairs.masters)

    def _stiffness_between(self, state: State, face: Indices | Ints, quad: Indices | Ints, other: Ints) -> Floats:
        skin = self.skin
        load = np.minimum(skin.load[face], skin.load[other])
        grip = np.minimum(skin.grip[face], skin.grip[other])
        return np.asarray(state.penalty * STIFFNESS * load / grip * 0.5 * skin.area[face, quad])

    def _depth(self, pairs: Pairs) -> Floats:
        return np.asarray(np.minimum(self.skin.depth[pairs.face], self.skin.depth[pairs.masters]))

    def _at_points(self, pairs: Pairs, values: Floats) -> Floats:
        field = np.zeros(self.skin.area.shape)
        field[pairs.face, pairs.quad] = values
        return field
