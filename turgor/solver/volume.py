"""Volume control: through limit points, where the pressure falls while the actuator goes on growing.

The path is followed by the conjugate of the load fraction (for one cavity: its volume), which keeps growing where the
pressure passes its maximum. The load fraction is then an unknown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.log import logger
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.apart import kept_apart
from turgor.solver.control import Quantity, Volume
from turgor.solver.events import Event
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.prediction import predicted
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

INVERSE_ITERATIONS = 12

SMALLEST_PART = 1e-3
"""A step is not cut below this part of the first one."""


@dataclass(frozen=True, eq=False)
class LimitPoint:
    """A state in which the load fraction is stationary along the path: a limit pressure, or the end of a snap.

    Attributes
    ----------
    equilibrium
        The state.
    maximum
        Whether the pressure has a maximum there (else a minimum).
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
    """

    def __init__(
        self,
        system: System,
        linear: StiffnessSolver,
        start: Equilibrium,
        step: float,
        options: NewtonOptions,
        quantity: Quantity | None = None,
    ) -> None:
        self.system = system
        self.linear = linear
        self.options = options
        self.quantity = quantity or Volume()
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
        while abs(self.step) >= SMALLEST_PART * abs(self.first_step):
            now = self.measure(self.here)
            whole = limit is not None and (limit - now) / self.step < 1.0 + SLACK
            aim = limit if whole and limit is not None else now + self.step
            try:
                found = self.at(aim)
            except NotConvergedError as error:
                log.info("volume step failed: %s", error.reason)
                self.failure = error
                self.step = 0.4 * (aim - now)
                continue
            if found.factorisations <= EASY:
                self.step = max(self.step, 1.4 * (aim - now), key=abs)
            self._earlier, self.before, self.here = self.before, self.here, found
            return found
        return None

    def stand_at(self, here: Equilibrium, before: Equilibrium | None, earlier: Equilibrium | None = None) -> None:
        """Go on from an equilibrium, predicting from it and one or two others."""
        self._earlier, self.before, self.here = earlier, before, here

    def measure(self, equilibrium: Equilibrium) -> float:
        """Return the quantity at an equilibrium."""
        conjugate = self.system.conjugate(equilibrium.state, self.quantity.weights)
        return self.quantity.value(conjugate, equilibrium.fraction)

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
            return find_equilibrium(self.system, self.linear, state, fraction, self.options, control=control)

        return kept_apart(self.system, find, guess)

    def limit_between(self, first: Equilibrium, second: Equilibrium, tolerance: float = 1e-6) -> LimitPoint:
        """Return the limit point between the last two equilibria of the walk, whose compliances differ in sign.

        The load fraction is stationary where its slope by the conjugate, the inverse of the compliance, vanishes; the
        secant of the slopes finds the place, safeguarded by halving. Each state is predicted from the two that enclose
        it and the one next to them.

        Raises
        ------
        NotConvergedError
            If the limit cannot be located; the walk then stands at `second` again.
        """
        ends = [(self.measure(e), 1.0 / _compliance(e), e) for e in (first, second)]
        span = ends[1][0] - ends[0][0]
        best = max(ends, key=lambda end: end[2].fraction * np.sign(ends[0][1]))[2]
        third = self._earlier
        nearer = 1.0
        for _ in range(30):
            (q0, s0, e0), (q1, s1, e1) = ends
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
            slope = 1.0 / _compliance(best)
            dropped = 0 if slope * s0 > 0 else 1
            third = ends[dropped][2]
            ends[dropped] = (aim, slope, best)
            if abs(slope) * span <= tolerance * abs(best.fraction):
                break
        return LimitPoint(best, ends[0][1] > 0, softest_mode(self.system, self.linear, best))

    def with_compliance(self, equilibrium: Equilibrium) -> Equilibrium:
        """Return an equilibrium with its compliance, for which the tangent is factorised once more."""
        factorise_tangent(self.system, self.linear, equilibrium.state)
        found = compliance(self.system, self.linear, equilibrium, self.quantity.weights)
        return replace(equilibrium, compliance=found)


def compliance(system: System, linear: StiffnessSolver, equilibrium: Equilibrium, weights: Floats | None) -> float:
    """Return dQ/df along the path of equilibria, by the tangent that was factorised last."""
    growth = system.growth(equilibrium.fraction)
    response = linear.solve(system.free_part(system.load_direction(equilibrium.state, growth)))
    return float(system.free_part(system.load_direction(equilibrium.state, weights)) @ response)


def softest_mode(system: System, linear: StiffnessSolver, equilibrium: Equilibrium) -> Floats:
    """Return the eigenmode of the tangent's smallest eigenvalue in size, ``(n_points, d)``, largest component one.

    By inverse iteration, from the load's direction and a little of everything: at a bifurcation the load has no part
    in the mode.
    """
    factorise_tangent(system, linear, equilibrium.state)
    vector = system.free_part(system.load_direction(equilibrium.state, system.growth(equilibrium.fraction)))
    noise = np.random.default_rng(0).standard_normal(len(vector))
    vector = vector + 0.1 * float(np.linalg.norm(vector)) / np.sqrt(len(vector)) * noise
    if not np.any(vector):
        vector = noise
    for _ in range(INVERSE_ITERATIONS):
        vector = linear.solve(vector)
        vector /= np.linalg.norm(vector)
    mode = system.nodal(vector)
    largest = mode.ravel()[np.argmax(np.abs(mode))]
    return np.asarray(mode / largest)


def _compliance(equilibrium: Equilibrium) -> float:
    assert equilibrium.compliance is not None
    return equilibrium.compliance
