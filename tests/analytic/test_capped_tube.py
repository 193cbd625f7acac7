"""The capped tube, the yardstick of the project: μ = 0.1047 MPa, K = 1000 μ, to 0.03 MPa."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.section import Axisymmetric
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.geometry.tube import CappedTube
from turgor.mesh.faces import boundary_faces
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import rectangle
from turgor.solver.path import output_fractions, solve_path


@pytest.fixture(scope="module")
def system():
    mesh = generate(CappedTube(), size=4.0)
    return System(mesh, {"body": neo_hookean(0.1047, 1000.0)}, [Clamped("mount")], [Pressure("cavity", 0.03)])


@pytest.fixture(scope="module")
def in_one_step(system):
    return solve_path(system, [1.0])[0]


def test_one_step_and_twenty_reach_the_same_displacement(system, in_one_step):
    assert in_one_step.factorisations <= 6
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


def half_section(n: int, kind: str) -> Mesh:
    """The tube's section: a grid with lines along the walls and caps, without the cells of the cavity."""
    r = np.concatenate([np.linspace(0.0, 6.35, 3 * n + 1), np.linspace(6.35, 9.85, 2 * n + 1)[1:]])
    caps = np.linspace(0.0, 17.0, 6 * n + 1)
    y = np.concatenate([caps, np.linspace(17.0, 103.0, 30 * n + 1)[1:], 103.0 + caps[1:]])
    grid = rectangle((len(r) - 1, len(y) - 1), (len(r) - 1, len(y) - 1), kind)
    points = np.column_stack(
        [np.interp(x, np.arange(len(line)), line) for x, line in zip(grid.points.T, (r, y), strict=True)]
    )
    centre = points[grid.cells].mean(axis=1)
    cells = grid.cells[(centre[:, 0] > 6.35) | (np.abs(centre[:, 1] - 60.0) > 43.0)]
    used, cells = np.unique(cells, return_inverse=True)
    points, faces = points[used], boundary_faces(cells)
    x, height = points[faces].mean(axis=1).T
    inside = (x > 1e-9) & (x < 6.36) & (np.abs(height - 60.0) < 43.01)
    surfaces = {"mount": faces[height < 1e-9], "tip-face": faces[height > 119.999], "cavity": faces[inside]}
    return Mesh(points, cells, surfaces=surfaces)


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
def test_half_of_its_section_moves_as_the_tube(system, in_one_step, kind):
    mesh = half_section(2, kind)
    loads = [Pressure("cavity", 0.03)]
    section = System(mesh, {"body": neo_hookean(0.1047, 1000.0)}, [Clamped("mount")], loads, section=Axisymmetric())
    found = solve_path(section, [1.0])[0]
    assert found.factorisations <= 6
    cavity, rest = section.cavities[0], np.zeros_like(mesh.points)
    assert cavity.volume(rest) == pytest.approx(np.pi * 6.35**2 * 86.0, rel=1e-12)
    # Meshes four times as fine: V/V0 = 2.1213 and 2.1215, tip 4.564 and 4.565 mm on the axis.
    assert cavity.volume(found.state.u) / cavity.volume(rest) == pytest.approx(2.1214, rel=4e-4)
    tip = np.flatnonzero((mesh.points[:, 0] == 0.0) & (mesh.points[:, 1] == 120.0))
    assert found.state.u[tip, 1] == pytest.approx(4.565, rel=2e-3)
    whole = system.cavities[0]
    growth = whole.volume(in_one_step.state.u) / whole.volume(np.zeros_like(system.mesh.points))
    assert growth == pytest.approx(2.1214, rel=5e-3)
