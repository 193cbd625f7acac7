"""The traction across the interface of two materials, against states known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.anisotropic import FibreFamily, QuadraticFibres
from turgor.fem.directions import Constant
from turgor.fem.interface import interface_name, interfaces
from turgor.fem.section import PlaneStrain, Section, surface_areas
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path

LAYERS = {"soft": neo_hookean(0.1, 50.0), "hard": neo_hookean(10.0, 50.0)}


def in_two(solid: Mesh, axis: int, level: float, names: tuple[str, str] = ("soft", "hard")) -> Mesh:
    """A block of two materials, one below and one above a level."""
    above = solid.points[solid.cells].mean(axis=1)[:, axis] > level
    regions = {names[0]: np.flatnonzero(~above), names[1]: np.flatnonzero(above)}
    return Mesh(solid.points, solid.cells, regions, solid.surfaces)


def block(kind: str) -> tuple[Mesh, Section | None]:
    if kind in ("tri6", "quad9"):
        return in_two(rectangle((2.0, 4.0), (2, 4), kind), 1, 2.0), PlaneStrain(3.0)
    return in_two(box((2.0, 3.0, 4.0), (2, 2, 4), kind), 2, 2.0), None


@pytest.mark.parametrize("kind", ["tet10", "hex27", "tri6", "quad9"])
def test_layers_in_series_carry_the_stress_of_the_softer_one(kind: str) -> None:
    mesh, section = block(kind)
    system = System(mesh, LAYERS, [Clamped("x0")], section=section)
    (between,) = interfaces(system)
    assert between.name == interface_name("soft", "hard")
    assert between.area.sum() == pytest.approx(2.0 * 3.0)
    # Both layers are sheared by the same angle and stretched; the traction is that of the softer one.
    d, shear, stretch = mesh.dimension, 0.3, 1.05
    up = d - 1
    u = np.zeros_like(mesh.points)
    u[:, 0] = shear * mesh.points[:, up]
    u[:, up] = (stretch - 1.0) * mesh.points[:, up]
    state = system.consistent(u, np.zeros(0))
    soft = system.solids[0].cauchy_stress(state)[0, 0]  # xx yy zz xy yz xz
    tension, along = soft[up], soft[3 if d == 2 else 5]
    # τ = μ dev(F Fᵀ) J^(-2/3), σ = τ/J: the shear stress is μ J^(-5/3) γ λ.
    assert along == pytest.approx(0.1 * stretch ** (-5.0 / 3.0) * shear * stretch)
    traction, normal = between.traction(state)
    assert normal[..., up] == pytest.approx(1.0)
    assert traction[..., 0] == pytest.approx(along)
    facts = between.facts(state)
    assert facts["normal_max_MPa"] == pytest.approx(tension)
    assert facts["shear_max_MPa"] == pytest.approx(along)
    for key in ("traction_max_MPa", "traction_p99_MPa", "traction_mean_MPa"):
        assert facts[key] == pytest.approx(np.hypot(tension, along))


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
def test_fibres_across_an_interface_carry_their_part_of_the_traction(kind: str) -> None:
    mesh, _ = block(kind)
    k, shear, stretch = 0.05, 0.3, 1.05
    fibres = FibreFamily("soft", QuadraticFibres(k), Constant((0.0, 0.0, 1.0)))
    with_fibres, without = (System(mesh, LAYERS, [Clamped("x0")], [], fs) for fs in ([fibres], []))
    u = mesh.points[:, 2:] * [shear, 0.0, stretch - 1.0]
    found, matrix = (
        interfaces(system)[0].traction(system.consistent(u, np.zeros(0)))[0] for system in (with_fibres, without)
    )
    # σ = 2 k E (F a) ⊗ (F a) / J with F a = (γ, 0, λ), J = λ and n = (0, 0, 1).
    E = shear**2 + stretch**2 - 1.0
    expected = 2.0 * k * E * np.array([shear, 0.0, stretch])
    np.testing.assert_allclose(found - matrix, np.broadcast_to(expected, found.shape), atol=1e-12)


def test_the_side_that_fibres_stiffen_is_the_stiffer_one() -> None:
    # At small strain Young's modulus along the fibres is 3 μ + 4 k: 0.3 + 4 k beside 30 MPa.
    mesh, _ = block("tet10")
    for k, name in ((7.4, "soft-hard"), (7.5, "hard-soft")):
        fibres = FibreFamily("soft", QuadraticFibres(k), Constant((0.0, 0.0, 1.0)))
        (between,) = interfaces(System(mesh, LAYERS, [Clamped("x0")], [], [fibres]))
        assert between.name == name


def test_the_traction_between_wound_and_plain_bars_is_the_force_over_the_area() -> None:
    solid = box((4.0, 1.0, 1.0), (4, 1, 1), "hex27")
    mesh = in_two(solid, 0, 2.0, ("wound", "plain"))
    supports = [Sliding("x0"), Sliding("y0"), Sliding("z0"), Prescribed("x1", (0.4, None, None))]
    fibres = FibreFamily("wound", QuadraticFibres(0.1), Constant((1.0, 0.0, 0.0)))
    system = System(mesh, {"wound": neo_hookean(0.1), "plain": neo_hookean(0.3)}, supports, [], [fibres])
    state = solve_path(system, [1.0])[0].state
    (between,) = interfaces(system)
    assert between.name == "wound-plain"
    pull = system.forces(state)[0][mesh.surface_nodes("x1"), 0].sum()
    traction, normal = between.traction(state)
    _, area = surface_areas(mesh.points + state.u, between.faces, None)
    assert normal[..., 0] == pytest.approx(1.0, abs=1e-2)
    assert (traction[..., 0] * area).sum() == pytest.approx(pull, rel=1e-2)


def test_a_rigid_turn_turns_the_traction_with_it() -> None:
    mesh, _ = block("tet10")
    system = System(mesh, LAYERS, [Clamped("x0")])
    (between,) = interfaces(system)
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    gradient = np.eye(3) + 0.1 * np.random.default_rng(2).standard_normal((3, 3))
    first, second = (
        system.consistent(mesh.points @ (F - np.eye(3)).T, np.zeros(0)) for F in (gradient, turn @ gradient)
    )
    assert between.traction(second)[0] == pytest.approx(between.traction(first)[0] @ turn.T)
    assert between.facts(second) == pytest.approx(between.facts(first))


def test_regions_that_do_not_touch_have_no_interface() -> None:
    solid = box((3.0, 1.0, 1.0), (3, 1, 1))
    part = np.floor(solid.points[solid.cells].mean(axis=1)[:, 0]).astype(int)
    names = ("a", "b", "c")
    regions = {name: np.flatnonzero(part == k) for k, name in enumerate(names)}
    mesh = Mesh(solid.points, solid.cells, regions, solid.surfaces)
    materials = {name: neo_hookean(mu) for name, mu in zip(names, (1.0, 3.0, 2.0), strict=True)}
    system = System(mesh, materials, [Clamped("x0")])
    assert {between.name for between in interfaces(system)} == {"a-b", "c-b"}
