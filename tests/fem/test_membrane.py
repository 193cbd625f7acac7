"""Sheets on faces: derivatives, uniform strain, composite bending, and what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.loads import Pressure, Traction
from turgor.fem.membrane import BondedMembrane, Membrane
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, shell_octant
from turgor.solver.path import solve_path

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]


@pytest.fixture(scope="module")
def octant():
    return shell_octant(1.0, 1.5, 1)


def test_derivatives(octant):
    system = System(octant, {"body": neo_hookean()}, [Clamped("x0")], [], [Membrane("outer", 3.0, 0.1)])
    state = random_state(system, 0.02)
    assert check_derivatives(system.membranes[0], state) > 1e-2


def test_the_lagged_stress_is_the_linearised_one(octant):
    system = System(octant, {"body": neo_hookean()}, [Clamped("x0")], [], [Membrane("outer", 3.0, 0.1)])
    membrane, state = system.membranes[0], random_state(system, 0.02)
    du = np.random.default_rng(1).standard_normal(state.u.shape)
    step = 1e-6
    more, less = (membrane.lagged_at(state.moved(h * du)) for h in (step, -step))
    slope = (more - less) / (2 * step)
    assert np.abs(slope).max() > 0.1
    np.testing.assert_allclose(
        membrane.lagged_after(state, du) - membrane.lagged_at(state), slope, rtol=1e-6, atol=1e-7
    )


def test_area_and_rigid_turn(octant):
    membrane = BondedMembrane(octant, Membrane("outer", 1000.0, 0.1))
    assert membrane.dA.sum() == pytest.approx(octant.surface_area("outer"), rel=1e-3)
    Q, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    Q *= np.sign(np.linalg.det(Q))
    assert np.abs(membrane.strain(octant.points @ (Q - np.eye(3)).T)).max() < 1e-13
    assert not membrane.strain(np.zeros_like(octant.points)).any()


def test_uniform_strain_of_a_flat_sheet():
    mesh = box((2.0, 1.0, 1.0), (2, 1, 1))
    membrane = BondedMembrane(mesh, Membrane("z1", 5.0, 0.2, 0.25))
    F = np.array([[1.2, 0.1, 0.3], [0.0, 0.9, 0.1], [0.2, 0.0, 1.0]])
    E = 0.5 * (F.T @ F - np.eye(3))[:2, :2]
    S = 5.0 * 0.2 / (1 - 0.25**2) * (0.75 * E + 0.25 * np.trace(E) * np.eye(2))
    u = mesh.points @ (F - np.eye(3)).T
    stress = membrane.stress(u)
    np.testing.assert_allclose(stress[..., 0] + stress[..., 1], np.trace(S), rtol=1e-10)
    determinant = stress[..., 0] * stress[..., 1] - stress[..., 2] ** 2
    np.testing.assert_allclose(determinant, np.linalg.det(S), rtol=1e-9)
    energy = 0.5 * np.sum(S * E) * 2.0
    system = System(mesh, {"body": neo_hookean()}, [Clamped("x0")])
    assert membrane.energy(system.consistent(u, np.zeros(0))) == pytest.approx(energy)


def test_sheets_share_the_load_of_a_block():
    # Held across, P = μ (λ − λ⁻³) of the incompressible block and D/2 λ (λ² − 1) of each membrane.
    mesh = box((2.0, 1.0, 1.0), (2, 1, 1))
    membranes = [Membrane("z1", 5.0, 0.01, 0.0), Membrane("z0", 5.0, 0.01, 0.0)]
    supports = [*PLANES, Sliding("y1"), Prescribed("x1", (0.4, None, None))]
    system = System(mesh, {"body": neo_hookean()}, supports, [], membranes)
    found = solve_path(system, [1.0])[0]
    pull = system.forces(found.state)[0][mesh.surface_nodes("x1"), 0].sum()
    expected = 0.1 * (1.2 - 1.2**-3) + 2 * 0.05 / 2 * 1.2 * (1.2**2 - 1)
    assert pull == pytest.approx(expected, rel=1e-4)


def test_a_sheet_on_one_side_bends_a_pulled_bar_as_a_composite_beam():
    # A layer of stiffness D per width on top of a bar of modulus E and height H moves the axis of stretching up from
    # the bar's middle by e = D H/2 / (E H + D). An even pull t below it bends the bar upward, towards the membrane, by
    # κ = t H e / (E H³/12 + E H e² + D (H/2 − e)²). With Poisson's ratio of the bar the sheet stays free across.
    E, H, width, length = 0.3, 1.0, 0.5, 10.0
    layer, pull = 0.3, 2e-5 * 0.3
    mesh = box((length, width, H), (40, 2, 4))
    membrane = Membrane("z1", layer / 0.01, 0.01, 0.5)
    load = Traction("x1", (pull, 0.0, 0.0))
    system = System(mesh, {"body": neo_hookean(E / 3, 1e3)}, [Clamped("x0")], [load], [membrane])
    u = solve_path(system, [1.0])[0].state.u
    x, _, z = mesh.points.T
    middle = (x > 3.0) & (x < 8.0) & (z == 0.5 * H)
    curvature = 2 * np.polyfit(x[middle], u[middle, 2], 2)[0]
    e = layer * H / 2 / (E * H + layer)
    expected = pull * H * e / (E * H**3 / 12 + E * H * e**2 + layer * (H / 2 - e) ** 2)
    assert curvature == pytest.approx(expected, rel=0.01)


def test_a_sheet_between_two_regions_is_found():
    mesh = box((2.0, 1.0, 1.0), (2, 1, 2))
    low = np.flatnonzero(mesh.points[mesh.cells[:, :4]].mean(axis=1)[:, 2] < 0.5)
    high = np.setdiff1d(np.arange(mesh.n_cells), low)
    both = replace(mesh, regions={"low": low.astype(np.int32), "high": high.astype(np.int32)})
    membrane = BondedMembrane(both, Membrane(("low", "high"), 5.0, 0.1))
    assert membrane.dA.sum() == pytest.approx(2.0)
    assert mesh.points[membrane.nodes, 2] == pytest.approx(0.5)
    assert len(np.unique(np.sort(membrane.nodes), axis=0)) == len(membrane.nodes)


def test_an_inextensible_skin_holds_a_sphere_in_shape(octant):
    # Thin shell, S11 = S22 = T: p r_outer... the skin carries nearly all of the pressure: T = p a² / (2 r).
    membrane = Membrane("outer", 3000.0, 0.1)
    system = System(shell_octant(1.0, 1.5, 2), {"body": neo_hookean()}, PLANES, [Pressure("inner", 0.2)], [membrane])
    found = solve_path(system, [1.0])[0]
    assert found.factorisations <= 5
    stress = system.membranes[0].stress(found.state.u)
    weights = system.membranes[0].dA
    mean = np.average(0.5 * (stress[..., 0] + stress[..., 1]), weights=weights)
    assert mean == pytest.approx(0.2 * 1.5 / 2, rel=0.02)


@pytest.mark.parametrize(
    ("membrane", "words"),
    [
        (Membrane("outer", 0.0, 0.1), "youngs_modulus.*positive"),
        (Membrane("outer", 1.0, -0.1), "thickness.*positive"),
        (Membrane("outer", 1.0, 0.1, 1.0), "poissons_ratio"),
        (Membrane("nowhere", 1.0, 0.1), "nowhere"),
        (Membrane(("body", "body2"), 1.0, 0.1), "body2"),
    ],
)
def test_refusals(octant, membrane, words):
    with pytest.raises(InputError, match=words):
        BondedMembrane(octant, membrane)
