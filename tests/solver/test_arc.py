"""Steps along the arc keep to one path, and try shorter ones before they give up."""

from __future__ import annotations

import numpy as np
import pytest
from samples import arch

from turgor.solver.control import Volume
from turgor.solver.events import Event
from turgor.solver.follow import follow_arc
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.path import StoppedShortError
from turgor.solver.volume import VolumeWalk

ONE = np.ones(1)


def loads_met(found: list[Equilibrium]) -> list[tuple[Event, float]]:
    return [(e.event, float(e.state.loads[0])) for e in found if e.event]


def walked(full: float, change: float, length: float, **arch_options) -> list[Equilibrium]:
    system = arch(full, **arch_options)
    target = system.conjugate(system.reference_state(), ONE) + change
    return follow_arc(system, Volume(ONE), target, length)


@pytest.mark.parametrize(("rise", "full", "length"), [(1.4, 5e-4, 0.2), (1.45, 1e-4, 1.0), (1.5, 1e-4, 0.5)])
def test_where_the_path_winds_no_step_goes_over_to_the_branch_that_it_crosses(rise, full, length):
    # Sucked through, the arch passes four limits; between them volume and pressure are again those near rest.
    limits = {
        1.4: (-1.8510e-4, -1.2001e-4, -2.0388e-4, -2.352e-5),
        1.45: (-1.9236e-4, -1.1257e-4, -2.2025e-4, -2.335e-5),
        1.5: (-1.9942e-4, -1.0617e-4, -2.3739e-4, -2.318e-5),
    }
    found = walked(full, -17.0, length, rise=rise, above=False)
    kinds = (Event.LIMIT, Event.MINIMUM, Event.LIMIT, Event.MINIMUM)
    expected = [(kind, pytest.approx(load, rel=1e-3)) for kind, load in zip(kinds, limits[rise], strict=True)]
    assert loads_met(found) == expected


def test_where_a_limit_is_expected_and_none_is_found_shorter_steps_are_tried(monkeypatch):
    located, refused = VolumeWalk.limit_between, []

    def unless_far_apart(walk, first, second, tolerance=1e-6):
        if abs(walk.measure(second) - walk.measure(first)) > 0.5:
            refused.append(walk.measure(second))
            raise NotConvergedError("the path jumps")
        return located(walk, first, second, tolerance)

    monkeypatch.setattr(VolumeWalk, "limit_between", unless_far_apart)
    met = loads_met(walked(2e-4, 12.5, 0.2))
    assert met == [
        (Event.LIMIT, pytest.approx(1.12607e-4, rel=1e-4)),
        (Event.MINIMUM, pytest.approx(2.43356e-5, rel=1e-4)),
    ]
    assert len(refused) >= 2


def test_steps_that_meet_no_limit_are_not_tried_without_end(monkeypatch):
    refused = []

    def never(walk, first, second, tolerance=1e-6):
        refused.append(walk.measure(second) - walk.measure(first))
        raise NotConvergedError("the path jumps here")

    monkeypatch.setattr(VolumeWalk, "limit_between", never)
    with pytest.raises(StoppedShortError, match="the path jumps here"):
        walked(2e-4, 12.5, 0.2)
    assert len(refused) > 5
    assert refused[-1] < 0.02 * 0.2 * 12.5
