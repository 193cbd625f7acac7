"""Along every kind of path surfaces are kept from overlapping too far."""

from __future__ import annotations

import pytest
from samples import neo_hookean

from turgor.fem.contact import obstacle
from turgor.fem.contact.spec import RigidContact
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.loads import Pressure
from turgor.fem.rigid import Plane
from turgor.fem.supports import Sliding
from turgor.fem.system import System
from turgor.mesh.structured import shell_octant
from turgor.solver.control import Volume
from turgor.solver.events import Event
from turgor.solver.follow import follow, follow_arc
from turgor.solver.path import PathOptions, solve_path
from turgor.solver.stops import LimitPressureError


@pytest.fixture
def balloon(monkeypatch):
    """A sphere that is blown up against a plate, whose contact is twenty times too soft."""
    monkeypatch.setattr(obstacle, "STIFFNESS", 0.05 * obstacle.STIFFNESS)
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    plate = RigidContact(Plane((0.0, 0.0, 1.6), (0.0, 0.0, -1.0)), "outer", label="plate")
    mesh = shell_octant(1.0, 1.5, 2)
    return System(mesh, {"body": neo_hookean()}, planes, [Pressure("inner", 0.1)], contact=[plate])


def deepest(system, found):
    return max(touch.overlap_per_wall for equilibrium in found for touch in system.touches(equilibrium.state))


def test_by_volume(balloon):
    rest = balloon.conjugate(balloon.reference_state())
    found = follow(balloon, Volume(), [1.5 * rest, 3.0 * rest, 6.0 * rest])
    assert any(equilibrium.event is Event.LIMIT for equilibrium in found)
    assert found[-1].state.penalty > 1.0
    assert 0.0 < deepest(balloon, found) <= LARGEST_OVERLAP


def test_along_the_arc(balloon):
    rest = balloon.conjugate(balloon.reference_state())
    found = follow_arc(balloon, Volume(), 4.0 * rest, 0.5)
    assert found[-1].state.penalty > 1.0
    assert 0.0 < deepest(balloon, found) <= LARGEST_OVERLAP


def test_at_the_limit_of_a_load_path(balloon):
    found = []
    with pytest.raises(LimitPressureError):
        solve_path(balloon, [0.2, 1.0], options=PathOptions(), on_equilibrium=found.append)
    assert found[-1].event is Event.LIMIT
    assert found[-1].state.penalty > 1.0
    assert 0.0 < deepest(balloon, found) <= LARGEST_OVERLAP
