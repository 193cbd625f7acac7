"""Contact by a barrier: what meets stays apart, moves as with penalties, and forces are in balance."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import half_chamber, merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.spec import RigidContact, SelfContact, Spring
from turgor.fem.loads import Pressure
from turgor.fem.rigid import Plane
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path

pytest.importorskip("ipctk")


def chambers(method: str) -> System:
    """Two pressurised boxes 1 mm apart, halves y ≥ 0 of them, standing on their floor."""
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    mesh = merged(left=one, right=shifted_mesh(one, 13.0))
    supports = [Clamped("left-z0"), Clamped("right-z0"), Sliding("left-y0"), Sliding("right-y0")]
    loads = [Pressure("left-cavity", 0.02), Pressure("right-cavity", 0.02)]
    contact = [SelfContact(method=method)]
    return System(mesh, {"body": neo_hookean(0.1, 1000.0)}, supports, loads, contact=contact)


def test_pressurised_chambers_meet_as_with_penalties_and_never_pass():
    systems = {method: chambers(method) for method in ("penalty", "barrier")}
    found = {method: solve_path(system, [0.5, 1.0]) for method, system in systems.items()}
    term = systems["barrier"].contacts[0]
    for equilibrium in found["barrier"]:
        assert not term.intersects(equilibrium.state)
        assert equilibrium.stable in (True, None)
    touch = term.touch(found["barrier"][-1].state)
    assert 0.0 < touch.gap < term.reach <= 0.01 * 2.0
    assert touch.area > 3.0
    u, v = (found[method][-1].state.u for method in ("penalty", "barrier"))
    assert np.linalg.norm(u - v) < 0.01 * np.linalg.norm(u)
    # the forces on both chambers are in balance
    out = np.zeros_like(v)
    term.force(found["barrier"][-1].state, out)
    left = systems["barrier"].mesh.points[:, 0] < 12.5
    assert out[left, 0].sum() > 0.05
    np.testing.assert_allclose(out[left].sum(axis=0), -out[~left].sum(axis=0), atol=1e-9)


def test_a_chamber_presses_on_a_plane_as_hard_as_its_mount_carries():
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    forces = []
    for method in ("penalty", "barrier"):
        contact = [RigidContact(Plane((0.0, 0.0, 12.4), (0.0, 0.0, -1.0)), label="plate", method=method)]
        loads, supports = [Pressure("cavity", 0.02)], [Clamped("z0"), Sliding("y0")]
        system = System(one, {"body": neo_hookean(0.1, 1000.0)}, supports, loads, contact=contact)
        state = solve_path(system, [1.0])[0].state
        touch = system.touches(state)[0]
        assert touch.force[2] > 0.1
        nodal, _ = system.forces(state)
        mount = one.surface_nodes("z0")
        plane = np.setdiff1d(one.surface_nodes("y0"), mount)
        total = nodal[mount].sum(axis=0) + nodal[plane].sum(axis=0)
        assert total[2] == pytest.approx(touch.force[2], rel=1e-6)
        forces.append(touch.force[2])
    assert forces[1] == pytest.approx(forces[0], rel=0.03)


def test_a_plate_is_pressed_on_a_block_as_by_penalties():
    # The plate is led through the gap and 0.1 mm further; on a spring, a chamber lifts it.
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1))
    forces = []
    for method in ("penalty", "barrier"):
        plate = RigidContact(Plane((0.0, 0.0, 1.05), (0.0, 0.0, -1.0)), "z1", (0.0, 0.0, -0.15), "plate", method=method)
        supports = [Clamped("z0"), Sliding("x0"), Sliding("y0")]
        system = System(mesh, {"body": neo_hookean(0.1, 10.0)}, supports, contact=[plate])
        state = solve_path(system, [0.5, 1.0])[-1].state
        touch = system.touches(state)[0]
        assert touch.displacement == pytest.approx((0.0, 0.0, -0.15))
        forces.append(touch.force[2])
    assert forces[0] > 0.05
    assert forces[1] == pytest.approx(forces[0], rel=0.1)  # the gap is a part of the way
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    spring = Spring(0.1, (0.0, 0.0, 1.0))
    plate = RigidContact(Plane((0.0, 0.0, 12.2), (0.0, 0.0, -1.0)), label="plate", method="barrier", spring=spring)
    loads, supports = [Pressure("cavity", 0.02)], [Clamped("z0"), Sliding("y0")]
    system = System(one, {"body": neo_hookean(0.1, 1000.0)}, supports, loads, contact=[plate])
    touch = system.touches(solve_path(system, [0.5, 1.0])[-1].state)[0]
    assert touch.force[2] > 0.01
    assert touch.force[2] == pytest.approx(0.1 * touch.displacement[2], rel=1e-6)


def test_blocks_pressed_together_in_the_plane():
    # Compressed between lubricated plates, two blocks carry one uniform stress; the gap between them is what is lost.
    low, high = rectangle((1.0, 0.5), (3, 1)), rectangle((1.0, 0.5), (4, 2))
    mesh = merged(low=low, high=shifted_mesh(high, y=0.504))
    supports = [Sliding("low-x0"), Sliding("high-x0"), Sliding("low-y0"), Prescribed("high-y1", (None, -0.104))]
    contact = [SelfContact(method="barrier")]
    system = System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, section=PlaneStrain(), contact=contact)
    found = solve_path(system, [1.0])[0]
    assert 0.0 < system.touches(found.state)[0].gap < 0.005
    stress = system.solids[0].cauchy_stress(found.state).reshape(-1, 6)
    mean = stress.mean(axis=0)
    assert mean[1] < -0.2
    assert np.sqrt(np.mean((stress - mean) ** 2)) < 0.03 * abs(mean[1])
