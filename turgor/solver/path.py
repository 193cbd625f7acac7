"""The load path: from rest to the target through every requested load, in steps as long as convergence allows."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from turgor.common.errors import InputError, SolverError
from turgor.common.log import logger
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.loads import Pressure
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.linear import LinearSolver, make_linear_solver
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.volume import LimitPoint, VolumeWalk

log = logger("solver")

CUT = 0.4
GROWTH = 1.6
EASY = 7
"""A step that took no more iterations than this lets the next one grow."""

FAILURES = 2
"""After so many failed steps on the way to one load, volume control looks for what is in the way."""

STIFFER = 6
"""How often contact is made stiffer before one equilibrium is given up."""

VOLUME_STEPS = 60
"""Steps that volume control may take between two requested loads."""


@dataclass(frozen=True)
class PathOptions:
    """How to walk along the load path.

    Attributes
    ----------
    newton
        Tolerance and iteration limit of each equilibrium.
    largest_step, smallest_step
        Bounds of a step in load fraction. The walk ends where not even the smallest step finds an equilibrium.
    """

    newton: NewtonOptions = field(default_factory=NewtonOptions)
    largest_step: float = 1.0
    smallest_step: float = 1e-3


class StoppedShortError(SolverError):
    """No equilibrium was found beyond the last one delivered."""


class LimitPressureError(StoppedShortError):
    """The load has a maximum on the way: beyond it there is no equilibrium, whatever the solver.

    ``limit`` is the state of the maximum, found by volume control, with the eigenmode in which the actuator gives way.
    """

    def __init__(self, reason: str, *, advice: str, facts: dict[str, object], limit: LimitPoint) -> None:
        super().__init__(reason, advice=advice, facts=facts)
        self.limit = limit


def solve_path(
    system: System,
    fractions: Sequence[float],
    *,
    options: PathOptions | None = None,
    start: Equilibrium | None = None,
    on_equilibrium: Callable[[Equilibrium], None] | None = None,
    on_progress: Callable[[float, int, float], None] | None = None,
) -> list[Equilibrium]:
    """Bring the system into equilibrium at each of the requested load fractions.

    Parameters
    ----------
    system
        The actuator.
    fractions
        Ascending load fractions in (0, 1] at which an equilibrium is wanted; each is hit exactly, whatever steps
        lie between. Weight acts in full from the start, and its equilibrium at fraction 0 is delivered first.
    options
        Tolerances and step bounds.
    start
        An equilibrium of the same system to go on from; fractions up to its own are skipped.
    on_equilibrium
        Called with each requested equilibrium as soon as it is reached.
    on_progress
        Called after every iteration with the fraction aimed at, the iteration and the relative residual.

    Returns
    -------
    list of Equilibrium
        The requested equilibria (without `start`).

    Raises
    ------
    InputError
        If the fractions are not ascending numbers in (0, 1].
    StoppedShortError
        If the walk ends before the last fraction; the last equilibrium that was found has been delivered too.
    """
    wanted = [float(f) for f in fractions]
    if not wanted or not all(0.0 < f <= 1.0 for f in wanted) or any(b <= a for a, b in itertools.pairwise(wanted)):
        raise InputError("the load fractions must ascend within 0 < f ≤ 1", key="fractions", value=wanted)
    walk = _Walk(system, options or PathOptions(), start, on_progress)
    reached: list[Equilibrium] = []

    def deliver(equilibrium: Equilibrium) -> None:
        reached.append(equilibrium)
        if on_equilibrium is not None:
            on_equilibrium(equilibrium)

    try:
        if start is None and system.loaded_at_start:
            walk.settle()
            deliver(walk.arrival())
        for fraction in wanted:
            if fraction > walk.here.fraction:
                walk.to(fraction)
                deliver(walk.arrival())
    except StoppedShortError:
        if walk.has_moved:
            deliver(walk.arrival())
        raise
    return reached


class _Walk:
    """The last two equilibria and the step length: what the next step is predicted from."""

    def __init__(
        self,
        system: System,
        options: PathOptions,
        start: Equilibrium | None,
        on_progress: Callable[[float, int, float], None] | None,
    ) -> None:
        self.system = system
        self.options = options
        self.on_progress = on_progress
        self.linear: LinearSolver = make_linear_solver(system.pattern.row_start, system.pattern.column)
        self.here = start or Equilibrium(system.reference_state(), 0.0, (0.0,), 0, 0)
        self.before: Equilibrium | None = None
        self.step = options.largest_step
        self._residuals: list[float] = []
        self._factorisations = 0
        self._failures = 0

    @property
    def has_moved(self) -> bool:
        """Whether equilibria were found since the last arrival."""
        return bool(self._factorisations)

    def arrival(self) -> Equilibrium:
        """Return the equilibrium reached, with the work of all steps since the last arrival."""
        last = self.here
        residuals = (*self._residuals, last.residuals[-1])
        whole = Equilibrium(last.state, last.fraction, residuals, self._factorisations, last.negative_pivots)
        self._residuals, self._factorisations = [], 0
        return whole

    def settle(self) -> None:
        """Find the equilibrium at load fraction zero under what acts from the start."""
        try:
            self._arrive(self._attempt(0.0, self.here.state))
        except NotConvergedError as error:
            raise self._stopped(error) from error

    def to(self, target: float) -> None:
        """Walk to the load fraction `target`."""
        self._failures = 0
        while self.here.fraction < target:
            aim = min(target, self.here.fraction + self.step)
            if target - aim < 0.2 * self.step:
                aim = target
            found = self._try(aim, target)
            if found is not None:
                self.before = self.here
                self._arrive(found)

    def _arrive(self, found: Equilibrium) -> None:
        self.here = found
        self._count(found)

    def _count(self, found: Equilibrium) -> None:
        self._residuals += found.residuals[:-1]
        self._factorisations += found.factorisations

    def _try(self, aim: float, target: float) -> Equilibrium | None:
        """Attempt one step towards `target`; shorten the next and return ``None`` if it fails."""
        size = aim - self.here.fraction
        try:
            found = self._attempt(aim, self._predicted(aim))
        except NotConvergedError as error:
            log.info("step to %.4g failed: %s", aim, error.reason)
            return self._failed(size, target, error)
        if found.stable is False and self.here.stable is not False and size > 4 * self.options.smallest_step:
            # A long step can land on an unstable branch that a shorter one would not have met.
            log.info("step to %.4g ended in an unstable equilibrium; trying a shorter one", aim)
            self.step = CUT * size
            return None
        if found.iterations <= EASY:
            self.step = min(max(self.step, GROWTH * size), self.options.largest_step)
        return found

    def _failed(self, size: float, target: float, error: NotConvergedError) -> Equilibrium | None:
        """Shorten the step; where that has not helped, go on by volume control."""
        self._failures += 1
        self.step = CUT * size
        if self._failures == FAILURES and not self.system.constraints.moves:
            found = self._by_volume(target)
            if found is not None:
                return found
        if self.step < self.options.smallest_step:
            raise self._stopped(error) from error
        return None

    def _by_volume(self, target: float) -> Equilibrium | None:
        """Follow the path by volume to the load fraction `target`, or to the limit before it.

        Returns ``None`` where volume control does not get on either.

        Raises
        ------
        LimitPressureError
            If the load has a maximum before `target`.
        """
        log.info("going on by volume control from %.4g", self.here.fraction)
        system = self.system
        now = system.conjugate(self.here.state)
        rest = system.conjugate(self.before.state if self.before else system.reference_state())
        step = 0.5 * abs(now - rest) or 0.05 * abs(now)
        if step == 0.0:
            return None
        walk = VolumeWalk(system, self.linear, self.here, step, self.options.newton)
        previous = walk.here
        for found in itertools.islice(walk, VOLUME_STEPS):
            self._count(found)
            if self.on_progress is not None:
                self.on_progress(found.fraction, found.iterations, found.residuals[-1])
            if previous.rising and not found.rising:
                raise self._at_limit(walk.limit_between(previous, found))
            if found.fraction >= target:
                try:
                    return self._attempt(target, found.state)
                except NotConvergedError:
                    return None
            self.before, self.here = previous, found
            previous = found
        return None

    def _attempt(self, aim: float, guess: State) -> Equilibrium:
        def report(iteration: int, residual: float) -> None:
            if self.on_progress is not None:
                self.on_progress(aim, iteration, residual)

        found = find_equilibrium(self.system, self.linear, guess, aim, self.options.newton, report)
        for _ in range(STIFFER):
            overlap = _overlap(self.system, found.state)
            if overlap <= LARGEST_OVERLAP:
                return found
            penalty = found.state.penalty * max(2.0, 2.0 * overlap / LARGEST_OVERLAP)
            log.info("overlap of %.2g of the wall: contact made stiffer, factor %.3g", overlap, penalty)
            self._count(found)
            stiffer = replace(found.state, penalty=penalty)
            found = find_equilibrium(self.system, self.linear, stiffer, aim, self.options.newton, report)
        raise NotConvergedError(
            "surfaces overlap too much however stiff their contact is", facts={"overlap_per_wall": overlap}
        )

    def _predicted(self, aim: float) -> State:
        """Extrapolate the last two equilibria along a straight line, unless that would turn an element inside out.

        It ends where surfaces would pass into each other too far.
        """
        here = self.here
        if self.before is None:
            return here.state
        reach = (aim - here.fraction) / (here.fraction - self.before.fraction)
        reach = min(reach, 2.0)
        reach *= self.system.longest_step(here.state, reach * (here.state.u - self.before.state.u))
        predicted = here.state.beyond(self.before.state, reach)
        return predicted if self.system.worst_jacobian(predicted.u)[0] > 0.0 else here.state

    def _stopped(self, error: NotConvergedError) -> StoppedShortError:
        facts = self._facts()
        return StoppedShortError(
            f"no equilibrium was found beyond {_load_text(facts)} ({error.reason})",
            advice=(
                "The material may lose its stability there, or the mesh may be too coarse where it is most distorted"
            ),
            facts=facts | error.facts,
        )

    def _at_limit(self, limit: LimitPoint) -> LimitPressureError:
        self._arrive(limit.equilibrium)
        facts = self._facts()
        worst = int(np.argmax(np.linalg.norm(limit.mode, axis=1)))
        facts["mode_largest_at_mm"] = [round(float(x), 3) for x in self.system.mesh.points[worst]]
        return LimitPressureError(
            f"the limit is reached at {_load_text(facts)}: beyond it the actuator grows while the pressure falls",
            advice="A thicker wall, a stiffer or a stiffening material raises the limit",
            facts=facts,
            limit=limit,
        )

    def _facts(self) -> dict[str, object]:
        here = self.here
        facts: dict[str, object] = {"last_fraction": here.fraction, "last_stable": here.stable}
        for load, name, value in zip(self.system.loads, self.system.load_names, here.state.loads, strict=True):
            pressure = isinstance(load, Pressure)
            facts[f"{name}_kPa" if pressure else name] = float(value) * (1e3 if pressure else 1.0)
        return facts


def _load_text(facts: dict[str, object]) -> str:
    pressures = [f"{value:.4g} kPa in {name[9:-4]}" for name, value in facts.items() if name.startswith("pressure:")]
    return ", ".join(pressures) or f"{facts['last_fraction']:.4g} of the load"


def _overlap(system: System, state: State) -> float:
    """Return the largest overlap of any contact over the wall there."""
    return max((touch.overlap_per_wall for touch in system.touches(state)), default=0.0)


def output_fractions(steps: int) -> list[float]:
    """Return `steps` equal load fractions that end at exactly 1."""
    return [float(f) for f in np.linspace(0.0, 1.0, steps + 1)[1:]]
