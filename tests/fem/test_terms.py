"""Every term's force is the derivative of its energy, its stiffness the derivative of its force, on random states."""

from __future__ import annotations

import numpy as np
import pytest
from samples import check_derivatives, differences, neo_hookean, random_state

from turgor.fem.loads import Force, Gravity, Pressure, Traction
from turgor.fem.supports import Clamped, ElasticSupport, Sliding
from turgor.fem.system import System
from turgor.materials.registry import models
from turgor.materials.volumetric import Logarithmic, Quadratic
from turgor.mesh.structured import shell_octant


def material_of(model, volumetric):
    rng = np.random.default_rng(3)
    values = [
        rng.uniform(0.05, 0.3) if c.linear else rng.uniform(min(c.starts), max(c.starts)) for c in model.constants()
    ]
    names = [c.name for c in model.constants()]
    bulk = 20.0 * model.trial(values).shear_modulus
    return model(**dict(zip(names, values, strict=True)), volumetric=volumetric(bulk))


@pytest.fixture(scope="module")
def octant():
    return shell_octant(1.0, 1.5, 1)


@pytest.mark.parametrize("name", sorted(models()))
@pytest.mark.parametrize("volumetric", [Quadratic, Logarithmic])
def test_solid(octant, name, volumetric):
    system = System(octant, {"body": material_of(models()[name], volumetric)}, [Clamped("x0")])
    state = random_state(system, 0.02)
    assert check_derivatives(system.solids[0], state) > 1e-3


@pytest.mark.parametrize("name", sorted(models()))
def test_kernels_agree_with_the_material_itself(octant, name):
    material = material_of(models()[name], Quadratic)
    system = System(octant, {"body": material}, [Clamped("x0")])
    state = random_state(system, 0.02, seed=5)
    solid = system.solids[0]
    stress = solid.cauchy_stress(state)
    F = np.eye(3) + np.einsum("eai,eqja->eqij", state.u[solid.nodes], solid.G)
    J = np.linalg.det(F)
    expected = np.einsum("eqij,eqkj->eqik", material.stress(F), F) / J[..., None, None]
    deviator = expected - np.trace(expected, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) / 3
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]
    ours = stress.copy()
    ours[..., :3] -= stress[..., :3].mean(axis=-1, keepdims=True)
    reference = np.stack([deviator[..., i, j] for i, j in pairs], axis=-1)
    np.testing.assert_allclose(ours, reference, atol=1e-11 * np.abs(reference).max())


@pytest.mark.parametrize("surface", ["inner", "outer"])
def test_cavity(octant, surface):
    # The outer skin stands for a wall that bends the other way; both are cut open by three symmetry planes.
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    system = System(octant, {"body": neo_hookean()}, planes, [Pressure(surface, 0.3)])
    state = random_state(system, 0.02)
    assert check_derivatives(system.cavities[0], state) > 1e-3


def test_dead_loads(octant):
    loads = [Gravity((1.0, 2.0, -3.0)), Traction("outer", (0.1, 0.2, 0.3)), Force("inner", (1.0, -1.0, 2.0))]
    system = System(octant, {"body": neo_hookean(density=2e-3)}, [Clamped("x0")], loads)
    state = random_state(system, 0.02)
    for term in system.terms[1:]:
        force, direction = np.zeros_like(state.u), np.random.default_rng(1).standard_normal(state.u.shape)
        term.force(state, force)
        slope = differences(term.energy, state, direction)
        assert abs(slope) > 1e-6
        assert np.vdot(force, direction) == pytest.approx(slope, rel=1e-8)


def test_total_of_dead_loads(octant):
    area, volume = octant.surface_area("outer"), octant.volume()
    loads = [Gravity((0.0, 0.0, -3.0)), Traction("outer", (0.1, 0.2, 0.3)), Force("inner", (1.0, -1.0, 2.0))]
    system = System(octant, {"body": neo_hookean(density=2e-3)}, [Clamped("x0")], loads)
    totals = [term.nodal.sum(axis=0) for term in system.terms[1:]]
    np.testing.assert_allclose(totals[0], [0, 0, -3.0 * 2e-3 * volume], rtol=1e-3, atol=1e-15)
    np.testing.assert_allclose(totals[1], area * np.array([0.1, 0.2, 0.3]), rtol=1e-3)
    np.testing.assert_allclose(totals[2], [1.0, -1.0, 2.0], rtol=1e-12)


@pytest.mark.parametrize("normal_only", [False, True])
def test_elastic_support(octant, normal_only):
    system = System(octant, {"body": neo_hookean()}, [ElasticSupport("outer", 0.3, normal_only), Clamped("x0")])
    assert check_derivatives(system.terms[1], random_state(system, 0.02)) > 1e-3


@pytest.mark.parametrize("which", ["cavity", "dead"])
def test_load_gradient(octant, which):
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    load = Pressure("inner", 0.3) if which == "cavity" else Traction("outer", (0.1, 0.2, 0.3))
    system = System(octant, {"body": neo_hookean()}, planes, [load])
    state = random_state(system, 0.02)
    gradient = np.zeros_like(state.u)
    system.terms[1].load_gradient(state, gradient)
    more, less = (system.forces(state.with_loads(state.loads + h))[0] for h in (1e-3, -1e-3))
    assert np.linalg.norm(gradient) > 1e-3
    np.testing.assert_allclose(gradient, (more - less) / 2e-3, atol=1e-9)
