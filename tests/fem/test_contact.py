"""Contact: its forces and stiffnesses on random states that touch, what it leaves alone, and the room it needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_bodies import half_chamber, merged, shifted_mesh
from contact_checks import check_contact, check_obstacle
from samples import check_assembled, neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.contact.obstacle import Obstacle
from turgor.fem.contact.partners import balls, find_partners
from turgor.fem.contact.shapes import second_derivatives, shape_functions
from turgor.fem.contact.skin import Skin
from turgor.fem.contact.spec import PairContact, RigidContact, SelfContact, Spring
from turgor.fem.loads import Traction
from turgor.fem.rigid import Box, Cylinder, Plane, Sphere
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.cells import CELLS
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, shell_octant

BODIES = {
    "plane": Plane((0.0, 0.0, 0.35), (0.1, 0.2, 1.0)),
    "sphere": Sphere((1.2, 1.0, -2.8), 3.0),
    "cylinder": Cylinder((-1.0, 0.7, -1.9), (3.0, 1.0, -1.9), 2.0),
    "cylinder's end": Cylinder((1.0, 1.0, -2.0), (1.0, 1.0, 0.1), 1.5),
    "box": Box((0.3, 0.4, -1.0), (1.5, 1.7, 0.07)),
}


KINDS = ["tet10", "hex27"]


def stacked(gap: float, kind: str) -> System:
    """A small block over a larger one, meshes that do not match, and a rigid sphere that pushes from below."""
    low, high = box((2.0, 2.0, 1.0), (2, 2, 1), kind), box((1.2, 1.3, 1.0), (3, 2, 1), kind)
    mesh = merged(low=low, high=shifted_mesh(high, 0.4, 0.35, 1.0 + gap))
    contact = [SelfContact(), RigidContact(BODIES["sphere"], motion=(0.1, 0.0, 0.1))]
    return System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("low-z0"), Clamped("high-z1")], contact=contact)


def with_skin(mesh: Mesh) -> Mesh:
    """The same mesh, its whole skin a surface."""
    return Mesh(mesh.points, mesh.cells, surfaces={**mesh.surfaces, "skin": boundary_faces(mesh.cells)})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("margin", [0.0, 0.02, 0.06])
def test_self_contact(kind, margin):
    # with the widest margin points press too whose gap is positive
    system = stacked(-0.05, kind)
    check_contact(system.contacts[0], replace(random_state(system, 0.008), margin=margin))


@pytest.mark.parametrize("kind", KINDS)
def test_a_margin_is_a_gap_that_presses_as_an_overlap_does(kind):
    # Flat blocks: drawn apart by the margin they press as hard, and nothing overlaps.
    found = []
    for gap, margin in ((-0.05, 0.0), (0.01, 0.06)):
        system = stacked(gap, kind)
        state = system.consistent(np.zeros_like(system.mesh.points), system.loading.at(0.0), margin=margin)
        found.append((system.contacts[0].energy(state), system.contacts[0].touch(state), state.lagged[1]))
    (energy, touch, lagged), (wide_energy, wide, wide_lagged) = found
    assert energy > 1e-3
    assert wide_energy == pytest.approx(energy)
    np.testing.assert_allclose(wide_lagged, lagged, atol=1e-12)
    assert wide.area == pytest.approx(touch.area)
    assert touch.overlap == pytest.approx(0.05)
    assert wide.overlap == 0.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", BODIES)
def test_rigid_body(name, kind):
    case = RigidContact(BODIES[name], motion=(0.03, -0.02, 0.01))
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1), kind)
    system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("z1")], contact=[case])
    state = random_state(system, 0.008)
    check_obstacle(system.contacts[0], state, case.motion)


def test_two_bodies_are_two_also_where_they_are_equal_or_made_of_arrays():
    mesh = box((2.0, 2.0, 2.0), (1, 1, 1))
    plane = Plane(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, -1.0]))
    led = RigidContact(plane, motion=np.array([0.0, 0.0, -0.1]), label="led")
    sprung = RigidContact(plane, label="sprung", spring=Spring(0.5, np.array([0.0, 0.0, 1.0])))
    barred = replace(led, label="barred", method="barrier", body=Plane(np.array([0.0, 0.0, 3.0]), plane.normal))
    contact = [led, SelfContact(), replace(led), led, sprung, replace(sprung), barred]
    loads = [Traction("z1", (0.0, 0.0, 0.1))]
    system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("z0")], loads, contact=contact)
    assert system.loading.names == ("traction:z1", "motion:led", "motion:led#2", "motion:led#3")
    bodies = [term for term in system.contacts if isinstance(term, Obstacle)]
    pushed = []
    for load in range(1, 4):
        state = system.consistent(system.reference_state().u, np.eye(4)[load])
        pushed.append([body.energy(state) > 0.0 for body in bodies])
    for row in range(2):
        u = system.reference_state().u
        u[mesh.n_points + row, 2] = -0.1
        pushed.append([body.energy(system.consistent(u, np.zeros(4))) > 0.0 for body in bodies])
    assert np.array_equal(pushed, np.eye(5, dtype=bool))


@pytest.mark.parametrize("name", BODIES)
def test_distance_of_rigid_bodies(name):
    x = np.random.default_rng(0).uniform(-1.0, 2.0, (50, 3))
    gap, normal, curvature = BODIES[name].distance(x)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-6
        (more, more_normal, _), (less, less_normal, _) = (BODIES[name].distance(x + h) for h in (step, -step))
        smooth = np.abs(more_normal - less_normal).max(axis=1) < 1e-3
        assert smooth.sum() > 40
        np.testing.assert_allclose(normal[smooth, axis], ((more - less) / 2e-6)[smooth], atol=1e-7)
        slope = (more_normal - less_normal) / 2e-6
        np.testing.assert_allclose(curvature[smooth][:, :, axis], slope[smooth], atol=1e-6)
    assert (gap < 0).any()


@pytest.mark.parametrize("kind", KINDS)
def test_whole_stiffness_is_the_derivative_of_all_forces_and_finds_its_room(kind):
    system = stacked(1.5, kind)  # far apart at rest: nothing is coupled between the blocks yet
    pattern = system.pattern
    lift = np.where(system.mesh.points[:, 2] > 1.2, -1.55, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    noise = 0.008 * np.random.default_rng(1).standard_normal(lift.shape)
    state = system.consistent(lift + noise, system.loading.at(0.7))
    assert all(touch.overlap > 1e-3 for touch in system.touches(state))
    system.stiffness(state)
    assert system.pattern is not pattern
    assert system.pattern.n_stored > pattern.n_stored
    direction = np.random.default_rng(4).standard_normal(state.u.shape)
    check_assembled(system, state, direction, 1e-6)
    # a state nearby finds room where there is some already
    pattern = system.pattern
    system.stiffness(system.consistent(lift + 1.5 * noise, system.loading.at(0.7)))
    assert system.pattern is pattern


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_touches_at_rest_or_through_a_wall(kind):
    # The walls' two sides are opposite and behind one another, at rest and when the wall has become thin.
    mesh = half_chamber((6.0, 3.0, 6.0), (6, 3, 6), kind)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("z0"), Sliding("y0")], contact=[SelfContact()])
    for thinner in (1.0, 0.5, 0.2):
        # the cavity's walls move outward until only this part of their thickness is left
        u = np.zeros_like(mesh.points)
        inside = np.unique(mesh.surface("cavity"))
        centre = np.array([3.0, 0.0, 3.0])
        scale = np.array([(3.0 - thinner) / 2.0] * 3)
        u[inside] = (mesh.points[inside] - centre) * (scale - 1.0)
        state = system.consistent(u, np.zeros(0))
        assert system.touches(state)[0].area == 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_walls_are_measured(kind):
    for mesh, wall, tolerance in (
        (half_chamber((6.0, 3.0, 6.0), (6, 3, 6), kind), 1.0, 0.35),
        (shell_octant(5.0, 5.8, 2, kind), 0.8, 0.05),
    ):
        skin = Skin(mesh, boundary_faces(mesh.cells), {"body": neo_hookean()}, 0.0)
        assert np.median(skin.wall) == pytest.approx(wall, rel=tolerance)


@pytest.mark.parametrize("kind", KINDS)
def test_closest_points_are_closest(kind):
    # Points in front of a curved face, against a search over a fine grid of the face.
    mesh = shell_octant(1.0, 1.5, 1, kind)
    face = mesh.surface("outer")[:1]
    skin = Skin(mesh, face, {"body": neo_hookean()}, 0.0)
    local = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 401)] * 2), axis=-1).reshape(-1, 2)
    if kind == "tet10":
        local = local[local.sum(axis=1) <= 1.0]
    surface = skin.shape_at(local) @ mesh.points[face[0]]
    # the face itself, mirrored and drawn out, is the slave
    points = np.vstack([mesh.points, 1.07 * mesh.points])
    faces = np.vstack([face, face[:, skin.cell.mirrored] + mesh.n_points]).astype(np.int32)
    start, candidates = np.array([0, 0, 1]), np.array([0], np.int32)
    shape_of = (2, len(skin.rule))
    partner, at, gap = np.empty(shape_of, np.int32), np.empty((*shape_of, 2)), np.empty(shape_of)
    where = (start, candidates, np.ones(2), 0.0, 1.0)
    find_partners(points, faces, balls(points, faces), skin.rule, *where, partner, at, gap)
    assert (partner[1] == 0).all()
    slaves = skin.shape @ points[faces[1]]
    nearest = np.array([np.linalg.norm(slave - surface, axis=1).min() for slave in slaves])
    np.testing.assert_allclose(gap[1], nearest, rtol=1e-4)
    assert (gap[1] <= nearest + 1e-12).all()


@pytest.mark.parametrize("name", ["line3", "tri6", "quad9"])
def test_kernels_know_the_faces_of_meshes_and_balls_hold_them(name):
    cell, rng = CELLS[name], np.random.default_rng(3)
    n, d = cell.n_nodes, cell.dimension
    N, D, second = np.empty(n), np.empty((n, 2)), np.empty((n, 3))
    local = rng.uniform(-0.1, 1.1, (20, d))
    for place, values, slopes in zip(local, cell.shape(local), cell.gradient(local), strict=True):
        a, b = np.pad(place, (0, 2 - d))
        shape_functions(a, b, N, D)
        np.testing.assert_allclose(N, values, atol=1e-14)
        np.testing.assert_allclose(D, np.pad(slopes, ((0, 0), (0, 2 - d))), atol=1e-13)
        second_derivatives(a, b, second)
        for i, j, column in [(0, 0, 0), (1, 1, 1), (0, 1, 2)][: 1 if d == 1 else 3]:
            more, less = (cell.gradient(place + h * np.eye(d)[j])[0, :, i] for h in (1e-3, -1e-3))
            np.testing.assert_allclose(second[:, column], (more - less) / 2e-3, atol=1e-10)
    # a face bent at random, and all of it in its ball, which is no larger than it need be for a flat one
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 41)] * d), axis=-1).reshape(-1, d)
    grid = grid[grid.sum(axis=1) <= 1.0] if cell.simplex else grid
    flat = np.pad(cell.nodes, ((0, 0), (0, 3 - d)))
    for bend in (0.0, 0.5):
        x = flat + bend * rng.uniform(-1.0, 1.0, (n, 3)) * [1, 1, d == 2]
        centre, normal, radius, rise = balls(x, np.arange(n, dtype=np.int32)[None])
        away = cell.shape(grid) @ x - centre
        assert np.linalg.norm(away, axis=1).max() <= radius[0] * (1 + 1e-12)
        assert np.abs(away @ normal[0]).max() <= rise[0] + 1e-12
    centre, _, radius, rise = balls(flat, np.arange(n, dtype=np.int32)[None])
    assert rise[0] < 1e-12
    assert radius[0] == pytest.approx(np.linalg.norm(flat - centre, axis=1).max())


@pytest.mark.parametrize("kind", KINDS)
def test_a_surface_may_meet_itself(kind):
    pair = stacked(0.3, kind)
    mesh = Mesh(
        pair.mesh.points, pair.mesh.cells, surfaces={**pair.mesh.surfaces, "skin": boundary_faces(pair.mesh.cells)}
    )
    held = [Clamped("low-z0"), Clamped("high-z1")]
    found = []
    for case in (PairContact("skin", "skin"), SelfContact()):
        system = System(mesh, {"body": neo_hookean(ratio=20)}, held, contact=[case])
        (contact,) = system.contacts
        rest = system.reference_state()
        assert contact.intersects(rest) is not True
        down = np.where(mesh.points[:, 2:] > 1.2, -0.32, 0.0) * [0.0, 0.0, 1.0]
        found.append(contact.energy(system.consistent(down, rest.loads)))
    assert found[0] == found[1] > 0.0


LOW_HIGH = PairContact("low-z1", "high-z0")


@pytest.mark.parametrize(
    ("contact", "counts"),
    [
        ([LOW_HIGH, SelfContact()], "self"),
        ([SelfContact(), LOW_HIGH], "self"),
        ([LOW_HIGH, PairContact("high-z0", "low-z1")], "low-z1:high-z0"),
        ([PairContact("high", "low-z1"), LOW_HIGH], "high:low-z1"),
    ],
)
def test_faces_that_meet_by_two_contacts_press_once(contact, counts, caplog):
    mesh = stacked(0.3, "tet10").mesh
    high = boundary_faces(mesh.cells[mesh.points[mesh.cells][:, :, 2].min(axis=1) > 1.2])
    mesh = Mesh(mesh.points, mesh.cells, surfaces={**mesh.surfaces, "high": high})
    down = np.where(mesh.points[:, 2:] > 1.2, -0.32, 0.0) * [0.0, 0.0, 1.0]

    def pressed(cases):
        system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("low-z0"), Clamped("high-z1")], contact=cases)
        return system, system.contact_force(system.consistent(down, system.reference_state().loads))

    once = pressed([LOW_HIGH])[1]
    assert not caplog.records
    system, twice = pressed(contact)
    assert [term.name for term in system.contacts] == [counts]
    assert twice == pytest.approx(once) != 0.0
    assert f"counts once, with '{counts}'" in caplog.text


def test_contacts_that_contradict_each_other_are_refused():
    mesh = stacked(0.3, "tet10").mesh
    part = {"part": mesh.surfaces["high-z0"][1:]}
    more = Mesh(mesh.points, mesh.cells, surfaces=mesh.surfaces | part)
    for other, problem in (
        (SelfContact(friction=0.1), r"^contact\.pairs: .*also 'self' says .*says otherwise \(found 'low-z1:high-z0'\)"),
        (PairContact("part", "low-z1"), "some faces .* 'part:low-z1' already, others not"),
    ):
        with pytest.raises(InputError, match=problem):
            System(more, {"body": neo_hookean()}, [Clamped("low-z0"), Clamped("high-z1")], contact=[other, LOW_HIGH])


def test_refusals():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=r"share faces.*'x0:skin'"):
        System(with_skin(mesh), {"body": neo_hookean()}, [Clamped("x1")], contact=[PairContact("x0", "skin")])
    for case in (PairContact("x0", "nowhere"), RigidContact(Sphere((0, 0, 0), 1.0), "nowhere")):
        with pytest.raises(InputError, match="nowhere"):
            System(mesh, {"body": neo_hookean()}, [Clamped("x0")], contact=[case])
    with pytest.raises(InputError, match="positive"):
        Sphere((0.0, 0.0, 0.0), 0.0)
    with pytest.raises(InputError, match="no length"):
        Plane((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
