"""Balloons: limit pressures, the snap of a Mooney–Rivlin sphere, and what lies behind it, against closed forms."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from samples import neo_hookean
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from turgor.fem.loads import Pressure
from turgor.fem.programme import PROPORTIONAL, Programme
from turgor.fem.section import Axisymmetric
from turgor.fem.supports import Sliding
from turgor.fem.system import System
from turgor.materials.models.mooney_rivlin import MooneyRivlin2
from turgor.materials.volumetric import Quadratic
from turgor.mesh.structured import quarter_ring
from turgor.solver.control import Volume
from turgor.solver.events import Event, Outcome
from turgor.solver.follow import follow
from turgor.solver.path import LimitPressureError, PathOptions, solve_path
from turgor.solver.slopes import stable_while_held

C10, C01, RATIO = 0.05, 0.007, 1.2


def sphere(material, ratio: float, pressure: float, n: int = 2, programme: Programme = PROPORTIONAL) -> System:
    """Half a sphere of inner radius one, turned about its axis."""
    mesh = quarter_ring(1.0, ratio, n, "quad9")
    loads = [Pressure("inner", pressure, programme)]
    return System(mesh, {"body": material}, [Sliding("y0")], loads, section=Axisymmetric())


def exact_pressure(stretch: float) -> float:
    """Incompressible Mooney–Rivlin sphere: p = ∫ Ŵ'(λ)/(λ³ − 1) dλ from outer to inner stretch (Ogden 1984, 5.3)."""
    outer = (1 + (stretch**3 - 1) / RATIO**3) ** (1 / 3)

    def slope(x: float) -> float:
        # Ŵ(λ) = C10 (2 λ² + λ⁻⁴ − 3) + C01 (λ⁴ + 2 λ⁻² − 3)
        return (C10 * (4 * x - 4 * x**-5) + C01 * (4 * x**3 - 4 * x**-3)) / (x**3 - 1)

    return float(quad(slope, outer, stretch, epsabs=1e-14)[0])


@functools.cache
def extremes() -> tuple[float, float, float, float, float]:
    """Stretch and pressure at the maximum, at the minimum, and the stretch behind the snap."""
    top = float(minimize_scalar(lambda x: -exact_pressure(x), bounds=(1.1, 2.0), method="bounded").x)
    low = float(minimize_scalar(exact_pressure, bounds=(2.0, 5.0), method="bounded").x)
    behind = float(brentq(lambda x: exact_pressure(x) - exact_pressure(top), low, 9.0))
    return top, exact_pressure(top), low, exact_pressure(low), behind


def inner_stretch(system: System, u: np.ndarray) -> float:
    nodes = system.mesh.surface_nodes("inner")
    return float(np.linalg.norm(system.mesh.points[nodes] + u[nodes], axis=1).mean())


def balloon(pressure: float, programme: Programme = PROPORTIONAL) -> System:
    material = MooneyRivlin2(C10=C10, C01=C01, volumetric=Quadratic(1e4))
    return sphere(material, RATIO, pressure, programme=programme)


def test_volume_control_traces_the_snap():
    top, highest, low, lowest, behind = extremes()
    assert highest > 1.03 * lowest
    system = balloon(highest)
    rest = 2 / 3 * np.pi
    weights = np.ones(1)
    targets = [stretch**3 * rest for stretch in (0.9 * top, 0.5 * (top + low), 1.1 * behind)]
    found = follow(system, Volume(weights), targets)
    assert [e.event for e in found] == [None, Event.LIMIT, None, Event.MINIMUM, None]
    for e in found:
        stretch = inner_stretch(system, e.state.u)
        assert float(e.state.loads[0]) == pytest.approx(exact_pressure(stretch), rel=5e-3)
        assert stable_while_held(system, Volume(weights), e) in (True, None)
    asked = [e for e in found if not e.event]
    assert [system.cavities[0].volume(e.state.u) for e in asked] == pytest.approx(targets, rel=1e-6)
    maximum, minimum = (next(e for e in found if e.event == event) for event in (Event.LIMIT, Event.MINIMUM))
    assert float(maximum.state.loads[0]) == pytest.approx(highest, rel=5e-3)
    assert float(minimum.state.loads[0]) == pytest.approx(lowest, rel=5e-3)
    assert inner_stretch(system, maximum.state.u) == pytest.approx(top, rel=1e-2)
    assert inner_stretch(system, minimum.state.u) == pytest.approx(low, rel=1e-2)


def test_the_state_behind_the_snap_is_found_on_request():
    _, highest, _, _, behind = extremes()
    system = balloon(1.1 * highest)
    with pytest.raises(LimitPressureError) as stop:
        solve_path(system, [1.0])
    assert stop.value.outcome is Outcome.LIMIT
    found = solve_path(system, [0.5, 1.0], options=PathOptions(post_snap=True))
    assert [e.event for e in found] == [None, Event.LIMIT, Event.POST_SNAP, None]
    limit, snapped, end = found[1:]
    assert limit.mode is not None
    assert snapped.fraction == limit.fraction
    assert float(snapped.state.loads[0]) == pytest.approx(highest, rel=5e-3)
    assert inner_stretch(system, snapped.state.u) == pytest.approx(behind, rel=5e-3)
    assert snapped.stable in (True, None)
    assert float(end.state.loads[0]) == pytest.approx(exact_pressure(inner_stretch(system, end.state.u)), rel=5e-3)


def test_a_pressure_that_is_taken_back_meets_its_minimum_and_snaps_back():
    _, highest, low, lowest, _ = extremes()
    system = balloon(1.1 * highest, Programme((0.0, 0.5, 1.0), (0.0, 1.0, 0.1)))
    found = solve_path(system, [0.5, 1.0], options=PathOptions(post_snap=True))
    assert [e.event for e in found] == [Event.LIMIT, Event.POST_SNAP, None, Event.MINIMUM, Event.POST_SNAP, None]
    blown, minimum, snapped = found[2:5]
    assert float(minimum.state.loads[0]) == pytest.approx(lowest, rel=5e-3)
    assert inner_stretch(system, minimum.state.u) == pytest.approx(low, rel=1e-2)
    assert float(snapped.state.loads[0]) == pytest.approx(
        exact_pressure(inner_stretch(system, snapped.state.u)), rel=5e-3
    )
    assert inner_stretch(system, snapped.state.u) < 0.6 * low
    with pytest.raises(LimitPressureError, match="shrinks while the pressure rises") as stop:
        solve_path(system, [1.0], start=blown)
    assert not stop.value.limit.maximum
    assert "post-snap" in stop.value.advice


def test_a_neo_hookean_sphere_locks_nowhere():
    system = sphere(neo_hookean(), 1.5, 0.06)
    with pytest.raises(LimitPressureError, match="without the pressure rising to the limit again") as stop:
        solve_path(system, [1.0], options=PathOptions(post_snap=True))
    assert stop.value.facts["pressure:inner_kPa"] == pytest.approx(49.35, rel=2e-3)
    assert stop.value.facts["lowest_load_behind_limit"] < 0.5


def test_the_limit_of_a_thin_sphere():
    # p = 2 μ (t/r) (1/λ − 1/λ⁷) has its maximum at λ = 7^(1/6) (Alexander 1971), λ of the mid-surface.
    thickness = 0.01
    system = sphere(neo_hookean(), 1.0 + thickness, 0.1 * 2.0 * thickness)
    with pytest.raises(LimitPressureError) as stop:
        solve_path(system, [1.0])
    limit = stop.value.limit.equilibrium
    nodes = np.concatenate([system.mesh.surface_nodes(name) for name in ("inner", "outer")])
    moved = np.linalg.norm(system.mesh.points[nodes] + limit.state.u[nodes], axis=1).mean()
    stretch = 7 ** (1 / 6)
    assert moved / (1.0 + thickness / 2) == pytest.approx(stretch, rel=5e-3)
    expected = 2 * 0.1 * thickness / (1 + thickness / 2) * (1 / stretch - stretch**-7)
    assert float(limit.state.loads[0]) == pytest.approx(expected, rel=5e-3)
