"""Thick-walled sphere and tube under inner pressure: closed forms, and the order at which the error falls.

With one constant pressure per element, ten-node tetrahedra and six-node triangles are of first order in the strain and
of second order in the displacement; with a linear pressure, 27-node hexahedra and nine-node quadrilaterals are of
second and third order (Boffi, Brezzi and Fortin 2013, sec. 8.6): these are the optimal orders of the pairs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Pressure
from turgor.fem.section import Axisymmetric, PlaneStrain, Section
from turgor.fem.supports import Sliding, Support
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import quarter_ring, rectangle, shell_octant, tube_sector
from turgor.solver.newton import NewtonOptions
from turgor.solver.path import LimitPressureError, PathOptions, solve_path

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
    mesh: Callable[[int, str], Mesh]
    supports: list[Support]
    pressure: Callable[[float], float]
    power: int  # radius is conserved to this power
    radius: tuple[int, ...]  # coordinates that it is made of
    section: Section | None = None

    def radial(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points[:, self.radius], axis=1)

    def exact(self, points: np.ndarray, stretch: float) -> np.ndarray:
        radius = self.radial(points)
        k = self.power
        factor = (radius**k + INNER**k * (stretch**k - 1)) ** (1 / k) / radius - 1
        direction = np.zeros_like(points)
        direction[:, self.radius] = points[:, self.radius]
        return direction * factor[:, None]


def section_of_tube(n: int, kind: str) -> Mesh:
    mesh = rectangle((OUTER - INNER, 0.5), (n, n), kind, corner=(INNER, 0.0))
    return Mesh(mesh.points, mesh.cells, surfaces=dict(mesh.surfaces) | {"inner": mesh.surface("x0")})


def skewed_ring(n: int, kind: str) -> Mesh:
    """A quarter ring whose grid lines lean: nothing in it is aligned with the solution."""
    mesh = quarter_ring(INNER, OUTER, n, kind)
    radius, angle = np.hypot(*mesh.points.T), np.arctan2(mesh.points[:, 1], mesh.points[:, 0])
    depth = (radius - INNER) / (OUTER - INNER)
    lean = 0.15 * np.sin(np.pi * depth) * np.sin(2 * angle)
    radius = radius + 0.1 * (OUTER - INNER) * np.sin(np.pi * depth) * np.sin(4 * angle)
    points = np.column_stack([radius * np.cos(angle + lean), radius * np.sin(angle + lean)])
    return Mesh(np.where(np.abs(points) < 1e-12, 0.0, points), mesh.cells, surfaces=mesh.surfaces)


X, Y, Z = Sliding("x0"), Sliding("y0"), Sliding("z0")
BODIES = {
    "sphere": Body(lambda n, kind: shell_octant(INNER, OUTER, n, kind), [X, Y, Z], sphere_pressure, 3, (0, 1, 2)),
    "tube": Body(
        lambda n, kind: tube_sector(INNER, OUTER, 0.5, n, kind), [X, Y, Z, Sliding("z1")], tube_pressure, 2, (0, 1)
    ),
    "plane tube": Body(
        lambda n, kind: quarter_ring(INNER, OUTER, n, kind), [X, Y], tube_pressure, 2, (0, 1), PlaneStrain(2.0)
    ),
    "skewed plane tube": Body(skewed_ring, [X, Y], tube_pressure, 2, (0, 1), PlaneStrain()),
    "skewed turned sphere": Body(skewed_ring, [Y], sphere_pressure, 3, (0, 1), Axisymmetric()),
    "turned tube": Body(section_of_tube, [Y, Sliding("y1")], tube_pressure, 2, (0,), Axisymmetric()),
    "turned sphere": Body(
        lambda n, kind: quarter_ring(INNER, OUTER, n, kind), [Y], sphere_pressure, 3, (0, 1), Axisymmetric()
    ),
}
CASES = [
    (name, kind)
    for name, body in BODIES.items()
    for kind in (("tet10", "hex27") if body.section is None else ("tri6", "quad9"))
]


def inflate(
    body: Body, kind: str, n: int, stretch: float, ratio: float, tolerance: float = 1e-7
) -> tuple[System, np.ndarray]:
    mesh = body.mesh(n, kind)
    loads = [Pressure("inner", body.pressure(stretch))]
    system = System(mesh, {"body": neo_hookean(MU, ratio)}, body.supports, loads, section=body.section)
    options = PathOptions(NewtonOptions(tolerance))
    return system, solve_path(system, [1.0], options=options)[0].state.u


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_pressure_against_inner_stretch(name, kind):
    body = BODIES[name]
    n = {"tet10": 3, "hex27": 2, "tri6": 4, "quad9": 3}[kind]
    system, u = inflate(body, kind, n, 1.5, ratio=1e4)
    inner = system.mesh.surface_nodes("inner")
    points = system.mesh.points[inner]
    stretch = body.radial(points + u[inner]).mean() / INNER
    assert abs(stretch - 1.5) < 5e-3
    assert body.pressure(stretch) == pytest.approx(body.pressure(1.5), rel=3e-3)
    # and the stretch itself, where the pressure is not near its maximum
    if body.power == 2:
        assert stretch == pytest.approx(1.5, rel=5e-4)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_rates(name, kind):
    body, stretch = BODIES[name], 1.3
    errors = []
    sizes = {"tet10": (2, 4), "hex27": (1, 2), "tri6": (8, 16), "quad9": (2, 4)}[kind]
    for n in sizes:
        # Near 1e7 rounding comes within reach of the usual tolerance; the discretisation's error is far above both.
        system, u = inflate(body, kind, n, stretch, ratio=1e7, tolerance=1e-6)
        solid = system.solids[0]
        error = (u - body.exact(system.mesh.points, stretch))[solid.nodes]
        values = np.einsum("qa,eai->eqi", solid.cell.shape_at_quadrature, error)
        slopes = np.einsum("eai,eqja->eqij", error, solid.G[:, :, : solid.cell.dimension])
        errors.append(
            [np.sqrt(np.sum(np.sum(v**2, axis=tuple(range(2, v.ndim))) * solid.dV)) for v in (values, slopes)]
        )
    rates = np.log(np.array(errors[0]) / errors[1]) / np.log(sizes[1] / sizes[0])
    order = 2 if solid.cell.simplex else 3
    # On grids that follow the solution, hexahedra and quadrilaterals do better than they must.
    assert order - 0.15 < rates[0] < order + 1.5, rates
    assert order - 1.07 < rates[1] < order + 0.3, rates


@pytest.mark.parametrize(("name", "kind"), [case for case in CASES if case[1] != "tet10"])
def test_incompressibility_costs_no_iterations(name, kind):
    body, counts = BODIES[name], []
    for ratio in (1.0, 1e2, 1e5):
        loads = [Pressure("inner", 0.6 * body.pressure(1.5))]
        mesh = body.mesh(1, kind)
        system = System(mesh, {"body": neo_hookean(MU, ratio)}, body.supports, loads, section=body.section)
        counts.append(solve_path(system, [1.0])[0].factorisations)
    assert max(counts) - min(counts) <= 2
    assert max(counts) <= 7


def test_limit_of_the_sphere_lies_where_it_should():
    stretches = np.linspace(1.3, 2.0, 2001)
    pressures = np.array([sphere_pressure(s) for s in stretches])
    assert pressures.max() / MU == pytest.approx(0.4935, abs=5e-5)
    assert stretches[pressures.argmax()] == pytest.approx(1.603, abs=1e-3)


@pytest.mark.parametrize(("name", "kind"), [("sphere", "hex27"), ("turned sphere", "quad9"), ("turned sphere", "tri6")])
def test_the_solver_finds_that_limit(name, kind):
    body = BODIES[name]
    mesh = body.mesh(4 if kind == "tri6" else 2, kind)
    loads = [Pressure("inner", 0.06)]
    system = System(mesh, {"body": neo_hookean(MU, 1e5)}, body.supports, loads, section=body.section)
    with pytest.raises(LimitPressureError) as stop:
        solve_path(system, [0.5, 1.0])
    limit = stop.value.limit.equilibrium
    assert float(limit.state.loads[0]) / MU == pytest.approx(0.4935, rel=1e-3)
    inner = mesh.surface_nodes("inner")
    stretch = body.radial(mesh.points[inner] + limit.state.u[inner]).mean() / INNER
    assert stretch == pytest.approx(1.603, rel=5e-3)
