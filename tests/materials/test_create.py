"""Materials made from names and constants: conventions, compressibility, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials import create, find_model
from turgor.materials.registry import models

PRINTED_NAMES = [
    "neo-hookean", "mooney-rivlin-2", "mooney-rivlin-3", "mooney-rivlin-5", "mooney-rivlin-9",
    "yeoh-1", "yeoh-2", "yeoh-3", "ogden-1", "ogden-2", "ogden-3",
]  # fmt: skip


@pytest.mark.parametrize("name", PRINTED_NAMES)
def test_printed_names_resolve(name):
    assert find_model(name).name == name


def test_aliases_are_not_names():
    aliases = [alias for model in models().values() for alias in model.aliases]
    assert len(set(aliases)) == len(aliases)
    assert not set(aliases) & set(models())


def test_text_with_units_and_internal_floats_are_the_same():
    text = create("yeoh-2", {"C10": "20 kPa", "C20": "300 Pa"}, density="1070 kg/m^3")
    plain = create("yeoh-2", {"C10": 0.02, "C20": 0.0003}, density=1.07e-9)
    assert text.parameters == pytest.approx(plain.parameters)
    assert text.density == pytest.approx(plain.density)


def test_neo_hookean_closed_form():
    material = create("neo-hookean", {"C10": 0.05})
    x = np.array([0.5, 1.0, 1.7, 4.0])
    np.testing.assert_allclose(material.uniaxial(x), 0.1 * (x - x**-2), atol=1e-15)
    np.testing.assert_allclose(material.equibiaxial(x), 0.1 * (x - x**-5), atol=1e-15)
    np.testing.assert_allclose(material.planar(x), 0.1 * (x - x**-3), atol=1e-15)
    np.testing.assert_allclose(material.simple_shear(x), 0.1 * x, atol=1e-15)


def test_mooney_rivlin_closed_form():
    material = create("mooney-rivlin-2", {"C10": 0.05, "C01": 0.02})
    x = np.array([0.5, 1.0, 1.7, 4.0])
    np.testing.assert_allclose(material.uniaxial(x), 2 * (x - x**-2) * (0.05 + 0.02 / x), atol=1e-14)


def test_the_two_ogden_conventions_are_the_same_material():
    abaqus = create("ogden-2", {"mu1": 0.01, "alpha1": 3.0, "mu2": 0.06, "alpha2": -2.0})
    ogden = create("ogden-2", {"mu1": 0.02 / 3.0, "alpha1": 3.0, "mu2": -0.06, "alpha2": -2.0}, convention="ogden")
    assert ogden.parameters == pytest.approx(abaqus.parameters)
    # Ogden's own convention: uniaxial stress Σ μ (λ^(α-1) - λ^(-α/2-1)).
    x = 1.8
    expected = 0.02 / 3.0 * (x**2.0 - x**-2.5) - 0.06 * (x**-3.0 - x**0.0)
    assert float(ogden.uniaxial(x)) == pytest.approx(expected)


def test_wrong_convention_is_refused_with_both_readings():
    constants = {
        "mu1": -0.30622, "alpha1": -3.059, "mu2": 0.02833, "alpha2": 4.597, "mu3": 6.6e-9, "alpha3": 17.685
    }  # fmt: skip
    with pytest.raises(InputError) as caught:
        create("ogden-3", constants)
    assert "-0.129 MPa at 100 % strain" in str(caught.value)
    assert "0.7643 MPa at 100 % strain" in str(caught.value)
    assert float(create("ogden-3", constants, convention="ogden").uniaxial(2.0)) == pytest.approx(0.764, abs=1e-3)


def test_hydrogel_is_recognised_as_poisson_0_32():
    hydrogel = create("neo-hookean", {"C10": "1.343e-2 MPa"}, D1="30.461 MPa^-1")
    assert hydrogel.poisson_ratio == pytest.approx(0.32, abs=1e-4)


def test_the_three_ways_to_give_the_compressibility_agree():
    by_poisson = create("yeoh-1", {"C10": 0.1}, poisson=0.45)
    by_bulk = create("yeoh-1", {"C10": 0.1}, bulk_modulus=by_poisson.bulk_modulus)
    by_d1 = create("yeoh-1", {"C10": 0.1}, D1=2.0 / by_poisson.bulk_modulus)
    assert by_poisson.poisson_ratio == pytest.approx(0.45)
    assert by_bulk.bulk_modulus == pytest.approx(by_d1.bulk_modulus)


def test_nearly_incompressible_unless_told():
    material = create("neo-hookean", {"C10": 0.1})
    assert material.bulk_modulus == pytest.approx(1e4 * material.shear_modulus)


@pytest.mark.parametrize(
    ("model", "constants", "options", "words"),
    [
        ("yeo-3", {"C10": 0.1}, {}, ["yeoh-3"]),
        ("yeoh-2", {"C10": 0.1}, {}, ["C20", "missing"]),
        ("neo-hookean", {"C10": 0.1, "C01": 0.1}, {}, ["C01", "no such constant"]),
        ("neo-hookean", {"C10": "0.1"}, {}, ["C10", "unit"]),
        ("neo-hookean", {"C10": "0.1 mm"}, {}, ["C10", "mm"]),
        ("neo-hookean", {"C10": float("nan")}, {}, ["C10", "finite"]),
        ("neo-hookean", {"C10": True}, {}, ["C10"]),
        ("neo-hookean", {"C10": None}, {}, ["C10", "no value"]),
        ("neo-hookean", {"C10": 0.0}, {}, ["shear modulus"]),
        ("mooney-rivlin-2", {"C10": 0.1, "C01": -0.2}, {}, ["shear modulus"]),
        ("ogden-1", {"mu1": 0.1, "alpha1": 0.0}, {}, ["alpha1", "zero"]),
        ("ogden-1", {"mu1": 0.1, "alpha1": "2 MPa"}, {}, ["alpha1"]),
        ("ogden-1", {"mu1": 0.1, "alpha1": 2.0}, {"convention": "ansys"}, ["convention", "abaqus"]),
        ("neo-hookean", {"C10": 0.1}, {"convention": "ogden"}, ["convention"]),
        ("neo-hookean", {"C10": 0.1}, {"poisson": 0.5}, ["poisson", "0.5"]),
        ("neo-hookean", {"C10": 0.1}, {"poisson": 0.4, "D1": 2.0}, ["poisson", "D1"]),
        ("neo-hookean", {"C10": 0.1}, {"D1": 0.0}, ["D1"]),
        ("neo-hookean", {"C10": 0.1}, {"bulk_modulus": -1.0}, ["bulk"]),
        ("neo-hookean", {"C10": 0.1}, {"density": 0.0}, ["density"]),
        ("neo-hookean", {"C10": 0.1}, {"volumetric": "cubic"}, ["volumetric", "quadratic"]),
    ],
)
def test_bad_input_is_refused_by_name(model, constants, options, words):
    with pytest.raises(InputError) as caught:
        create(model, constants, **options)
    for word in words:
        assert word in str(caught.value)
