"""The barrier: energy, force and stiffness agree, it leaves alone what is at rest, and says what it does not know."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from contact_bodies import half_chamber, merged, shifted_mesh
from contact_checks import force_of
from samples import check_assembled, neo_hookean, shifted

from turgor.common.errors import InputError, MissingPackageError
from turgor.fem.contact.hull import hull
from turgor.fem.contact.spec import PairContact, RigidContact, SelfContact, Spring
from turgor.fem.frames import block_products
from turgor.fem.rigid import Box, Cylinder, Plane, Sphere
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.geometry.imported.triangles import TriangleBody
from turgor.mesh.structured import box, rectangle

pytest.importorskip("ipctk")

SELF, PAIR = SelfContact(method="barrier"), PairContact("low-top", "high-bottom", method="barrier")


def stacked(case, section=None, gap=0.2, kind="tet10") -> System:
    """A small block over a larger one, meshes that do not match."""
    if section is None:
        low, high = box((2.0, 2.0, 1.0), (2, 2, 1), kind), box((1.2, 1.3, 1.0), (3, 2, 1), kind)
        away, top, bottom = (0.4, 0.35, 1.0 + gap), "z1", "z0"
    else:
        low, high, away = rectangle((2.0, 1.0), (3, 2)), rectangle((1.2, 1.0), (2, 1)), (0.4, 1.0 + gap)
        top, bottom = "y1", "y0"
    mesh = merged(low=low, high=shifted_mesh(high, *away))
    names = {"low-top": mesh.surface(f"low-{top}"), "high-bottom": mesh.surface(f"high-{bottom}")}
    mesh = type(mesh)(mesh.points, mesh.cells, surfaces={**mesh.surfaces, **names})
    supports = [Clamped(f"low-{bottom}"), Clamped(f"high-{top}")]
    return System(mesh, {"body": neo_hookean(ratio=20)}, supports, section=section, contact=[case])


def near(system: System, left: float, noise: float = 4e-4):
    """The upper block lowered until this gap is left, and everything shaken a little."""
    up = system.mesh.points[:, -1]
    u = np.zeros_like(system.mesh.points)
    u[up > 1.1, -1] = left - 0.2
    return system.consistent(u + noise * np.random.default_rng(1).standard_normal(u.shape), system.loading.at(1.0))


def check(term, state):
    """Compare force and stiffness with differences."""
    direction = np.random.default_rng(7).standard_normal(state.u.shape)
    assert term.touch(state).gap < term.reach
    step = 1e-7  # small against the gaps
    more, less = (term.energy(shifted(state, direction, h)) for h in (step, -step))
    assert np.vdot(force_of(term, state), direction) == pytest.approx((more - less) / (2 * step), rel=1e-6)
    nodes, packed = term.blocks(state, np.empty(0))
    product = np.zeros_like(state.u)
    block_products(nodes, packed, direction, product)
    more, less = (force_of(term, shifted(state, direction, h)) for h in (step, -step))
    expected = (more - less) / (2 * step)
    np.testing.assert_allclose(product, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("case", [SELF, PAIR], ids=["self", "pair"])
@pytest.mark.parametrize(
    ("section", "kind"), [(None, "tet10"), (None, "hex27"), (PlaneStrain(2.0), "quad9"), (Axisymmetric(), "quad9")]
)
def test_force_and_stiffness_are_derivatives_of_the_energy(section, kind, case):
    system = stacked(case, section, kind=kind)
    term, state = system.contacts[0], near(system, 0.006)
    assert term.touch(system.reference_state()).gap is None
    check(term, state)
    force = force_of(term, state)
    low = system.mesh.points[:, -1] < 1.1
    np.testing.assert_allclose(force[low].sum(axis=0)[-1], -force[~low].sum(axis=0)[-1], rtol=1e-9)
    assert force[low].sum(axis=0)[-1] > 0.0  # the energy falls where the lower block gives way downward


BODIES = {
    "plane": Plane((0.0, 0.0, -0.205), (0.0, 0.0, 1.0)),
    "sphere": Sphere((1.2, 1.0, -3.205), 3.0),
    "cylinder": Cylinder((-1.0, 0.7, -2.205), (3.0, 1.0, -2.205), 2.0),
    "box": Box((0.3, 0.4, -1.0), (1.5, 1.7, -0.205)),
}


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
@pytest.mark.parametrize("name", BODIES)
def test_rigid_body_feels_what_the_skin_does(name, kind):
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1), kind)
    contact = [RigidContact(BODIES[name], method="barrier")]
    system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("z1")], contact=contact)
    term = system.contacts[0]
    u = np.full_like(mesh.points, [0.0, 0.0, -0.2])
    state = system.consistent(u + 2e-4 * np.random.default_rng(3).standard_normal(u.shape), np.zeros(0))
    check(term, state)
    force = term.touch(state).force
    np.testing.assert_allclose(force, force_of(term, state).sum(axis=0), rtol=1e-8, atol=1e-12)
    assert force[2] < 0.0


@pytest.mark.parametrize("led", [{"spring": Spring(0.7, (0.3, 0.1, 1.0))}, {"motion": (0.02, 0.01, 0.2)}], ids=str)
def test_a_body_that_gives_way_or_moves_is_a_part_of_the_potential(led):
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1))
    contact = [RigidContact(BODIES["sphere"], method="barrier", **led)]
    system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("z1")], contact=contact)
    u = np.zeros_like(system.constraints.value)
    u[:-1, 2] = -0.18
    u[:-1] += 2e-4 * np.random.default_rng(3).standard_normal(mesh.points.shape)
    u[-1] = 0.02 * np.array([0.3, 0.1, 1.0])
    state = system.consistent(u, system.loading.at(1.0))
    assert system.touches(state)[0].displacement == pytest.approx(u[-1])
    direction = np.random.default_rng(4).standard_normal(u.shape)
    more, less = (system.energy(shifted(state, direction, h)) for h in (1e-7, -1e-7))
    assert np.vdot(system.forces(state)[0], direction) == pytest.approx((more - less) / 2e-7, rel=1e-5)
    system.stiffness(state)
    check_assembled(system, state, direction, 1e-7)


@pytest.mark.parametrize("name", BODIES)
def test_hulls_follow_their_bodies(name):
    points = np.random.default_rng(0).uniform(-1.0, 2.0, (50, 3))
    found = hull(BODIES[name], points, 0.01, "contact")
    middles = found.vertices[found.pieces].mean(axis=1)
    for places in (found.vertices, middles):
        assert np.abs(BODIES[name].distance(places)[0]).max() < 0.0101


def test_room_in_the_matrix_is_found_where_surfaces_come_near():
    system = stacked(SELF, gap=1.2)  # nothing is coupled between the blocks at rest
    pattern = system.pattern
    u = np.zeros_like(system.mesh.points)
    u[system.mesh.points[:, 2] > 1.1, 2] = 0.006 - 1.2
    noise = 4e-4 * np.random.default_rng(1).standard_normal(u.shape)
    state = system.consistent(u + noise, np.zeros(0))
    system.stiffness(state)
    assert system.pattern.n_stored > pattern.n_stored
    direction = np.random.default_rng(4).standard_normal(u.shape)
    check_assembled(system, state, direction, 1e-7)
    pattern = system.pattern
    system.stiffness(system.consistent(u + 1.5 * noise, np.zeros(0)))
    assert system.pattern is pattern


def test_a_step_ends_before_surfaces_meet():
    system = stacked(SELF)
    rest, du = system.reference_state(), np.zeros_like(system.mesh.points)
    du[system.mesh.points[:, 2] > 1.1, 2] = -1.0  # far through a gap of 0.2
    part = system.longest_step(rest, du)
    assert 0.1 < part < 0.2
    assert not system.contacts[0].intersects(rest.moved(part * du))
    assert system.contacts[0].intersects(rest.moved(0.5 * du))


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
def test_nothing_pushes_at_rest_nor_through_a_wall(kind):
    mesh = half_chamber((6.0, 3.0, 6.0), (6, 3, 6), kind)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("z0"), Sliding("y0")], contact=[SELF])
    state = system.reference_state()
    assert system.contacts[0].energy(state) == 0.0
    assert len(system.contacts[0].blocks(state, np.empty(0))[0]) == 0
    # a gap smaller than the reach shortens it
    close = stacked(SELF, gap=0.004)
    assert close.contacts[0].reach == pytest.approx(0.9 * 0.004, rel=1e-6)
    assert close.contacts[0].energy(close.reference_state()) == 0.0


def test_refusals():
    for gap, problem in ((2e-4, "too near"), (0.0, "intersect"), (-0.05, "intersect")):
        with pytest.raises(InputError, match=problem):
            stacked(SELF, gap=gap)
    with pytest.raises(InputError, match="friction"):
        SelfContact(0.3, method="barrier")
    with pytest.raises(InputError, match="no such method"):
        SelfContact(method="lagrange")
    with pytest.raises(InputError, match="far end"):
        RigidContact(BODIES["plane"], motion=(0.0, 0.0, 1.0), method="barrier", spring=Spring(1.0, (0.0, 0.0, 1.0)))
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    body = TriangleBody(corners - [0, 0, 3], np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    with pytest.raises(InputError, match="does not know this body"):
        System(
            box((2.0, 2.0, 1.0), (1, 1, 1)),
            {"body": neo_hookean()},
            [Clamped("z1")],
            contact=[RigidContact(body, method="barrier")],
        )


def test_a_missing_package_is_named(monkeypatch):
    def missing(name, *args):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MissingPackageError, match=r"barrier method needs the package 'ipctk'"):
        stacked(SELF)
