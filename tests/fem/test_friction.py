"""Friction's forces and stiffnesses on random states in which some points stick and others slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_bodies import merged, shifted_mesh
from contact_checks import check_contact, check_obstacle
from samples import neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.contact.friction import FORCE, SLIP
from turgor.fem.contact.spec import PairContact, RigidContact, SelfContact
from turgor.fem.rigid import Plane, Sphere
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle

SLIPPERY = 0.02
BODIES = [(2, "quad9"), (3, "tet10"), (3, "hex27")]


def on_a_body(dimension: int, kind: str = "tet10") -> System:
    flat, body = (
        (rectangle((2.0, 1.0), (3, 2)), Sphere((1.2, -2.8), 3.0))
        if dimension == 2
        else (
            box((2.0, 2.0, 1.0), (2, 2, 1), kind),
            Sphere((1.2, 1.0, -2.8), 3.0),
        )
    )
    top = "y1" if dimension == 2 else "z1"
    motion = (0.03, 0.01) if dimension == 2 else (0.03, -0.02, 0.01)
    section = PlaneStrain(2.0) if dimension == 2 else None
    contact = [RigidContact(body, motion=motion, friction=SLIPPERY)]
    return System(flat, {"body": neo_hookean(ratio=20)}, [Clamped(top)], section=section, contact=contact)


def on_itself(dimension: int, kind: str = "tet10") -> System:
    if dimension == 2:
        low, high = rectangle((2.0, 1.0), (3, 2)), shifted_mesh(rectangle((1.2, 1.0), (2, 1)), 0.4, 0.97)
        held, section = [Clamped("low-y0"), Clamped("high-y1")], PlaneStrain(2.0)
    else:
        low, high = box((2.0, 2.0, 1.0), (2, 2, 1), kind), box((1.2, 1.3, 1.0), (3, 2, 1), kind)
        high = shifted_mesh(high, 0.4, 0.35, 0.95)
        held, section = [Clamped("low-z0"), Clamped("high-z1")], None
    mesh, contact = merged(low=low, high=high), [SelfContact(friction=SLIPPERY)]
    return System(mesh, {"body": neo_hookean(ratio=20)}, held, section=section, contact=contact)


def rubbed(system: System):
    """A random state that touches and then slips sideways, some of it farther than it sticks."""
    state = system.gripped(random_state(system, 0.008), dragged=False)
    moved = replace(state, u=random_state(system, 0.008).u + 0.06 * np.random.default_rng(3).random(state.u.shape))
    rubbing = system.contacts[0]._rubbing(moved)
    size = np.linalg.norm(rubbing.drag, axis=1)
    slides = size > rubbing.limit * (1.0 - 1e-9)
    assert slides.any()
    assert not slides.all()
    assert (size <= rubbing.limit * (1.0 + 1e-9)).all()
    return moved


@pytest.mark.parametrize(("dimension", "kind"), BODIES)
def test_forces_and_stiffness_on_a_body(dimension, kind):
    system = on_a_body(dimension, kind)
    motion = np.pad(system.contacts[0].motion, (0, 3 - dimension))
    check_obstacle(system.contacts[0], rubbed(system), motion)


@pytest.mark.parametrize(("dimension", "kind"), BODIES)
def test_forces_and_stiffness_of_self_contact(dimension, kind):
    system = on_itself(dimension, kind)
    check_contact(system.contacts[0], rubbed(system))


@pytest.mark.parametrize("system", [on_a_body(2), on_a_body(3), on_itself(2), on_itself(3)])
def test_dragging_along_changes_no_drag(system):
    state, term = rubbed(system), system.contacts[0]
    before, gripped = term._rubbing(state), system.gripped(state, dragged=False)
    settled = system.gripped(state, dragged=True)
    # once with the normal forces of the same state, with and without what slides dragged along
    np.testing.assert_allclose(term._rubbing(settled).limit, term._rubbing(gripped).limit)
    same = replace(state, grips=(np.where(np.arange(12) == FORCE, gripped.grips[0], settled.grips[0]),))
    slid = np.linalg.norm(term._rubbing(same).slip, axis=1)
    assert (slid <= np.linalg.norm(term._rubbing(gripped).slip, axis=1) + 1e-15).all()
    # the slip that is left is the elastic one, at the limit where it slid
    kept = np.isin(gripped.grips[0][:, :2] @ (64, 1), state.grips[0][:, :2] @ (64, 1))
    assert np.linalg.norm(settled.grips[0][kept][:, SLIP], axis=1).max() <= (before.limit / before.stiffness).max()
    assert (settled.grips[0][~kept][:, SLIP] == 0.0).all()


def test_refusals():
    for case in (SelfContact, lambda friction: PairContact("a", "b", friction)):
        with pytest.raises(InputError, match="not negative"):
            case(friction=-0.1)
    with pytest.raises(InputError, match="not negative"):
        RigidContact(Plane((0.0, 0.0), (0.0, 1.0)), friction=float("nan"))
