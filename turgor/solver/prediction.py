"""Where the path goes on from the last equilibria: along a parabola, a line, or not at all."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turgor.fem.state import State
from turgor.fem.system import System

LARGEST_WEIGHT = 4.0
"""A parabola through states of which one would count more than this is no better than a line; 3 for equal steps."""


def predicted(system: System, places: Sequence[float], states: Sequence[State], aim: float) -> tuple[State, float]:
    """Return where the path is expected at `aim`, and the part of the way there that this is.

    Less than one where surfaces would meet, or pass into each other too far; zero, the last state itself, where an
    element would turn inside out or there is nothing to go by.

    Parameters
    ----------
    system
        The actuator.
    places, states
        Where the last states are on the path, oldest first, and the states.
    aim
        Where to go.
    """
    here = states[-1]
    if len(states) == 1:
        return here, 0.0
    there = extrapolated(places, states, aim)
    part = system.longest_step(here, there.u - here.u)
    if part < 1.0:
        there = there.beyond(here, part - 1.0)
    return (there, part) if system.worst_jacobian(there.u)[0] > 0.0 else (here, 0.0)


def extrapolated(places: Sequence[float], states: Sequence[State], aim: float) -> State:
    """Return the state at `aim`, on the polynomial through the last three states, or fewer where there are fewer.

    Displacement and what lags are extrapolated alike, so that turns, which make the displacement curved, leave no
    stress behind.

    Parameters
    ----------
    places, states
        Where the states are on the path, oldest first, and the states.
    aim
        Where to go.
    """
    places, states = places[-3:], states[-3:]
    weights = [
        float(np.prod([(aim - other) / (place - other) for other in places if other != place])) for place in places
    ]
    if len(states) == 3 and max(map(abs, weights)) > LARGEST_WEIGHT:
        return extrapolated(places[1:], states[1:], aim)
    return states[-1].mixed(weights, states)
