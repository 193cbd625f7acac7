"""What is said of a set of constants before a run."""

from __future__ import annotations

import json

import numpy as np
import pytest

from turgor.materials import create
from turgor.materials.assessment import assess, ellipticity_margin, stability_map, stretch_plane, warnings_in_use
from turgor.materials.library import get, library


def test_moduli_are_those_of_linear_elasticity():
    found = assess(create("neo-hookean", {"C10": 0.1}, poisson=0.45))
    assert found.shear_modulus == pytest.approx(0.2)
    assert found.young_modulus == pytest.approx(2 * 0.2 * 1.45)
    assert found.poisson_ratio == pytest.approx(0.45)
    json.dumps(found.as_dict(), allow_nan=False)


def test_neo_hookean_margin_of_ellipticity_in_closed_form():
    """a·Q(N)·a = μ |a|² N·N for W = μ/2 (I₁ − 3): exactly μ for every state and direction."""
    material = create("neo-hookean", {"C10": 0.1})
    np.testing.assert_allclose(ellipticity_margin(material, stretch_plane(0.4, 3.0)), 1.0, rtol=1e-9)


def test_positive_constants_are_elliptic_and_negative_c01_is_not():
    assert assess(create("mooney-rivlin-2", {"C10": 0.1, "C01": 0.02})).elliptic
    assert not assess(get("tangoplus-mooney-rivlin")).elliptic


def test_ellipticity_follows_from_drucker_where_both_are_checked():
    """Drucker's inequality is the stronger: what it admits over all stretches is elliptic along the coaxial shears."""
    for entry in library():
        if entry.verdict.stable and entry.model.startswith("ogden"):
            assert assess(entry.build, 0.5, 3.0).elliptic, entry.name


def test_hencky_stress_falls_beyond_e():
    low, high = assess(create("hencky", {"mu": 1.0})).monotonic["uniaxial"]
    assert high == pytest.approx(np.e, rel=0.01)
    assert low == pytest.approx(0.3)


def test_map_is_symmetric_and_marks_what_is_lost():
    axis, margin = stability_map(get("tpu-0deg-mooney-rivlin-5"))
    np.testing.assert_allclose(margin, margin.T, rtol=1e-9)
    near_rest = np.abs(np.log(axis)) < 0.05
    assert np.all(margin[np.ix_(near_rest, near_rest)] > 0)
    assert np.any(margin < 0)


def test_map_of_a_locking_material_has_no_value_beyond():
    _, margin = stability_map(create("gent", {"mu": 0.1, "Jm": 5.0}))
    assert np.isnan(margin[-1, -1])
    assert np.nanmin(margin) > 0


def test_a_run_is_warned_of_a_material_that_locks():
    """λ² + 2/λ, 2 λ² + λ⁻⁴ and λ² + 1 + λ⁻² are 3 + Jm there."""
    gent = create("gent", {"mu": 0.1, "Jm": 1.0})
    assert warnings_in_use(gent, 1.3) == ()
    (locks,) = warnings_in_use(gent, 1.64)
    assert locks.startswith("the material locks where the run may go (equibiaxial beyond a stretch of 1.36; planar")
    assert "uniaxial" not in locks
    found = assess(gent).as_dict()
    assert found["digit_sensitivity"] < 0.01
    assert found["locks"]["planar"]["tension"] == pytest.approx(0.5 * (1.0 + 5.0**0.5))
    json.dumps(found, allow_nan=False)


def test_a_run_is_warned():
    assert not warnings_in_use(get("dragon-skin-10-slow-ogden-2"), 3.0)
    (unstable, *_) = warnings_in_use(get("dragon-skin-10-slow-mooney-rivlin"), 2.0)
    assert "equibiaxial beyond a stretch of 1.0" in unstable
    assert any("times the uniaxial" in text for text in warnings_in_use(get("ninjaflex-mooney-rivlin"), 2.0))
    assert any("digits" in text for text in warnings_in_use(get("tpu-0deg-mooney-rivlin-9"), 3.0))
