"""The capped tube, the yardstick of the project: μ = 0.1047 MPa, K = 1000 μ, to 0.03 MPa."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.geometry.tube import CappedTube
from turgor.mesh.generate import generate
from turgor.solver.path import output_fractions, solve_path


@pytest.fixture(scope="module")
def system():
    mesh = generate(CappedTube(), size=4.0)
    return System(mesh, {"body": neo_hookean(0.1047, 1000.0)}, [Clamped("mount")], [Pressure("cavity", 0.03)])


@pytest.fixture(scope="module")
def in_one_step(system):
    return solve_path(system, [1.0])[0]


def test_one_step_and_twenty_reach_the_same_displacement(system, in_one_step):
    assert in_one_step.iterations <= 6
    steps = solve_path(system, output_fractions(20))
    assert len(steps) == 20
    u = in_one_step.state.u
    assert np.abs(steps[-1].state.u - u).max() <= 1e-6 * np.abs(u).max()


def test_motion(system, in_one_step):
    # Independent prototypes on meshes of 3 and 2 mm: tip 4.52 and 4.555 mm, V/V0 = 2.1.
    u = in_one_step.state.u
    tip = u[system.mesh.surface_nodes("tip-face")].mean(axis=0)
    cavity = system.cavities[0]
    assert tip[2] == pytest.approx(4.53, rel=0.02)
    assert cavity.volume(u) / cavity.volume(np.zeros_like(u)) == pytest.approx(2.12, rel=0.01)
    assert in_one_step.stable in (True, None)


def test_reaction_balances_the_pressure_on_the_caps(system, in_one_step):
    # The pressures on all inner walls cancel, so the mount carries nothing.
    force, _ = system.forces(in_one_step.state)
    reaction = force[system.mesh.surface_nodes("mount")].sum(axis=0)
    thrust = 0.03 * np.pi * 6.35**2
    assert np.abs(reaction).max() < 1e-5 * thrust
