"""Bodies, materials and states that several tests use."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from turgor.fem.frames import block_products
from turgor.fem.loads import Pressure
from turgor.fem.pattern import packed_size
from turgor.fem.programme import Programme
from turgor.fem.section import PlaneStrain
from turgor.fem.state import State
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.geometry.tube import CappedTube
from turgor.materials.models.neo_hookean import NeoHookean
from turgor.materials.volumetric import Quadratic
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import rectangle, shell_octant


def neo_hookean(mu: float = 0.1, ratio: float = 1e4, density: float | None = None) -> NeoHookean:
    """A neo-Hookean material of shear modulus `mu` (MPa) and bulk modulus `ratio` times that."""
    return NeoHookean(C10=mu / 2, volumetric=Quadratic(ratio * mu), density=density)


def sphere(cell_type: str, n: int = 2, ratio: float = 1e3, pressure: float = 0.02) -> System:
    """An octant of a thick sphere under inner pressure, MPa."""
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    mesh = shell_octant(1.0, 1.5, n, cell_type)
    return System(mesh, {"body": neo_hookean(ratio=ratio)}, planes, [Pressure("inner", pressure)])


def tube(size: float, ratio: float = 1e3) -> System:
    """A short capped tube under inner pressure, in tetrahedra of a size in mm."""
    shape = CappedTube(inner_radius="6 mm", wall="2 mm", length="30 mm", cap="6 mm")
    loads = [Pressure("cavity", 0.015)]
    return System(generate(shape, size), {"body": neo_hookean(ratio=ratio)}, [Clamped("mount")], loads)


def arch(
    pressure: float,
    *,
    rise: float = 1.2,
    depth: float = 10.0,
    above: bool = True,
    programme: Programme | None = None,
) -> System:
    """Half of a shallow arch in plane strain, clamped at its end, under pressure (MPa) from above or from below.

    It spans 20 mm, is 0.4 mm thick and stands `depth` mm above the axis up to which the air on its side counts; with
    the air above it, so many mm below.
    """
    mesh = rectangle((10.0, 0.4), (12, 1), "quad9")
    points = mesh.points.copy()
    points[:, 1] += (-depth if above else depth) + rise * np.sin(np.pi * points[:, 0] / 20.0)
    mesh = Mesh(points, mesh.cells, regions=mesh.regions, surfaces=mesh.surfaces)
    load = Pressure("y1" if above else "y0", pressure, **({} if programme is None else {"programme": programme}))
    held = [Clamped("x0"), Sliding("x1")]
    return System(mesh, {"body": neo_hookean(1.0, 1e3)}, held, [load], section=PlaneStrain())


def random_state(system: System, size: float, seed: int = 0, fraction: float = 0.7) -> State:
    """A random displacement of a given size with the dilatations that belong to it."""
    u = size * np.random.default_rng(seed).standard_normal(system.mesh.points.shape)
    assert system.worst_jacobian(u)[0] > 0.05
    return system.consistent(u, system.loading.at(fraction))


def shifted(state: State, direction: np.ndarray, step: float) -> State:
    return replace(state, u=state.u + step * direction)


def differences(function, state, direction, step=1e-5):
    """Fourth-order central difference of `function` along `direction`."""
    f = [function(shifted(state, direction, k * step)) for k in (1, -1, 2, -2)]
    return (8 * (f[0] - f[1]) - (f[2] - f[3])) / (12 * step)


def check_derivatives(term, state):
    """Compare force and stiffness with differences of energy and force; neither may vanish."""
    direction = np.random.default_rng(7).standard_normal(state.u.shape)

    def force(at):
        out = np.zeros(state.u.shape)
        term.force(at, out)
        return out

    slope = np.vdot(force(state), direction)
    assert abs(slope) > 1e-8
    assert slope == pytest.approx(differences(term.energy, state, direction), rel=1e-7)

    packed = np.empty((len(term.nodes), packed_size(3 * term.nodes.shape[1])))
    term.stiffness(state, term.lagged_at(state), packed)
    product = np.zeros(state.u.shape)
    block_products(term.nodes, packed, direction, product)
    expected = differences(force, state, direction)
    assert np.linalg.norm(product - expected) <= 1e-8 * np.linalg.norm(force(state)) + 1e-8 * np.linalg.norm(expected)
    return np.linalg.norm(expected)


def check_assembled(system, state, direction, step):
    """Compare the stiffness assembled last, along a direction, with the difference of all forces."""
    more, less = (system.forces(shifted(state, direction, h))[0] for h in (step, -step))
    expected = (more - less) / (2.0 * step)
    np.testing.assert_allclose(system.stiffness_times(direction), expected, atol=1e-6 * np.abs(expected).max())


def printed(code: str, variable: str, **environment: str) -> str:
    """What a process of its own prints, an environment variable being as given here or not set at all."""
    kept = {name: value for name, value in os.environ.items() if name != variable}
    run = subprocess.run([sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()
