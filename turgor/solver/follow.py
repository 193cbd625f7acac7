"""The path by volume, by an amount of air or by arc length: through limits, to states of given size."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from turgor.common.blas import dense_products_on_one_thread
from turgor.common.errors import InputError, SolverError
from turgor.common.log import logger
from turgor.fem.system import System
from turgor.solver.air import at_limit_of_air, limit_of_air
from turgor.solver.apart import kept_apart
from turgor.solver.arc import Arc
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.control import Air, Quantity, Volume
from turgor.solver.events import Event
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.path import PathOptions
from turgor.solver.stiffness import StiffnessSolver
from turgor.solver.stops import ALONG_THE_ARC, out_of_reach, stopped
from turgor.solver.tally import Tally
from turgor.solver.volume import LimitPoint, VolumeWalk

log = logger("solver")

OnEquilibrium = Callable[[Equilibrium], None]
OnProgress = Callable[[float, int, float], None]

FIRST_STEP = 0.3
"""First step of a walk from rest, in parts of what the quantity is there."""

LARGEST_LOAD = 100.0
"""Load fraction beyond which an arc is given up: the material locks, or is sucked empty, and its volume hardly changes.

By the place on the path and not by the number of states, so that a run that is taken up ends there, too. Far above
one, as the loads of a case, where the arc has its unit from, need not be near those of the target.
"""


@dense_products_on_one_thread()
def follow(
    system: System,
    quantity: Quantity,
    targets: Sequence[float],
    *,
    options: PathOptions | None = None,
    start: Equilibrium | None = None,
    on_equilibrium: OnEquilibrium | None = None,
    on_progress: OnProgress | None = None,
) -> list[Equilibrium]:
    """Bring the system into equilibrium at each of the given values of a quantity, the load being what it must be.

    Parameters
    ----------
    system
        The actuator; its loads follow the load fraction in proportion.
    quantity
        What is prescribed: :class:`turgor.solver.control.Volume` or :class:`turgor.solver.control.Air`.
    targets
        Values of the quantity, all above or all below that at the start (:func:`settled`), in order; each is hit
        exactly.
    options
        Tolerance and iteration limit of each equilibrium, and bounds of a step: the largest in parts of the way to the
        last target, the smallest in parts of the first one.
    start
        An equilibrium of the same system to go on from; targets that it has reached are skipped.
    on_equilibrium
        Called with each state as soon as it is reached.
    on_progress
        Called after every step with the part of the way done, the iterations and the residual.

    Returns
    -------
    list of Equilibrium
        The states at the targets, and between them those of special kind (:class:`turgor.solver.events.Event`): the
        limits of the load, located, and the first state behind a bifurcation, each with its mode.

    Raises
    ------
    InputError
        If the targets are not in order, given displacements grow with the load, or there is friction.
    StoppedShortError
        If the walk ends before the last target; the last equilibrium found has been delivered too.
    """
    options = options or PathOptions()
    walk = _walk_from(system, quantity, options, start)
    begin = walk.measure(walk.here)
    sign = _direction(begin, targets, start is not None)
    walk.longest = options.largest_step * abs(targets[-1] - begin)
    walk.step = walk.first_step = sign * _first_step(begin, targets)
    post = _Post(walk, on_equilibrium)
    if start is None and system.loading.acts_at_start:
        post.send(walk.here)
    with _telling_why(walk, post, ALONG_THE_ARC if isinstance(quantity, Volume) else None, targets[-1]):
        for target in targets:
            while sign * (target - walk.measure(walk.here)) > _rounding(target):
                previous = walk.here
                stride = walk.stride(target)
                if stride is None:
                    raise _nowhere(walk)
                found, limit = stride
                post.tally.count(found)
                if on_progress is not None:
                    part = (walk.measure(found) - begin) / (targets[-1] - begin)
                    on_progress(part, found.iterations, found.residuals[-1])
                if limit is not None:
                    post.send_limit(limit)
                post.send_bifurcation(previous, found)
            post.send_once(walk.here)
    return post.sent


@dense_products_on_one_thread()
def follow_arc(
    system: System,
    volume: Volume,
    target: float,
    length: float,
    *,
    options: PathOptions | None = None,
    start: Equilibrium | None = None,
    before: Equilibrium | None = None,
    on_equilibrium: OnEquilibrium | None = None,
    on_progress: OnProgress | None = None,
) -> list[Equilibrium]:
    """Follow the path by its arc length until the volume has a given value, which is hit exactly.

    Parameters
    ----------
    system, options, start, on_equilibrium, on_progress
        As for :func:`follow`.
    volume
        The measure of volume.
    target
        Its value at the end.
    length
        Distance between the states delivered, in the plane of volume and load fraction; along the first the way from
        rest to the target counts as one. Steps are shorter where `options` bounds them to less of that way.
    before
        The equilibrium that was delivered before `start`: the path goes on as from there to `start`. Left out, it sets
        out towards the target, which is back the way it came where the volume has turned.

    Returns
    -------
    list of Equilibrium
        The states, and between them the limits of the load where the volume grows through them, and the first state
        behind a bifurcation.

    Raises
    ------
    InputError, StoppedShortError
        As for :func:`follow`.
    """
    options = options or PathOptions()
    walk = _walk_from(system, volume, options, start)
    rest = volume.value(system.conjugate(system.reference_state(), volume.weights), 0.0)
    scale = abs(target - rest)
    sign = _direction(walk.measure(walk.here), [target], start is not None)
    post = _Post(walk, on_equilibrium)
    if start is None and system.loading.acts_at_start:
        post.send(walk.here)
    parts = math.ceil(length / options.largest_step)
    arc = Arc(walk, sign, scale, length / parts, before)
    taken = 0
    with _telling_why(walk, post):
        while sign * (target - walk.measure(walk.here)) > _rounding(target):
            part = (walk.measure(walk.here) - rest) / (target - rest)
            if part < -1.0:
                raise out_of_reach(system, walk.here, part, "the path leads back past where it began")
            if abs(walk.here.fraction) > LARGEST_LOAD:
                raise out_of_reach(system, walk.here, part, f"the loads are {LARGEST_LOAD:g} times what they are given")
            previous = walk.here
            stride = arc.stride_to(target, sign)
            if stride is None:
                raise _nowhere(walk)
            found, limit = stride
            post.tally.count(found)
            if on_progress is not None:
                on_progress((walk.measure(found) - rest) / (target - rest), found.iterations, found.residuals[-1])
            if limit is not None:
                post.send_limit(limit)
            if previous.rising == found.rising or arc.is_flat(previous, found):
                post.send_bifurcation(previous, found)
            # Behind a state that was delivered the count begins anew, as it does where a run is taken up there.
            taken = 0 if post.last is found else taken + 1
            if taken == parts:
                taken = 0
                post.send_once(walk.here)
        post.send_once(walk.here)
    return post.sent


class _Post:
    """Hands out equilibria of a walk with the work that led to them, and remembers them."""

    def __init__(self, walk: VolumeWalk, on_equilibrium: OnEquilibrium | None) -> None:
        self.walk = walk
        self.tally = Tally(walk.linear)
        self.last = walk.here
        self.sent: list[Equilibrium] = []
        self._on_equilibrium = on_equilibrium

    def send(self, equilibrium: Equilibrium) -> None:
        """Hand out an equilibrium."""
        self.last = equilibrium
        self.sent.append(self.tally.closed(equilibrium))
        if self._on_equilibrium is not None:
            self._on_equilibrium(self.sent[-1])

    def send_once(self, equilibrium: Equilibrium) -> None:
        """Hand out an equilibrium unless it was the last one to be."""
        if equilibrium is not self.last:
            self.send(equilibrium)

    def send_limit(self, limit: LimitPoint) -> None:
        """Hand out a limit of the load."""
        log.info("limit of the load at %.5g", limit.equilibrium.fraction)
        self.send(replace(limit.equilibrium, event=limit.event, mode=limit.mode))

    def send_bifurcation(self, before: Equilibrium, found: Equilibrium) -> None:
        """Hand out a state where the walk stands if the path has lost its stability on the way to it."""
        if not self.walk.loses_stability(before, found):
            return
        log.warning("bifurcation between %.5g and %.5g of the load", before.fraction, found.fraction)
        self.send(replace(found, event=Event.BIFURCATION, mode=self.walk.softest_mode(found)))
        self.last = found


def _walk_from(system: System, quantity: Quantity, options: PathOptions, start: Equilibrium | None) -> VolumeWalk:
    if system.constraints.moves:
        raise InputError("given displacements cannot grow where the load is what it must be", key="control")
    if system.loading.kinks:
        raise InputError("loads with a programme follow time, not a volume", key="control")
    if system.rubs:
        raise InputError("friction follows the path of the loads, not a volume", key="control")
    linear = make_stiffness_solver(system, options.newton.linear)
    here = start or settled(system, linear, options.newton)
    try:
        return VolumeWalk(system, linear, here, 1.0, options.newton, quantity, smallest_part=options.smallest_step)
    except NotConvergedError as error:
        raise stopped(system, here, error, instead=None) from error


def settled(system: System, linear: StiffnessSolver, options: NewtonOptions) -> Equilibrium:
    """Return where a walk begins: rest, or the equilibrium under what acts from the start.

    Raises
    ------
    StoppedShortError
        If there is none.
    """
    rest = Equilibrium(system.reference_state(), 0.0, (0.0,), 0, 0)
    if not system.loading.acts_at_start:
        return rest
    try:
        return kept_apart(system, lambda state: find_equilibrium(system, linear, state, 0.0, options), rest.state)
    except NotConvergedError as error:
        raise stopped(system, rest, error, instead=None) from error


def _direction(begin: float, targets: Sequence[float], going_on: bool) -> float:
    """Return the sign in which the targets lie; going on, some may lie behind."""
    sign = float(np.sign(targets[-1] - begin)) if len(targets) else 0.0
    ahead = [begin, *(t for t in targets if sign * (t - begin) > 0.0)] if going_on else [begin, *targets]
    if sign == 0.0 and going_on:
        return 1.0
    if sign == 0.0 or any(sign * (b - a) <= 0.0 for a, b in itertools.pairwise(ahead)):
        raise InputError("the targets must lead away from the start, in order", key="targets", value=list(targets))
    return sign


def _first_step(begin: float, targets: Sequence[float]) -> float:
    return min(abs(targets[-1] - begin), FIRST_STEP * abs(begin) or np.inf)


def _rounding(target: float) -> float:
    return 1e-6 * abs(target)


def _nowhere(walk: VolumeWalk) -> NotConvergedError:
    return walk.failure or NotConvergedError("the path turns back")


@contextlib.contextmanager
def _telling_why(walk: VolumeWalk, post: _Post, instead: str | None = None, target: float = math.nan) -> Iterator[None]:
    """Where the solver stops, hand out the last equilibrium found; say why there is none beyond, and what `instead`."""
    try:
        yield
    except SolverError as error:
        if not isinstance(error, NotConvergedError):
            post.send_once(walk.here)
            raise
        air = walk.quantity if isinstance(walk.quantity, Air) else None
        if air is not None and (limit := limit_of_air(walk, target)) is not None:
            post.send(limit)
            raise at_limit_of_air(walk, air, limit, target) from error
        post.send_once(walk.here)
        raise stopped(walk.system, walk.here, error, instead=instead) from error
