"""The page of a fit: everything in one file, and what must not be missed is said."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import yaml

from turgor.materials import create
from turgor.materials.fit import fit
from turgor.materials.measurement import MaterialTest
from turgor.results import fit_report


@pytest.fixture(scope="module")
def report():
    x = np.linspace(1.0, 3.0, 40)
    rubber = create("ogden-2", {"mu1": 0.06, "alpha1": 1.4, "mu2": 0.002, "alpha2": 5.0})
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(x))
    test = MaterialTest("uniaxial", x, rubber.uniaxial(x) + noise, name="<specimen>", warnings=("mind the crosshead",))
    return fit(test, ["ogden-1", "yeoh-3", "mooney-rivlin-9"])


def test_page_is_self_contained_and_complete(report, tmp_path):
    page = fit_report.write_fit_page(report, tmp_path / "fit.html").read_text(encoding="utf-8")
    body = page[page.index("<body>") :]
    assert "http" not in re.sub(r"https?://(www\.)?(w3|plotly|plot)\S*", "", body)
    for found in report.fits:
        assert found.model in body
    assert report.recommended in body
    assert "mind the crosshead" in body
    assert "<specimen>" not in body.split("<script>")[0], "text from files is escaped"
    assert body.count("Plotly.newPlot") == 4


def test_the_yaml_gives_the_recommended_material_back(report):
    document = yaml.safe_load(fit_report.material_yaml(report))
    assert create(document["model"], document["constants"]).parameters == pytest.approx(report.best.parameters)


def test_a_fitted_volume_change_goes_with_the_material():
    x, J = np.linspace(1.0, 2.0, 20), np.linspace(1.0, 0.98, 20)
    rubber = create("neo-hookean", {"C10": 0.05}, bulk_modulus=5.0)
    tests = [
        MaterialTest("uniaxial", x, rubber.uniaxial(x)),
        MaterialTest("volumetric", J, rubber.volumetric.pressure(J)),
    ]
    report = fit(tests, ["neo-hookean"])
    assert yaml.safe_load(fit_report.material_yaml(report))["bulk_modulus"].endswith(" MPa")
    assert "bulk_modulus" not in fit_report.material_yaml(fit(tests[0], ["neo-hookean"]))


def test_curves_show_data_and_every_model(report):
    names = [trace.name for trace in fit_report.curves(report).data]
    assert {found.model for found in report.fits} <= set(names)
    shown = {trace.name for trace in fit_report.curves(report).data if trace.visible is True}
    assert report.recommended in shown


def test_residuals_are_model_minus_test(report):
    (test,) = report.tests
    trace = next(t for t in fit_report.residuals(report).data if t.name == "ogden-1")
    np.testing.assert_allclose(trace.y, report["ogden-1"].material.uniaxial(test.stretch) - test.stress)


def test_band_encloses_the_recommended_prediction(report):
    figure = fit_report.other_modes(report)
    bands = [trace for trace in figure.data if trace.legendgroup == "band"]
    assert len(bands) == 3
    stretch = 1.0 + np.asarray(bands[1].x)
    low, high = report.band("equibiaxial", stretch)
    middle = report.best.equibiaxial(stretch)
    assert np.all(low - 1e-12 <= middle)
    assert np.all(middle <= high + 1e-12)


def test_a_fit_without_recommendation_is_drawn_too(tmp_path):
    x = np.linspace(1.0, 2.0, 20)
    report = fit(MaterialTest("uniaxial", x, -0.1 * (x - 1)), "neo-hookean")
    page = fit_report.write_fit_page(report, tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "No fit can be recommended" in page
    json.dumps(report.as_dict(), allow_nan=False)
