"""Where the amount of air in a cavity has a limit along the path: with more of it the actuator snaps."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from turgor.common.log import logger
from turgor.solver.control import Air, Volume
from turgor.solver.events import Event, Outcome
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.slopes import slope_of
from turgor.solver.stops import StoppedShortError, load_facts, load_text
from turgor.solver.volume import VolumeWalk

log = logger("solver")

STEPS = 20
"""Steps by volume in which a limit of the amount is looked for where a walk by it has ended."""

FIRST_STEP = 0.01
"""The first of them in parts of the volume, where the walk has made none."""


def limit_of_air(walk: VolumeWalk, target: float) -> Equilibrium | None:
    """Return the state in which the amount of air is largest (or on its way down, smallest), with what gives way.

    Parameters
    ----------
    walk
        A walk by an amount of air that found nothing beyond where it stands.
    target
        The amount asked for.

    Returns
    -------
    Equilibrium or None
        The state, its mode the change of displacement along the path; ``None`` where the volume leads to no limit of
        the amount before the target, so that it is something else that the walk did not get past.
    """
    system, air = walk.system, walk.quantity
    sign = math.copysign(1.0, target - walk.measure(walk.here))
    step = sign * FIRST_STEP * system.conjugate(walk.here.state, air.weights)
    if walk.before is not None:
        step = system.conjugate(walk.here.state, air.weights) - system.conjugate(walk.before.state, air.weights)

    def slope(state: Equilibrium) -> float:
        return slope_of(air, system, state)

    try:
        by_volume = VolumeWalk(system, walk.linear, walk.here, step, walk.options, Volume(air.weights), watched=air)
        here = walk.here
        for found in itertools.islice(by_volume, STEPS):
            if slope(here) * slope(found) < 0.0:
                limit, _ = by_volume.stationary_between(here, found, walk.measure, slope)
                return replace(limit, event=Event.AIR_LIMIT, mode=by_volume.tangent_mode(limit))
            if sign * (walk.measure(found) - target) >= 0.0:
                return None
            here = found
    except NotConvergedError as error:
        log.info("by volume no limit of the amount of air is found either: %s", error.reason)
    return None


def at_limit_of_air(walk: VolumeWalk, air: Air, limit: Equilibrium, target: float) -> StoppedShortError:
    """Return the error for a walk by an amount of air that ends at a limit of it."""
    system = walk.system
    amount, rest = walk.measure(limit), air.value(system.conjugate(system.reference_state(), air.weights), 0.0)
    facts = load_facts(system, limit)
    percent = 100.0 * amount / rest
    kind, more = ("maximum", "more") if target > amount else ("minimum", "less")
    return StoppedShortError(
        f"the amount of air has a {kind} of {percent:.4g} % of that at rest, at {load_text(facts)}: with {more} of it "
        "the actuator snaps while the air is held",
        advice="Control by volume (control.type: volume) follows it further",
        facts=facts | {"air_at_limit_mm3": amount / air.surroundings, "air_at_limit_percent": percent},
        outcome=Outcome.AIR_LIMIT,
    )
