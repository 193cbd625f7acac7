"""Newton's method and the walk along the load path."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from samples import neo_hookean

from turgor.common.errors import InputError
from turgor.fem.loads import Force, Gravity, Pressure, Traction
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, shell_octant
from turgor.solver.linear import SuperLU, make_linear_solver
from turgor.solver.newton import NewtonOptions, NotConvergedError, find_equilibrium
from turgor.solver.path import LimitPressureError, PathOptions, output_fractions, solve_path
from turgor.solver.volume import VolumeWalk

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]


def sphere(pressure, mu=0.1, ratio=1e4, n=1):
    return System(shell_octant(1.0, 1.5, n), {"body": neo_hookean(mu, ratio)}, PLANES, [Pressure("inner", pressure)])


def test_patch_of_uniform_strain_passes_to_solver_precision():
    # K/μ = 1e4; one interior node is off centre and every element is distorted; the surface follows a uniform F.
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    F = np.array([[1.1, 0.2, 0.0], [0.0, 0.95, 0.1], [0.05, 0.0, 1.0]])
    F /= np.cbrt(np.linalg.det(F))
    system = System(mesh, {"body": neo_hookean()}, [Clamped(name) for name in mesh.surfaces])
    wanted = mesh.points @ (F - np.eye(3)).T
    constraints = system.constraints
    constraints.value[constraints.fixed] = wanted[constraints.fixed]
    found = solve_path(system, [1.0])[0]
    np.testing.assert_allclose(found.state.u, wanted, atol=1e-9)
    np.testing.assert_allclose(system.dilatation(found.state), 1.0, atol=1e-12)
    stress = system.solids[0].cauchy_stress(found.state)
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0, 0], stress.shape), atol=1e-9 * 0.1)


def test_a_rigid_turn_gives_no_stress():
    mesh = shell_octant(1.0, 1.5, 1)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("x0")])
    angle = 2.0
    Q = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    state = system.consistent(mesh.points @ (Q - np.eye(3)).T, np.zeros(0))
    assert system.energy(state) < 1e-20
    np.testing.assert_allclose(system.solids[0].cauchy_stress(state), 0.0, atol=1e-10)


def test_incompressibility_costs_no_iterations():
    counts = [solve_path(sphere(0.035, ratio=ratio), [1.0])[0].factorisations for ratio in (1e2, 1e3, 1e4, 1e5)]
    assert max(counts) - min(counts) <= 1


def test_every_requested_fraction_is_hit_exactly_and_delivered_as_reached():
    seen, progress = [], []
    found = solve_path(
        sphere(0.04),
        [0.3, 0.55, 1.0],
        on_equilibrium=lambda e: seen.append(e.fraction),
        on_progress=lambda *facts: progress.append(facts),
    )
    assert seen == [0.3, 0.55, 1.0] == [e.fraction for e in found]
    assert [float(e.state.loads[0]) for e in found] == pytest.approx([0.012, 0.022, 0.04], rel=1e-15)
    assert all(e.residuals[-1] <= 1e-7 and e.stable in (True, None) for e in found)
    assert len(progress) >= sum(e.iterations for e in found)


def test_steps_do_not_change_the_result():
    one = solve_path(sphere(0.045), [1.0])[0].state.u
    many = solve_path(sphere(0.045), output_fractions(10))[-1].state.u
    np.testing.assert_allclose(many, one, atol=1e-6 * np.abs(one).max())


def test_going_on_from_a_stored_equilibrium_gives_the_same():
    system = sphere(0.045)
    whole = solve_path(system, [0.5, 1.0])
    rest = solve_path(sphere(0.045), [0.5, 1.0], start=whole[0])
    assert [e.fraction for e in rest] == [1.0]
    np.testing.assert_allclose(rest[0].state.u, whole[1].state.u, atol=1e-6 * np.abs(whole[1].state.u).max())


def test_beyond_the_limit_pressure_the_walk_ends_at_the_limit():
    # The thick neo-Hookean sphere has no equilibrium above p/μ = 0.4935, reached at λa = 1.603.
    reached = []
    system = sphere(0.06, n=2)
    with pytest.raises(LimitPressureError, match=r"limit is reached at 49\.\d+ kPa") as stop:
        solve_path(system, output_fractions(6), on_equilibrium=reached.append)
    assert [round(e.fraction, 6) for e in reached[:-1]] == [round(k / 6, 6) for k in (1, 2, 3, 4)]
    facts, limit = stop.value.facts, stop.value.limit
    assert facts["pressure:inner_kPa"] == pytest.approx(49.35, rel=2e-3)
    assert limit.maximum
    assert stop.value.exit_code == 3
    assert reached[-1].fraction == facts["last_fraction"] > 4 / 6  # the limit state is delivered too
    assert reached[-1].iterations > 0
    inner = system.mesh.points[system.mesh.surface_nodes("inner")]
    moved = inner + limit.equilibrium.state.u[system.mesh.surface_nodes("inner")]
    assert np.linalg.norm(moved, axis=1).mean() == pytest.approx(1.603, rel=5e-3)
    # the sphere gives way by growing: the mode is radial
    mode = limit.mode[system.mesh.surface_nodes("inner")]
    radial = np.einsum("ni,ni->n", mode, inner) / np.linalg.norm(inner, axis=1)
    assert np.abs(radial).min() > 0.9 * np.abs(radial).max()


def test_a_limit_is_located_though_states_between_its_ends_are_hard_to_find(monkeypatch):
    system = sphere(0.01, n=2)
    linear = make_linear_solver(system.pattern.row_start, system.pattern.column)
    start = solve_path(system, [1.0])[0]
    walk = VolumeWalk(system, linear, start, 0.5 * system.conjugate(system.reference_state()), NewtonOptions())
    ends = [walk.here]
    while ends[-1].rising:
        ends.append(walk.advance())
    found, reach = walk.at, walk.measure(ends[-2]) + 0.05 * (walk.measure(ends[-1]) - walk.measure(ends[-2]))
    refused = []

    def at_hand(value):
        if value > reach and len(refused) < 3:
            refused.append(value)
            raise NotConvergedError("out of reach")
        return found(value)

    monkeypatch.setattr(walk, "at", at_hand)
    limit = walk.limit_between(*ends[-2:])
    assert len(refused) == 3
    # p/μ = 0.4935, as in the test above
    assert 0.01 * limit.equilibrium.fraction / 0.1 == pytest.approx(0.4935, rel=5e-3)


def test_volume_control_goes_on_behind_the_limit():
    system = sphere(0.01, n=2)
    linear = make_linear_solver(system.pattern.row_start, system.pattern.column)
    start = solve_path(system, [1.0])[0]
    step = 0.5 * system.conjugate(system.reference_state())
    inner = system.mesh.surface_nodes("inner")
    falling = 0
    walk = VolumeWalk(system, linear, start, step, NewtonOptions())
    for found in itertools.islice(walk, 8):
        stretch = np.linalg.norm(system.mesh.points[inner] + found.state.u[inner], axis=1).mean()
        outer = (1 + (stretch**3 - 1) / 1.5**3) ** (1 / 3)
        pressure = 0.1 * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))
        assert float(found.state.loads[0]) == pytest.approx(pressure, rel=5e-3)
        assert found.factorisations <= 6
        if found.negative_pivots is not None:
            assert found.negative_pivots == (0 if found.rising else 1)
            assert walk.is_stable(found)
        falling += not found.rising
    assert falling >= 2


def test_failure_tells_the_residuals_and_the_worst_element():
    system = sphere(0.2)
    linear = SuperLU(system.pattern.row_start, system.pattern.column)
    with pytest.raises(NotConvergedError) as failure:
        find_equilibrium(system, linear, system.reference_state(), 1.0, NewtonOptions(max_iterations=4))
    assert len(failure.value.facts["residuals"]) >= 2
    assert 0 <= failure.value.facts["worst_element"] < system.mesh.n_cells


def test_a_stretched_bar_follows_the_closed_form():
    # Uniaxial tension to λ = 2 by a prescribed displacement; neo-Hookean: P = μ (λ − λ⁻²).
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    system = System(mesh, {"body": neo_hookean()}, [*PLANES, Prescribed("x1", (1.0, None, None))])
    found = solve_path(system, [1.0])[0]
    pull = system.forces(found.state)[0][mesh.surface_nodes("x1"), 0].sum()
    assert pull == pytest.approx(0.1 * (2.0 - 0.25), rel=2e-4)


def test_a_load_on_what_is_stretched_is_no_jump():
    # The stretch moves the force along, which says nothing about what gives way to the force.
    supports = [*PLANES, Prescribed("z1", (None, None, 0.4))]
    system = System(
        box((2.0, 3.0, 4.0), (2, 2, 2)), {"body": neo_hookean(0.5, 20.0)}, supports, [Force("y1", (0.0, 0.1, 0.0))]
    )
    whole, parts = (solve_path(system, output_fractions(steps))[-1].state.u for steps in (1, 4))
    np.testing.assert_allclose(whole, parts, atol=1e-7)


def test_dead_traction_reaches_the_same_stretch():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    system = System(mesh, {"body": neo_hookean()}, PLANES, [Traction("x1", (0.175, 0.0, 0.0))])
    found = solve_path(system, [1.0])[0]
    assert found.state.u[mesh.surface_nodes("x1"), 0] == pytest.approx(1.0, rel=5e-4)


def test_a_hanging_column_under_its_weight():
    # Sliding sides make the strain uniaxial: at small strain u(L) = ρ g L² / (2 M), M = K + 4/3 μ.
    mesh = box((0.3, 0.3, 2.0), (1, 1, 4))
    material = neo_hookean(mu=1.0, ratio=2.0, density=1e-6)
    sides = [Sliding(name) for name in ("x0", "x1", "y0", "y1", "z0")]
    system = System(mesh, {"body": material}, sides, [Gravity((0.0, 0.0, -100.0))])
    start, end = solve_path(system, [1.0])
    assert start.fraction == 0.0
    np.testing.assert_allclose(end.state.u, start.state.u, atol=1e-12)  # weight acts in full from the start
    sag = start.state.u[mesh.surface_nodes("z1"), 2].mean()
    assert sag == pytest.approx(-1e-4 * 4.0 / (2 * (2.0 + 4.0 / 3.0)), rel=2e-3)


def test_a_bed_of_springs_carries_the_load():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    system = System(
        mesh, {"body": neo_hookean(mu=100.0)}, [ElasticSupport("z0", 0.05)], [Force("z1", (0.0, 0.0, -0.002))]
    )
    found = solve_path(system, [1.0])[0]
    assert found.state.u[mesh.surface_nodes("z0"), 2] == pytest.approx(-0.04, rel=1e-3)
    assert found.stable in (True, None)


def test_without_load_nothing_moves():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    found = solve_path(System(mesh, {"body": neo_hookean()}, PLANES), [1.0])
    assert found[0].iterations == 0
    assert not found[0].state.u.any()


@pytest.mark.parametrize("fractions", [[], [0.0], [0.5, 0.5], [0.7, 0.2], [1.2], [float("nan")]])
def test_fractions_must_ascend_to_one(fractions):
    with pytest.raises(InputError, match="fractions"):
        solve_path(sphere(0.01), fractions)


def test_step_bounds_are_kept():
    found = solve_path(sphere(0.045), [1.0], options=PathOptions(largest_step=0.25))
    assert found[0].fraction == 1.0
    assert found[0].factorisations >= 8
