"""Steps along a path by its arc length, which go on where load and volume turn."""

from __future__ import annotations

import numpy as np

from turgor.common.log import logger
from turgor.fem.state import State
from turgor.solver.apart import kept_apart
from turgor.solver.area import area_to_chord
from turgor.solver.control import AlongTangent, ArcLength, Control
from turgor.solver.newton import Equilibrium, NotConvergedError, find_equilibrium
from turgor.solver.prediction import predicted
from turgor.solver.volume import FEW_CUTS, SHORT_ENOUGH, LimitPoint, VolumeWalk

log = logger("solver")

SHORTER = 0.5
"""Part of its length that a step is tried with where it has failed."""

LARGEST_AREA = 0.5
"""Area between the path along a step and its chord, in parts of the square over the chord, above which it has jumped.

Half a circle makes 0.39; a jump encloses a loop beside that.
"""


class Arc:
    """Steps of a given length in the plane of volume and load fraction, each in the direction of the last one.

    Parameters
    ----------
    walk
        Where it sets out, with a volume as its quantity.
    sign
        In which the volume is to change at first, if nothing is known of where the path came from.
    scale
        Volume that counts as much as the whole load, N mm.
    length
        Of a step.
    before
        An earlier equilibrium, from which the path has come.
    """

    def __init__(
        self, walk: VolumeWalk, sign: float, scale: float, length: float, before: Equilibrium | None = None
    ) -> None:
        self.walk, self.scale, self.length = walk, scale, length
        here = walk.here
        assert here.compliance is not None
        # The path sets out along the tangent, dQ/df being the compliance.
        way = np.array([here.compliance / scale, 1.0])
        ahead = sign * np.sign(way[0]) if before is None else walk.heading(before)
        self.direction = ahead * way / np.linalg.norm(way)
        walk.stand_at(here, before)

    def stride_to(self, target: float, sign: float) -> tuple[Equilibrium, LimitPoint | None] | None:
        """Go to the next state as :meth:`advance_to` and return it, with the limit of the load where one lies between.

        What looks like a limit, but cannot be located, may be a step to another branch: shorter ones are tried, and
        ``None`` is returned where even those lead to none.
        """
        walk, direction, length = self.walk, self.direction, self.length
        here, before = walk.here, walk.before
        while (found := self.advance_to(target, sign, length)) is not None:
            length = SHORTER * float(np.linalg.norm(self._way(found)))
            walk.stand_at(found, here, before)
            if here.rising == found.rising or not self.is_flat(here, found):
                return found, None
            try:
                limit = walk.limit_between(here, found)
            except NotConvergedError as error:
                log.info("arc-length step met no limit: %s", error.reason)
                walk.failure = error
                walk.stand_at(here, before)
                self.direction = direction
                if length < SHORT_ENOUGH * self.length:
                    return None
                continue
            walk.stand_at(found, here)
            return found, limit
        return None

    def advance_to(self, target: float, sign: float, length: float) -> Equilibrium | None:
        """Return the state behind a step of at most a length, that at a volume where it would pass it, if there is one.

        ``None`` where even short steps fail.
        """
        direction = self.direction
        while (found := self.advance(length)) is not None and sign * (self.walk.measure(found) - target) > 0.0:
            try:
                return _cut(self.walk, found, target)
            except NotConvergedError as error:
                self.walk.failure = error
                self.direction = direction
                length *= SHORTER
        return found

    def advance(self, length: float) -> Equilibrium | None:
        """Return the state behind a step of at most a length, or ``None`` where even short steps find none."""
        here = self.walk.here
        while length >= self.walk.smallest_part * self.length:
            try:
                found = self._at(length)
            except NotConvergedError as error:
                log.info("arc-length step failed: %s", error.reason)
                self.walk.failure = error
                length *= SHORTER
                continue
            way = self._way(found)
            if float(way @ self.direction) <= 0.0:
                log.info("arc-length step turned back")
                length *= SHORTER
                continue
            part = length / self.length
            if part > FEW_CUTS * self.walk.smallest_part and self.may_have_jumped(here, found):
                log.info("arc-length step may have led to another branch")
                length *= SHORTER
                continue
            if self.is_flat(here, found) and self.walk.is_doubtful(found, part):
                length *= SHORTER
                continue
            self.direction = way / np.linalg.norm(way)
            return found
        return None

    def is_flat(self, first: Equilibrium, second: Equilibrium) -> bool:
        """Whether the volume goes on in its direction between two states: then it is the load that may turn."""
        way = self._way(second, first)
        tangents = [np.array([e.compliance / self.scale, 1.0]) for e in (first, second) if e.compliance is not None]
        (before, _), (after, _) = (tangent * np.sign(tangent @ way) for tangent in tangents)
        return bool(before * after > 0.0)

    def may_have_jumped(self, first: Equilibrium, second: Equilibrium) -> bool:
        """Whether a step may have gone over to another branch, by the inertia at its ends or by the energy."""
        if not self.keeps_inertia(first, second):
            return True
        way, ends = self._way(second, first), (first, second)
        area = area_to_chord(self.walk.system, self.walk.quantity.weights, self.walk.line.growth, ends)
        return area > LARGEST_AREA * self.scale * float(way @ way)

    def keeps_inertia(self, first: Equilibrium, second: Equilibrium) -> bool:
        """Whether the tangent's negative eigenvalues are as many at both ends of a step as one path makes expect.

        One more or less where the load turns, not where the volume does; else the path bifurcates, or was left.
        """
        if first.negative_pivots is None or second.negative_pivots is None:
            return True
        turns = first.rising != second.rising and self.is_flat(first, second)
        return abs(second.negative_pivots - first.negative_pivots) == turns

    def _at(self, length: float) -> Equilibrium:
        walk = self.walk
        here, before = walk.here, walk.before
        guess, aim = here.state, here.fraction + length * float(self.direction[1])
        place, weights = (walk.measure(here), here.fraction, self.scale), walk.quantity.weights
        if before is None:
            found = self._found(AlongTangent(*place, length, weights, tangent=self.direction), guess, aim)
            guess, aim = found.state, found.fraction
        else:
            reach = length / float(np.linalg.norm(self._way(here, before)))
            guess, part = predicted(walk.system, (-1.0, 0.0), (before.state, here.state), reach)
            if part > 0.0:
                aim = here.fraction + part * reach * (here.fraction - before.fraction)
        return self._found(ArcLength(*place, length, weights), guess, aim)

    def _found(self, control: Control, guess: State, aim: float) -> Equilibrium:
        walk = self.walk

        def find(state: State) -> Equilibrium:
            return find_equilibrium(walk.system, walk.linear, state, aim, walk.options, control=control, line=walk.line)

        return kept_apart(walk.system, find, guess)

    def _way(
        self, to: Equilibrium, since: Equilibrium | None = None
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        since = since or self.walk.here
        return np.array([(self.walk.measure(to) - self.walk.measure(since)) / self.scale, to.fraction - since.fraction])


def _cut(walk: VolumeWalk, beyond: Equilibrium, target: float) -> Equilibrium:
    """Return the state at a volume between the one where the walk stands and one beyond.

    Between the two the path is as good as straight. The walk goes on standing where it stands.
    """
    here, before = walk.here, walk.before
    walk.stand_at(beyond, here, before)
    try:
        return walk.at(target)
    finally:
        walk.stand_at(here, before)
