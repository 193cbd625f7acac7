"""Limits of the load are found whatever the steps, the size of the cavity and the sign of the pressure."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from samples import arch, neo_hookean, sphere

from turgor.common.errors import InputError
from turgor.fem.contact.spec import RigidContact
from turgor.fem.loads import Force, Pressure
from turgor.fem.programme import Programme
from turgor.fem.rigid import Plane
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.materials.models.gent import Gent
from turgor.materials.volumetric import Quadratic
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quarter_ring, rectangle, shell_octant
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.control import ATMOSPHERE, Air, Volume
from turgor.solver.events import Event, Outcome
from turgor.solver.follow import follow, follow_arc
from turgor.solver.newton import Equilibrium, NewtonOptions, NotConvergedError
from turgor.solver.path import LimitPressureError, PathOptions, StoppedShortError, output_fractions, solve_path
from turgor.solver.slopes import is_monotone, stable_while_held
from turgor.solver.volume import VolumeWalk

ONE = np.ones(1)
LIMIT, MINIMUM = 1.12607e-4, 2.43356e-5
"""Of the arch that rises by 1.2 mm, MPa."""
SHALLOW = 4.0738e-5
"""Limit of the one that rises by 0.75 mm: its snap changes the volume of a cavity 10 mm deep by a twentieth."""


def volumes(system: System, change: float, steps: int) -> list[float]:
    rest = system.conjugate(system.reference_state(), ONE)
    return [float(v) for v in np.linspace(rest, rest + change, steps + 1)[1:]]


def events(found: list[Equilibrium]) -> list[tuple[Event, float]]:
    return [(e.event, float(e.state.loads[0])) for e in found if e.event]


def stop(system: System, steps: int, **options: float) -> LimitPressureError:
    with pytest.raises(LimitPressureError) as stopped:
        solve_path(system, output_fractions(steps), options=PathOptions(**options))
    return stopped.value


@pytest.mark.parametrize("steps", [1, 2, 10])
def test_by_volume_both_limits_are_found_though_one_step_could_span_them(steps):
    system = arch(1.0)
    found = follow(system, Volume(ONE), volumes(system, 14.0, steps))
    (first, top), (second, low) = events(found)
    assert (first, second) == (Event.LIMIT, Event.MINIMUM)
    assert (top, low) == (pytest.approx(LIMIT, rel=1e-4), pytest.approx(MINIMUM, rel=1e-4))
    assert all(stable_while_held(system, Volume(ONE), e) for e in found)


@pytest.mark.parametrize("steps", [4, 10])
@pytest.mark.parametrize("full", [1e-4, 1e-2])
def test_along_the_arc_both_limits_are_found_whatever_the_units_of_its_axes(full, steps):
    system = arch(full)
    found = follow_arc(system, Volume(ONE), volumes(system, 12.5, 1)[-1], 1.0 / steps)
    (first, top), (second, low) = events(found)
    assert (first, second) == (Event.LIMIT, Event.MINIMUM)
    assert (top, low) == (pytest.approx(LIMIT, rel=1e-4), pytest.approx(MINIMUM, rel=1e-4))


@pytest.mark.parametrize("full", [2e-4, 1.0])
def test_the_arc_sets_out_from_any_state_of_the_path(full):
    target = volumes(arch(full), 12.5, 1)[-1]
    whole = follow_arc(arch(full), Volume(ONE), target, 0.1)
    for state in whole[:-1]:
        if not state.event:
            # As it is taken up from the disk: without what the walk knew there.
            start = Equilibrium(state.state, state.fraction, state.residuals, 0, 0)
            system = arch(full)
            end = follow_arc(system, Volume(ONE), target, 0.1, start=start)[-1]
            assert system.conjugate(end.state, ONE) == pytest.approx(target, rel=1e-6)
            assert end.fraction == pytest.approx(whole[-1].fraction, rel=1e-5)


@pytest.mark.parametrize(("full", "largest"), [(5e-5, 0.2), (2e-4, 0.07)])
def test_an_arc_goes_on_behind_a_turn_of_the_volume_as_if_it_had_not_stopped(full, largest):
    def walk(**past):
        system = arch(full, rise=1.5, depth=3.0)
        target = volumes(system, 17.1887, 1)[-1]
        found = follow_arc(system, Volume(ONE), target, 0.2, options=PathOptions(largest_step=largest), **past)
        return found, [system.conjugate(e.state, ONE) for e in found]

    whole, places = walk()
    passable = [k for k, e in enumerate(whole) if e.event is None]
    back = [k for k in passable[1:-1] if places[k + 1] < places[k]]
    assert len(back) > 3
    for k in (back[0], back[len(back) // 2], back[-1]):
        # As they are taken up from the disk: without what the walk knew there.
        before, start = (
            Equilibrium(e.state, e.fraction, e.residuals, 0, None)
            for e in (whole[max(j for j in passable if j < k)], whole[k])
        )
        found, volume = walk(start=start, before=before)
        assert volume[-1] == pytest.approx(places[-1], rel=1e-6)
        assert found[-1].fraction == pytest.approx(whole[-1].fraction, rel=1e-6)
        assert events(found) == [(event, pytest.approx(p, rel=1e-5)) for event, p in events(whole[k + 1 :])]
        if largest == 0.2:  # every state of the walk is delivered, and known where it is taken up
            assert volume == pytest.approx(places[k + 1 :], rel=1e-6)


@pytest.mark.parametrize("steps", [1, 4, 20])
def test_where_the_volume_turns_back_no_step_lands_on_another_branch_unnoticed(steps):
    system = arch(1.0, rise=1.5)
    found: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match="arc-length"):
        follow(system, Volume(ONE), volumes(system, 20.0, steps), on_equilibrium=found.append)
    assert events(found) == [(Event.LIMIT, pytest.approx(1.99420e-4, rel=1e-4))]
    assert all(stable_while_held(system, Volume(ONE), e) for e in found)


def test_an_arc_that_leads_back_ends():
    system = arch(2e-4)
    target = volumes(system, 20.0, 1)[-1]
    *_, here, further = follow_arc(system, Volume(ONE), volumes(system, 4.0, 1)[-1], 0.1)
    found: list[Equilibrium] = []
    # Come from further on, it goes on back to rest and into suction.
    with pytest.raises(StoppedShortError, match="leads back past where it began") as stopped:
        follow_arc(system, Volume(ONE), target, 0.2, start=here, before=further, on_equilibrium=found.append)
    assert stopped.value.outcome is Outcome.OUT_OF_REACH
    assert stopped.value.facts["part_of_the_way"] == pytest.approx(
        (system.conjugate(found[-1].state, ONE) - target) / 20.0 + 1.0
    )


def test_an_arc_ends_where_the_material_locks(monkeypatch):
    monkeypatch.setattr("turgor.solver.follow.LARGEST_LOAD", 10.0)
    # Gent's rubber has a largest stretch: the pressure grows without end before forty times the volume.
    rubber = Gent(mu=0.1, Jm=5.0, volumetric=Quadratic(100.0))
    body = quarter_ring(1.0, 1.5, 1)
    system = System(body, {"body": rubber}, [Sliding("y0")], [Pressure("inner", 0.02)], section=Axisymmetric())
    target = 40.0 * system.conjugate(system.reference_state(), ONE)
    found: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match=r"out of reach: at .* kPa in inner the loads are 10 times") as stopped:
        follow_arc(system, Volume(ONE), target, 0.1, on_equilibrium=found.append)
    assert (stopped.value.exit_code, stopped.value.outcome) == (3, Outcome.OUT_OF_REACH)
    assert found[-1].fraction == stopped.value.facts["last_fraction"] > 10.0
    assert len(found) < 120
    # taken up there, it ends there again
    with pytest.raises(StoppedShortError, match="out of reach"):
        follow_arc(system, Volume(ONE), target, 0.1, start=found[-1], before=found[-2], on_equilibrium=pytest.fail)


@pytest.mark.parametrize("steps", [1, 10])
def test_a_plate_that_moves_is_no_jump(steps):
    plate = RigidContact(Plane((0.0, 0.0, 1.6), (0.0, 0.0, -1.0)), surface="outer", motion=(0.0, 0.0, -0.4))
    held = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    loads = [Pressure("inner", 0.001)]
    system = System(shell_octant(1.0, 1.5, 1), {"body": neo_hookean()}, held, loads, contact=[plate])
    found = solve_path(system, output_fractions(steps))
    assert found[-1].fraction == 1.0
    assert sum(e.factorisations for e in found) < 60


def test_friction_and_a_volume_do_not_go_together():
    plate = RigidContact(Plane((0.0, 0.0, 1.6), (0.0, 0.0, -1.0)), surface="outer", friction=0.3)
    held = [Clamped("z0"), Sliding("x0"), Sliding("y0")]
    loads = [Pressure("inner", 0.01)]
    system = System(shell_octant(1.0, 1.5, 1), {"body": neo_hookean()}, held, loads, contact=[plate])
    with pytest.raises(InputError, match="friction"):
        follow(system, Volume(ONE), [1.5])


@pytest.mark.parametrize("full", [1.0, -1.0])
@pytest.mark.parametrize("steps", [1, 3])
def test_a_limit_of_suction_is_found_where_it_is_whatever_the_sign_of_the_load(full, steps):
    system = arch(full, above=False)
    found = follow(system, Volume(ONE), volumes(system, -7.0, steps))
    ((event, pressure),) = events(found)
    assert event == Event.LIMIT
    assert pressure == pytest.approx(-LIMIT, rel=1e-4)
    assert [stable_while_held(system, Volume(ONE), e) for e in found] == [True] * len(found)


@pytest.mark.parametrize("times", [1.3, 4.0])
@pytest.mark.parametrize("steps", [1, 3, 10])
def test_a_snap_that_hardly_changes_the_volume_is_not_jumped_over(times, steps):
    limit = stop(arch(times * SHALLOW, rise=0.75), steps).limit
    assert float(limit.equilibrium.state.loads[0]) == pytest.approx(SHALLOW, rel=1e-4)


@pytest.mark.parametrize(("rise", "times", "steps"), [(0.6, 1.02, 1), (0.65, 1.1, 1), (0.56, 1.5, 3)])
def test_a_snap_that_changes_the_volume_no_faster_than_what_follows_is_not_jumped_over(rise, times, steps):
    system = arch(1.0, rise=rise)
    (top, low) = (pressure for _, pressure in events(follow(system, Volume(ONE), volumes(system, 10.0, 20))))
    assert low < top
    limit = stop(arch(times * top, rise=rise), steps).limit
    assert float(limit.equilibrium.state.loads[0]) == pytest.approx(top, rel=1e-4)


@pytest.mark.parametrize(("rise", "top", "times"), [(0.65, 3.13172e-5, 1.3), (0.6, 2.74857e-5, 2.0)])
def test_nor_is_it_by_iteration(rise, top, times):
    block = box((10.0, 1.0, 0.4), (12, 1, 1), "hex27")
    points = block.points + np.array([[0.0, 0.0, 1.0]]) * (rise * np.sin(np.pi * block.points[:, :1] / 20.0) - 10.0)
    mesh = Mesh(points, block.cells, regions=block.regions, surfaces=block.surfaces)
    held = [Clamped("x0"), Sliding("x1"), Sliding("y0"), Sliding("y1")]
    system = System(mesh, {"body": neo_hookean(1.0, 1e3)}, held, [Pressure("z1", times * top)])
    with pytest.raises(LimitPressureError) as stopped:
        solve_path(system, [1.0], options=PathOptions(newton=NewtonOptions(linear="iterative")))
    assert float(stopped.value.limit.equilibrium.state.loads[0]) == pytest.approx(top, rel=1e-3)


def test_a_limit_that_is_none_is_not_located_where_its_ends_meet():
    system = arch(1.0)
    found: list[Equilibrium] = []
    follow(system, Volume(ONE), volumes(system, 7.0, 14), on_equilibrium=found.append)
    falling = [e for e in found if not e.rising]
    walk = VolumeWalk(system, make_stiffness_solver(system, "auto"), falling[-3], 0.5, NewtonOptions(), Volume(ONE))
    # As where rounding makes a state behind a limit look like one before it.
    first = replace(falling[-3], compliance=1e12)
    with pytest.raises(NotConvergedError, match="jumps"):
        walk.limit_between(first, falling[-2])
    assert walk.here is falling[-2]


@pytest.mark.parametrize(("steps", "largest"), [(1, 0.12), (6, 1.0)])
def test_a_step_on_which_the_load_falls_at_once_is_no_step_along_the_path(steps, largest):
    # The volume turns after 8.2 mm³, far from the target; slopes and mean over it are those of a monotone cubic.
    system = arch(1e-4, rise=1.55, above=False)
    rest = volumes(system, 0.0, 1)[-1]
    found: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match="no equilibrium was found beyond"):
        follow(
            system,
            Volume(ONE),
            volumes(system, -14.0, steps),
            options=PathOptions(largest_step=largest),
            on_equilibrium=found.append,
        )
    assert rest - system.conjugate(found[-1].state, ONE) == pytest.approx(8.2, abs=0.05)
    assert found[-1].fraction < -1.0


def test_what_a_jump_leads_to_is_no_state_of_the_path(monkeypatch):
    def never(walk, first, second, tolerance=1e-6):
        walk.stand_at(second, first)
        raise NotConvergedError("the path jumps here")

    monkeypatch.setattr(VolumeWalk, "limit_between", never)
    system = arch(1.0)
    found: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match="the path jumps here"):
        follow(system, Volume(ONE), volumes(system, 14.0, 5), on_equilibrium=found.append)
    assert found
    assert all(e.rising for e in found)


@pytest.mark.parametrize("part", [0.95, 0.999])
@pytest.mark.parametrize("steps", [1, 3])
def test_a_load_just_below_the_limit_is_reached(part, steps):
    end = solve_path(arch(part * SHALLOW, rise=0.75), output_fractions(steps))[-1]
    assert (end.fraction, end.stable, end.event) == (1.0, True, None)
    # An inflated sphere, on which the volume's own step passes the load and the limit behind it.
    ring = quarter_ring(1.0, 1.5, 2)
    balloon = System(
        ring, {"body": neo_hookean()}, [Sliding("y0")], [Pressure("inner", part * 0.0493473)], section=Axisymmetric()
    )
    end = solve_path(balloon, output_fractions(steps))[-1]
    assert (end.fraction, end.stable, end.event) == (1.0, True, None)


def test_a_limit_is_told_where_the_first_failure_is_the_last():
    limit = stop(arch(1.3 * LIMIT), 20, smallest_step=0.04).limit
    assert float(limit.equilibrium.state.loads[0]) == pytest.approx(LIMIT, rel=1e-4)


@pytest.mark.parametrize("steps", [1, 5])
def test_a_limit_of_a_force_is_told_in_words_of_a_force(steps):
    mesh = rectangle((10.0, 0.4), (12, 1), "quad9")
    points = mesh.points + np.array([[0.0, 1.0]]) * 1.2 * np.sin(np.pi * mesh.points[:, :1] / 20.0)
    bent = Mesh(points, mesh.cells, surfaces=mesh.surfaces)
    held = [Clamped("x0"), Sliding("x1")]
    system = System(
        bent, {"body": neo_hookean(1.0, 1e3)}, held, [Force("x1", (0.0, -0.005, 0.0))], section=PlaneStrain()
    )
    error = stop(system, steps)
    assert error.limit.equilibrium.fraction * 0.005 == pytest.approx(3.625e-4, rel=1e-3)
    assert "gives way while the load falls" in str(error)
    assert "ontrol by volume" not in str(error)


@pytest.mark.parametrize(
    ("pressure", "above", "text"),
    [(1.3 * LIMIT, True, "grows while the pressure falls"), (-1.3 * LIMIT, False, "shrinks while the suction falls")],
)
def test_what_lies_behind_a_limit_is_told_in_its_own_words(pressure, above, text):
    assert text in str(stop(arch(pressure, above=above), 5))


def test_behind_a_limit_the_loads_go_on_along_their_line_over_a_kink():
    up_and_down = Programme((0.0, 0.5, 1.0), (0.0, 1.0, -1.0))
    found = solve_path(
        arch(1.3 * LIMIT, programme=up_and_down), output_fractions(10), options=PathOptions(post_snap=True)
    )
    met = events(found)
    assert [event for event, _ in met] == [Event.LIMIT, Event.POST_SNAP, Event.MINIMUM, Event.POST_SNAP]
    # On the way down it snaps back from where the pressure is smallest.
    assert [pressure for _, pressure in met] == pytest.approx([LIMIT, LIMIT, MINIMUM, MINIMUM], rel=1e-4)
    assert found[-1].fraction == 1.0


@pytest.mark.parametrize(("rise", "full"), [(0.8, 3e-4), (0.8, 1e-3), (0.75, 5e-4)])
def test_what_it_snaps_to_is_not_the_limit_again(rise, full):
    up_and_down = Programme((0.0, 0.4, 1.0), (0.0, 1.0, -1.0))
    system = arch(full, rise=rise, programme=up_and_down)
    found = solve_path(system, output_fractions(4), options=PathOptions(post_snap=True))
    crown = int(np.argmax(system.mesh.points[:, 0]))
    snaps = [(a, b) for a, b in itertools.pairwise(found) if b.event is Event.POST_SNAP]
    assert [a.event for a, _ in snaps] == [Event.LIMIT, Event.MINIMUM]
    for limit, beyond in snaps:
        assert beyond.fraction == limit.fraction
        assert beyond.stable
        assert abs(beyond.state.u[crown, 1] - limit.state.u[crown, 1]) > 0.3 * rise


@pytest.mark.parametrize(
    ("rise", "full", "top", "crown"), [(1.5, 4e-4, 1.99420e-4, -2.849), (2.0, 1e-3, 2.597e-4, -3.767)]
)
def test_what_it_snaps_to_is_found_where_the_volume_turns_on_the_way(rise, full, top, crown):
    system = arch(full, rise=rise)
    found = solve_path(system, [1.0], options=PathOptions(post_snap=True))
    (_, limit), (event, snapped) = events(found)
    assert (event, limit, snapped) == (Event.POST_SNAP, pytest.approx(top, rel=1e-3), limit)
    # The same state is found from beyond: pressed through at a higher pressure, and let go to that of the limit.
    assert found[1].stable
    assert found[1].state.u[:, 1].min() == pytest.approx(crown, abs=2e-3)


def test_friction_of_what_is_out_of_reach_hides_no_limit():
    def limit(friction: float) -> tuple[Event, float]:
        bare = arch(1.3 * LIMIT)
        table = RigidContact(Plane((0.0, -100.0), (0.0, 1.0)), friction=friction)
        held = [Clamped("x0"), Sliding("x1")]
        load = Pressure("y1", 1.3 * LIMIT)
        system = System(
            bare.mesh, {"body": neo_hookean(1.0, 1e3)}, held, [load], section=PlaneStrain(), contact=[table]
        )
        found = solve_path(system, output_fractions(5), options=PathOptions(post_snap=True))
        assert found[-1].fraction == 1.0
        ((first, pressure), (snapped, _)) = events(found)
        assert snapped is Event.POST_SNAP
        return first, pressure

    assert limit(0.3) == limit(0.0) == (Event.LIMIT, pytest.approx(LIMIT, rel=1e-4))


@pytest.mark.parametrize("timed", [False, True])
def test_control_by_volume_is_advised_where_it_is_possible(timed):
    load = {"programme": Programme((0.0, 1.0), (0.0, 1.0))} if timed else {}
    advice = stop(arch(1.3 * LIMIT, **load), 5).advice
    assert ("Control by volume" in advice) is not timed


def test_a_kink_makes_the_walk_forget_its_past_once():
    ring = quarter_ring(1.0, 1.5, 2)

    def work(programme: Programme) -> int:
        load = Pressure("inner", 0.03, programme=programme)
        system = System(ring, {"body": neo_hookean()}, [Sliding("y0")], [load], section=Axisymmetric())
        return sum(e.factorisations for e in solve_path(system, output_fractions(10)))

    assert work(Programme((0.0, 0.1, 1.0), (0.0, 0.1000001, 1.0))) <= work(Programme((0.0, 1.0), (0.0, 1.0))) + 2


def test_a_bifurcation_by_volume_is_told():
    ring = quarter_ring(1.0, 1.5, 2)
    system = System(
        ring, {"body": neo_hookean(0.3)}, [Sliding("y0")], [Pressure("inner", 0.01)], section=Axisymmetric()
    )
    rest = system.conjugate(system.reference_state(), ONE)
    found = follow(system, Volume(ONE), volumes(system, -0.6 * rest, 5))
    held = [stable_while_held(system, Volume(ONE), e) for e in found]
    assert held[0] is True
    assert held[-1] is False
    first = held.index(False)
    assert [e.event for e in found if e.event] == [Event.BIFURCATION]
    assert found[first].event == Event.BIFURCATION
    assert np.abs(found[first].mode).max() == pytest.approx(1.0)


@pytest.mark.parametrize("full", [1e-3, 1.0, -0.01])
def test_a_given_amount_of_air_takes_few_steps_whatever_the_size_and_the_sign_of_the_load(full):
    system = sphere("hex27", 1, pressure=full)
    rest = system.conjugate(system.reference_state(), ONE)
    air = Air(full, ATMOSPHERE, full * ONE)
    told: list[float] = []
    found = follow(
        system,
        air,
        [ATMOSPHERE * rest * times for times in (1.5, 3.0, 8.0)],
        on_progress=lambda *how: told.append(how[0]),
    )
    assert events(found) == [(Event.LIMIT, pytest.approx(0.0493, rel=2e-3))]
    assert [stable_while_held(system, air, e) for e in found] == [True] * 4
    assert len(told) < 15


@pytest.mark.parametrize("full", [3e-4, -1e-3])
@pytest.mark.parametrize("steps", [12, 20])
def test_an_amount_of_air_that_has_a_maximum_is_told_by_it(full, steps):
    # Of soft air, at a hundredth of the pressure outside: a roomy cavity of it pushes the arch through.
    system, soft = arch(full, rise=0.9), 1e-3
    air = Air(full, soft, full * ONE)

    def amount(equilibrium: Equilibrium) -> float:
        return air.value(system.conjugate(equilibrium.state, air.weights), equilibrium.fraction)

    rest = system.conjugate(system.reference_state(), ONE)
    by_volume = [amount(e) for e in follow(system, Volume(ONE), volumes(system, 5.0, 100))]
    maximum = by_volume[int(np.argmax(np.array(by_volume[1:]) < by_volume[:-1]))]
    assert maximum == pytest.approx(1.0825 * soft * rest, rel=1e-4)
    found: list[Equilibrium] = []
    targets = [soft * rest * float(times) for times in np.linspace(1.0, 1.17, steps + 1)[1:]]
    with pytest.raises(StoppedShortError, match=r"maximum of 108\.2 % .* while the air is held") as stopped:
        follow(system, air, targets, on_equilibrium=found.append)
    assert stopped.value.outcome is Outcome.AIR_LIMIT
    assert "volume" in stopped.value.advice
    limit = found[-1]
    assert limit.event is Event.AIR_LIMIT
    assert amount(limit) == pytest.approx(maximum, rel=1e-4)
    assert stopped.value.facts["air_at_limit_mm3"] == pytest.approx(amount(limit) / soft)
    # what gives way is the middle of the arch, most of all
    assert system.mesh.points[np.argmax(np.abs(limit.mode).max(axis=1)), 0] == pytest.approx(10.0)
    # taken up from the state before, it ends there again
    again: list[Equilibrium] = []
    with pytest.raises(StoppedShortError, match="while the air is held"):
        follow(system, air, targets, start=found[-2], on_equilibrium=again.append)
    assert amount(again[-1]) == pytest.approx(amount(limit), rel=1e-6)
    assert again[-1].fraction == pytest.approx(limit.fraction, rel=1e-4)


@pytest.mark.parametrize("along", ["volume", "arc"])
def test_steps_are_not_longer_than_is_allowed(along):
    system = arch(1e-3)
    target = volumes(system, 4.0, 1)[-1]
    options = PathOptions(largest_step=0.1)
    told: list[float] = []

    def count(part: float, iteration: int, residual: float) -> None:
        told.append(part)

    if along == "volume":
        follow(system, Volume(ONE), [target], options=options, on_progress=count)
    else:
        found = follow_arc(system, Volume(ONE), target, 0.5, options=options, on_progress=count)
        assert 1 < len(found) < len(told)
    assert len(told) >= 8
    assert max(np.diff([0.0, *told])) <= 0.12 + 1e-6


def test_a_cubic_is_told_to_rise_only_where_it_does():
    x = np.linspace(0.0, 1.0, 2001)
    rng = np.random.default_rng(1)
    told = 0
    for _ in range(300):
        mean, start, end = rng.uniform(-0.5, 4.0, 3)
        cubic = (start + end - 2 * mean) * x**3 + (3 * mean - 2 * start - end) * x**2 + start * x
        if min(start, end) > 0.0 and is_monotone(mean, start, end):
            assert np.diff(cubic).min() > -1e-9
            told += 1
    assert told > 50
