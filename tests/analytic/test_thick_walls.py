"""Thick-walled sphere and tube under inner pressure: closed forms, and the order at which the error falls.

With one constant pressure per element, the ten-node tetrahedron is of first order in the strain and of second order in
the displacement (Boffi, Brezzi and Fortin 2013, sec. 8.6): these are the optimal orders of the pair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.elements import TET10
from turgor.fem.loads import Pressure
from turgor.fem.supports import Sliding, Support
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import shell_octant, tube_sector
from turgor.solver.path import solve_path

MU, INNER, OUTER = 0.1, 1.0, 1.5


def sphere_pressure(stretch: float) -> float:
    """Incompressible neo-Hookean sphere: p = μ [2/λ + 1/(2 λ⁴)] between inner and outer stretch (Green and Zerna)."""
    outer = (1 + (stretch**3 - 1) * (INNER / OUTER) ** 3) ** (1 / 3)
    return MU * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))


def tube_pressure(stretch: float) -> float:
    """Incompressible neo-Hookean tube in plane strain: p = μ [ln(λa/λb) + (1/λb² − 1/λa²)/2] (Green and Zerna)."""
    outer = np.sqrt(1 + (stretch**2 - 1) * (INNER / OUTER) ** 2)
    return MU * (np.log(stretch / outer) + 0.5 * (1 / outer**2 - 1 / stretch**2))


@dataclass(frozen=True)
class Body:
    mesh: Callable[[int], Mesh]
    supports: list[Support]
    pressure: Callable[[float], float]
    power: int  # radius is conserved to this power

    def radial(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points[:, : self.power], axis=1)

    def exact(self, points: np.ndarray, stretch: float) -> np.ndarray:
        radius = self.radial(points)
        k = self.power
        factor = (radius**k + INNER**k * (stretch**k - 1)) ** (1 / k) / radius - 1
        direction = points * np.array([1, 1, k == 3])
        return direction * factor[:, None]


PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
BODIES = {
    "sphere": Body(lambda n: shell_octant(INNER, OUTER, n), PLANES, sphere_pressure, 3),
    "tube": Body(lambda n: tube_sector(INNER, OUTER, 0.5, n), [*PLANES, Sliding("z1")], tube_pressure, 2),
}


def inflate(body: Body, n: int, stretch: float, ratio: float) -> tuple[System, np.ndarray]:
    mesh = body.mesh(n)
    pressure = body.pressure(stretch)
    system = System(mesh, {"body": neo_hookean(MU, ratio)}, body.supports, [Pressure("inner", pressure)])
    return system, solve_path(system, [1.0])[0].state.u


@pytest.mark.parametrize("name", BODIES)
def test_pressure_against_inner_stretch(name):
    body = BODIES[name]
    system, u = inflate(body, 3, 1.5, ratio=1e4)
    inner = system.mesh.surface_nodes("inner")
    points = system.mesh.points[inner]
    stretch = body.radial(points + u[inner]).mean() / INNER
    assert abs(stretch - 1.5) < 5e-3
    assert body.pressure(stretch) == pytest.approx(body.pressure(1.5), rel=3e-3)
    # and the stretch itself, where the pressure is not near its maximum
    if name == "tube":
        assert stretch == pytest.approx(1.5, rel=3e-4)


@pytest.mark.parametrize("name", BODIES)
def test_rates(name):
    body, stretch = BODIES[name], 1.3
    errors = []
    sizes = (2, 4)
    for n in sizes:
        system, u = inflate(body, n, stretch, ratio=1e7)
        solid = system.solids[0]
        error = (u - body.exact(system.mesh.points, stretch))[solid.nodes]
        values = np.einsum("qa,eai->eqi", TET10.shape_at_quadrature, error)
        slopes = np.einsum("eai,eqja->eqij", error, solid.G)
        errors.append(
            [np.sqrt(np.sum(np.sum(v**2, axis=tuple(range(2, v.ndim))) * solid.dV)) for v in (values, slopes)]
        )
    rates = np.log(np.array(errors[0]) / errors[1]) / np.log(sizes[1] / sizes[0])
    assert 1.85 < rates[0] < 2.4, rates
    assert 0.93 < rates[1] < 1.5, rates


def test_limit_of_the_sphere_lies_where_it_should():
    stretches = np.linspace(1.3, 2.0, 2001)
    pressures = np.array([sphere_pressure(s) for s in stretches])
    assert pressures.max() / MU == pytest.approx(0.4935, abs=5e-5)
    assert stretches[pressures.argmax()] == pytest.approx(1.603, abs=1e-3)
