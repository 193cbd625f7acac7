"""Behind a limit: the state that an actuator snaps to while its pressures stay."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from turgor.common.log import logger
from turgor.fem.programme import LoadLine
from turgor.fem.state import State
from turgor.solver.apart import kept_apart
from turgor.solver.apiece import taking_part
from turgor.solver.arc import Arc
from turgor.solver.control import Volume
from turgor.solver.events import Event
from turgor.solver.newton import Equilibrium, NotConvergedError, find_equilibrium
from turgor.solver.slopes import knows_volume
from turgor.solver.stops import Facts, at_limit, worst_point
from turgor.solver.tally import Tally
from turgor.solver.volume import LimitPoint, VolumeWalk

log = logger("solver")

SNAP_STEPS = 60
"""Steps that the walk along the falling branch may take."""

ARC_STEP = 0.1
"""Length of a step along the arc behind a limit, in parts of the way to it; longer ones leave winding paths."""

ARC_STEPS = 300

MOST_VOLUMES = 1000.0
"""Growth of the volume beyond which no rubber goes: tenfold stretch in every direction of a wall."""

REFINEMENTS = 12

BESIDE = 1e-3
"""Part of what lies between two states by which one between them may be seen beyond one of them."""


def after_snap(walk: VolumeWalk, limit: LimitPoint, beyond: Equilibrium, tally: Tally) -> Equilibrium:
    """Follow the falling branch until it has risen to the loads of its limit again, and return the state there.

    Parameters
    ----------
    walk
        The walk that passed the limit.
    limit, beyond
        The limit, and the first state of the walk behind it.
    tally
        Counts the work.

    Raises
    ------
    StoppedShortError
        If the branch does not rise to the limit again as far as it could be followed.
    """
    walk, beyond = _alone(walk, limit, beyond)
    goal = limit.equilibrium.fraction
    rest = walk.system.conjugate(walk.system.reference_state(), walk.quantity.weights)
    previous, lowest = beyond, beyond.fraction
    ended = f"after {SNAP_STEPS} steps"
    for found, by_volume in _behind(walk, limit, beyond, rest):
        tally.count(found)
        log.info("behind the limit: load %.5g at volume %.5g", found.fraction, walk.measure(found))
        if not knows_volume(walk.system, found.state):
            ended = "where surfaces begin to rub"
            break
        if found.fraction >= goal and (by_volume or found.stable):
            try:
                return replace(at_load(walk, goal, previous, found, tally), event=Event.POST_SNAP)
            except NotConvergedError as error:
                ended = f"and the state at the limit's loads was enclosed but not found ({error.reason})"
                break
        previous, lowest = found, min(lowest, found.fraction)
        if _volume_ratio(walk, found) > MOST_VOLUMES:
            ended = "at a volume that no rubber reaches"
            break
    else:
        if walk.failure is not None:
            ended = f"where the walk ended ({walk.failure.reason})"
    raise at_limit(walk.system, limit, *_why(walk, previous, _part_of(walk, lowest, goal), ended))


def _alone(walk: VolumeWalk, limit: LimitPoint, beyond: Equilibrium) -> tuple[VolumeWalk, Equilibrium]:
    """Return a walk from the limit on, and its first state: only the loads change that take part in the limit's mode.

    Those that do not are held as they are while the actuator snaps: on the way back they may be greater, and have
    limits of their own. Where all take part, or no state is found, it is the walk itself.
    """
    at, growth = limit.equilibrium, walk.line.growth
    part = taking_part(walk.system, at.state, limit.mode, growth)
    if np.array_equal(part, growth):
        return walk, beyond
    quantity, line = Volume(part), LoadLine(at.fraction, at.state.loads, part)
    states = (walk.system.reference_state(), at.state, beyond.state)
    rest, here, there = (walk.system.conjugate(state, part) for state in states)
    step = math.copysign(max(abs(there - here), ARC_STEP * abs(here - rest)), there - here)
    start = replace(at, compliance=None)
    alone = VolumeWalk(walk.system, walk.linear, start, step, walk.options, quantity, line=line)
    found = alone.advance()
    return (walk, beyond) if found is None else (alone, found)


def _behind(
    walk: VolumeWalk, limit: LimitPoint, beyond: Equilibrium, rest: float
) -> Iterator[tuple[Equilibrium, bool]]:
    """Yield the states behind a limit, and whether they are found by volume: along the arc where the volume turns.

    `rest` is the volume at rest, N mm.
    """
    walk.stand_at(beyond, limit.equilibrium)
    walk.failure = None
    for found in itertools.islice(walk, SNAP_STEPS):
        yield found, True
        walk.first_step = max(walk.first_step, walk.step)  # the walk ends where steps must be so much shorter again
    if walk.failure is None or walk.before is None:
        return
    log.info("behind the limit: on along the arc (%s)", walk.failure.reason)
    scale = abs(walk.measure(limit.equilibrium) - rest) / abs(limit.equilibrium.fraction)
    arc = Arc(walk, 1.0, scale, ARC_STEP * abs(limit.equilibrium.fraction), walk.before)
    for _ in range(ARC_STEPS):
        here, before = walk.here, walk.before
        state = arc.advance(arc.length)
        if state is None:
            return
        walk.stand_at(state, here, before)
        yield state, False


def at_load(walk: VolumeWalk, goal: float, below: Equilibrium, above: Equilibrium, tally: Tally) -> Equilibrium:
    """Return the equilibrium at a load fraction between two states of a walk, the load given.

    A limit has the same load where it lies on the way back to it, and may be nearer to the guess: what does not lie
    between the two is not what is looked for.

    Raises
    ------
    NotConvergedError
        If none is found there.
    """

    def at_goal(state: State) -> Equilibrium:
        return find_equilibrium(walk.system, walk.linear, state, goal, walk.options, line=walk.line)

    for _ in range(REFINEMENTS):
        part = (goal - below.fraction) / (above.fraction - below.fraction)
        guess = above.state.beyond(below.state, part - 1.0)
        found = None
        with contextlib.suppress(NotConvergedError):
            found = kept_apart(walk.system, at_goal, guess)
        if found is None or not _lies_between(walk, below, found, above):
            walk.stand_at(above, below)
            middle = walk.at(0.5 * (walk.measure(below) + walk.measure(above)))
            tally.count(middle)
            below, above = (middle, above) if middle.fraction < goal else (below, middle)
            continue
        return found
    raise NotConvergedError(f"no equilibrium after {REFINEMENTS} refinements")


def _lies_between(walk: VolumeWalk, below: Equilibrium, found: Equilibrium, above: Equilibrium) -> bool:
    """Whether a state lies between two others on a walk, or beside one of them through rounding alone."""
    low, place, high = (walk.measure(e) for e in (below, found, above))
    return abs(place - 0.5 * (low + high)) <= (0.5 + BESIDE) * abs(high - low)


def _part_of(walk: VolumeWalk, fraction: float, goal: float) -> float:
    """Return the load that changes most at one load fraction in parts of what it is at another."""
    leading = walk.system.loading.leading(walk.line.growth)
    now, whole = (float(walk.line.at(f)[leading]) for f in (fraction, goal))
    return now / whole if whole else float("nan")


def _volume_ratio(walk: VolumeWalk, found: Equilibrium) -> float:
    """Return the volume in parts of that at rest; not a number where there was none.

    Where cavities grow against each other their conjugates may add up to nothing, so that they count by size.
    """
    weights = np.abs(walk.line.growth)
    now, rest = (walk.system.conjugate(state, weights) for state in (found.state, walk.system.reference_state()))
    return abs(now / rest) if rest else float("nan")


def _why(walk: VolumeWalk, last: Equilibrium, lowest: float, ended: str) -> tuple[str, Facts]:
    """Say how far the branch behind a limit was followed, and what it was like there."""
    ratio = _volume_ratio(walk, last)
    worst = worst_point(walk.system, last)
    text = (
        f"; behind it no state under the same loads was found: the branch was followed to {ratio:.3g} times the volume "
        f"at rest, {ended}, without the pressure rising to the limit again (lowest {100.0 * lowest:.3g} % of it)"
    )
    facts: Facts = {
        "followed_to_volume_ratio": ratio,
        "lowest_load_behind_limit": lowest,
        "drucker_margin_behind_limit": worst.margin,
        "stretches_behind_limit": list(worst.stretches),
    }
    return text, facts
