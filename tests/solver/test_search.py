"""How much of a step of Newton's method is taken, by what the merit does along it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from turgor.fem.state import State
from turgor.solver import newton

START = State(np.zeros((1, 1)), (), np.zeros(0))
STEP = np.ones((1, 1))


def taken(merit, presses=lambda t: False):
    """Return the part that is taken of a step along which the merit is a function of its part t."""
    system = SimpleNamespace(
        merit=lambda state, lagged: merit(float(state.u[0, 0])),
        contact_force=lambda state: float(presses(float(state.u[0, 0]))),
        has_barrier=False,
    )
    return newton._searched(system, START, STEP, (), 1.0)


def rising_to(times):
    """Return a merit that promises to fall by 1 and rises by so many times that after the full step."""
    return lambda t: -2.0 * t + (2.0 + times) * t**4


def test_a_step_after_which_the_merit_falls_is_taken():
    assert taken(lambda t: (1.0 - t) ** 2) == 1.0


@pytest.mark.parametrize("times", [0.5, 1.9])
def test_a_step_after_which_it_rises_little_is_taken_where_nothing_presses(times):
    assert taken(rising_to(times)) == 1.0


@pytest.mark.parametrize("times", [2.1, 30.0, 300.0])
def test_a_step_after_which_it_rises_far_is_shortened_until_it_does_not(times):
    part, merit = taken(rising_to(times)), rising_to(times)
    assert part < 1.0
    assert merit(part) <= newton.RISE_ALLOWED < merit(2.0 * part)


def test_a_step_is_never_shorter_than_the_shortest():
    for beyond in (np.inf, np.nan):
        assert taken(lambda t, beyond=beyond: -t if t <= newton.SHORT else beyond) == newton.SHORT


def test_a_step_along_which_it_only_rises_is_taken_towards_an_unstable_state():
    assert taken(lambda t: 2.0 * t - t**2) == 1.0


@pytest.mark.parametrize("presses", [lambda t: t == 0.0, lambda t: t == 1.0], ids=["before", "after"])
def test_where_surfaces_press_the_merit_must_fall(presses):
    merit = rising_to(1.0)
    part = taken(merit, presses)
    assert part < 1.0
    assert merit(part) < 0.0
