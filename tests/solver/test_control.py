"""Controls other than the load: each cuts the same path, which a closed form knows."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.supports import Sliding
from turgor.fem.system import System
from turgor.mesh.structured import shell_octant
from turgor.solver.control import AirAmount, AlongTangent, ArcLength, FixedConjugate
from turgor.solver.linear import make_linear_solver
from turgor.solver.newton import NewtonOptions, find_equilibrium
from turgor.solver.path import solve_path
from turgor.solver.volume import VolumeWalk

FULL = 0.04


@pytest.fixture(scope="module")
def sphere():
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    system = System(shell_octant(1.0, 1.5, 2), {"body": neo_hookean()}, planes, [Pressure("inner", FULL)])
    return system, make_linear_solver(system.pattern.row_start, system.pattern.column)


def pressure_at(system, state):
    """Closed form of the incompressible sphere (Green and Zerna) at the volume of the state."""
    stretch = np.cbrt(system.cavities[0].volume(state.u) / (np.pi / 6))
    outer = (1 + (stretch**3 - 1) / 1.5**3) ** (1 / 3)
    return 0.1 * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))


def test_derivatives_of_the_gaps():
    tangent = AlongTangent(0.1, 0.2, 2.0, 0.5, tangent=np.array([0.6, 0.8]))
    controls = [FixedConjugate(0.3), AirAmount(0.2, FULL), ArcLength(0.1, 0.2, 2.0, 0.5), tangent]
    for control in controls:
        _, by_conjugate, by_fraction = control.gap(0.4, 0.7)
        steps = [(control.gap(0.4 + h, 0.7)[0], control.gap(0.4, 0.7 + h)[0]) for h in (1e-6, -1e-6)]
        assert (steps[0][0] - steps[1][0]) / 2e-6 == pytest.approx(by_conjugate, abs=1e-8)
        assert (steps[0][1] - steps[1][1]) / 2e-6 == pytest.approx(by_fraction, abs=1e-8)


@pytest.mark.parametrize("times", [1.5, 3.0, 8.0])
def test_a_closed_amount_of_air_holds_the_sphere_beyond_its_limit(sphere, times):
    system, linear = sphere
    volume = system.cavities[0].volume(np.zeros_like(system.mesh.points))
    start = solve_path(system, [0.5])[0]
    state, fraction = start.state, start.fraction
    amounts = volume * (0.101325 + 0.5 * FULL) * np.geomspace(1.0, times, 6)[1:]
    for amount in amounts:
        control = AirAmount(amount, FULL)
        found = find_equilibrium(system, linear, state, fraction, NewtonOptions(), control=control)
        state, fraction = found.state, found.fraction
    pressure = float(state.loads[0])
    assert (pressure + 0.101325) * system.cavities[0].volume(state.u) == pytest.approx(amounts[-1], rel=1e-6)
    assert pressure == pytest.approx(pressure_at(system, state), rel=6e-3)


def test_a_state_that_needs_no_iteration_still_has_its_compliance(sphere):
    system, linear = sphere
    start = solve_path(system, [0.5])[0]
    walk = VolumeWalk(system, linear, start, 1.0, NewtonOptions())
    found = walk.at(system.conjugate(start.state))
    assert found.iterations == 0
    assert found.compliance == pytest.approx(walk.here.compliance, rel=1e-6)
    assert found.compliance > 0


def test_arc_length_walks_over_the_top(sphere):
    system, linear = sphere
    rest = system.conjugate(system.reference_state())
    before, here = solve_path(system, [0.9, 1.0])
    fractions = [here.fraction]
    for _ in range(8):
        control = ArcLength(system.conjugate(here.state), here.fraction, 10.0 * rest, 0.1)
        reach = 1.0 / np.hypot(
            (control.conjugate - system.conjugate(before.state)) / rest, (here.fraction - before.fraction) / 0.1
        )
        guess = here.state.beyond(before.state, reach)
        aim = here.fraction + reach * (here.fraction - before.fraction)
        before, here = here, find_equilibrium(system, linear, guess, aim, NewtonOptions(), control=control)
        fractions.append(here.fraction)
        assert control.gap(system.conjugate(here.state), here.fraction)[0] == pytest.approx(0.0, abs=1e-6)
        assert float(here.state.loads[0]) == pytest.approx(pressure_at(system, here.state), rel=6e-3)
    top = int(np.argmax(fractions))
    assert 0 < top < len(fractions) - 1
    assert max(fractions) == pytest.approx(0.4935 * 0.1 / FULL, rel=0.01)
