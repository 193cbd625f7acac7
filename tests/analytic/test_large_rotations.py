"""Bodies that turn far: a cylinder twisted (Rivlin 1949) and a thin strip bent by a force (the elastica)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import neo_hookean
from scipy.integrate import solve_bvp

from turgor.fem.loads import Force
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.geometry.blocks import AXIS, Block, Blocks
from turgor.geometry.path import polygon
from turgor.mesh.blocks import structured_mesh
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import rectangle
from turgor.solver.path import solve_path

MU = 0.1


def cylinder(radius: float, length: float, size: float) -> Mesh:
    first, second, third, fourth = polygon([(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)])
    block = Block("body", (first, second, third, fourth), ("z0", "outer", "z1", AXIS))
    return structured_mesh(Blocks([block], {}), "full", size, 8, 10_000)


@pytest.mark.parametrize("twist", [0.02, 0.1])
def test_a_twisted_cylinder_carries_rivlins_torque_and_is_pushed_apart(twist):
    # Rivlin (1949): with its length kept, an incompressible neo-Hookean cylinder twisted by τ per length needs the
    # torque π a⁴ μ τ/2 and pushes its ends apart with π a⁴ μ τ²/4 (the Poynting effect); radii do not change.
    radius, length = 5.0, 8.0
    mesh = cylinder(radius, length, 2.6)
    system = System(mesh, {"body": neo_hookean(MU, 1e4)}, [Clamped("z0"), Clamped("z1")])
    exact = turned(mesh.points, twist) - mesh.points
    system.constraints = replace(
        system.constraints, value=np.where(mesh.points[:, 2:] == length, exact, 0.0) * system.constraints.fixed
    )
    state = solve_path(system, [1.0])[-1].state
    force, _ = system.forces(state)
    end = mesh.surface_nodes("z1")
    x, y = (mesh.points + state.u)[end, :2].T
    torque = float(np.sum(x * force[end, 1] - y * force[end, 0]))
    assert torque == pytest.approx(np.pi * radius**4 * MU * twist / 2, rel=5e-3)
    assert float(force[end, 2].sum()) == pytest.approx(-np.pi * radius**4 * MU * twist**2 / 4, rel=5e-3)
    assert np.abs(state.u - exact).max() < 2e-3 * np.abs(exact).max()


def turned(points, twist):
    """Each plane across z turned by the twist times its height."""
    x, y, z = points.T
    c, s = np.cos(twist * z), np.sin(twist * z)
    return np.column_stack([c * x - s * y, s * x + c * y, z])


@pytest.mark.parametrize("strength", [1.0, 5.0])
def test_a_thin_strip_bends_as_the_elastica(strength):
    # A cantilever of bending stiffness B under a force P across its end, P L²/B = `strength`: θ'' = −strength cos θ,
    # θ(0) = 0, θ'(1) = 0 (Euler 1744; Bisshopp and Drucker 1945). In plane strain B = E/(1 − ν²) h³/12.
    system = strip(strength)
    (found,) = solve_path(system, [1.0])
    mesh = system.mesh
    moved = (mesh.points + found.state.u)[mesh.surface_nodes("x1")].mean(axis=0) - [0.0, THICKNESS / 2]
    assert moved / LENGTH == pytest.approx(elastica(strength), rel=5e-3)
    # From rest to 72° at the stronger force: 15 steps, 32 and cut ones if the stress does not lag.
    assert found.iterations < 18


LENGTH, THICKNESS = 100.0, 1.0


def strip(strength: float) -> System:
    depth = 2.0
    rubber = neo_hookean(MU, 1e4)
    stiffness = rubber.young_modulus / (1 - rubber.poisson_ratio**2) * depth * THICKNESS**3 / 12
    mesh = rectangle((LENGTH, THICKNESS), (40, 1), "quad9")
    load = Force("x1", (0.0, strength * stiffness / LENGTH**2, 0.0))
    return System(mesh, {"body": rubber}, [Clamped("x0")], [load], section=PlaneStrain(depth))


def elastica(strength: float) -> np.ndarray:
    """Return where the end comes to, in lengths."""

    def slopes(s, y):
        return np.vstack([y[1], -strength * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(first, last):
        return np.array([first[0], last[1], first[2], first[3]])

    s = np.linspace(0.0, 1.0, 41)
    guess = np.vstack([s * (2 - s), 2 - 2 * s, s, 0.5 * s])
    return solve_bvp(slopes, ends, s, guess, tol=1e-8).y[2:, -1]
