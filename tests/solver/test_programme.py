"""Loads along tables: hit where asked, through kinks, up and down, each cavity on its own."""

from __future__ import annotations

import numpy as np
import pytest
from samples import arch, neo_hookean

from turgor.common.errors import InputError
from turgor.fem.loads import Pressure
from turgor.fem.programme import CONSTANT, PROPORTIONAL, Programme
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Sliding
from turgor.fem.system import System
from turgor.mesh.structured import quarter_ring
from turgor.solver.events import Event
from turgor.solver.path import LimitPressureError, PathOptions, solve_path

UP_AND_DOWN = Programme((0.0, 0.3, 0.6, 1.0), (0.0, 1.0, 1.0, 0.25))


def test_a_programme_is_a_polyline_that_goes_on():
    values = [UP_AND_DOWN.at(f) for f in (-0.3, 0.0, 0.15, 0.3, 0.5, 0.8, 1.0, 1.4)]
    assert values == pytest.approx([-1.0, 0.0, 0.5, 1.0, 1.0, 0.625, 0.25, -0.5])
    for f in (0.1, 0.45, 0.9):
        assert UP_AND_DOWN.slope(f) == pytest.approx((UP_AND_DOWN.at(f + 1e-6) - UP_AND_DOWN.at(f - 1e-6)) / 2e-6)
    assert UP_AND_DOWN.kinks == (0.3, 0.6)
    assert Programme((0.0, 0.5, 1.0), (0.0, 0.5, 1.0)).kinks == ()
    assert (PROPORTIONAL.at(0.3), CONSTANT.at(0.3)) == pytest.approx((0.3, 1.0))


@pytest.mark.parametrize("points", [((0.0,), (1.0,)), ((0.0, 1.0), (1.0,)), ((0.0, 0.0), (0.0, 1.0))])
def test_what_is_no_programme_is_refused(points):
    with pytest.raises(InputError, match="programme"):
        Programme(*points)


def ring(programme, pressure=0.02):
    loads = [Pressure("inner", pressure, programme)]
    planes = [Sliding("x0"), Sliding("y0")]
    return System(quarter_ring(1.0, 1.5, 2), {"body": neo_hookean()}, planes, loads, section=PlaneStrain())


def test_the_path_goes_up_and_down_and_hits_what_is_asked():
    system = ring(UP_AND_DOWN)
    assert system.loading.kinks == (0.3, 0.6)
    found = solve_path(system, [0.15, 0.5, 0.8, 1.0])
    assert [e.fraction for e in found] == [0.15, 0.5, 0.8, 1.0]
    assert [float(e.state.loads[0]) for e in found] == pytest.approx([0.01, 0.02, 0.0125, 0.005])
    for e in found:  # no memory: the same pressure, in proportion
        alone = solve_path(ring(PROPORTIONAL, float(e.state.loads[0])), [1.0])[0]
        np.testing.assert_allclose(e.state.u, alone.state.u, atol=1e-6)


def test_the_limit_is_found_on_a_later_line_of_a_programme():
    steep = Programme((0.0, 0.5, 1.0), (0.0, 0.5, 2.0))
    with pytest.raises(LimitPressureError) as stop:
        solve_path(sphere(steep), [0.5, 1.0])
    assert stop.value.facts["pressure:inner_kPa"] == pytest.approx(49.35, rel=2e-3)
    assert 0.5 < stop.value.facts["last_fraction"] < 1.0


def sphere(programme, pressure=0.04):
    loads = [Pressure("inner", pressure, programme)]
    return System(quarter_ring(1.0, 1.5, 2), {"body": neo_hookean()}, [Sliding("y0")], loads, section=Axisymmetric())


def test_how_far_the_load_falls_behind_a_limit_is_told_by_the_pressure_and_not_by_the_time():
    steep = Programme((0.0, 0.5, 1.0), (0.0, 0.5, 2.0))
    facts = []
    for system in (sphere(PROPORTIONAL, 0.08), sphere(steep)):
        with pytest.raises(LimitPressureError, match="rising to the limit again") as stop:
            solve_path(system, [0.5, 1.0], options=PathOptions(post_snap=True))
        facts.append(stop.value.facts["lowest_load_behind_limit"])
    assert facts == pytest.approx([0.2, 0.2], abs=0.01)


def test_the_way_back_behind_a_limit_does_not_heed_the_plateau_before_it():
    # Where the walk passes it nothing grows by the programme: its states were called unstable.
    with_plateau = Programme((0.0, 0.3, 0.6, 1.0), (0.0, 0.6, 0.6, 1.0))
    plain, programmed = (
        next(
            e
            for e in solve_path(system, [0.25, 0.5, 0.75, 1.0], options=PathOptions(post_snap=True))
            if e.event is Event.POST_SNAP
        )
        for system in (arch(1.69e-4), arch(1.69e-4, programme=with_plateau))
    )
    assert programmed.factorisations <= 1.5 * plain.factorisations
    assert programmed.state.u == pytest.approx(plain.state.u, abs=1e-5)
