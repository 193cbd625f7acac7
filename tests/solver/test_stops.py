"""Why a path ends: each cause told from the others by what the last equilibrium shows."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Prescribed, Sliding
from turgor.fem.system import System
from turgor.materials.library import get
from turgor.materials.stability import verdict
from turgor.mesh.structured import box, quarter_ring, rectangle
from turgor.solver.control import Volume
from turgor.solver.events import Event, Outcome
from turgor.solver.follow import follow, follow_arc
from turgor.solver.linear import SingularMatrixError, SuperLU
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.path import solve_path
from turgor.solver.stops import StoppedShortError, stopped, worst_point
from turgor.solver.volume import VolumeWalk


def sphere(material):
    return System(
        quarter_ring(1.0, 1.5, 2),
        {"body": material},
        [Sliding("y0")],
        [Pressure("inner", 0.01)],
        section=Axisymmetric(),
    )


def grown(system, stretch):
    """The state of a sphere blown up without change of volume, as if an equilibrium."""
    points = system.mesh.points
    radius = np.linalg.norm(points, axis=1)
    u = points * (((radius**3 + stretch**3 - 1) ** (1 / 3) / radius) - 1)[:, None]
    return Equilibrium(system.consistent(u, system.loading.at(1.0)), 1.0, (0.0,), 1, 0)


def test_a_material_is_blamed_where_it_is_least_stable():
    material = get("tpu-0deg-mooney-rivlin-5")
    limit = verdict(material).lost["equibiaxial"]["tension"]
    system = sphere(material)
    for stretch, outcome in ((1.0 + 0.5 * (limit - 1.0), Outcome.UNEXPLAINED), (1.02 * limit, Outcome.MATERIAL)):
        error = stopped(system, grown(system, stretch), NotConvergedError("the iteration wanders"))
        assert error.outcome is outcome
        assert error.exit_code == 3
    # a sphere's wall is stretched equibiaxially, most of all inside
    facts = error.facts
    assert facts["unstable_region"] == "body"
    assert np.hypot(*facts["unstable_at_mm"]) == pytest.approx(1.05, abs=0.06)
    first, second, third = facts["unstable_at_stretches"]
    assert first == pytest.approx(second, rel=5e-3)
    assert first * second * third == pytest.approx(1.0, abs=1e-3)
    assert limit < first < 1.02 * limit
    assert facts["material_verdict"] == str(verdict(material))
    assert "turgor materials" in error.advice


def test_the_margin_is_the_laboratory_s_at_rest():
    system = sphere(neo_hookean())
    assert worst_point(system, grown(system, 1.0)).margin == pytest.approx(2.0, rel=1e-6)


def test_a_distorted_element_is_blamed_with_its_place():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    system = System(mesh, {"body": neo_hookean()}, [Sliding(name) for name in ("x0", "y0", "z0")])
    u = np.zeros_like(mesh.points)
    cell = 17
    corner = mesh.cells[cell][0]
    centre = mesh.points[mesh.cells[cell]].mean(axis=0)
    for part in np.linspace(0.0, 1.5, 151):
        u[corner] = part * (centre - mesh.points[corner])
        smallest, at = system.worst_jacobian(u)
        if smallest < 0.25:
            break
    assert smallest > 0.0
    state = system.consistent(u, system.loading.at(1.0))
    error = stopped(
        system, Equilibrium(state, 1.0, (0.0,), 1, 0), NotConvergedError("an element would turn inside out")
    )
    assert error.outcome is Outcome.MESH
    assert error.facts["distorted_element"] == at
    assert corner in mesh.cells[at]
    assert "finer mesh" in error.advice


def test_too_much_overlap_is_blamed_on_contact():
    system = sphere(neo_hookean())
    error = NotConvergedError("surfaces overlap too much", facts={"overlap_per_wall": 0.5})
    assert stopped(system, grown(system, 1.1), error).outcome is Outcome.CONTACT


def test_a_crease_is_told_from_a_distorted_element():
    # A block between two walls that come together, on a third; its top is free (Hong, Zhao and Suo 2009: 0.645).
    mesh = rectangle((2.0, 1.0), (4, 2), "quad9")
    supports = [Sliding("x0"), Sliding("y0"), Prescribed("x1", (-0.8, None))]
    system = System(mesh, {"body": neo_hookean()}, supports, section=PlaneStrain())
    for stretch, outcome in ((0.66, Outcome.UNEXPLAINED), (0.63, Outcome.CREASE)):
        u = mesh.points * [stretch - 1.0, 1.0 / stretch - 1.0]
        here = Equilibrium(system.consistent(u, system.loading.at(1.0)), 1.0, (0.0,), 1, 0)
        error = stopped(system, here, NotConvergedError("an element would turn inside out"))
        assert error.outcome is outcome
    assert error.facts["creased_at_mm"][1] == pytest.approx(1.0)
    assert error.facts["surface_stretches"] == pytest.approx([0.63, 1.0, 1.0 / 0.63], abs=1e-4)
    # held all around there is no free surface to fold
    whole = System(mesh, {"body": neo_hookean()}, [Sliding(name) for name in mesh.surfaces], section=PlaneStrain())
    assert stopped(whole, here, NotConvergedError("the iteration wanders")).outcome is Outcome.UNEXPLAINED


def test_a_compressed_column_bifurcates_and_shows_how():
    # Euler's column between a clamped and a guided end buckles at ε ≈ π² (h/L)²/12, the stouter the later.
    length, height = 10.0, 1.0
    mesh = rectangle((height, length), (2, 20), "quad9")
    supports = [Prescribed("y0", (0.0, 0.0)), Prescribed("y1", (0.0, -0.1 * length))]
    system = System(mesh, {"body": neo_hookean()}, supports, section=PlaneStrain())
    found = solve_path(system, [1.0])
    event = next(e for e in found if e.event is Event.BIFURCATION)
    euler = np.pi**2 / 3 * (height / length) ** 2
    assert event.fraction * 0.1 == pytest.approx(euler, rel=0.06)
    # the mode bends sideways, most in the middle, and is clamped at both ends: (1 − cos 2πy/L)/2
    sideways = event.mode[:, 0] / event.mode[np.argmax(np.abs(event.mode[:, 0])), 0]
    expected = 0.5 * (1 - np.cos(2 * np.pi * mesh.points[:, 1] / length))
    np.testing.assert_allclose(sideways, expected, atol=0.05)
    assert event.stable is False


FULL = 0.06
"""Beyond the limit of the thick sphere, MPa."""


def balloon():
    material = neo_hookean()
    return System(
        quarter_ring(1.0, 1.5, 2),
        {"body": material},
        [Sliding("y0")],
        [Pressure("inner", FULL)],
        section=Axisymmetric(),
    )


def by_load(system, keep):
    solve_path(system, [0.5, 1.0], on_equilibrium=keep)


def by_volume(system, keep):
    rest = system.conjugate(system.reference_state())
    follow(system, Volume(), [2.0 * rest, 20.0 * rest], on_equilibrium=keep)


def by_arc(system, keep, times=20.0):
    rest = system.conjugate(system.reference_state())
    follow_arc(system, Volume(), times * rest, 0.1, on_equilibrium=keep)


def by_arc_to_a_volume(system, keep):
    by_arc(system, keep, times=2.0)


@pytest.mark.parametrize("walk", [by_load, by_volume, by_arc, by_arc_to_a_volume])
def test_what_cannot_be_located_ends_a_path_at_its_last_state(walk, monkeypatch):
    at = VolumeWalk.at

    def nowhere_between(self, value):
        known = [self.measure(e) for e in (self.before, self.here) if e is not None]
        if len(known) == 2 and min(known) < value < max(known):
            raise NotConvergedError("the iteration wanders")
        return at(self, value)

    monkeypatch.setattr(VolumeWalk, "at", nowhere_between)
    system, kept = balloon(), []
    with pytest.raises(StoppedShortError, match=r"beyond \d.* kPa in inner .*the iteration wanders") as stop:
        walk(system, kept.append)
    assert stop.value.exit_code == 3
    assert stop.value.advice
    assert kept[-1].fraction == stop.value.facts["last_fraction"] > 0.0
    assert len({round(e.fraction, 6) for e in kept}) == len(kept)
    # pressure of the incompressible sphere (Green and Zerna) at the state that was kept
    stretch = np.cbrt(system.conjugate(kept[-1].state) / system.conjugate(system.reference_state()))
    outer = (1 + (stretch**3 - 1) / 1.5**3) ** (1 / 3)
    exact = 0.1 * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))
    assert kept[-1].fraction * FULL == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("walk", [by_load, by_volume, by_arc])
def test_a_singular_stiffness_ends_a_path_as_any_failure_does(walk, monkeypatch):
    def singular(self, values):
        raise SingularMatrixError("the stiffness matrix is singular")

    monkeypatch.setattr("turgor.solver.linear.solver_in_use", lambda: SuperLU)
    monkeypatch.setattr(SuperLU, "factorise", singular)
    with pytest.raises(StoppedShortError, match=r"beyond 0 kPa in inner \(the stiffness is singular\)") as stop:
        walk(balloon(), pytest.fail)
    assert stop.value.advice
