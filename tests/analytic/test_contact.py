"""Contact against closed forms: Hertz, a patch across meshes that do not match, balance; and walls that really meet."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import geometric, graded, half_chamber, merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.skin import STIFFNESS
from turgor.fem.contact.spec import PairContact, RigidContact, SelfContact
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.loads import Pressure
from turgor.fem.rigid import Cylinder, Plane
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.geometry.pneunet import PneuNet
from turgor.mesh.cells import face_fluxes
from turgor.mesh.generate import generate
from turgor.mesh.structured import box
from turgor.solver.path import output_fractions, solve_path

KINDS = ["tet10", "hex27"]


@pytest.mark.parametrize("kind", KINDS)
def test_hertz_cylinder_on_a_half_space(kind):
    # Line contact (Hertz 1882): b² = 4 F' R/(π E*), p0² = F' E*/(π R), p = p0 √(1 − x²/b²).
    radius, depth, length, n = 25.0, 0.1, 12.0, 16
    mesh = box((1.0, 0.25, 1.0), (n, 1, n), kind)
    places = geometric(0.12, n, length)
    mesh = graded(graded(mesh, 0, n, places), 2, n, length - places[::-1])
    mu, bulk = 1.0, 2.0
    cylinder = Cylinder((0.0, -9.0, length + radius), (0.0, 9.0, length + radius), radius)
    contact = [RigidContact(cylinder, "z1", motion=(0.0, 0.0, -depth))]
    supports = [Sliding("x0"), Sliding("y0"), Sliding("y1"), Clamped("z0")]
    system = System(mesh, {"body": neo_hookean(mu, bulk / mu)}, supports, contact=contact)
    state = solve_path(system, [1.0])[0].state

    nu = (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu))
    modulus = 2 * mu * (1 + nu) / (1 - nu**2)
    line_force = 2 * system.touches(state)[0].force[2] / 0.25
    half_width = np.sqrt(4 * line_force * radius / (np.pi * modulus))
    peak = np.sqrt(line_force * modulus / (np.pi * radius))

    x, pressure = contact_pressure(system.contacts[0], state)
    inside = x < 0.9 * half_width
    assert inside.sum() > 60
    slope, square = np.polyfit(x[inside] ** 2, pressure[inside] ** 2, 1)
    assert np.sqrt(square) == pytest.approx(peak, rel=0.01)
    assert np.sqrt(-square / slope) == pytest.approx(half_width, rel=0.015)


def contact_pressure(term, state):
    """Place along x and contact pressure of every quadrature point of an obstacle's skin."""
    skin = term.skin
    x = np.einsum("qa,fai->fqi", skin.shape, (skin.points + state.u)[skin.faces])
    stiffness = state.penalty * STIFFNESS * (skin.load / skin.grip)[:, None]
    return x[..., 0].ravel(), -(stiffness * term.lagged_at(state)).ravel()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("contact", [SelfContact(), PairContact("low-z1", "high-z0")])
def test_patch_of_uniform_stress_across_meshes_that_do_not_match(contact, kind):
    low, high = box((1.0, 1.0, 0.5), (2, 3, 1), kind), box((1.0, 1.0, 0.5), (3, 2, 2), kind)
    mesh = merged(low=low, high=shifted_mesh(high, z=0.5))
    supports = [Sliding(f"{part}-{side}") for part in ("low", "high") for side in ("x0", "y0")]
    supports += [Sliding("low-z0"), Prescribed("high-z1", (None, None, -0.1))]
    system = System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, contact=[contact])
    found = solve_path(system, [1.0])[0]
    stress = system.solids[0].cauchy_stress(found.state)
    mean = stress.reshape(-1, 6).mean(axis=0)
    assert mean[2] < -0.2
    assert np.abs(mean[[0, 1, 3, 4, 5]]).max() < 2e-3 * abs(mean[2])
    assert np.sqrt(np.mean((stress - mean) ** 2)) < 2e-3 * abs(mean[2])
    assert np.abs(stress - mean).max() < 0.02 * abs(mean[2])


def chambers(pressure: float, contact, kind: str = "tet10") -> System:
    """Two pressurised boxes 1 mm apart, halves y ≥ 0 of them, standing on their floor."""
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6), kind)
    mesh = merged(left=one, right=shifted_mesh(one, 13.0))
    supports = [Clamped("left-z0"), Clamped("right-z0"), Sliding("left-y0"), Sliding("right-y0")]
    loads = [Pressure("left-cavity", pressure), Pressure("right-cavity", pressure)]
    return System(mesh, {"body": neo_hookean(0.1, 1000.0)}, supports, loads, contact=contact)


@pytest.mark.parametrize(("steps", "kind"), [(1, "tet10"), (4, "tet10"), (4, "hex27")])
def test_walls_of_pressurised_chambers_meet_and_do_not_pass(steps, kind):
    free = chambers(0.03, (), kind)
    found = solve_path(free, [1.0])[0]
    system = chambers(0.03, [SelfContact()], kind)
    check = system.contacts[0].intersection_check
    assert check.intersects(found.state.u)
    equilibria = solve_path(system, output_fractions(steps))
    for equilibrium in equilibria:
        assert equilibrium.stable in (True, None)
        assert system.touches(equilibrium.state)[0].overlap_per_wall < LARGEST_OVERLAP
        assert not check.intersects(equilibrium.state.u)
    touch = system.touches(equilibria[-1].state)[0]
    assert touch.area > 3.0
    assert equilibria[-1].factorisations <= (9 if steps == 1 else 12)
    # but for the way their cells are cut, one is the other's mirror image: the walls meet half-way
    left, right = (system.mesh.surface_nodes(name) for name in ("left-x1", "right-x0"))
    x = system.mesh.points + equilibria[-1].state.u
    assert x[left, 0].max() == pytest.approx(12.5, abs=0.05)
    assert x[right, 0].min() == pytest.approx(12.5, abs=0.05)


def test_a_chamber_under_vacuum_closes_on_itself():
    # Flat, held at both ends: floor and roof meet in the middle of the height, found by nothing but the search.
    mesh = half_chamber((12.0, 6.0, 4.0), (8, 4, 4), "hex27")
    supports, vacuum = [Clamped("x0"), Clamped("x1"), Sliding("y0")], [Pressure("cavity", -0.01)]
    free, system = (
        System(mesh, {"body": neo_hookean(0.1, 1000.0)}, supports, vacuum, contact=contact)
        for contact in ([], [SelfContact()])
    )
    check = system.contacts[0].intersection_check
    assert check.intersects(solve_path(free, [0.5, 1.0])[-1].state.u)
    found = solve_path(system, [0.5, 1.0])[-1]
    touch = system.touches(found.state)[0]
    assert touch.area > 4.0
    assert touch.overlap_per_wall < LARGEST_OVERLAP
    assert not check.intersects(found.state.u)
    z = (mesh.points + found.state.u)[:, 2]
    roof, floor = z[mesh.surface_nodes("z1")].min(), z[mesh.surface_nodes("z0")].max()
    # two walls, thinned a little, are all that lies between them
    assert roof + floor == pytest.approx(4.0, abs=1e-6)
    assert roof - floor == pytest.approx(2.0, rel=0.05)


def test_walls_of_a_pneunet_meet_and_push_it_to_bend_more():
    # "By reducing the distance between the chambers, the collision of the outer walls of the chambers with each other
    # is increased, so the maximum bending angle … also increases" (the PneuNet geometry study).
    finger = PneuNet(
        chambers=3, gap="0.3 mm", wall="1.5 mm", second_layer="0 mm", chamber_height="10 mm", symmetric=True
    )
    mesh = generate(finger, 3.0)
    material = {region: neo_hookean(0.2, 1000.0) for region in mesh.regions}
    supports, loads = [Clamped("mount"), Sliding("symmetry")], [Pressure("cavity", 0.035)]
    angles = []
    for contact in ([], [SelfContact()]):
        system = System(mesh, material, supports, loads, contact=contact)
        state = solve_path(system, [0.5, 1.0])[-1].state
        normal = face_fluxes((mesh.points + state.u)[mesh.surface("tip-face")])[1].sum(axis=0)
        angles.append(np.arctan2(-normal[2], normal[0]))
    touch, check = system.touches(state)[0], system.contacts[0].intersection_check
    assert touch.area > 2.0
    assert touch.overlap_per_wall < LARGEST_OVERLAP
    assert not check.intersects(state.u)
    assert angles[1] > 1.08 * angles[0] > 0.3


@pytest.mark.parametrize("kind", KINDS)
def test_force_on_a_plane_is_what_the_mount_carries(kind):
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6), kind)
    contact = [RigidContact(Plane((0.0, 0.0, 12.4), (0.0, 0.1, -1.0)), label="plate")]
    loads = [Pressure("cavity", 0.02)]
    system = System(one, {"body": neo_hookean(0.1, 1000.0)}, [Clamped("z0"), Sliding("y0")], loads, contact=contact)
    found = solve_path(system, [1.0])[0]
    touch = system.touches(found.state)[0]
    # Forces on the mount, on the symmetry plane and on the plate, with the pressure's on that plane, are in balance.
    forces = system.forces(found.state)[0]
    mount = one.surface_nodes("z0")
    plane = np.setdiff1d(one.surface_nodes("y0"), mount)
    total = forces[mount].sum(axis=0) + forces[plane].sum(axis=0)
    assert touch.force[2] > 0.1
    assert total[2] == pytest.approx(touch.force[2], rel=1e-6)
    assert total[0] == pytest.approx(touch.force[0], abs=1e-6 * touch.force[2])
    # no friction: the force is along the normal, here and at every point, and so the torque has no part along it
    normal = np.array([0.0, 0.1, -1.0]) / np.hypot(0.1, 1.0)
    assert np.linalg.norm(np.cross(touch.force, normal)) < 1e-12
    assert abs(np.dot(touch.torque, normal)) < 1e-9


def test_contact_is_made_stiffer_where_surfaces_overlap_too_much():
    # Pressed far beyond what the modulus lets expect.
    mesh = merged(low=box((1.0, 1.0, 0.5), (2, 2, 1)), high=shifted_mesh(box((1.0, 1.0, 0.5), (2, 2, 1)), z=0.5))
    held = [Sliding(f"{part}-{side}") for part in ("low", "high") for side in ("x0", "x1", "y0", "y1")]
    supports = [*held, Clamped("low-z0"), Prescribed("high-z1", (0.0, 0.0, -0.05))]
    system = System(mesh, {"body": neo_hookean(0.1, 100.0)}, supports, contact=[SelfContact()])
    found = solve_path(system, [1.0])[0]
    assert found.state.penalty > 1.0
    assert 0.0 < system.touches(found.state)[0].overlap_per_wall < LARGEST_OVERLAP
