"""Fits: constants are recovered, residuals are least, and what is recommended is stable."""

from __future__ import annotations

import json

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials import create
from turgor.materials.fit import fit, parse_strain_range
from turgor.materials.measurement import MaterialTest
from turgor.materials.registry import models
from turgor.materials.testdata import read_tests


def synthetic(material, modes=("uniaxial", "equibiaxial", "planar"), low=0.8, high=2.5, points=40):
    x = np.linspace(low, high, points)
    return [MaterialTest(mode, x, getattr(material, mode)(x)) for mode in modes]


def reference(name: str):
    """A material whose constants the three modes determine: moduli decreasing with their order."""
    model = models()[name]
    rng = np.random.default_rng(7)
    values, order = {}, 0
    for constant in model.constants():
        if constant.linear:
            values[constant.name] = rng.uniform(0.05, 0.2) / 4.0**order
            order += 1
        else:
            inner = constant.starts[1:-1] or constant.starts
            values[constant.name] = rng.choice(inner) * rng.uniform(1.05, 1.15)
    if name == "ogden-3":
        values |= {"alpha1": 1.4, "alpha2": 4.6, "alpha3": -2.3}
    if name == "ogden-2":
        values |= {"alpha1": 1.4, "alpha2": 4.6}
    return model.of(values)


@pytest.mark.parametrize("name", sorted(models()))
def test_constants_are_recovered_from_exact_data(name):
    material = reference(name)
    found = fit(synthetic(material), name)[name]
    exact = material.parameters
    if name.startswith("ogden"):  # the order of the terms is free
        n = len(exact) // 2
        key = lambda p: sorted((p[f"alpha{i}"], p[f"mu{i}"]) for i in range(1, n + 1))  # noqa: E731
        np.testing.assert_allclose(key(found.parameters), key(exact), rtol=1e-6)
    else:
        assert found.parameters == pytest.approx(exact, rel=1e-6)
    assert found.r2 == pytest.approx(1.0)


def test_linear_model_solves_the_normal_equations(shared_data):
    (test,) = read_tests(shared_data / "tensile" / "Dragon Skin 30.csv")
    found = fit(test, "yeoh-3", strain_range="0:3")["yeoh-3"]
    part = test.within(0, 3)
    x = part.stretch
    I = x**2 + 2 / x - 3  # noqa: E741
    A = np.column_stack([2 * (x - x**-2) * n * I ** (n - 1) for n in (1, 2, 3)])
    expected = np.linalg.lstsq(A, part.stress, rcond=None)[0]
    np.testing.assert_allclose(list(found.parameters.values()), expected, rtol=1e-9)
    assert found.residual_norm == pytest.approx(float(np.linalg.norm(A @ expected - part.stress)), rel=1e-9)
    assert found.rmse == pytest.approx(found.residual_norm / np.sqrt(len(x)))


@pytest.mark.parametrize(("factor", "word"), [(1e6, "stiffer"), (1e-6, "softer"), (1.0, None)])
def test_stresses_of_another_unit_are_doubted(factor, word):
    material = create("neo-hookean", {"C10": 0.1 * factor})
    (test,) = fit(synthetic(material, ["uniaxial"]), "neo-hookean").tests
    assert [f"{word} than elastomers are; check the unit" in text for text in test.warnings] == [True] * bool(word)


def test_fits_are_deterministic(shared_data):
    file = shared_data / "tensile" / "Ecoflex 00-35 FAST.csv"
    assert fit(file, "ogden-3").as_dict() == fit(file, "ogden-3").as_dict()


def test_recommended_material_is_stable_in_use(tensile_file):
    report = fit(tensile_file, "all", strain_range="0:3")
    chosen = report[report.recommended]
    assert chosen.stable
    assert report.best is chosen.material
    assert [found.residual_norm for found in report.fits] == sorted(found.residual_norm for found in report.fits)
    assert {found.model for found in report.fits if not found.constrained} == set(models())
    assert not chosen.objections
    assert chosen.rmse <= 0.005 * report.largest_stress
    unstable = [found for found in report.fits if not found.stable]
    assert unstable, "nine Mooney–Rivlin constants on one curve are unstable"


def test_report_is_plain_json(tensile_file):
    report = fit(tensile_file, ["yeoh-3", "ogden-1"], strain_range="0:200%")
    printed = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert {"fits", "recommended", "data"} <= printed.keys()
    first = printed["fits"][0]
    assert {"model", "parameters", "units", "rmse_MPa", "residual_norm_MPa", "r2", "stable"} <= first.keys()
    (test,) = printed["data"]["tests"]
    assert test["strain_source"] == "crosshead"
    assert printed["data"]["strain_range"] == [0.0, 2.0]


def test_several_tests_are_fitted_together():
    material = create("mooney-rivlin-2", {"C10": 0.1, "C01": 0.03})
    found = fit(synthetic(material, ["uniaxial"]) + synthetic(material, ["equibiaxial"]), "mooney-rivlin-2")
    assert found.best.parameters == pytest.approx(material.parameters)
    assert len(found.tests) == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [("0:3", (0, 3)), ("0:300%", (0, 3)), ("10 % : 200 %", (0.1, 2)), (":2", (-np.inf, 2)), ((0, 1), (0, 1))],
)
def test_strain_ranges(text, expected):
    assert parse_strain_range(text) == pytest.approx(expected)


@pytest.mark.parametrize("text", ["3", "a:b", "3:1", "1:1", "", "0:1:2", (2, 1)])
def test_wrong_strain_ranges(text):
    with pytest.raises(InputError, match="range"):
        parse_strain_range(text)


def test_wrong_input(shared_data, tmp_path):
    file = shared_data / "tensile" / "Ecoflex 00-30.csv"
    with pytest.raises(InputError, match="yeoh"):
        fit(file, "yeoh-4")
    with pytest.raises(InputError, match="strain range"):
        fit(file, "yeoh-3", strain_range="20:30")
    with pytest.raises(InputError, match="no test data"):
        fit([], "yeoh-3")
    with pytest.raises(InputError, match="no model"):
        fit(file, [])


def test_no_stable_model_is_an_error():
    """A curve that softens at once: a negative initial slope has no material."""
    x = np.linspace(1.0, 2.0, 20)
    falling = MaterialTest("uniaxial", x, -0.1 * (x - 1), file="falling.csv")
    report = fit(falling, ["neo-hookean", "yeoh-2"])
    assert report.recommended is None
    assert "no fit" in report.reason
    json.dumps(report.as_dict(), allow_nan=False)
    with pytest.raises(InputError, match=r"falling.csv.*stable"):
        _ = report.best


def test_more_constants_than_points():
    material = create("neo-hookean", {"C10": 0.1})
    with pytest.raises(InputError, match="9 constants"):
        fit(synthetic(material, ["uniaxial"], points=6), "mooney-rivlin-9")


def test_of_all_models_those_with_more_constants_than_points_are_left_out(caplog):
    tests = synthetic(create("yeoh-1", {"C10": 0.1}), ["uniaxial"], points=5)
    with caplog.at_level("WARNING"):
        report = fit(tests)
    (warning,) = caplog.messages
    assert warning.endswith("only 5 points: mooney-rivlin-9 (9 constants), ogden-3 (6 constants)")
    assert "only 5 points: mooney-rivlin-9" in report.reason
    tried = {found.model for found in report.fits if not found.constrained}
    assert tried == set(models()) - {"mooney-rivlin-9", "ogden-3"}
    assert report.recommended is not None


def test_a_model_that_is_named_is_not_left_out():
    tests = synthetic(create("yeoh-1", {"C10": 0.1}), ["uniaxial"], points=5)
    with pytest.raises(InputError, match="ogden-3 has 6 constants, the tests have only 5 points"):
        fit(tests, ["all", "ogden-3"])


def test_points_of_a_test_that_does_not_count_determine_nothing():
    tests = synthetic(create("yeoh-1", {"C10": 0.1}), ["uniaxial", "planar"], points=5)
    with pytest.raises(InputError, match="ogden-3 has 6 constants, the tests have only 5 points"):
        fit(tests, "ogden-3", weights=[1.0, 0.0])


def test_a_test_without_points_is_refused():
    with pytest.raises(InputError, match="a test without points"):
        fit(MaterialTest("uniaxial", np.zeros(0), np.zeros(0)))
