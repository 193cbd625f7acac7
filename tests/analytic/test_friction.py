"""Friction against closed forms: a block that a moving plane drags, and one pressed on an oblique plane."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.spec import PairContact, RigidContact
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.rigid import Plane
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import output_fractions, solve_path

MU = 0.3


def block_without_bulge(contact, supports, mesh):
    """A block of Poisson's ratio zero (K = 2/3 μ, E = 2 μ): what presses it does not make it slide."""
    material = {"body": neo_hookean(1.0, 2.0 / 3.0)}
    return System(mesh, material, supports, section=PlaneStrain(), contact=contact)


def test_a_plane_drags_a_block_until_it_slides():
    # Pressed in by 0.02 mm from the start, then moved along: T = min(k x, μ N), k near μ A/h = 4 N/mm.
    mesh = rectangle((4.0, 1.0), (8, 2))
    contact = [RigidContact(Plane((0.0, 0.02), (0.0, 1.0)), "y0", motion=(0.04, 0.0), friction=MU)]
    system = block_without_bulge(contact, [Clamped("y1")], mesh)
    equilibria = solve_path(system, output_fractions(16))
    forces = np.array([system.touches(e.state)[0].force for e in equilibria])
    drag, press = -forces[:, 0], -forces[:, 1]
    np.testing.assert_allclose(press, 0.16, rtol=0.1)
    np.testing.assert_allclose(np.diff(drag)[:2] / 0.0025, 4.0, rtol=0.2)
    np.testing.assert_allclose(drag[-6:], MU * press[-6:], rtol=1e-3)
    assert (drag <= MU * press * (1.0 + 1e-3)).all()
    # what the support carries is what the plane feels
    reaction = system.forces(equilibria[-1].state)[0][system.mesh.surface_nodes("y1")].sum(axis=0)
    np.testing.assert_allclose(reaction, forces[-1][:2], rtol=1e-6)


@pytest.mark.parametrize(("slope", "sticks"), [(0.4, True), (0.9, False)])
def test_a_block_pushed_askew_sticks_up_to_the_angle_of_friction(slope, sticks):
    # Pushed by (slope, −1) × 0.03 mm: T/N = μ slope/E = slope/2 as long as it sticks, and it slides beyond 2 × 0.3.
    mesh = rectangle((6.0, 1.0), (12, 2))
    contact = [RigidContact(Plane((0.0, 1e-5), (0.0, 1.0)), "y0", friction=MU)]
    system = block_without_bulge(contact, [Prescribed("y1", (0.03 * slope, -0.03))], mesh)
    found = solve_path(system, output_fractions(8))[-1]
    force = np.array(system.touches(found.state)[0].force)
    assert -force[1] == pytest.approx(6.0 * 2.0 * 0.03, rel=0.1)
    expected = 0.5 * slope if sticks else MU
    assert force[0] / -force[1] == pytest.approx(expected, rel=0.12 if sticks else 0.02)


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_block_drags_another(dimension):
    d = dimension
    make, up = (rectangle, "y") if d == 2 else (box, "z")
    low, high = make((2.0, 2.0, 1.0)[3 - d :], (4, 4, 2)[3 - d :]), make((1.0, 1.0, 0.5)[3 - d :], (3, 3, 1)[3 - d :])
    mesh = merged(low=low, high=shifted_mesh(high, *((0.3, 1.0) if d == 2 else (0.3, 0.5, 1.0))))
    shift = [0.08] + [0.0] * (d - 2) + [-0.03]
    supports = [Clamped(f"low-{up}0"), Prescribed(f"high-{up}1", tuple(shift))]
    contact = [PairContact(f"low-{up}1", f"high-{up}0", friction=MU)]
    section = PlaneStrain() if d == 2 else None
    system = System(mesh, {"body": neo_hookean(1.0, 5.0)}, supports, section=section, contact=contact)
    found = solve_path(system, output_fractions(6))[-1]
    force = system.forces(found.state)[0][mesh.surface_nodes(f"high-{up}1")].sum(axis=0)
    assert force[-1] < -0.01
    assert abs(force[0]) == pytest.approx(MU * abs(force[-1]), rel=0.03)
    assert system.touches(found.state)[0].overlap_per_wall < LARGEST_OVERLAP
