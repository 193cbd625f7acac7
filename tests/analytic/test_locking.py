"""No element locks where the material is nearly incompressible: a bent cantilever and Cook's membrane."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.loads import Force
from turgor.fem.section import PlaneStrain, PlaneStress
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path

KINDS = ["tri6", "quad9", "tet10", "hex27"]
# A constant pressure sees the linear volume change of bending too little: of second order in the depth of an element.
BEAM = {"tri6": (96, 8), "quad9": (20, 1), "tet10": (72, 6), "hex27": (20, 1)}


def slice_of(kind: str, divisions: tuple[int, int], depth: float) -> Mesh:
    """The unit square, or a slice of it in space, one element deep."""
    if kind in ("tri6", "quad9"):
        return rectangle((1.0, 1.0), divisions, kind)
    return box((1.0, 1.0, depth), (*divisions, 1), kind)


def tip_motion(mesh: Mesh, material, force: float, section) -> float:
    """Rise of the highest node at the right end under a force along y in all, the left end clamped."""
    sides = [Sliding(name) for name in ("z0", "z1") if name in mesh.surfaces]
    load = Force("x1", (0.0, force, 0.0))
    system = System(mesh, {"body": material}, [Clamped("x0"), *sides], [load], section=section)
    found = solve_path(system, [1.0])[0]
    assert found.stable in (True, None)
    tip = max(mesh.surface_nodes("x1"), key=lambda node: mesh.points[node, 1])
    return float(found.state.u[tip, 1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ratio", [1.0, 1e5])
def test_a_slender_cantilever_bends_as_a_beam(kind, ratio):
    # Euler and Bernoulli in plane strain: u = F L³/(3 E' I), E' = E/(1 − ν²); shear adds (h/L)² and less.
    length, depth, mu, force = 40.0, 0.5, 0.1, 1e-8
    material = neo_hookean(mu, ratio)
    square = slice_of(kind, BEAM[kind], depth)
    scale = np.array([length, 1.0, 1.0])[: square.dimension]
    mesh = Mesh(square.points * scale, square.cells, surfaces=square.surfaces)
    section = PlaneStrain(depth) if mesh.dimension == 2 else None
    stiffness = material.young_modulus / (1 - material.poisson_ratio**2)
    expected = force * length**3 / (3 * stiffness * depth / 12)
    assert tip_motion(mesh, material, force, section) == pytest.approx(expected, rel=0.012)


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
def test_a_sheet_bends_by_youngs_modulus(kind):
    length, mu, force = 40.0, 0.1, 1e-8
    material = neo_hookean(mu, 1e5)
    mesh = rectangle((length, 1.0), (40, 2), kind)
    expected = force * length**3 / (3 * material.young_modulus * 0.5 / 12)
    assert tip_motion(mesh, material, force, PlaneStress(0.5)) == pytest.approx(expected, rel=0.005)


@functools.cache
def cook(kind: str, n: int, ratio: float) -> float:
    """Cook's membrane (1974) in plane strain, 100 N on the right side, μ = 80.194 MPa: rise of its upper corner, mm."""
    square = slice_of(kind, (n, n), 8.0)
    x, y = square.points.T[:2]
    points = square.points.copy()
    points[:, 0] = 48 * x
    points[:, 1] = 44 * x + (44 - 28 * x) * y
    mesh = Mesh(points, square.cells, surfaces=square.surfaces)
    plane = mesh.dimension == 2
    return tip_motion(
        mesh, neo_hookean(80.194, ratio), 100.0 * (1 if plane else 8), PlaneStrain(1.0) if plane else None
    )


def test_cooks_membrane_is_enclosed_from_both_sides():
    # The quadrilateral comes from the stiff side, the triangle from the soft one.
    for coarse, fine in ((8, 16), (16, 32)):
        low, high = ([cook(kind, n, 5e3) for n in (coarse, fine)] for kind in ("quad9", "tri6"))
        assert low[0] < low[1] < high[1] < high[0]
    assert high[1] - low[1] < 3e-3 * low[1]


@pytest.mark.parametrize(("kind", "n"), [("tri6", 24), ("quad9", 12), ("tet10", 12), ("hex27", 8)])
def test_cooks_membrane_is_the_same_with_every_element(kind, n):
    middle = 0.5 * (cook("quad9", 32, 5e3) + cook("tri6", 32, 5e3))
    assert cook(kind, n, 5e3) == pytest.approx(middle, rel=5e-3)
    if kind == "hex27":
        assert cook(kind, n, 5e3) == pytest.approx(cook("quad9", n, 5e3), rel=1e-6)


def test_cooks_membrane_does_not_stiffen_towards_incompressibility():
    for kind in ("tri6", "quad9"):
        assert cook(kind, 16, 1e6) == pytest.approx(cook(kind, 16, 5e3), rel=1e-3)
