"""Several cavities, each with a pressure of its own: the one that gives way is found whatever the others do."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from samples import arch, neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.programme import PROPORTIONAL, Programme
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.solver.events import Event
from turgor.solver.newton import Equilibrium
from turgor.solver.path import LimitPressureError, PathOptions, output_fractions, solve_path

LIMIT, SHALLOW = 1.12607e-4, 4.0738e-5
"""Limits of the arches that rise by 1.2 mm and by 0.75 mm, MPa."""
UP = Programme((0.0, 0.4, 1.0), (0.0, 0.5, 1.0))
DOWN = Programme((0.0, 0.4, 1.0), (0.0, 0.5, 0.0))


def two_arches(
    first: tuple[float, Programme], second: tuple[float, Programme], rises: tuple[float, float], mu: float = 1.0
) -> System:
    """Two arches that do not touch, each under a pressure of its own; the second is of a shear modulus `mu`, MPa."""
    meshes = [arch(1.0, rise=rise).mesh for rise in rises]
    count, cells = meshes[0].n_points, meshes[0].n_cells
    surfaces = {
        f"{name}-{number}": faces + number * count
        for number, mesh in enumerate(meshes)
        for name, faces in mesh.surfaces.items()
    }
    mesh = Mesh(
        np.vstack([mesh.points for mesh in meshes]),
        np.vstack([mesh.cells + number * count for number, mesh in enumerate(meshes)]),
        regions={"body": np.arange(cells), "second": np.arange(cells, 2 * cells)},
        surfaces=surfaces,
    )
    held = [kind(f"{name}-{number}") for number in (0, 1) for kind, name in ((Clamped, "x0"), (Sliding, "x1"))]
    loads = [Pressure("y1-0", *first), Pressure("y1-1", *second)]
    materials = {"body": neo_hookean(1.0, 1e3), "second": neo_hookean(mu, 1e3)}
    return System(mesh, materials, held, loads, section=PlaneStrain())


def volumes(system: System, found: Equilibrium) -> list[float]:
    return [cavity.volume(found.state.u) for cavity in system.cavities]


def beside_a_larger(rise: float, limit: float, full: float, mu: float) -> System:
    """An arch that snaps beside one that bulges, and whose pressure changes the work of all loads far more."""
    return two_arches((1.5 * limit, PROPORTIONAL), (full, PROPORTIONAL), (rise, -1.2), mu)


def snapped_alone(rise: float, limit: float) -> float:
    """The volume above an arch that has snapped at its limit."""
    system = arch(1.5 * limit, rise=rise)
    found = solve_path(system, [1.0], options=PathOptions(post_snap=True))
    return system.conjugate(next(e for e in found if e.event is Event.POST_SNAP).state, np.ones(1))


@pytest.mark.parametrize(
    ("rise", "limit", "full", "mu", "steps"),
    [
        (0.75, SHALLOW, 1e-3, 1.0, 1),  # was passed over
        (1.2, LIMIT, 0.1, 10.0, 3),  # from a state right before the limit: was passed over
        (0.75, SHALLOW, 0.1, 10.0, 10),  # was passed over
        (1.2, LIMIT, 0.01, 10.0, 3),  # was not located
        (0.75, SHALLOW, 0.01, 10.0, 10),  # was not located, nor the state behind it found
    ],
)
def test_a_cavity_that_snaps_is_not_hidden_by_another_one(rise, limit, full, mu, steps):
    system = beside_a_larger(rise, limit, full, mu)
    with pytest.raises(LimitPressureError) as stopped:
        solve_path(system, output_fractions(steps))
    at = stopped.value.limit.equilibrium
    assert float(at.state.loads[0]) == pytest.approx(limit, rel=1e-4)
    assert stopped.value.facts["pressure:y1-1_kPa"] == pytest.approx(1e3 * full * at.fraction)

    found = solve_path(system, output_fractions(steps), options=PathOptions(post_snap=True))
    before, behind = (next(e for e in found if e.event is event) for event in (Event.LIMIT, Event.POST_SNAP))
    assert behind.state.loads == pytest.approx(before.state.loads, rel=1e-9)
    first, second = volumes(system, behind)
    assert first == pytest.approx(snapped_alone(rise, limit), rel=1e-4)
    assert second == pytest.approx(volumes(system, before)[1], rel=1e-6)


def test_one_that_bulges_ever_faster_beside_a_stiffer_one_is_no_jump():
    # The soft one doubles its volume without a limit.
    system = two_arches((2e-4, PROPORTIONAL), (0.01, PROPORTIONAL), (-0.4, -1.2), 10.0)
    found = solve_path(system, output_fractions(4))
    assert [e.event for e in found] == [None] * 4
    assert sum(e.factorisations for e in found) < 40


def test_one_cavity_snaps_while_the_other_goes_down():
    # The way back along the programmes leads to a higher pressure in the other one, and to its limit.
    system = two_arches((1.5 * LIMIT, UP), (1.5 * LIMIT, DOWN), (1.2, 1.2))
    found = solve_path(system, output_fractions(5), options=PathOptions(post_snap=True))
    events = [(e.event, e.fraction) for e in found if e.event]
    assert [event for event, _ in events] == [Event.LIMIT, Event.POST_SNAP]
    assert [fraction for _, fraction in events] == pytest.approx([0.6, 0.6], rel=1e-4)
    behind = next(e for e in found if e.event is Event.POST_SNAP)
    first, second = volumes(system, behind)
    assert first == pytest.approx(snapped_alone(1.2, LIMIT), rel=1e-4)
    alone = arch(float(behind.state.loads[1]))
    assert second == pytest.approx(alone.conjugate(solve_path(alone, [1.0])[-1].state, np.ones(1)), rel=1e-6)
    assert found[-1].state.loads[1] == pytest.approx(0.0, abs=1e-12)
    at_rest = system.cavities[1].volume(system.reference_state().u)
    assert volumes(system, found[-1])[1] == pytest.approx(at_rest, rel=1e-6)


def test_energy_is_the_work_of_each_pressure_on_its_own_volume():
    system = two_arches((0.9 * LIMIT, UP), (-5e-5, DOWN), (1.2, 1.2))
    found = solve_path(system, output_fractions(60))
    states = [system.reference_state(), *(e.state for e in found)]
    bulk = [sum(solid.energy(state) for solid in system.solids) for state in states]
    work = 0.0
    for before, after in itertools.pairwise(states):
        change = [cavity.volume(after.u) - cavity.volume(before.u) for cavity in system.cavities]
        work += float(0.5 * (before.loads + after.loads) @ change)
    assert bulk[-1] - bulk[0] == pytest.approx(work, rel=1e-3)


def test_times_that_differ_by_rounding_are_one():
    # 0.7 s and 700 ms of 4 s, and a state asked for at either: steps of the last digit were tried and cut to nothing.
    point, beside = 0.7 / 4.0, 700.0 * 0.001 / 4.0
    assert 0.0 < abs(beside - point) < 1e-15
    held = Programme((0.0, point, 1.0), (0.0, 0.0, -1.0))
    up = Programme((0.0, beside, 1.0), (0.0, 1.0, 0.5))
    system = two_arches((LIMIT, up), (LIMIT, held), (-1.2, -1.2))
    assert len(system.loading.kinks) == 1
    low, high = sorted((point, beside))
    assert system.loading.growth(low) == pytest.approx(system.loading.growth(high), rel=1e-12)
    assert system.loading.growth(low)[0] < 0.0
    for asked in (low, high):
        told: list[float] = []
        found = solve_path(system, [asked, 1.0], on_progress=lambda aim, iteration, residual, t=told: t.append(aim))
        assert [e.fraction for e in found] == [asked, 1.0]
        assert set(told) == {asked, 1.0}


@pytest.mark.parametrize("fall", [0.3, 0.45])
def test_a_limit_is_told_of_the_cavity_that_gives_way(fall: float):
    # The other one's pressure changes faster, and falls: its limit was called a minimum of the way back.
    up = Programme((0.0, 0.5, 1.0), (0.0, 0.5, 1.0))
    down = Programme((0.0, 0.5, 0.5 + fall, 1.1), (0.0, 0.9, 0.0, 0.0))
    system = two_arches((1.5 * LIMIT, up), (LIMIT, down), (1.2, 1.2))
    with pytest.raises(LimitPressureError, match="grows while the pressure in y1-0 falls") as stopped:
        solve_path(system, output_fractions(4))
    assert stopped.value.limit.event is Event.LIMIT
    assert float(stopped.value.limit.equilibrium.state.loads[0]) == pytest.approx(LIMIT, rel=1e-4)
