"""Contact of plane models against closed forms: Hertz's line and point contact, a patch, and a strip that folds."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import geometric, merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.skin import STIFFNESS
from turgor.fem.contact.spec import PairContact, RigidContact, SelfContact
from turgor.fem.contact.term import LARGEST_OVERLAP, WIDEST_MARGIN
from turgor.fem.rigid import Plane, Sphere
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import rectangle
from turgor.solver.path import solve_path

MU, BULK = 1.0, 2.0
NU = (3 * BULK - 2 * MU) / (2 * (3 * BULK + MU))
PLANE_MODULUS = 2 * MU * (1 + NU) / (1 - NU**2)


def pressed(section, radius: float, depth: float, length: float) -> tuple[float, float, float]:
    """Press a rigid circle on a square refined under it; return its force, half-width and peak pressure."""
    n = 18
    mesh = rectangle((1.0, 1.0), (n, n))
    places = geometric(0.1, n, length)
    points = np.column_stack(
        [
            np.interp(mesh.points[:, 0] * n, np.arange(n + 1), places),
            length - np.interp((1.0 - mesh.points[:, 1]) * n, np.arange(n + 1), places),
        ]
    )
    mesh = Mesh(points, mesh.cells, surfaces=mesh.surfaces)
    contact = [RigidContact(Sphere((0.0, length + radius), radius), "y1", motion=(0.0, -depth))]
    system = System(
        mesh, {"body": neo_hookean(MU, BULK / MU)}, [Sliding("x0"), Clamped("y0")], section=section, contact=contact
    )
    state = solve_path(system, [1.0])[0].state
    term, skin = system.contacts[0], system.contacts[0].skin
    x = np.einsum("qa,fa->fq", skin.shape, (mesh.points + state.u)[skin.faces][:, :, 0]).ravel()
    stiffness = state.penalty * STIFFNESS * (skin.load / skin.grip)[:, None]
    pressure = -(stiffness * term.lagged_at(state)).ravel()
    inside = x < 0.9 * x[pressure > 0.0].max()
    assert inside.sum() > 15
    # the square of the pressure falls linearly with the square of the place
    slope, square = np.polyfit(x[inside] ** 2, pressure[inside] ** 2, 1)
    return float(term.touch(state).force[1]), float(np.sqrt(-square / slope)), float(np.sqrt(square))


def test_hertz_cylinder_in_plane_strain():
    # b² = 4 F' R/(π E*), p0² = F' E*/(π R) (Hertz 1882)
    radius = 25.0
    force, width, peak = pressed(PlaneStrain(0.5), radius, 0.1, 12.0)
    line_force = 2 * force / 0.5
    assert width == pytest.approx(np.sqrt(4 * line_force * radius / (np.pi * PLANE_MODULUS)), rel=0.03)
    assert peak == pytest.approx(np.sqrt(line_force * PLANE_MODULUS / (np.pi * radius)), rel=0.03)


def test_hertz_sphere_in_revolution():
    # a³ = 3 F R/(4 E*), p0 = 3 F/(2 π a²), approach a²/R (Hertz 1882)
    radius, depth = 25.0, 0.06
    force, width, peak = pressed(Axisymmetric(), radius, depth, 20.0)
    a = (0.75 * force * radius / PLANE_MODULUS) ** (1 / 3)
    assert width == pytest.approx(a, rel=0.03)
    assert peak == pytest.approx(1.5 * force / (np.pi * a**2), rel=0.03)
    assert depth == pytest.approx(a**2 / radius, rel=0.08)  # the block is no half-space


@pytest.mark.parametrize("contact", [SelfContact(), PairContact("low-y1", "high-y0")])
@pytest.mark.parametrize("kind", ["quad9", "tri6"])
@pytest.mark.parametrize("section", [PlaneStrain(), Axisymmetric()])
def test_patch_of_uniform_stress_across_meshes_that_do_not_match(section, kind, contact):
    low, high = rectangle((1.0, 0.5), (3, 1), kind), rectangle((1.0, 0.5), (4, 2), kind)
    mesh = merged(low=low, high=shifted_mesh(high, y=0.5))
    supports = [Sliding("low-x0"), Sliding("high-x0"), Sliding("low-y0"), Prescribed("high-y1", (None, -0.1))]
    system = System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, section=section, contact=[contact])
    found = solve_path(system, [1.0])[0]
    stress = system.solids[0].cauchy_stress(found.state).reshape(-1, 6)
    mean = stress.mean(axis=0)
    assert mean[1] < -0.2
    assert np.abs(mean[[0, 3, 4, 5]]).max() < 2e-3 * abs(mean[1])
    assert np.sqrt(np.mean((stress - mean) ** 2)) < 1e-2 * abs(mean[1])


def test_surfaces_press_sooner_where_only_the_independent_look_sees_too_much(monkeypatch, caplog):
    low, high = rectangle((1.0, 0.5), (3, 1), "quad9"), rectangle((1.0, 0.5), (4, 2), "quad9")
    mesh = merged(low=low, high=shifted_mesh(high, y=0.5))
    supports = [Sliding("low-x0"), Sliding("high-x0"), Sliding("low-y0"), Prescribed("high-y1", (None, -0.1))]
    system = System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, section=PlaneStrain(), contact=[SelfContact()])
    plain = solve_path(system, [1.0])[0].state
    assert not system.seen_to_overlap(plain)
    looks = []
    monkeypatch.setattr(system, "seen_to_overlap", lambda state: looks.append(state) or True)
    found = solve_path(system, [1.0])[0]
    *five, end, start = looks
    assert len(five) == 5, "an end is put to it"
    # What was found is not tried in a shorter step: it is seen to overlap at the start, too.
    assert (end is five[-1], start is not end) == (True, True)
    assert "still seen to overlap" in caplog.text
    assert found.state.margin == pytest.approx(WIDEST_MARGIN * 0.5)
    assert found.iterations <= 15
    # What is pressed together by 0.1 mm is now by the margin more.
    pressed = system.contacts[0].lagged_at(found.state)
    np.testing.assert_allclose(pressed, system.contacts[0].lagged_at(plain), atol=0.12 * np.abs(pressed).max())
    assert system.touches(plain)[0].overlap > 0.0
    assert system.touches(found.state)[0].overlap == 0.0


def ridges(depth: float) -> System:
    """A block with a ridge of 28° between two faces, pressed so far on another whose faces meet there too."""
    low, high = rectangle((1.0, 1.0), (2, 2)), rectangle((1.0, 1.0), (2, 2))
    points = low.points.copy()
    points[:, 1] *= 1.0 - 0.25 * np.abs(points[:, 0] - 0.5)
    low = Mesh(points, low.cells, surfaces=low.surfaces)
    mesh = merged(low=low, high=shifted_mesh(high, y=1.001))
    supports = [Clamped("low-y0"), Prescribed("high-y1", (0.0, -depth - 0.001))]
    return System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, section=PlaneStrain(), contact=[SelfContact()])


@pytest.mark.parametrize("depth", [0.011, 0.03])
def test_a_ridge_between_the_points_of_contact_does_not_pass_into_what_it_meets(depth, monkeypatch):
    pytest.importorskip("ipctk")
    system = ridges(depth)
    with monkeypatch.context() as blind:
        blind.setattr(system, "seen_to_overlap", lambda state: False)
        plain = solve_path(system, [1.0])[0].state
    assert system.touches(plain)[0].overlap_per_wall < LARGEST_OVERLAP
    assert system.contacts[0].intersects(plain)
    found = solve_path(system, [1.0])[0].state
    assert not system.contacts[0].intersects(found)
    assert 0.0 < found.margin <= WIDEST_MARGIN
    assert found.penalty == plain.penalty


def angle_section(kind: str, n: int) -> Mesh:
    """A square of two by two squares less the upper right one; surfaces ``top right``, ends of its arms."""
    grid = rectangle((2.0, 2.0), (2 * n, 2 * n), kind)
    middle = grid.points[grid.cells[:, : grid.cell.n_corners]].mean(axis=1)
    used, cells = np.unique(grid.cells[(middle < 1.0).any(axis=1)], return_inverse=True)
    points, cells = grid.points[used], cells.reshape(-1, grid.cells.shape[1]).astype(np.int32)
    skin = boundary_faces(cells)
    top, right = ((points[skin][:, :, axis] == 2.0).all(axis=1) for axis in (1, 0))
    return Mesh(points, cells, surfaces={"top": skin[top], "right": skin[right]})


@pytest.mark.parametrize(("kind", "n"), [("quad9", 1), ("tri6", 1), ("quad9", 2)])
def test_a_corner_closes_on_itself(kind, n):
    # Its two sides share a corner, or even have no other faces; closed they lie on one another.
    pytest.importorskip("ipctk")
    mesh = angle_section(kind, n)
    supports = [Clamped("right"), Prescribed("top", (1.0, -0.6))]
    material = {"body": neo_hookean(1.0, 5.0)}
    free = System(mesh, material, supports, section=PlaneStrain())
    system = System(mesh, material, supports, section=PlaneStrain(), contact=[SelfContact()])
    fractions = np.linspace(0.1, 1.0, 10)
    assert system.contacts[0].intersects(solve_path(free, fractions)[-1].state)
    found = solve_path(system, fractions)
    for equilibrium in found:
        assert not system.contacts[0].intersects(equilibrium.state)
    (touch,) = system.touches(found[-1].state)
    assert touch.area > 0.1
    assert touch.overlap_per_wall <= LARGEST_OVERLAP


def hairpin(bend: float, wall: float, arm: float, n: int) -> Mesh:
    """A strip bent into a hairpin, arms along x; surfaces ``low`` (the end of one), ``outer`` and ``inner``."""
    strip = rectangle((1.0, 1.0), (10 * n, n))
    s, t = strip.points.T
    r = bend + wall * (1.0 - t)
    run = np.pi * (bend + 0.5 * wall)
    along = s * (2 * arm + run)
    angle = np.clip((along - arm) / run, 0.0, 1.0) * np.pi
    back = np.clip(along - arm - run, 0.0, None)
    x = np.clip(along, None, arm) + r * np.sin(angle) - back
    return Mesh(
        np.column_stack([x, -r * np.cos(angle)]),
        strip.cells,
        surfaces={"low": strip.surfaces["x0"], "outer": strip.surfaces["y0"], "inner": strip.surfaces["y1"]},
    )


def test_a_strip_folded_by_a_barrier_never_touches_itself():
    # As below, and here the roller too comes to the arm through a gap.
    pytest.importorskip("ipctk")
    mesh = hairpin(1.0, 0.6, 4.0, 3)
    roller, table = Sphere((1.0, 4.61), 3.0), Plane((0.0, -1.61), (0.0, 1.0))
    contact = [
        SelfContact(method="barrier"),
        RigidContact(roller, "outer", motion=(0.0, -2.11), label="roller", method="barrier"),
        RigidContact(table, "outer", label="table", method="barrier"),
    ]
    material, supports = {"body": neo_hookean(0.1, 100.0)}, [Clamped("low")]
    system = System(mesh, material, supports, section=PlaneStrain(), contact=contact)
    for found in solve_path(system, [0.5, 1.0]):
        assert not any(term.intersects(found.state) for term in system.contacts)
    own, roller, table = system.touches(found.state)
    assert own.area > 1.0
    assert 0.0 < own.gap < 0.01 * 0.6
    assert roller.force[1] > 0.01
    reaction = system.body_part(system.forces(found.state)[0])[mesh.surface_nodes("low")].sum(axis=0)
    np.testing.assert_allclose(np.add(roller.force, table.force)[:2], reaction, atol=1e-6 * roller.force[1])


def test_a_folded_strip_closes_on_itself():
    # A roller presses one arm of a hairpin on the other, 0.1 mm farther than they need to meet.
    mesh = hairpin(1.0, 0.6, 4.0, 3)
    squeeze = [
        RigidContact(Sphere((1.0, 4.6), 3.0), "outer", motion=(0.0, -2.1), label="roller"),
        RigidContact(Plane((0.0, -1.6), (0.0, 1.0)), "outer", label="table"),
    ]
    material, supports = {"body": neo_hookean(0.1, 100.0)}, [Clamped("low")]
    free = System(mesh, material, supports, section=PlaneStrain(), contact=squeeze)
    u = solve_path(free, [0.5, 1.0])[-1].state.u
    system = System(mesh, material, supports, section=PlaneStrain(), contact=[SelfContact(), *squeeze])
    check = system.contacts[0].intersection_check
    assert check.intersects(u)
    found = solve_path(system, [0.5, 1.0])[-1]
    assert not check.intersects(found.state.u)
    own, roller, table = system.touches(found.state)
    assert own.area > 1.0
    assert own.overlap_per_wall < LARGEST_OVERLAP
    assert roller.force[1] > 0.01
    assert roller.overlap_per_wall < LARGEST_OVERLAP
    reaction = system.forces(found.state)[0][mesh.surface_nodes("low")].sum(axis=0)
    np.testing.assert_allclose(np.add(roller.force, table.force)[:2], reaction, atol=1e-6 * roller.force[1])
