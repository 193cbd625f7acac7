"""Fibre families: derivatives, closed forms, directions, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.anisotropic import ExponentialFibres, FibreFamily, QuadraticFibres
from turgor.fem.constitutive import COL, ROW
from turgor.fem.directions import Constant, Helical
from turgor.fem.fields import von_mises
from turgor.fem.loads import Pressure
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle, shell_octant, tube_sector
from turgor.solver.path import solve_path

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
LAWS = [QuadraticFibres(0.4), ExponentialFibres(0.4, 1.5)]


def family(law=LAWS[0], direction=None, **options):
    return FibreFamily("body", law, direction or Constant((1.0, 0.5, -0.2)), **options)


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_of_the_laws(law):
    E, step = np.linspace(-0.5, 1.0, 9), 1e-5
    energy, first, second = law.derivatives(E)
    more, less = law.derivatives(E + step), law.derivatives(E - step)
    np.testing.assert_allclose(first, (more[0] - less[0]) / (2 * step), atol=1e-8)
    np.testing.assert_allclose(second, (more[1] - less[1]) / (2 * step), atol=1e-7)
    assert law.derivatives(np.zeros(1))[:2] == (0.0, 0.0)
    assert (energy[E != 0] > 0.0).all()


@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("dispersion", [0.0, 0.2])
def test_derivatives(law, dispersion, cell_type):
    mesh = tube_sector(1.0, 1.5, 0.5, 1, cell_type)
    fibres = family(law, Helical(0.7), dispersion=dispersion)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("z0")], [], [fibres])
    state = random_state(system, 0.01)
    stretch = system.families[0].stretch(state.u)
    assert stretch.min() < 0.99 < 1.01 < stretch.max()
    assert check_derivatives(system.families[0], state) > 1e-3


def test_derivatives_of_slack_and_taut_fibres():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    system = System(mesh, {"body": neo_hookean()}, [Clamped("z0")], [], [family(tension_only=True)])
    state, term = random_state(system, 0.05), system.families[0]
    stretch = term.stretch(state.u)
    assert stretch.min() < 0.95 < 1.05 < stretch.max()
    assert (term.stress(state.u)[stretch < 1.0] == 0.0).all()
    assert check_derivatives(term, state) > 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_the_lagged_stress_is_the_linearised_one(law):
    mesh = shell_octant(1.0, 1.5, 1)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("x0")], [], [family(law, dispersion=0.1)])
    state, term = random_state(system, 0.02), system.families[0]
    du, step = np.random.default_rng(1).standard_normal(state.u.shape), 1e-6
    more, less = (term.stress(state.u + h * du) for h in (step, -step))
    slope = (more - less) / (2 * step)
    assert np.abs(slope).max() > 1.0
    np.testing.assert_allclose(term.lagged_after(state, du) - term.stress(state.u), slope, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kappa", [0.0, 0.15, 1 / 3])
def test_a_bar_along_its_fibres_follows_the_closed_form(law, kappa):
    # Incompressible: P = μ (λ − λ⁻²) + ψ'(E) dE/dλ, E = κ (λ² + 2/λ − 3) + (1 − 3κ)(λ² − 1).
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    fibres = family(law, Constant((2.0, 0.0, 0.0)), dispersion=kappa)
    system = System(mesh, {"body": neo_hookean()}, [*PLANES, Prescribed("x1", (0.4, None, None))], [], [fibres])
    found = solve_path(system, [1.0])[0]
    pull = system.forces(found.state)[0][mesh.surface_nodes("x1"), 0].sum()
    s = 1.4
    E = kappa * (s**2 + 2 / s - 3) + (1 - 3 * kappa) * (s**2 - 1)
    slope = kappa * (2 * s - 2 / s**2) + (1 - 3 * kappa) * 2 * s
    added = law.derivatives(np.array(E))[1] * slope
    assert pull == pytest.approx(0.1 * (s - s**-2) + float(added), rel=1e-3)
    assert system.families[0].stretch(found.state.u) == pytest.approx(1.4, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kappa", [0.0, 0.15])
def test_the_stress_of_a_bar_is_what_matrix_and_fibres_carry_together(law, kappa):
    # Uniaxial and incompressible: σ = λ P = μ (λ² − 1/λ) + λ ψ'(E) dE/dλ, a third of it the mean stress.
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    fibres = family(law, Constant((2.0, 0.0, 0.0)), dispersion=kappa)
    system = System(mesh, {"body": neo_hookean()}, [*PLANES, Prescribed("x1", (0.4, None, None))], [], [fibres])
    state = solve_path(system, [1.0])[0].state
    s = 1.4
    E = kappa * (s**2 + 2 / s - 3) + (1 - 3 * kappa) * (s**2 - 1)
    slope = kappa * (2 * s - 2 / s**2) + (1 - 3 * kappa) * 2 * s
    stress = 0.1 * (s**2 - 1 / s) + s * float(law.derivatives(np.array(E))[1]) * slope
    found = von_mises(system, state)
    np.testing.assert_allclose(found.nodal, stress, rtol=1e-3)
    assert found.largest == pytest.approx(stress, rel=1e-3)
    np.testing.assert_allclose(system.element_pressure(state), stress / 3.0, rtol=1e-3)


@pytest.mark.parametrize("tension_only", [False, True])
def test_the_stress_of_fibres_does_the_work_of_their_forces(tension_only):
    # f_a = ∫ σ F⁻ᵀ ∂N_a/∂X J dV.
    mesh = tube_sector(1.0, 1.5, 0.5, 1)
    fibres = family(LAWS[1], Helical(0.7), dispersion=0.1, tension_only=tension_only)
    system = System(mesh, {"body": neo_hookean()}, [Clamped("z0")], [], [fibres])
    state, (term,), (solid,) = random_state(system, 0.01), system.families, system.solids
    stored = system.cauchy_stress(solid, state) - solid.cauchy_stress(state)
    stress = np.empty((*stored.shape[:2], 3, 3))
    stress[..., ROW, COL] = stress[..., COL, ROW] = stored
    F = np.eye(3) + np.einsum("eai,eqja->eqij", state.u[solid.nodes], solid.G)
    spatial = np.linalg.inv(F).swapaxes(-1, -2) @ solid.G
    volume = np.linalg.det(F) * solid.dV
    expected, forces = np.zeros_like(state.u), np.zeros_like(state.u)
    np.add.at(expected, solid.nodes, np.einsum("eqij,eqja,eq->eai", stress, spatial, volume))
    term.force(state, forces)
    assert np.abs(forces).max() > 1e-3
    np.testing.assert_allclose(forces, expected, atol=1e-12)


def test_oblique_fibres_shear_a_pulled_block_towards_themselves():
    mesh = box((3.0, 1.0, 1.0), (3, 1, 1))
    fibres = family(QuadraticFibres(1.0), Constant((1.0, 1.0, 0.0)))
    supports = [*PLANES[::2], Sliding("z1"), Clamped("x0"), Prescribed("x1", (0.3, None, None))]
    system = System(mesh, {"body": neo_hookean()}, supports, [], [fibres])
    u = solve_path(system, [1.0])[0].state.u
    # The fibres, at 45°, turn into the direction of pulling and take the end along.
    assert u[mesh.surface_nodes("x1"), 1].mean() < -0.03


def test_slack_fibres_carry_nothing():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    pulls = []
    for tension_only in (True, False):
        fibres = family(LAWS[0], Constant((1.0, 0.0, 0.0)), tension_only=tension_only)
        system = System(mesh, {"body": neo_hookean()}, [*PLANES, Prescribed("x1", (-0.2, None, None))], [], [fibres])
        # Fibres that take compression lose their stability on the way, which is a state of its own on the path.
        found = solve_path(system, [1.0])[-1]
        pulls.append(system.forces(found.state)[0][mesh.surface_nodes("x1"), 0].sum())
    alone = 0.1 * (0.8 - 0.8**-2)
    assert pulls[0] == pytest.approx(alone, rel=1e-3)
    assert pulls[1] == pytest.approx(alone + 0.4 * (0.8**2 - 1) * 2 * 0.8, rel=1e-3)


@pytest.mark.parametrize("degrees", [40.0, 54.7356, 70.0])
def test_stiff_families_hold_a_tube_as_netting_does(degrees):
    # Inextensible ±θ plies that carry the hoop force p r pull along the tube with 2π r² p cot²θ, its ends push with
    # p π r²: held at its length, a tube needs no force at the neutral angle, and one of either sign beside it.
    mesh = tube_sector(1.0, 1.05, 0.1, 1)
    angle = np.radians(degrees)
    plies = [family(QuadraticFibres(500.0), Helical(sign * angle)) for sign in (1, -1)]
    system = System(mesh, {"body": neo_hookean()}, [*PLANES, Sliding("z1")], [Pressure("inner", 0.05)], plies)
    found = solve_path(system, [1.0])[0]
    assert found.factorisations <= 5
    assert np.abs(found.state.u).max() < 3e-3
    hold = system.forces(found.state)[0][mesh.surface_nodes("z1"), 2].sum()
    thrust = 0.25 * np.pi * 1.025**2 * 0.05
    assert hold == pytest.approx(thrust * (2.0 / np.tan(angle) ** 2 - 1.0), abs=0.02 * thrust)


def test_helical_directions():
    places = np.array([[2.0, 1.0, 5.0], [1.0, 2.0, -3.0]])
    right = Helical(0.5, origin=(1.0, 1.0, 0.0)).at(places)
    np.testing.assert_allclose(right[0], [0.0, np.sin(0.5), np.cos(0.5)], atol=1e-15)
    np.testing.assert_allclose(right[1], [-np.sin(0.5), 0.0, np.cos(0.5)], atol=1e-15)
    left = Helical(-0.5, origin=(1.0, 1.0, 0.0)).at(places)
    np.testing.assert_allclose(left, right * [-1.0, -1.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(Helical(0.0, (0.0, 3.0, 0.0)).at(places), [[0.0, 1.0, 0.0]] * 2)
    hoop = Helical(np.pi / 2, (1.0, 0.0, 0.0)).at(np.array([[7.0, 2.0, 0.0]]))
    np.testing.assert_allclose(hoop, [[0.0, 0.0, 1.0]], atol=1e-15)


def test_refusals():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=r"k1: .*positive"):
        ExponentialFibres(0.0, 1.0)
    with pytest.raises(InputError, match="no direction"):
        Constant((0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="no direction"):
        Helical(0.3, axis=(0.0, 0.0, 0.0))
    for wrong, words in [
        (family(dispersion=0.4), "dispersion"),
        (FibreFamily("skin", LAWS[0], Constant((1.0, 0.0, 0.0))), "skin"),
        (family(direction=OnlyAbove()), r"not defined at \("),
    ]:
        with pytest.raises(InputError, match=words):
            System(mesh, {"body": neo_hookean()}, PLANES, [], [wrong])


def test_a_plane_section_is_refused():
    with pytest.raises(InputError, match="plane section"):
        System(rectangle((1.0, 1.0), (1, 1)), {"body": neo_hookean()}, [Clamped("x0")], [], [family()], PlaneStrain())


class OnlyAbove:
    def at(self, places):
        return np.where(places[:, 2:] > 0.5, [[1.0, 0.0, 0.0]], 0.0)
