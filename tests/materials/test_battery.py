"""Invariants that every strain-energy model of the package must keep; none is named here, and users' models join."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from turgor.materials import Hyperelastic, Logarithmic, Quadratic
from turgor.materials.registry import find_model, models

STATES = 12
STEP = 1e-4


def sample(model: type[Hyperelastic], seed: int = 0, volumetric=Quadratic) -> Hyperelastic:
    """A material with random positive moduli and random exponents inside their starting range."""
    rng = np.random.default_rng(seed)
    values = {}
    for constant in model.constants():
        if constant.linear:
            values[constant.name] = rng.uniform(0.05, 0.3)
        else:
            values[constant.name] = rng.uniform(min(constant.starts), max(constant.starts))
    trial = model.trial(list(values.values()))
    return model(**values, volumetric=volumetric(25.0 * trial.shear_modulus))


def random_gradients(seed: int = 1, size: int = STATES, spread: float = 0.25) -> np.ndarray:
    """Deformation gradients with positive determinant."""
    F = np.eye(3) + spread * np.random.default_rng(seed).standard_normal((4 * size, 3, 3))
    return F[np.linalg.det(F) > 0.3][:size]


def random_rotations(seed: int, size: int) -> np.ndarray:
    Q, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((size, 3, 3)))
    return Q * np.sign(np.linalg.det(Q))[:, None, None]


def differences(function, F: np.ndarray, step: float = STEP) -> np.ndarray:
    """Derivative of `function` by F, the components of F last: central differences of fourth order."""
    columns = []
    for i in range(3):
        for j in range(3):
            E = np.zeros((3, 3))
            E[i, j] = step
            near, far = function(F + E) - function(F - E), function(F + 2 * E) - function(F - 2 * E)
            columns.append((8.0 * near - far) / (12.0 * step))
    derivative = np.stack(columns, axis=-1)
    return derivative.reshape(*derivative.shape[:-1], 3, 3)


def near_equal_gradients() -> np.ndarray:
    """Rotated stretches of which two or three coincide, exactly or to a distance between 1e-12 and 2e-2."""
    stretches = [[1.0, 1.0, 1.0], [1.4, 1.4, 0.6], [0.8, 0.8, 1.3]]
    for gap in (1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 0.9e-2, 2e-2, 2.5e-2):
        stretches += [[1.2 + gap, 1.2, 0.7], [1.0 + gap, 1.0, 1.0 - gap]]
    x = np.array(stretches)
    return random_rotations(3, len(x)) @ (x[:, :, None] * random_rotations(4, len(x)))


USER_MODELS = {file.stem: str(file) for file in Path(__file__).parent.glob("user_*.yaml")}


@pytest.fixture(params=[*sorted(models()), *sorted(USER_MODELS)])
def model(request) -> type[Hyperelastic]:
    return find_model(USER_MODELS.get(request.param, request.param))


@pytest.fixture(params=[Quadratic, Logarithmic], ids=lambda law: law.name)
def material(request, model) -> Hyperelastic:
    return sample(model, volumetric=request.param)


def test_there_are_models_to_test():
    assert len(models()) >= 11


def test_stress_is_the_derivative_of_the_energy(material):
    F = random_gradients()
    scale = material.shear_modulus + np.abs(material.stress(F)).max(axis=(1, 2), keepdims=True)
    assert len(F) == STATES
    assert np.max(np.abs(material.stress(F) - differences(material.energy, F)) / scale) < 1e-8


def test_tangent_is_the_derivative_of_the_stress(material):
    F = random_gradients()
    tangent = material.tangent(F)
    scale = np.abs(tangent).max(axis=(1, 2, 3, 4), keepdims=True)
    assert np.max(np.abs(tangent - differences(material.stress, F)) / scale) < 1e-8


def test_tangent_has_major_symmetry(material):
    tangent = material.tangent(random_gradients())
    np.testing.assert_allclose(tangent, np.einsum("...ijkl->...klij", tangent), atol=1e-12 * np.abs(tangent).max())


def test_undeformed_body_has_neither_energy_nor_stress(material):
    assert abs(float(material.energy(np.eye(3)))) < 1e-14 * material.bulk_modulus
    assert np.abs(material.stress(np.eye(3))).max() < 1e-13 * material.bulk_modulus


def test_pure_volume_change_has_no_isochoric_stress(material):
    F = 1.2 * np.eye(3)
    expected = float(material.volumetric.pressure(np.array(1.2**3))) * 1.2**2 * np.eye(3)
    np.testing.assert_allclose(material.stress(F), expected, atol=1e-12 * material.bulk_modulus)


def test_frame_indifference(material):
    F = random_gradients()
    Q = random_rotations(5, len(F))
    np.testing.assert_allclose(material.energy(Q @ F), material.energy(F), rtol=1e-10)
    np.testing.assert_allclose(material.stress(Q @ F), Q @ material.stress(F), atol=1e-10 * material.bulk_modulus)


def test_isotropy(material):
    F = random_gradients()
    Q = random_rotations(6, len(F))
    np.testing.assert_allclose(material.energy(F @ Q), material.energy(F), rtol=1e-10)
    np.testing.assert_allclose(material.stress(F @ Q), material.stress(F) @ Q, atol=1e-10 * material.bulk_modulus)


def test_linearisation_has_the_stated_moduli(material):
    delta = np.eye(3)
    ik_jl = np.einsum("ik,jl->ijkl", delta, delta)
    il_jk = np.einsum("il,jk->ijkl", delta, delta)
    ij_kl = np.einsum("ij,kl->ijkl", delta, delta)
    mu, K = material.shear_modulus, material.bulk_modulus
    elasticity = mu * (ik_jl + il_jk) + (K - 2.0 * mu / 3.0) * ij_kl
    np.testing.assert_allclose(material.tangent(delta), elasticity, atol=1e-12 * K)


def test_equal_principal_stretches(material):
    F = near_equal_gradients()
    if not material.smooth_at_rest:  # differences of its stress do not converge there
        F = F[np.abs(np.linalg.svd(F, compute_uv=False) - 1.0).max(axis=-1) > 0.1]
    tangent = material.tangent(F)
    assert np.all(np.isfinite(tangent))
    scale = np.abs(tangent).max(axis=(1, 2, 3, 4), keepdims=True)
    assert np.max(np.abs(tangent - differences(material.stress, F)) / scale) < 1e-8


def test_tangent_passes_smoothly_from_equal_to_distinct_stretches(model):
    material = sample(model)
    stretches = np.array([[1.3, 1.3, 0.7], [1.3 * (1 + 1e-13), 1.3, 0.7]])
    F = random_rotations(8, 1) @ (stretches[:, :, None] * random_rotations(9, 1))
    equal, distinct = material.tangent(F)
    np.testing.assert_allclose(distinct, equal, atol=1e-11 * np.abs(equal).max())


def test_leading_shapes(material):
    F = random_gradients().reshape(3, 4, 3, 3)
    assert material.energy(F).shape == (3, 4)
    assert material.stress(F).shape == (3, 4, 3, 3)
    assert material.tangent(F).shape == (3, 4, 3, 3, 3, 3)
    np.testing.assert_array_equal(material.tangent(F)[1, 2], material.tangent(F[1, 2]))


MODES = {
    "uniaxial": lambda x: np.stack([x, x**-0.5, x**-0.5], axis=-1),
    "equibiaxial": lambda x: np.stack([x, x, x**-2], axis=-1),
    "planar": lambda x: np.stack([x, np.ones_like(x), 1 / x], axis=-1),
}


@pytest.mark.parametrize("mode", MODES)
def test_closed_homogeneous_stress_follows_from_the_full_stress(model, mode):
    """The hydrostatic part is fixed by the free surface: σ₁ − σ₃ does not depend on it."""
    material = sample(model)
    x = np.linspace(0.7, 1.8, 12)
    stretches = MODES[mode](x)
    P = np.diagonal(material.stress(stretches[:, :, None] * np.eye(3)), axis1=1, axis2=2)
    nominal = P[:, 0] - P[:, 2] * stretches[:, 2] / x
    np.testing.assert_allclose(getattr(material, mode)(x), nominal, rtol=1e-9, atol=1e-11 * material.bulk_modulus)


def test_simple_shear_follows_from_the_full_stress(model):
    material = sample(model)
    gamma = np.linspace(-1.0, 1.5, 11)
    F = np.tile(np.eye(3), (len(gamma), 1, 1))
    F[:, 0, 1] = gamma
    expected = material.stress(F)[:, 0, 1]
    np.testing.assert_allclose(material.simple_shear(gamma), expected, atol=1e-11 * material.bulk_modulus)


def test_principal_derivatives_are_consistent(model):
    material = sample(model)
    x = np.random.default_rng(2).uniform(0.7, 1.5, (20, 3))
    x /= np.cbrt(x.prod(axis=1))[:, None]
    _, slope, curvature = material.principal(x)
    for a in range(3):
        step = np.zeros(3)
        step[a] = 1e-5
        up, down = material.principal(x + step), material.principal(x - step)
        np.testing.assert_allclose((up[0] - down[0]) / 2e-5, slope[:, a], rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose((up[1] - down[1]) / 2e-5, curvature[:, a], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_no_positive_shear_modulus_is_refused(model, bad):
    from turgor.common.errors import InputError

    good = sample(model)
    values = {c.name: (bad * getattr(good, c.name) if c.linear else getattr(good, c.name)) for c in model.constants()}
    with pytest.raises(InputError, match="shear modulus"):
        model(**values)
