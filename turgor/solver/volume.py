"""Volume control: through limit points, where the pressure falls while the actuator goes on growing.

The path is followed by the conjugate of the load fraction (for one cavity: its volume), which keeps growing where the
pressure passes its maximum. The load fraction is then an unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.log import logger
from turgor.fem.programme import LoadLine
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.apart import kept_apart
from turgor.solver.apiece import changes, leading_in, steep_alone
from turgor.solver.area import area_to_chord
from turgor.solver.control import Quantity, Volume
from turgor.solver.events import Event
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.prediction import predicted
from turgor.solver.slopes import (
    compliance,
    is_monotone,
    response,
    scaled,
    slope_of,
    slope_of_load,
    softest_mode,
    stable_while_held,
    turns_alone,
)
from turgor.solver.stiffness import StiffnessSolver
from turgor.solver.tangent import factorise_tangent

log = logger("solver")

Floats = NDArray[np.float64]

SLACK = 0.2
"""A step that would leave less than this part of itself to a limit goes there."""

EASY = 5
"""A step that took no more factorisations than this lets the next one grow."""

NEARER = 0.3
NEAREST = 0.01
"""Where no equilibrium is found between the ends of a limit, it is sought so much nearer to the first, so far."""

CUT = 0.4
SMALLEST_PART = 1e-3
"""A failed step is cut by this, but not below this part of the first one."""

SHORT_ENOUGH = 0.01
"""Part of the first step below which none is shortened for what it may hide, or along an arc for a limit not found."""

FEW_CUTS = 4.0
"""So many smallest steps long, one that ends in an unstable state is tried shorter: it may be on another branch. So is
one on which surfaces passed into each other."""

CLOSEST = 1e-10
"""Part of themselves by which two volumes differ that rounding may make one."""

STEEP = 1e-3
"""A state is no limit where the load changes by more than this part of itself over the step that holds it."""


@dataclass(frozen=True, eq=False)
class LimitPoint:
    """A state in which the load fraction is stationary along the path: a limit pressure, or the end of a snap.

    Attributes
    ----------
    equilibrium
        The state.
    maximum
        Whether the load is largest there in size; else it is smallest, on its way back or where it begins to grow.
    mode
        The eigenmode that the tangent loses its stiffness in, ``(n_points, 3)``, largest component one.
    """

    equilibrium: Equilibrium
    maximum: bool
    mode: Floats

    @property
    def event(self) -> Event:
        """What the state is on its path."""
        return Event.LIMIT if self.maximum else Event.MINIMUM


class VolumeWalk:
    """Equilibria at growing (or, with a negative step, shrinking) volume, or amount of air, from a first one on.

    Parameters
    ----------
    system, linear
        The actuator and the solver of its pattern.
    start
        An equilibrium; the walk goes on from it.
    step
        First step of the quantity: for the conjugate, N mm.
    options
        Tolerance and iteration limit of each equilibrium.
    quantity
        What is prescribed.
    longest
        Bound of a step's size.
    smallest_part
        Part of the first step below which none is cut.
    watched
        Another quantity of the same weights, of which no step is to hide limits.
    line
        How the loads follow the load fraction; left out, as at the start, also where the walk passes a kink of theirs.

    Attributes
    ----------
    line
        How the loads follow the load fraction.
    """

    def __init__(
        self,
        system: System,
        linear: StiffnessSolver,
        start: Equilibrium,
        step: float,
        options: NewtonOptions,
        quantity: Quantity | None = None,
        *,
        longest: float = np.inf,
        smallest_part: float = SMALLEST_PART,
        watched: Quantity | None = None,
        line: LoadLine | None = None,
    ) -> None:
        self.system = system
        self.linear = linear
        self.options = options
        self.quantity = quantity or Volume()
        self.line = line or system.loading.line_at(start.fraction)
        self.longest, self.smallest_part = longest, smallest_part
        self.watched = watched
        self.here = start if start.compliance is not None else self.with_compliance(start)
        self.before: Equilibrium | None = None
        self._earlier: Equilibrium | None = None
        self.step = self.first_step = step
        self.failure: NotConvergedError | None = None

    def __iter__(self) -> Iterator[Equilibrium]:
        """Yield one equilibrium after the other; ends where not even a small step finds one."""
        while (found := self.advance()) is not None:
            yield found

    def advance(self, limit: float | None = None) -> Equilibrium | None:
        """Return the next equilibrium, not beyond a value of the quantity; ``None`` where no step finds one."""
        while abs(self.step) >= self.smallest_part * abs(self.first_step):
            now = self.measure(self.here)
            self.step = math.copysign(min(abs(self.step), self.longest), self.step)
            whole = limit is not None and (limit - now) / self.step < 1.0 + SLACK
            aim = limit if whole and limit is not None else now + self.step
            try:
                found = self.at(aim)
            except NotConvergedError as error:
                log.info("volume step failed: %s", error.reason)
                self.failure = error
                self.step = CUT * (aim - now)
                continue
            if self.is_doubtful(found, abs((aim - now) / self.first_step)):
                self.step = CUT * (aim - now)
                continue
            if found.factorisations <= EASY:
                self.step = max(self.step, 1.4 * (aim - now), key=abs)
            self._earlier, self.before, self.here = self.before, self.here, found
            return found
        return None

    def stride(self, limit: float | None = None) -> tuple[Equilibrium, LimitPoint | None] | None:
        """Return the next equilibrium as :meth:`advance`, with the limit of the load on the way to it, if there is one.

        What looks like a limit, but cannot be located, may be a step to another branch: shorter ones are tried.

        Raises
        ------
        NotConvergedError
            If a limit cannot be located however short the step; the walk stands before it.
        """
        while True:
            here, before = self.here, self.before
            found = self.advance(limit)
            if found is None or here.rising == found.rising:
                return None if found is None else (found, None)
            try:
                point = self.limit_between(here, found)
            except NotConvergedError:
                self.step = CUT * (self.measure(found) - self.measure(here))
                self.stand_at(here, before)
                if abs(self.step) < self.smallest_part * abs(self.first_step):
                    raise
                continue
            self.stand_at(found, here)
            return found, point

    def is_doubtful(self, found: Equilibrium, part: float) -> bool:
        """Whether a shorter step should be tried, for what this one may hide or where it may have landed.

        `part` is its length over that of the first one.
        """
        if self._may_have_snapped(found) or self._has_left(found):
            log.info("the step has left the path")
            return True
        if self._one_has_left(found):
            log.info("on the step one cavity has left the path")
            return True
        if part > SHORT_ENOUGH and self._may_hide_limits(found):
            log.info("the step may hide limits")
            return True
        if part <= FEW_CUTS * self.smallest_part:
            return False
        if self.loses_stability(self.here, found):
            log.info("the step ended in an unstable state")
            return True
        if self.system.have_passed(self.here.state, found.state):
            log.info("on the step surfaces passed into each other")
            return True
        return False

    def stand_at(self, here: Equilibrium, before: Equilibrium | None, earlier: Equilibrium | None = None) -> None:
        """Go on from an equilibrium, predicting from it and one or two others."""
        self._earlier, self.before, self.here = earlier, before, here

    def measure(self, equilibrium: Equilibrium) -> float:
        """Return the quantity at an equilibrium."""
        return self.quantity.value(self._conjugate(equilibrium), equilibrium.fraction)

    def _conjugate(self, equilibrium: Equilibrium) -> float:
        return self.system.conjugate(equilibrium.state, self.quantity.weights)

    def at(self, value: float) -> Equilibrium:
        """Return the equilibrium at a given value of the quantity, predicted from the last ones.

        Raises
        ------
        NotConvergedError
            If there is none near.
        """
        known = [e for e in (self._earlier, self.before, self.here) if e is not None]
        places = [self.measure(e) for e in known]
        guess, part = predicted(self.system, places, [e.state for e in known], value)
        fraction = self.here.fraction
        if part > 0.0:
            reach = (value - places[-1]) / (places[-1] - places[-2])
            fraction += part * reach * (fraction - known[-2].fraction)
        control = self.quantity.fixed(value)

        def find(state: State) -> Equilibrium:
            return find_equilibrium(
                self.system, self.linear, state, fraction, self.options, control=control, line=self.line
            )

        return kept_apart(self.system, find, guess)

    def limit_between(self, first: Equilibrium, second: Equilibrium, tolerance: float = 1e-6) -> LimitPoint:
        """Return the limit point between the last two equilibria of the walk, whose compliances differ in sign.

        Raises
        ------
        NotConvergedError
            If the limit cannot be located, or the two lie on different branches; the walk stands at `second` again.
        """
        best, change = self.stationary_between(first, second, _fraction, slope_of_load, tolerance)
        mode = self.softest_mode(best)
        return LimitPoint(best, self._is_largest(best, mode, change), mode)

    def stationary_between(
        self,
        first: Equilibrium,
        second: Equilibrium,
        value: Callable[[Equilibrium], float],
        slope_at: Callable[[Equilibrium], float],
        tolerance: float = 1e-6,
    ) -> tuple[Equilibrium, float]:
        """Return the state between the last two equilibria of the walk in which a value is stationary along the path.

        There its slope by the conjugate vanishes (of the load fraction it is the inverse of the compliance); the
        secant of the slopes finds the place, safeguarded by halving. Each state is predicted from the two that enclose
        it and the one next to them. The number says with its sign how the value has changed on the way to it.

        Raises
        ------
        NotConvergedError
            If the state cannot be located, or the two lie on different branches; the walk stands at `second` again.
        """
        ends = [(self.measure(e), slope_at(e), e) for e in (first, second)]
        span = self._conjugate(second) - self._conjugate(first)
        best = max(ends, key=lambda end: value(end[2]) * np.sign(ends[0][1] * span))[2]
        third = self._earlier
        nearer, slope = 1.0, np.inf
        for _ in range(30):
            (q0, s0, e0), (q1, s1, e1) = ends
            if abs(q1 - q0) <= CLOSEST * abs(q0):
                break
            self.stand_at(e1, e0, third)
            aim = q0 + nearer * min(max(s0 / (s0 - s1), 0.05), 0.95) * (q1 - q0)
            try:
                best = self.at(aim)
            except NotConvergedError as error:
                # Two ends far apart say little of what lies between; nearer to the first one it is easier.
                nearer *= NEARER
                if nearer < NEAREST:
                    self.stand_at(second, first)
                    reason = f"the load has a limit near {best.fraction:.4g} of the target, not located: {error.reason}"
                    raise NotConvergedError(reason, facts=error.facts) from error
                continue
            nearer = 1.0
            slope = slope_at(best)
            dropped = 0 if slope * s0 > 0 else 1
            third = ends[dropped][2]
            ends[dropped] = (aim, slope, best)
            if abs(slope * span) <= tolerance * abs(value(best)):
                break
        if abs(slope * span) > STEEP * abs(value(best)):
            self.stand_at(second, first)
            raise NotConvergedError(f"the path jumps near {best.fraction:.4g} of the load, where a limit was expected")
        return best, ends[0][1] * span

    def _is_largest(self, limit: Equilibrium, mode: Floats, change: float) -> bool:
        """Whether the load that gives way in a limit's mode is largest there, come to by a `change` of the fraction."""
        growth = self.line.growth
        leading = leading_in(self.system, limit.state, mode, growth)
        return bool(change * growth[leading] * limit.state.loads[leading] > 0.0)

    def softest_mode(self, equilibrium: Equilibrium) -> Floats:
        """Return the eigenmode of the tangent's smallest eigenvalue in size, as :func:`softest_mode`."""
        return softest_mode(self.system, self.linear, equilibrium.state, self.line.growth)

    def with_compliance(self, equilibrium: Equilibrium) -> Equilibrium:
        """Return an equilibrium with its compliance and its inertia, for which the tangent is factorised once more."""
        factorise_tangent(self.system, self.linear, equilibrium.state)
        state, weights = equilibrium.state, self.quantity.weights
        found = compliance(self.system, self.linear, state, weights, self.line.growth)
        return replace(equilibrium, compliance=found, negative_pivots=self.linear.inertia())

    def heading(self, before: Equilibrium) -> float:
        """Return the sign with which the load fraction changes on the way on, come from the equilibrium `before`.

        That of the displacement since then along du/df (Feng, Perić and Owen 1996): it goes on where load or volume
        turn.
        """
        return float(np.sign(np.vdot(self._tangent(self.here), self.here.state.u - before.state.u)))

    def tangent_mode(self, equilibrium: Equilibrium) -> Floats:
        """Return the displacement along the path at an equilibrium, ``(n_points, d)``, largest component one."""
        return scaled(self._tangent(equilibrium))

    def _tangent(self, equilibrium: Equilibrium) -> Floats:
        """Return du/df along the path, ``(n_points, d)``."""
        factorise_tangent(self.system, self.linear, equilibrium.state)
        return self.system.nodal(response(self.system, self.linear, equilibrium.state, self.line.growth))

    def is_stable(self, equilibrium: Equilibrium) -> bool | None:
        """Say whether a state is stable while the quantity is held; ``None`` if that is not known."""
        return stable_while_held(self.system, self.quantity, equilibrium, self.line.growth)

    def loses_stability(self, before: Equilibrium, found: Equilibrium) -> bool:
        """Say whether a state is unstable while the quantity is held, and the one before it was not seen to be."""
        return self.is_stable(found) is False and self.is_stable(before) is not False

    def _may_have_snapped(self, found: Equilibrium) -> bool:
        """Whether what is held, an amount of air, may have a maximum and a minimum on the way to a state.

        It grows with its conjugate where a state is stable while it is held: however short the step, where it does not
        do so all the way the path has been left.
        """
        ends = (self.here, found)
        return all(self.is_stable(end) for end in ends) and self._may_turn(found, self.quantity)

    def _has_left(self, found: Equilibrium) -> bool:
        """Whether the load's mean on the way to a state, by the energy, is one that no path with such ends has.

        So it is where the volume turns and the step has gone over to what lies behind: the load falls at once, and a
        cubic that does so is monotone.
        """
        ends = (self.here, found)
        if not all(end.compliance for end in ends):
            return False
        change = abs(self._conjugate(found) - self._conjugate(self.here))
        most = abs(found.fraction - self.here.fraction) + change * sum(abs(slope_of_load(end)) for end in ends)
        return area_to_chord(self.system, self.quantity.weights, self.line.growth, ends) > 0.5 * change * most

    def _one_has_left(self, found: Equilibrium) -> bool:
        """Whether the volume of one cavity, of several, has jumped where the others hide it."""
        system, here, weights = self.system, self.here, self.quantity.weights
        expected = None  # of a first step, which may set out next to a limit, all that change are looked at
        span = self._conjugate(found) - self._conjugate(here)
        if self.before is not None:
            reach = span / (self._conjugate(here) - self._conjugate(self.before))
            expected = changes(system, self.before.state, here.state, reach)
        suspects = steep_alone(system, here.state, found.state, expected)
        if not suspects or span == 0.0:
            return False
        slopes = []
        for end in (found, here):
            factorise_tangent(system, self.linear, end.state)
            by_load = [compliance(system, self.linear, end.state, w, self.line.growth) for w in (weights, *suspects)]
            slopes.append([slope / by_load[0] for slope in by_load[1:]])
        means = [(system.conjugate(found.state, w) - system.conjugate(here.state, w)) / span for w in suspects]
        return any(turns_alone(*of_one) for of_one in zip(means, *reversed(slopes), strict=True))

    def _may_hide_limits(self, found: Equilibrium) -> bool:
        """Whether the load, or what is watched, may have a maximum and a minimum on the way to a state, both hidden."""
        return self._may_turn(found) or (self.watched is not None and self._may_turn(found, self.watched))

    def _may_turn(self, found: Equilibrium, quantity: Quantity | None = None) -> bool:
        """Whether a quantity, or without one the load, may turn twice on the way to a state.

        It is a smooth function of its conjugate, through limits of its own, too. One limit is told by its slopes.
        """
        ends = (self.here, found)
        if not all(end.compliance for end in ends):
            return False
        conjugates = [self._conjugate(end) for end in ends]
        if quantity is None:
            values, slopes = [end.fraction for end in ends], [slope_of_load(end) for end in ends]
        else:
            values = [quantity.value(q, end.fraction) for q, end in zip(conjugates, ends, strict=True)]
            slopes = [slope_of(quantity, self.system, end) for end in ends]
        if slopes[0] * slopes[1] < 0.0:
            return False
        change = conjugates[1] - conjugates[0]
        return change == 0.0 or not is_monotone((values[1] - values[0]) / change, *slopes)


def _fraction(equilibrium: Equilibrium) -> float:
    return equilibrium.fraction
