"""Contact of plane models: forces and stiffnesses on random states that touch, and what is cut out of rigid bodies."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import merged, shifted_mesh
from contact_checks import check_contact, check_obstacle
from samples import neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.contact.spec import RigidContact, SelfContact
from turgor.fem.rigid import Box, Cylinder, Plane, Sphere
from turgor.fem.section import Axisymmetric, PlaneStrain, PlaneStress
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.mesh.structured import box, quarter_ring, rectangle

SECTIONS = {"strain": PlaneStrain(2.0), "stress": PlaneStress(2.0), "revolution": Axisymmetric()}
BODIES = {
    "line": Plane((0.0, 0.25), (0.1, 1.0)),
    "circle": Sphere((1.2, -2.8), 3.0),
    "rectangle": Box((0.3, -1.0), (1.5, 0.07)),
    "bar": Cylinder((1.0, -2.0), (1.1, 0.1), 0.7),
}


@pytest.mark.parametrize("kind", ["quad9", "tri6"])
@pytest.mark.parametrize("section", SECTIONS)
def test_self_contact(section, kind):
    low, high = rectangle((2.0, 1.0), (3, 2), kind), rectangle((1.2, 1.0), (2, 1), kind)
    mesh = merged(low=low, high=shifted_mesh(high, 0.4, 0.97))
    supports = [Clamped("low-y0"), Clamped("high-y1")]
    material = {"body": neo_hookean(ratio=20)}
    system = System(mesh, material, supports, section=SECTIONS[section], contact=[SelfContact()])
    check_contact(system.contacts[0], random_state(system, 0.008))


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", BODIES)
def test_rigid_body(name, section):
    motion = (0.0, 0.01) if section == "revolution" else (0.03, 0.01)
    case = RigidContact(BODIES[name], motion=motion)
    mesh = rectangle((2.0, 1.0), (3, 2))
    system = System(mesh, {"body": neo_hookean(ratio=20)}, [Clamped("y1")], section=SECTIONS[section], contact=[case])
    check_obstacle(system.contacts[0], random_state(system, 0.008), (*motion, 0.0))


def test_walls_are_measured_in_the_plane():
    mesh = quarter_ring(5.0, 5.8, 2)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("x0")], section=PlaneStrain(), contact=[SelfContact()])
    assert np.median(system.contacts[0].skin.wall) == pytest.approx(0.8, rel=0.05)


def test_a_plane_model_meets_what_its_plane_cuts_out_of_a_body_in_space():
    x = np.random.default_rng(0).uniform(-2.0, 2.0, (60, 2))
    in_space = np.pad(x, ((0, 0), (0, 1)))
    bodies = [
        Plane((0.0, 0.3, 0.0), (0.2, 1.0, 0.0)),
        Sphere((0.1, 0.2, 0.0), 1.0),
        Cylinder((0.1, 0.2, -9.0), (0.1, 0.2, 9.0), 1.0),
        Cylinder((-1.0, -0.3, 0.0), (1.0, 0.5, 0.0), 0.6),
        Box((-1.0, -0.5, -9.0), (0.4, 0.8, 9.0)),
    ]
    for body in bodies:
        distance, normal, curvature = body.distance(in_space)
        found = body.section().distance(x)
        np.testing.assert_allclose(found[0], distance, atol=1e-14)
        np.testing.assert_allclose(found[1], normal[:, :2], atol=1e-14)
        np.testing.assert_allclose(found[2], curvature[:, :2, :2], atol=1e-14)


@pytest.mark.parametrize(
    ("body", "motion", "problem"),
    [
        (Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.5)), None, "plane z = 0"),
        (Sphere((0.0, 0.0, 1.0), 2.0), None, "plane z = 0"),
        (Cylinder((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), 2.0), None, "plane z = 0"),
        (Box((0.0, 0.0, 1.0), (1.0, 1.0, 2.0)), None, "plane z = 0"),
        (Sphere((0.0, -3.0), 2.0), (1.0, 0.0), "does not fit the model"),
    ],
)
def test_refusals(body, motion, problem):
    with pytest.raises(InputError, match=problem):
        System(
            rectangle((1.0, 1.0), (1, 1)),
            {"body": neo_hookean()},
            [Clamped("y1")],
            section=Axisymmetric(),
            contact=[RigidContact(body, motion=motion)],
        )


def turned(body):
    support, contact = [Clamped("y1")], [RigidContact(body, label="jaw")]
    return System(
        rectangle((1.0, 1.0), (1, 1)), {"body": neo_hookean()}, support, section=Axisymmetric(), contact=contact
    )


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        (
            Cylinder((0.0, -3.0, -9.0), (0.0, -3.0, 9.0), 2.0),
            r"^contact\.jaw\.end: a bar across .*expected a bar in the plane",
        ),
        (Cylinder((5.0, 0.0, -9.0), (5.0, 0.0, 9.0), 2.0), r"^contact\.jaw\.end: a bar across the plane"),
        (
            Box((3.0, -1.0, -1.0), (5.0, 1.0, 1.0)),
            r"^contact\.jaw\.lower: a box beside the y axis .*or a cylinder along y",
        ),
    ],
)
def test_what_is_no_body_of_revolution_is_refused(body, problem):
    with pytest.raises(InputError, match=problem):
        turned(body)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        (Plane((0.0, -1.0, 0.0), (0.0, 1.0, 0.0)), ""),
        (Sphere((0.0, -3.0, 0.0), 2.0), ""),
        (Cylinder((0.0, -3.0, 0.0), (0.0, -1.0, 0.0), 2.0), ""),
        (Sphere((5.0, -3.0), 2.0), ""),  # a section anyway
        (Plane((0.0, -1.0, 0.0), (0.1, 1.0, 0.0)), "plane stands for a cone"),
        (Sphere((5.0, 0.0, 0.0), 2.0), "sphere stands for a ring"),
        (Cylinder((5.0, 0.0, 0.0), (5.0, 1.0, 0.0), 2.0), "cylinder stands for a ring"),
        (Box((-9.0, -2.0, -9.0), (9.0, -1.0, 9.0)), "box stands for a disc"),
    ],
)
def test_what_is_another_body_when_it_is_turned_is_told(body, told, caplog):
    with caplog.at_level("WARNING", "turgor.fem"):
        turned(body)
    assert [record.getMessage() for record in caplog.records] == (
        [f"contact.jaw: this {told} about the axis of the model"] if told else []
    )


def test_a_body_of_the_plane_has_no_place_in_space():
    with pytest.raises(InputError, match="2 coordinates"):
        System(
            box((1.0, 1.0, 1.0), (1, 1, 1)),
            {"body": neo_hookean()},
            [Clamped("x0")],
            contact=[RigidContact(Sphere((0.0, -3.0), 2.0))],
        )
