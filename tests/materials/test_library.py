"""The library of published constants."""

from __future__ import annotations

import pytest

from turgor.common.errors import InputError
from turgor.materials.library import find, get, library

YARDSTICKS_MPa = {
    "ecoflex-00-30-yeoh-sorotoki": 0.058,
    "ecoflex-00-30-ogden-moseley": 0.044,
    "ecoflex-00-30-ogden": 0.044,
    "dragon-skin-10-slow-ogden-2": 0.108,
    "dragon-skin-30-yeoh-sorotoki": 0.560,
    "elastosil-m4601-yeoh": 0.665,
    "smooth-sil-950-mooney-rivlin": 1.89,
    "smooth-sil-950-ogden": 0.764,
    "mold-star-15-ogden": 0.199,
    "mold-star-15-mooney-rivlin": 0.216,
    "elastic-50a-yeoh": 1.88,
    "ninjaflex-mooney-rivlin": 7.84,
}
"""Nominal stress at 100 % strain as known beside the published constants."""


@pytest.mark.parametrize("entry", library(), ids=lambda entry: entry.name)
def test_every_set_builds_and_says_where_it_comes_from(entry):
    assert entry.build.shear_modulus > 0
    assert entry.source
    assert entry.tests
    described = entry.as_dict()
    assert described["stability"]
    assert described["stable"] == entry.verdict.stable


def test_the_library_is_complete():
    assert len(library()) >= 30
    assert [entry.name for entry in library()] == sorted(entry.name for entry in library())


@pytest.mark.parametrize("name", YARDSTICKS_MPa)
def test_stress_at_100_percent(name):
    assert find(name).stress_at_100_percent == pytest.approx(YARDSTICKS_MPa[name], rel=0.02)


def test_unusable_sets_are_unstable_or_excluded_by_the_test():
    for entry in library():
        if entry.unusable:
            assert not entry.verdict.stable, entry.name


def test_the_formula_of_the_thesis_is_excluded_by_its_test():
    """Table and formula print C02 with two signs; a tensile test cannot give a compressive stress."""
    x = 1.5
    assert float(get("tpu-0deg-mooney-rivlin-5").uniaxial(x)) > 0
    assert float(get("tpu-0deg-mooney-rivlin-5-formula").uniaxial(x)) == pytest.approx(-16.9, abs=0.1)


def test_unknown_name_suggests_near_ones():
    with pytest.raises(InputError, match="dragon-skin-30-yeoh"):
        get("dragon-skin-30")


def test_the_tool_says_which_sign_the_test_excludes():
    assert "compressive stress" in find("tpu-0deg-mooney-rivlin-5-formula").contradiction
    for n in (2, 3, 5):
        assert find(f"tpu-0deg-mooney-rivlin-{n}").contradiction == ""
    assert "15.772 MPa was measured" in find("tpu-0deg-mooney-rivlin-9").contradiction
    assert find("dragon-skin-30-yeoh").contradiction == ""


def test_every_material_that_soft_robots_are_made_of_is_there():
    listed = " ".join(entry.material for entry in library())
    for name in (
        "Ecoflex 00-10", "Ecoflex 00-20", "Ecoflex 00-30", "Ecoflex 00-35", "Ecoflex 00-50", "Dragon Skin 10",
        "Dragon Skin 20", "Dragon Skin 30", "Elastosil M4601", "Smooth-Sil 950", "Mold Star", "PDMS", "TPU",
        "NinjaFlex", "Agilus30", "TangoPlus", "natural rubber",
    ):  # fmt: skip
        assert name in listed, name
