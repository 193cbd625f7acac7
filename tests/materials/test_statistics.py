"""Confidence intervals, criteria, weights, bounds, constraints and the choice that rests on them."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials import create
from turgor.materials.fit import fit, largest_stretch
from turgor.materials.inequalities import least_squares_above
from turgor.materials.least_squares import Problem, solve
from turgor.materials.measurement import MaterialTest
from turgor.materials.registry import models
from turgor.materials.stability import stable_up_to
from turgor.materials.statistics import statistics

TRUTH = {
    "neo-hookean": {"C10": 0.1},
    "mooney-rivlin-2": {"C10": 0.1, "C01": 0.03},
    "mooney-rivlin-3": {"C10": 0.1, "C01": 0.03, "C11": 0.004},
    "mooney-rivlin-5": {"C10": 0.1, "C01": 0.03, "C20": 0.004, "C11": 0.003, "C02": 0.001},
    "mooney-rivlin-9": {
        "C10": 0.1, "C01": 0.03, "C20": 0.004, "C11": 0.003, "C02": 0.001,
        "C30": 4e-4, "C21": 3e-4, "C12": 2e-4, "C03": 1e-4,
    },
    "yeoh-1": {"C10": 0.1},
    "yeoh-2": {"C10": 0.1, "C20": 0.004},
    "yeoh-3": {"C10": 0.1, "C20": -0.004, "C30": 0.0008},
    "ogden-1": {"mu1": 0.2, "alpha1": 2.6},
    "ogden-2": {"mu1": 0.15, "alpha1": 1.4, "mu2": 0.01, "alpha2": 5.0},
    "ogden-3": {"mu1": 0.15, "alpha1": 1.4, "mu2": 0.005, "alpha2": 6.0, "mu3": 0.02, "alpha3": -2.5},
    "gent": {"mu": 0.2, "Jm": 25.0},
    "arruda-boyce": {"mu": 0.2, "lambda_m": 2.5},
    "van-der-waals": {"mu": 0.2, "lambda_m": 6.0, "a": 0.3, "beta": 0.2},
    "extended-tube": {"Gc": 0.15, "delta": 0.12, "Ge": 0.1, "beta": 0.6},
    "hencky": {"mu": 0.2},
}  # fmt: skip
"""Constants that three modes to a stretch of 3 determine well."""

REPETITIONS = 100


def synthetic(material, noise: float = 0.0, seed: int = 0, modes=("uniaxial", "equibiaxial", "planar")):
    rng = np.random.default_rng(seed)
    x = np.linspace(0.6, 3.0, 40)
    return [MaterialTest(mode, x, getattr(material, mode)(x) + noise * rng.standard_normal(len(x))) for mode in modes]


@pytest.mark.parametrize("name", sorted(models()))
def test_truth_lies_within_the_confidence_intervals(name):
    """Each constant is inside its 95 % interval in at least 90 % of all noisy repetitions, taken over the constants."""
    assert TRUTH.keys() == models().keys(), "every model of the package has its truth here"
    material = create(name, TRUTH[name])
    kind, exact = type(material), np.array(list(TRUTH[name].values()))
    if name.startswith("ogden"):
        exact = _sorted_terms(exact)
    searched = sum(not constant.linear for constant in kind.constants())
    repetitions = REPETITIONS // (1, 4, 8, 10)[searched]
    noise = 2e-4 * float(material.uniaxial(3.0))
    inside = []
    for seed in range(repetitions):
        tests = tuple(synthetic(material, noise, seed))
        problem = Problem(tests, (1.0,) * len(tests))
        solution = solve(kind, problem)
        half = statistics(solution.jacobian, solution.weighted).half_widths
        values = solution.values
        if name.startswith("ogden"):
            values, half = _sorted_terms(values), _sorted_terms(half, by=values)
        inside += (np.abs(values - exact) <= half).tolist()
    assert np.mean(inside) >= 0.9
    assert np.all(np.isfinite(half))
    assert np.mean(inside) < 1.0 or len(inside) < 200, "intervals that always hold the truth are too wide"


def _sorted_terms(values, by=None):
    """Order the pairs mu, alpha by alpha: the terms of Ogden's model can be exchanged."""
    order = np.argsort((values if by is None else by)[1::2])
    return np.asarray(values).reshape(-1, 2)[order].ravel()


def test_intervals_shrink_with_the_noise_and_grow_with_correlation():
    material = create("yeoh-3", TRUTH["yeoh-3"])
    wide = fit(synthetic(material, 2e-3), "yeoh-3").fits[0]
    narrow = fit(synthetic(material, 2e-4), "yeoh-3").fits[0]
    for key in TRUTH["yeoh-3"]:
        ratio = np.diff(wide.confidence[key])[0] / np.diff(narrow.confidence[key])[0]
        assert ratio == pytest.approx(10.0, rel=1e-6)
    assert np.allclose(np.diag(wide.correlation), 1.0)
    assert wide.correlation[1, 2] < -0.9


def test_constants_that_the_tests_cannot_tell_have_no_finite_interval():
    """In simple shear I1 = I2: C10 and C01 are one constant."""
    gamma = np.linspace(0.0, 1.0, 20)
    test = MaterialTest("simple-shear", gamma, 0.1 * gamma)
    found = fit(test, "mooney-rivlin-2", stability="ignore").fits[0]
    assert not np.any(np.isfinite([found.confidence["C10"], found.confidence["C01"]]))
    assert 2 * (found.parameters["C10"] + found.parameters["C01"]) == pytest.approx(0.1)


def test_criteria_punish_a_useless_constant():
    material = create("yeoh-2", TRUTH["yeoh-2"])
    report = fit(synthetic(material, 1e-3), ["yeoh-2", "yeoh-3"])
    assert report["yeoh-3"].residual_norm <= report["yeoh-2"].residual_norm
    assert report["yeoh-3"].bic > report["yeoh-2"].bic
    assert report.recommended == "yeoh-2"


def test_weights_move_the_fit_towards_the_heavier_test():
    soft, hard = (create("neo-hookean", {"C10": c}) for c in (0.05, 0.15))
    tests = synthetic(soft, modes=["uniaxial"]) + synthetic(hard, modes=["equibiaxial"])
    fitted = [
        fit(tests, "neo-hookean", weights=w).fits[0].parameters["C10"] for w in ((1, 0), (10, 1), (1, 10), (0, 1))
    ]
    assert fitted == sorted(fitted)
    assert fitted[0] == pytest.approx(0.05)
    assert fitted[-1] == pytest.approx(0.15)


def test_relative_error_fits_small_strains_closer():
    x = np.linspace(1.02, 4.0, 80)
    stiffening = create("yeoh-3", {"C10": 0.1, "C20": 0.002, "C30": 1e-4})
    test = MaterialTest("uniaxial", x, stiffening.uniaxial(x))
    absolute, relative = (
        fit(test, "neo-hookean", error=error).fits[0].parameters["C10"] for error in ("absolute", "relative")
    )
    assert abs(relative - 0.1) < abs(absolute - 0.1)


def test_bounds_hold():
    tests = synthetic(create("ogden-1", TRUTH["ogden-1"]))
    assert fit(tests, "ogden-1", bounds={"alpha1": (1.0, 2.0)}).fits[0].parameters["alpha1"] == pytest.approx(2.0)
    found = fit(tests, "mooney-rivlin-2", bounds={"C01": (0.01, 1.0)}).fits[0]
    assert found.parameters["C01"] >= 0.01 - 1e-12


@pytest.mark.parametrize(
    "options",
    [
        {"error": "squared"},
        {"weights": [1.0]},
        {"weights": [0.0, 0.0, 0.0]},
        {"weights": [1.0, -1.0, 1.0]},
        {"bounds": {"C10": (2.0, 1.0)}},
        {"stability": "hope"},
        {"stable_to": 0.5},
        {"stable_to": np.inf},
    ],
)
def test_wrong_options(options):
    with pytest.raises(InputError):
        fit(synthetic(create("neo-hookean", {"C10": 0.1})), "neo-hookean", **options)


def test_constrained_least_squares_is_optimal():
    """Karush–Kuhn–Tucker: feasible, multipliers not negative, complementary."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        A, y = rng.standard_normal((15, 4)), rng.standard_normal(15)
        G, h = rng.standard_normal((6, 4)), rng.standard_normal(6) - 1.0
        x = least_squares_above(A, y, G, h)
        if x is None:
            continue
        gradient = A.T @ (A @ x - y)
        slack = G @ x - h
        assert slack.min() > -1e-9
        active = slack < 1e-8
        multipliers, *_ = np.linalg.lstsq(G[active].T, gradient, rcond=None)
        assert np.all(multipliers > -1e-8)
        np.testing.assert_allclose(G[active].T @ multipliers, gradient, atol=1e-8)


def test_contradicting_inequalities_have_no_solution():
    assert least_squares_above(np.eye(1), np.ones(1), np.array([[1.0], [-1.0]]), np.array([1.0, 1.0])) is None


@pytest.mark.parametrize("name", ["mooney-rivlin-3", "mooney-rivlin-5", "yeoh-3", "ogden-2"])
def test_required_stability_is_kept(shared_data, name):
    file = shared_data / "tensile" / "Dragon Skin 10 MEDIUM.csv"
    plain = fit(file, name, strain_range="0:3", stability="ignore").fits[0]
    report = fit(file, name, strain_range="0:3", stability="require")
    kept = report.fits[0]
    assert kept.constrained
    assert kept.stable
    assert stable_up_to(kept.material, largest_stretch(report.tests))
    assert kept.residual_norm >= plain.residual_norm * (1 - 1e-9)
    assert 1.0 - 1e-6 <= kept.biaxial_ratio <= 1.5 + 1e-6


def test_a_longer_range_of_stability_costs_residual(shared_data):
    file = shared_data / "tensile" / "Dragon Skin 30.csv"
    near, far = (
        fit(file, "yeoh-3", strain_range="0:2", stability="require", stable_to=stretch).fits[0]
        for stretch in (2.0, 8.0)
    )
    assert far.residual_norm > near.residual_norm
    assert stable_up_to(far.material, 8.0)
    assert not stable_up_to(near.material, 8.0)


def test_the_recommended_fit_is_close_on_every_measured_curve(tensile_file):
    report = fit(tensile_file, strain_range="0:300%")
    chosen = report[report.recommended]
    assert chosen.rmse <= 0.005 * report.largest_stress
    assert chosen.stable
    assert not chosen.objections
    assert chosen.model in report.reason


def test_treloar_by_ogden_3(shared_data):
    report = fit(shared_data / "treloar.csv", "ogden-3")
    assert report.fits[0].relative_rmse <= 0.03
    assert report.fits[0].stable
    # Planar tension, predicted: between uniaxial and equibiaxial at moderate stretch.
    material = report.best
    assert material.uniaxial(2.0) < material.planar(2.0) < material.equibiaxial(2.0)


def test_uniaxial_data_alone_leave_a_band_in_biaxial_tension(shared_data):
    report = fit(shared_data / "tensile" / "Dragon Skin 30.csv", strain_range="0:2")
    x = np.array([1.5, 2.0])
    low, high = report.band("equibiaxial", x)
    near, far = report.band("uniaxial", x)
    assert np.all(high > 1.1 * low)
    assert np.all((far - near) / far < (high - low) / high)


def test_range_in_use():
    x = np.array([0.5, 1.0])
    assert largest_stretch([MaterialTest("uniaxial", x, x)]) == pytest.approx(2**0.5)
    assert largest_stretch([MaterialTest("equibiaxial", x, x)]) == pytest.approx(4.0)
    assert largest_stretch([MaterialTest("simple-shear", 1.5 * x, x)]) == pytest.approx(2.0)
