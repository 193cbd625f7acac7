"""The load path: from rest to the target through every requested load, in steps as long as convergence allows."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.blas import dense_products_on_one_thread
from turgor.common.errors import InputError, SolverError
from turgor.common.log import logger
from turgor.fem.programme import ROUNDING
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.apart import kept_apart
from turgor.solver.apiece import STEEPER, changes, steep_alone, taking_part
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.control import Volume
from turgor.solver.events import Event
from turgor.solver.limits import after_snap, at_load
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.prediction import predicted
from turgor.solver.slopes import compliance, is_monotone, knows_volume, softest_mode, turns_alone
from turgor.solver.stops import LimitPressureError, StoppedShortError, at_limit, stopped
from turgor.solver.tally import Tally
from turgor.solver.tangent import factorise_tangent
from turgor.solver.volume import CUT, EASY, FEW_CUTS, LimitPoint, VolumeWalk

__all__ = ["LimitPressureError", "PathOptions", "StoppedShortError", "output_fractions", "solve_path"]

log = logger("solver")

Floats = NDArray[np.float64]

GROWTH = 1.6

FAILURES = 2
"""After so many failed steps on the way to one load, volume control looks for what is in the way."""

LARGE_CHANGE = 1.0
"""A step is asked whether it has jumped if it has changed the conjugate by more than this part of it, or `STEEPER`
times as fast as the step before (the first step: as the tangent at its start says).

Where cavities are roomy, a wall that snaps changes the conjugate by little: a shallow arch by a twentieth, 16 times as
fast as the step before. Before its limit it gives way up to twice as fast from step to step.
"""

LONGEST_REACH = 2.0
"""Lengths of the last step by which the next one is predicted at most."""

LAGS = 25
"""How often an equilibrium is found again with the forces of friction that it shows, before it is given up."""

RUBBING = 1e-3
"""The forces of friction have settled when they change by less than this part of all forces of contact."""

SAME = 1e-9
"""Part of a step's size below which two conjugates are one."""

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
        Bounds of a step in load fraction. One that ends at a fraction asked for may be a fifth longer; the walk ends
        where the next one would be shorter.
    post_snap
        Whether to go on behind a limit from where the actuator snaps to: the state under the same loads. Otherwise the
        walk ends at a limit.
    """

    newton: NewtonOptions = field(default_factory=NewtonOptions)
    largest_step: float = 1.0
    smallest_step: float = 1e-3
    post_snap: bool = False


@dense_products_on_one_thread()
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
        lie between. Weight acts in full from the start, and its equilibrium at fraction 0 is delivered first. Where a
        load's programme has a kink, the walk stops too, but delivers nothing.
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
        The requested equilibria (without `start`), and between them the states of special kind that were met
        (:class:`turgor.solver.events.Event`): a bifurcation, and with `PathOptions.post_snap` limits and the states
        behind them.

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
    reached: list[Equilibrium] = []

    def deliver(equilibrium: Equilibrium) -> None:
        reached.append(equilibrium)
        if on_equilibrium is not None:
            on_equilibrium(equilibrium)

    walk = _Walk(system, options or PathOptions(), start, deliver, on_progress)
    try:
        if start is None and system.loading.acts_at_start:
            walk.settle()
            walk.deliver()
        for fraction in wanted:
            for kink in system.loading.kinks:
                if walk.here.fraction + ROUNDING < kink < fraction - ROUNDING:
                    walk.to(kink)
            walk.to(fraction)
            walk.deliver()
    except NotConvergedError as error:
        walk.deliver()
        raise stopped(system, walk.here, error) from error
    except SolverError:
        walk.deliver()
        raise
    return reached


class _Walk:
    """The last three equilibria and the step length: what the next step is predicted from."""

    def __init__(
        self,
        system: System,
        options: PathOptions,
        start: Equilibrium | None,
        on_equilibrium: Callable[[Equilibrium], None],
        on_progress: Callable[[float, int, float], None] | None,
    ) -> None:
        self.system = system
        self.options = options
        self.on_equilibrium = on_equilibrium
        self.on_progress = on_progress
        self.linear = make_stiffness_solver(system, self.options.newton.linear)
        self.here = start or Equilibrium(system.reference_state(), 0.0, (0.0,), 0, 0)
        self.past: tuple[Equilibrium, ...] = ()
        self.step = options.largest_step
        self._tally = Tally(self.linear)
        self._delivered = start
        self._failures = 0
        self._tried_from: Equilibrium | None = None

    def deliver(self) -> None:
        """Hand out the equilibrium reached, with the work of all steps since the last one; not a second time."""
        if not self._tally.is_empty and self.here is not self._delivered:
            self._delivered = self.here
            self.on_equilibrium(self._tally.closed(self.here))

    def settle(self) -> None:
        """Find the equilibrium at load fraction zero under what acts from the start."""
        self._arrive(self._attempt(0.0, self.here.state))

    def to(self, target: float) -> None:
        """Walk to the load fraction `target`."""
        self._failures = 0
        at_kink = any(abs(target - kink) <= ROUNDING for kink in self.system.loading.kinks)
        turns = at_kink and self.here.fraction < target
        while self.here.fraction < target:
            step = self._longest_step()
            aim = min(target, self.here.fraction + step)
            if target - aim < 0.2 * step:
                aim = target
            found = self._try(aim, target)
            if found is not None:
                if found.event is None and found.stable is False and self.here.stable is not False:
                    found = self._bifurcated(found)
                # A snap leads nowhere that could be gone on with.
                past = () if found.event is Event.POST_SNAP else (*self.past, self.here)[-2:]
                self._arrive(found)
                self.past = past
        if turns:
            # Beyond it the path turns: what lies before says nothing of the direction.
            self.past = ()

    def _longest_step(self) -> float:
        """Return the length of the next step, less where a rigid body moves that could pass what it is to meet."""
        here = self.here
        advance = self.system.longest_advance(here.state, self.system.loading.growth(here.fraction))
        return min(self.step, max(advance, self.options.smallest_step))

    def _arrive(self, found: Equilibrium) -> None:
        self.here = found
        self._tally.count(found)
        if found.event:
            self.deliver()

    def _try(self, aim: float, target: float) -> Equilibrium | None:
        """Attempt one step towards `target`; shorten the next and return ``None`` if it fails."""
        size = aim - self.here.fraction
        try:
            found = self._attempt(aim, self._predicted(aim))
        except NotConvergedError as error:
            log.info("step to %.4g failed: %s", aim, error.reason)
            return self._failed(size, target, error)
        if size > FEW_CUTS * self.options.smallest_step and (where := self._led_astray(found)):
            log.info("step to %.4g ended %s; trying a shorter one", aim, where)
            self.step = CUT * size
            return None
        if self._may_have_jumped(found):
            log.info("step to %.4g may have passed over a limit", aim)
            return self._failed(size, target, NotConvergedError("the path has a jump"))
        if found.factorisations <= EASY:
            self.step = min(max(self.step, GROWTH * size), self.options.largest_step)
        return found

    def _led_astray(self, found: Equilibrium) -> str | None:
        """Say where a long step has ended, if it is where a shorter one might not have."""
        if found.stable is False and self.here.stable is not False:
            return "in an unstable equilibrium"
        if self.system.have_passed(self.here.state, found.state):
            return "where surfaces have passed into each other"
        return None

    def _bifurcated(self, found: Equilibrium) -> Equilibrium:
        """Mark the first state behind a bifurcation: the inertia has changed, and the load has no limit there."""
        mode = softest_mode(self.system, self.linear, found.state, self.system.loading.growth(found.fraction))
        log.warning("bifurcation between %.5g and %.5g of the load", self.here.fraction, found.fraction)
        return replace(found, event=Event.BIFURCATION, mode=mode)

    def _may_have_jumped(self, found: Equilibrium) -> bool:
        """Whether a step may have passed over a limit, to a branch behind it.

        The load is a smooth function of its conjugate, also through limits, where nothing grows with it that moves the
        conjugate by itself. Its slopes are the inverse compliances
        (:func:`turgor.solver.slopes.is_monotone`). They are asked for only where the conjugate has changed much. A
        cavity that snaps alone may hardly change it, so that the volume of each is looked at, too.
        """
        system, linear, here = self.system, self.linear, self.here
        if system.is_moved:
            return False
        growth = system.loading.growth(here.fraction)
        before, after = (system.conjugate(e.state, growth) for e in (here, found))
        large = abs(after - before) > LARGE_CHANGE * abs(before) or self._is_uneven(before, after, found, growth)
        suspects = [*([growth] if large else []), *self._uneven_alone(found)]
        if not suspects:
            return False
        at_end = [compliance(system, linear, found.state, weights, growth) for weights in suspects]
        factorise_tangent(system, linear, here.state)
        at_start = [compliance(system, linear, here.state, weights, growth) for weights in suspects]
        size = found.fraction - here.fraction
        means = [(system.conjugate(found.state, w) - system.conjugate(here.state, w)) / size for w in suspects]
        slopes = list(zip(means, at_start, at_end, strict=True))
        return (large and _turns(*slopes[0])) or any(turns_alone(*of_one) for of_one in slopes[large:])

    def _uneven_alone(self, found: Equilibrium) -> list[Floats]:
        """Return the weights of the cavities, of several, whose volumes have changed much faster than expected."""
        here = self.here
        if not self.past:
            return steep_alone(self.system, here.state, found.state, found.expected_volumes)
        earlier = self.past[-1]
        reach = (found.fraction - here.fraction) / (here.fraction - earlier.fraction)
        return steep_alone(self.system, here.state, found.state, changes(self.system, earlier.state, here.state, reach))

    def _is_uneven(self, before: float, after: float, found: Equilibrium, growth: Floats) -> bool:
        """Whether the conjugate has changed unevenly on a step, or much faster than on the one before.

        Where surfaces touch the path has corners, which say nothing.
        """
        if any(self.system.contact_force(e.state) > 0.0 for e in (self.here, found)):
            return False
        size, change = found.fraction - self.here.fraction, after - before
        return self._bends_back(before, change, size, found) or self._is_steep(change, size, found, growth)

    def _bends_back(self, before: float, change: float, size: float, found: Equilibrium) -> bool:
        """Whether the parabola with the conjugate's values at both ends of a step, and its mean, is not monotone.

        The potential tells the mean: along a path of equilibria it falls by the conjugate.
        """
        fall = self.system.energy(self.here.state) - self.system.energy(found.state)
        return abs(fall / size - before - 0.5 * change) > abs(change) / 6.0

    def _is_steep(self, change: float, size: float, found: Equilibrium, growth: Floats) -> bool:
        """Whether the conjugate has changed much faster than on the step before or, without one, than was expected."""
        if self.past:
            earlier, here = self.past[-1], self.here
            last = self.system.conjugate(here.state, growth) - self.system.conjugate(earlier.state, growth)
            expected = last * size / (here.fraction - earlier.fraction)
        else:
            expected = found.expected
        return abs(change) > STEEPER * abs(expected)

    def _failed(self, size: float, target: float, error: NotConvergedError) -> Equilibrium | None:
        """Shorten the step; where that has not helped, and before the walk ends, go on by volume control."""
        self._failures += 1
        self.step = CUT * size
        ends = self.step < self.options.smallest_step
        if (self._failures == FAILURES or ends) and self._has_volume_control:
            found = self._by_volume(target)
            if found is not None:
                return found
            self._tried_from = self.here
        if ends:
            raise error
        return None

    @property
    def _has_volume_control(self) -> bool:
        """Whether volume control may find what the load does not, and has not been tried from here."""
        return knows_volume(self.system, self.here.state) and self.here is not self._tried_from

    def _by_volume(self, target: float) -> Equilibrium | None:
        """Follow the path by volume to the load fraction `target`, or to the limit before it.

        Returns ``None`` where volume control does not get on either.

        Raises
        ------
        LimitPressureError
            If the load has a maximum before `target`.
        NotConvergedError
            If it has one that cannot be located.
        """
        system, growth = self.system, self.system.loading.growth(self.here.fraction)
        found = self._following(growth, target)
        if found is None:
            # Where others grow with the load fraction more than those that give way, their sum turns with it.
            mode = softest_mode(system, self.linear, self.here.state, growth)
            part = taking_part(system, self.here.state, mode, growth)
            found = None if np.array_equal(part, growth) else self._following(part, target)
        return found

    def _following(self, weights: Floats, target: float) -> Equilibrium | None:
        """Do as :meth:`_by_volume` by the conjugate of the given weights."""
        log.info("going on by volume control from %.4g", self.here.fraction)
        system, quantity = self.system, Volume(weights)
        rest = self.past[-1].state if self.past else system.reference_state()
        now, then = (system.conjugate(state, weights) for state in (self.here.state, rest))
        whole = 0.05 * system.conjugate(self.here.state, np.abs(weights))
        # Cavities that grow against each other may add up to nothing.
        step = 0.5 * abs(now - then) if abs(now - then) > SAME * abs(whole) else abs(whole)
        if step == 0.0:
            return None
        walk = VolumeWalk(system, self.linear, self.here, step, self.options.newton, quantity)
        for _ in range(VOLUME_STEPS):
            previous = walk.here
            stride = walk.stride()
            if stride is None:
                return None
            found, limit = stride
            self._tally.count(found)
            if not knows_volume(system, found.state):
                return None  # something has begun to rub on the way
            if self.on_progress is not None:
                self.on_progress(found.fraction, found.iterations, found.residuals[-1])
            if limit is not None and previous.rising:
                if limit.equilibrium.fraction >= target:
                    return self._below(walk, target, previous, limit)
                return self._passed(walk, limit, found)
            if found.fraction >= target:
                try:
                    return self._attempt(target, found.state)
                except NotConvergedError:
                    return None
            if walk.loses_stability(previous, found):
                found = self._bifurcated(found)
            self.past, self.here = (*self.past, previous)[-2:], found
            if found.event:
                self.deliver()
        return None

    def _below(self, walk: VolumeWalk, target: float, previous: Equilibrium, limit: LimitPoint) -> Equilibrium | None:
        """Return the state at the target that a step by volume has passed, together with a limit behind it."""
        try:
            return at_load(walk, target, previous, limit.equilibrium, self._tally)
        except NotConvergedError:
            return None

    def _passed(self, walk: VolumeWalk, limit: LimitPoint, beyond: Equilibrium) -> Equilibrium:
        """Deliver a limit; then find the state that the actuator snaps to, or raise."""
        self._arrive(replace(limit.equilibrium, event=limit.event, mode=limit.mode))
        if not self.options.post_snap:
            raise at_limit(self.system, limit)
        found = after_snap(walk, limit, beyond, self._tally)
        self._failures, self.step = 0, self.options.largest_step
        return found

    def _attempt(self, aim: float, guess: State) -> Equilibrium:
        if self.system.rubs:
            guess = replace(guess, grips=self.system.gripped(self.here.state, dragged=True).grips)
        return kept_apart(self.system, lambda state: self._found(aim, state), guess)

    def _found(self, aim: float, guess: State) -> Equilibrium:
        """Return the equilibrium in which friction goes by the normal forces of the equilibrium itself."""

        def report(iteration: int, residual: float) -> None:
            if self.on_progress is not None:
                self.on_progress(aim, iteration, residual)

        system, newton = self.system, self.options.newton
        found = find_equilibrium(system, self.linear, guess, aim, newton, report)
        for _ in range(LAGS if system.rubs else 0):
            state = system.gripped(found.state, dragged=False)
            force, scale = system.forces(state)
            allowed = max(newton.tolerance * scale, RUBBING * system.contact_force(state))
            if np.linalg.norm(system.free_part(force)) <= allowed:
                return found
            self._tally.count(found)
            found = find_equilibrium(system, self.linear, state, aim, newton, report)
            if found.iterations == 0:
                return found
        if system.rubs:
            raise NotConvergedError("the forces of friction do not settle")
        return found

    def _predicted(self, aim: float) -> State:
        """Extrapolate the last equilibria, as far as may be."""
        here = self.here
        if self.past:
            aim = min(aim, here.fraction + LONGEST_REACH * (here.fraction - self.past[-1].fraction))
        known = (*self.past, here)
        state, _ = predicted(self.system, [e.fraction for e in known], [e.state for e in known], aim)
        return state


def _turns(mean: float, at_start: float, at_end: float) -> bool:
    """Whether the load may turn on a step, from the conjugate's mean slope by it and those at both ends."""
    if mean == 0.0 or min(at_start, at_end) <= 0.0:
        return False  # nothing gives way to the loads yet, as before a body is touched
    return not is_monotone(1.0 / mean, 1.0 / at_start, 1.0 / at_end)


def output_fractions(steps: int) -> list[float]:
    """Return `steps` equal load fractions that end at exactly 1."""
    return [float(f) for f in np.linspace(0.0, 1.0, steps + 1)[1:]]
