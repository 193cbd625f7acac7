"""Where the amount of air in a cavity turns along the path, whatever the steps by it."""

from __future__ import annotations

import numpy as np
import pytest
from samples import arch

from turgor.solver.control import Air
from turgor.solver.events import Event, Outcome
from turgor.solver.follow import follow
from turgor.solver.newton import Equilibrium
from turgor.solver.path import StoppedShortError

ONE = np.ones(1)


@pytest.mark.parametrize(("times", "steps"), [(1.1, 3), (1.1, 5), (1.17, 1)])
def test_no_step_passes_over_a_maximum_of_the_amount_to_what_it_snaps_to(times, steps):
    # The amount has a maximum of 1.0825 times that at rest; behind the snap it grows on.
    system, soft = arch(3e-4, rise=0.9), 1e-3
    air = Air(3e-4, soft, 3e-4 * ONE)
    rest = air.value(system.conjugate(system.reference_state(), air.weights), 0.0)
    found: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match="maximum of 108") as stopped:
        follow(system, air, list(rest * np.linspace(1.0, times, steps + 1)[1:]), on_equilibrium=found.append)
    assert stopped.value.outcome is Outcome.AIR_LIMIT
    assert found[-1].event is Event.AIR_LIMIT
    amount = air.value(system.conjugate(found[-1].state, air.weights), found[-1].fraction)
    assert amount == pytest.approx(1.0825 * rest, rel=1e-4)
