"""Volume control: through limit points, where the pressure falls while the actuator goes on growing.

The path is followed by the conjugate of the load fraction (for one cavity: its volume), which keeps growing where the
pressure passes its maximum. The load fraction is then an unknown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from turgor.common.log import logger
from turgor.fem.system import System
from turgor.solver.control import FixedConjugate
from turgor.solver.linear import LinearSolver
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, factorise_tangent, find_equilibrium

log = logger("solver")

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
    mode: np.ndarray[tuple[int, ...], np.dtype[np.float64]]


class VolumeWalk:
    """Equilibria at growing volume, from a first one on.

    Parameters
    ----------
    system, linear
        The actuator and the solver of its pattern.
    start
        An equilibrium; the walk goes on from it.
    step
        First step of the conjugate, N mm.
    options
        Tolerance and iteration limit of each equilibrium.
    """

    def __init__(
        self, system: System, linear: LinearSolver, start: Equilibrium, step: float, options: NewtonOptions
    ) -> None:
        self.system = system
        self.linear = linear
        self.options = options
        self.here = start if start.compliance is not None else self._with_compliance(start)
        self.before: Equilibrium | None = None
        self.step = self.first_step = step

    def __iter__(self) -> Iterator[Equilibrium]:
        """Yield one equilibrium after the other; ends where not even a small step finds one."""
        while True:
            aim = self.system.conjugate(self.here.state) + self.step
            try:
                found = self.at(aim)
            except NotConvergedError as error:
                log.info("volume step failed: %s", error.reason)
                self.step *= 0.4
                if self.step < SMALLEST_PART * self.first_step:
                    return
                continue
            if found.iterations <= 5:
                self.step *= 1.4
            self.before, self.here = self.here, found
            yield found

    def at(self, conjugate: float) -> Equilibrium:
        """Return the equilibrium at a given conjugate, predicted from the last two.

        Raises
        ------
        NotConvergedError
            If there is none near.
        """
        here, before = self.here, self.before
        guess, fraction = here.state, here.fraction
        if before is not None:
            last = self.system.conjugate(here.state)
            reach = (conjugate - last) / (last - self.system.conjugate(before.state))
            predicted = here.state.beyond(before.state, reach)
            if self.system.worst_jacobian(predicted.u)[0] > 0.0:
                guess = predicted
                fraction += reach * (here.fraction - before.fraction)
        control = FixedConjugate(conjugate)
        found = find_equilibrium(self.system, self.linear, guess, fraction, self.options, control=control)
        # A prediction that needed no iteration has not been asked for its compliance yet.
        return found if found.compliance is not None else self._with_compliance(found)

    def limit_between(self, first: Equilibrium, second: Equilibrium, tolerance: float = 1e-6) -> LimitPoint:
        """Return the limit point between two equilibria of the walk whose compliances differ in sign.

        The load fraction is stationary where its slope by the conjugate, the inverse of the compliance, vanishes; the
        secant of the slopes finds the place, safeguarded by halving.
        """
        ends = [(self.system.conjugate(e.state), 1.0 / _compliance(e), e) for e in (first, second)]
        span = ends[1][0] - ends[0][0]
        best = max(ends, key=lambda end: end[2].fraction * np.sign(ends[0][1]))[2]
        for _ in range(30):
            (q0, s0, e0), (q1, s1, e1) = ends
            self.before, self.here = e0, e1
            aim = q0 - s0 * (q1 - q0) / (s1 - s0)
            aim = min(max(aim, q0 + 0.05 * (q1 - q0)), q1 - 0.05 * (q1 - q0))
            best = self.at(aim)
            slope = 1.0 / _compliance(best)
            ends[0 if slope * s0 > 0 else 1] = (aim, slope, best)
            if abs(slope) * span <= tolerance * abs(best.fraction):
                break
        return LimitPoint(best, ends[0][1] > 0, self._mode(best))

    def _with_compliance(self, equilibrium: Equilibrium) -> Equilibrium:
        factorise_tangent(self.system, self.linear, equilibrium.state)
        direction = self.system.load_direction(equilibrium.state)
        response = self.linear.solve(self.system.free_part(direction))
        return replace(equilibrium, compliance=float(self.system.free_part(direction) @ response))

    def _mode(self, equilibrium: Equilibrium) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Return the eigenmode of the smallest eigenvalue in size, by inverse iteration."""
        factorise_tangent(self.system, self.linear, equilibrium.state)
        vector = self.system.free_part(self.system.load_direction(equilibrium.state))
        for _ in range(4):
            vector = self.linear.solve(vector)
            vector /= np.linalg.norm(vector)
        mode = self.system.nodal(vector)
        largest = mode.ravel()[np.argmax(np.abs(mode))]
        return np.asarray(mode / largest)


def _compliance(equilibrium: Equilibrium) -> float:
    assert equilibrium.compliance is not None
    return equilibrium.compliance
