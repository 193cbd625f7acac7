"""A rigid body on a spring: its displacement is an unknown like any other, and Π stays one potential."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import half_chamber
from samples import check_assembled, neo_hookean, shifted

from turgor.common.errors import InputError
from turgor.fem.contact.spec import RigidContact, Spring
from turgor.fem.loads import Gravity, Pressure, Traction
from turgor.fem.rigid import Plane, Sphere
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, ElasticSupport, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path


def pressed(friction: float = 0.0, kind: str = "tet10") -> System:
    """A block over a ball on an oblique spring, whose far end is pushed."""
    spring = Spring(0.7, (0.3, 0.1, 1.0))
    contact = [RigidContact(Sphere((1.0, 1.0, -2.95), 3.0), "z0", (0.05, 0.02, 0.1), "ball", friction, spring=spring)]
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1), kind)
    return System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("z1")], contact=contact)


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_forces_and_stiffness_are_derivatives_of_the_energy(friction, kind):
    system = pressed(friction, kind)
    noise = 0.008 * np.random.default_rng(2).standard_normal(system.constraints.value.shape)
    state = system.consistent(system.nodal(system.free_part(noise)), system.loading.at(0.4))
    state = system.gripped(state, dragged=True)
    state = system.gripped(system.consistent(1.1 * state.u, system.loading.at(0.5), 1.0, state.grips), dragged=False)
    assert system.touches(state)[0].overlap > 1e-3
    direction = system.nodal(np.random.default_rng(4).standard_normal(system.n_dofs))
    assert np.linalg.norm(direction[-1]) > 0.1  # the body moves too, along its spring
    np.testing.assert_allclose(np.cross(direction[-1], (0.3, 0.1, 1.0)), 0.0, atol=1e-12)
    more, less = (system.energy(shifted(state, direction, h)) for h in (1e-6, -1e-6))
    assert np.vdot(system.forces(state)[0], direction) == pytest.approx((more - less) / 2e-6, rel=1e-6)
    system.stiffness(state)
    check_assembled(system, state, direction, 1e-6)
    more, less = (system.forces(state.with_loads(state.loads + h))[0] for h in (1e-5, -1e-5))
    expected = (more - less) / 2e-5
    np.testing.assert_allclose(system.load_direction(state), expected, atol=1e-6 * np.abs(expected).max())


def test_a_block_hangs_on_a_plane_and_its_spring():
    # Pulled down by a traction on its top, between frictionless walls: the spring carries all of it.
    stiffness, pull = 0.5, 0.03
    supports = [Sliding("x0"), Sliding("y0"), Sliding("x1"), Sliding("y1")]
    plate = RigidContact(
        Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "z0", label="plate", spring=Spring(stiffness, (0, 0, -2))
    )
    soft = ElasticSupport("z1", 1e-3, normal_only=True)
    system = System(
        box((2.0, 1.0, 1.0), (2, 1, 1)),
        {"body": neo_hookean(1.0, 20)},
        [*supports, soft],
        [Traction("z1", (0.0, 0.0, -pull))],
        contact=[plate],
    )
    found = solve_path(system, [1.0])[0]
    touch = system.touches(found.state)[0]
    force, moved = touch.force[2], touch.displacement[2]
    assert force == pytest.approx(stiffness * moved, rel=1e-6)
    top = system.mesh.surface_nodes("z1")
    carried = 1e-3 * 2.0 * found.state.u[top, 2].mean()  # what the bed of springs takes
    assert force == pytest.approx(-pull * 2.0 - carried, rel=1e-6)
    assert found.stable in (True, None)


@pytest.mark.parametrize("section", [PlaneStrain(2.0), Axisymmetric()])
def test_in_the_plane_force_is_stiffness_times_displacement(section):
    spring = Spring(0.4, (0.0, 1.0))
    contact = [RigidContact(Plane((0.0, -0.01), (0.0, 1.0)), "y0", (0.0, 0.3), "plate", spring=spring)]
    held = [Clamped("y1"), Sliding("x0")]
    mesh = rectangle((1.0, 1.0), (3, 3))
    system = System(mesh, {"body": neo_hookean(0.1, 20)}, held, section=section, contact=contact)
    touch = system.touches((found := solve_path(system, [0.5, 1.0])[-1]).state)[0]
    compressed = touch.displacement[1] - 0.3  # the far end of the spring has moved by 0.3
    assert compressed < -0.05
    assert touch.force[1] == pytest.approx(0.4 * compressed, rel=1e-6)
    assert found.state.u.shape == (mesh.n_points + 1, 2)


def test_a_chamber_lifts_a_plate_on_a_spring():
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    forces = []
    for stiffness in (0.05, 0.5, 1e4, None):
        spring = None if stiffness is None else Spring(stiffness, (0.0, 0.0, 1.0))
        contact = [RigidContact(Plane((0.0, 0.0, 12.2), (0.0, 0.0, -1.0)), label="plate", spring=spring)]
        loads = [Pressure("cavity", 0.02), Gravity((0.0, 0.0, -9810.0))]
        material = {"body": neo_hookean(0.1, 1000.0, density=1.07e-9)}
        system = System(one, material, [Clamped("z0"), Sliding("y0")], loads, contact=contact)
        touch = system.touches(solve_path(system, [1.0])[-1].state)[0]
        forces.append(touch.force[2])
        if stiffness is not None:
            assert touch.force[2] == pytest.approx(stiffness * touch.displacement[2], rel=1e-6)
    assert 0.0 < forces[0] < forces[1] < forces[2]
    assert forces[2] == pytest.approx(forces[3], rel=1e-3)  # a very stiff spring holds the plate still


def test_refusals():
    with pytest.raises(InputError, match="must be positive"):
        Spring(0.0, (0.0, 0.0, 1.0))
    with pytest.raises(InputError, match="no length"):
        Spring(1.0, (0.0, 0.0, 0.0))
    contact = [RigidContact(Plane((0.0, 0.0), (0.0, 1.0)), spring=Spring(1.0, (1.0, 0.0)))]
    with pytest.raises(InputError, match="does not fit"):
        System(
            rectangle((1.0, 1.0), (1, 1)),
            {"body": neo_hookean()},
            [Clamped("y1")],
            section=Axisymmetric(),
            contact=contact,
        )
