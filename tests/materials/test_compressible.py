"""Compressible materials: free lateral faces, lateral strain in the fit, volumetric tests."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials import create
from turgor.materials.compressible import free_response
from turgor.materials.fit import fit
from turgor.materials.measurement import MaterialTest

HYDROGEL = create("neo-hookean", {"C10": 1.343e-2}, D1=30.461)


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
def test_free_faces_carry_no_stress(mode):
    x = np.linspace(0.7, 2.0, 9)
    lateral, stress = free_response(HYDROGEL, mode, x)
    second = {"uniaxial": lateral, "equibiaxial": x, "planar": np.ones_like(x)}[mode]
    P = HYDROGEL.stress(np.stack([x, second, lateral], axis=-1)[:, :, None] * np.eye(3))
    np.testing.assert_allclose(P[:, 2, 2], 0.0, atol=1e-12)
    np.testing.assert_allclose(P[:, 0, 0], stress, atol=1e-12)


def test_the_branch_from_rest_is_followed_where_there_are_others():
    # Gent's rubber has no energy beyond its locking stretch, and C01 < 0 lets a second root of the stress appear.
    for material in (
        create("gent", {"mu": 0.1, "Jm": 20.0}, poisson=0.35),
        create("mooney-rivlin-2", {"C10": 0.1, "C01": -0.02}, poisson=0.35),
    ):
        lateral, stress = free_response(material, "uniaxial", np.linspace(0.5, 2.0, 31))
        assert np.all(np.diff(lateral) < 0.0)
        assert np.all(np.isfinite(stress))
        assert np.all(np.abs(np.diff(lateral)) < 0.1)


def test_small_strain_has_the_stated_poisson_ratio():
    lateral, stress = free_response(HYDROGEL, "uniaxial", np.array([1.0 + 1e-5]))
    assert (1.0 - lateral[0]) / 1e-5 == pytest.approx(HYDROGEL.poisson_ratio, rel=1e-4)
    assert stress[0] / 1e-5 == pytest.approx(HYDROGEL.young_modulus, rel=1e-4)


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
def test_nearly_incompressible_is_the_incompressible_response(mode):
    material = create("yeoh-2", {"C10": 0.1, "C20": 0.01}, bulk_modulus=1e6)
    x = np.linspace(0.8, 2.0, 7)
    _, stress = free_response(material, mode, x)
    np.testing.assert_allclose(stress, getattr(material, mode)(x), rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "constants"), [("neo-hookean", {"C10": 0.0134}), ("ogden-1", {"mu1": 0.03, "alpha1": 3})]
)
@pytest.mark.parametrize("poisson", [0.32, 0.45])
def test_lateral_strain_gives_poisson_ratio(name, constants, poisson):
    material = create(name, constants, poisson=poisson)
    x = np.linspace(1.0, 1.8, 25)
    lateral, stress = free_response(material, "uniaxial", x)
    report = fit(MaterialTest("uniaxial", x, stress, lateral=lateral), name)
    found = report.fits[0]
    assert found.parameters == pytest.approx(constants, rel=1e-6)
    assert found.material.poisson_ratio == pytest.approx(poisson, rel=1e-6)
    assert found.residual_norm < 1e-8
    assert "Poisson" in found.remark


def test_volumetric_test_gives_the_bulk_modulus():
    rubber = create("neo-hookean", {"C10": 0.1}, bulk_modulus=800.0)
    x, J = np.linspace(1.0, 2.0, 20), np.linspace(0.98, 1.0, 10)
    tests = [
        MaterialTest("uniaxial", x, rubber.uniaxial(x)),
        MaterialTest("volumetric", J, rubber.volumetric.pressure(J)),
    ]
    found = fit(tests, "neo-hookean").best
    assert found.bulk_modulus == pytest.approx(800.0)
    assert found.parameters["C10"] == pytest.approx(0.1)


def test_volumetric_test_alone_or_wrong_way_round_is_refused():
    J = np.linspace(0.98, 1.0, 10)
    with pytest.raises(InputError, match="volumetric"):
        fit(MaterialTest("volumetric", J, 800.0 * (J - 1)), "neo-hookean")
    x = np.linspace(1.0, 2.0, 20)
    tests = [MaterialTest("uniaxial", x, x - x**-2), MaterialTest("volumetric", J, -800.0 * (J - 1))]
    assert "bulk modulus" in fit(tests, "neo-hookean").fits[0].remark


def compressible_test(material, noise: float = 0.0, seed: int = 0):
    rng = np.random.default_rng(seed)
    x = np.linspace(1.0, 1.8, 30)
    lateral, stress = free_response(material, "uniaxial", x)
    return MaterialTest(
        "uniaxial",
        x,
        stress + noise * material.shear_modulus * rng.standard_normal(len(x)),
        lateral=lateral + noise * rng.standard_normal(len(x)),
    )


def test_intervals_and_criteria_are_those_of_the_compressible_fit():
    material = create("ogden-1", {"mu1": 0.03, "alpha1": 3.0}, poisson=0.35)
    inside = []
    for seed in range(60):
        found = fit(compressible_test(material, 3e-3, seed), "ogden-1").fits[0]
        inside += [low <= material.parameters[name] <= high for name, (low, high) in found.confidence.items()]
        assert found.confidence["mu1"][0] < found.parameters["mu1"] < found.confidence["mu1"][1]
    assert 0.9 <= np.mean(inside) < 1.0
    report = fit(compressible_test(material, 3e-3), ["ogden-1", "neo-hookean"])
    assert report["ogden-1"].aic < report["neo-hookean"].aic
    assert report["ogden-1"].correlation.shape == (2, 2)


def test_bounds_hold_in_compressible_fits():
    material = create("ogden-1", {"mu1": 0.03, "alpha1": 3.0}, poisson=0.35)
    found = fit(compressible_test(material), "ogden-1", bounds={"alpha1": (1.0, 2.0)}).fits[0]
    assert found.parameters["alpha1"] == pytest.approx(2.0)
    assert found.material.poisson_ratio < 0.45


def test_a_constrained_fit_stays_stable_where_the_volume_is_fitted_too():
    softening = create("mooney-rivlin-2", {"C10": 0.1, "C01": -0.02}, poisson=0.4)
    test = compressible_test(softening)
    plain, kept = (
        fit(test, "mooney-rivlin-2", stability=choice, stable_to=3.0).fits[0] for choice in ("ignore", "require")
    )
    assert not plain.stable
    assert kept.stable
    assert kept.parameters["C01"] > plain.parameters["C01"]
    assert kept.material.poisson_ratio == pytest.approx(0.4, abs=0.05)


def test_where_lateral_strain_is_missing_the_stress_counts_alone():
    material = create("ogden-1", {"mu1": 0.03, "alpha1": 3.0}, poisson=0.35)
    whole = compressible_test(material)
    for missing in (slice(5, 9), slice(None)):
        lateral = whole.lateral.copy()
        lateral[missing] = np.nan
        found = fit(MaterialTest("uniaxial", whole.stretch, whole.stress, lateral=lateral), "ogden-1").fits[0]
        if missing == slice(None):
            assert "lateral" not in found.remark
        else:
            assert found.parameters == pytest.approx(material.parameters, rel=1e-6)
            assert found.material.poisson_ratio == pytest.approx(0.35, rel=1e-6)


def test_a_test_of_no_weight_does_not_count():
    material = create("neo-hookean", {"C10": 0.0134}, poisson=0.32)
    x = np.linspace(1.0, 1.5, 12)
    foreign = MaterialTest("uniaxial", x, 10.0 * (x - 1.0), lateral=np.ones_like(x))
    test = compressible_test(material, 1e-3)
    alone, beside = fit(test, "neo-hookean").fits[0], fit([test, foreign], "neo-hookean", weights=(1, 0)).fits[0]
    for name in ("parameters", "confidence", "rmse", "residual_norm", "r2", "aic", "bic"):
        assert getattr(beside, name) == getattr(alone, name), name
    assert beside.material.poisson_ratio == alone.material.poisson_ratio
