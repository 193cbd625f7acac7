"""Drucker verdicts against closed forms and the thresholds known of published sets."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.materials import create
from turgor.materials.expression import define_model
from turgor.materials.library import get
from turgor.materials.registry import models
from turgor.materials.stability import (
    MODES,
    digit_sensitivity,
    drucker_margin,
    drucker_matrix,
    locking,
    principal_stretches,
    stable_range,
    stable_up_to,
    verdict,
)


def test_matrix_is_abaqus_closed_form():
    """D11 = 4(λ₁²+λ₃²)(U₁+λ₂²U₂) + 4(λ₁²−λ₃²)²(U₁₁+2λ₂²U₁₂+λ₂⁴U₂₂), Abaqus Theory Guide."""
    material = create("mooney-rivlin-5", {"C10": 0.1, "C01": 0.02, "C20": 0.003, "C11": -0.001, "C02": 0.0005})
    x = np.array([1.6, 0.8, 1 / (1.6 * 0.8)])
    I1, I2 = np.array((x**2).sum()), np.array((x**-2.0).sum())
    _, U1, U2, U11, U12, U22 = material.derivatives(I1, I2)
    a, b, c = x**2
    D11 = 4 * (a + c) * (U1 + b * U2) + 4 * (a - c) ** 2 * (U11 + 2 * b * U12 + b**2 * U22)
    D22 = 4 * (b + c) * (U1 + a * U2) + 4 * (b - c) ** 2 * (U11 + 2 * a * U12 + a**2 * U22)
    D12 = 4 * c * U1 + 4 / c * U2 + 4 * (b - c) * (a - c) * (U11 + (a + b) * U12 + a * b * U22)
    np.testing.assert_allclose(drucker_matrix(material, x), [[D11, D12], [D12, D22]], rtol=1e-12)


@pytest.mark.parametrize("name", sorted(models()))
def test_margin_of_the_undeformed_body_is_two(name):
    model = models()[name]
    values = {c.name: (0.1 if c.linear else c.starts[0]) for c in model.constants()}
    assert float(drucker_margin(model.of(values), np.ones(3))) == pytest.approx(2.0)


@pytest.mark.parametrize("alpha", [-40.0, -21.3, 15.0, 40.0])
@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar"])
def test_a_margin_beside_far_larger_ones_has_all_its_digits(alpha, mode):
    """A convex energy is stable; the matrix of μ Σ λ^α has eigenvalues 10²⁰ times apart where the stretch is large.

    With H_a = 2μ λ_a^α its determinant is H₁H₂ + H₁H₃ + H₂H₃.
    """
    material = create("ogden-1", {"mu1": 0.1, "alpha1": alpha})
    stretches = principal_stretches(mode, np.linspace(0.3, 6.0, 40))
    H = 0.2 * stretches**alpha
    part = H[:, :2] + H[:, 2:]
    largest = 0.5 * (part.sum(axis=1) + np.hypot(part[:, 0] - part[:, 1], 2.0 * H[:, 2]))
    expected = (H[:, 0] * H[:, 1] + H[:, 0] * H[:, 2] + H[:, 1] * H[:, 2]) / largest / 0.1
    np.testing.assert_allclose(drucker_margin(material, stretches), expected, rtol=1e-9)
    assert stable_range(material, mode) == (0.3, 6.0)


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("tpu-0deg-mooney-rivlin-2", {}),
        ("mold-star-15-ogden", {}),
        ("tpu-0deg-mooney-rivlin-3", {}),
        ("dragon-skin-10-slow-neo-hookean", {}),
        ("dragon-skin-10-slow-ogden-2", {}),
        (
            "tpu-0deg-mooney-rivlin-5",
            {
                "uniaxial": {"compression": 0.83},
                "equibiaxial": {"tension": 1.10},
                "planar": {"compression": 0.82, "tension": 1.22},
            },
        ),
        (
            "tpu-0deg-mooney-rivlin-9",
            {
                "uniaxial": {"compression": 0.94, "tension": 1.13},
                "equibiaxial": {"compression": 0.94, "tension": 1.03},
                "planar": {"compression": 0.94, "tension": 1.06},
            },
        ),
    ],
)
def test_published_sets(name, lost):
    found = verdict(get(name))
    assert found.stable == (not lost)
    assert found.lost.keys() == lost.keys()
    for mode, places in lost.items():
        assert found.lost[mode] == pytest.approx(places, abs=0.006)


@pytest.mark.parametrize("name", ["dragon-skin-10-slow-mooney-rivlin", "tangoplus-mooney-rivlin"])
def test_negative_c01_is_lost_in_biaxial_tension(name):
    assert "tension" in verdict(get(name)).lost["equibiaxial"]


def test_loss_is_where_the_margin_vanishes():
    material = get("tpu-0deg-mooney-rivlin-5")
    _, high = stable_range(material, "equibiaxial")
    assert abs(float(drucker_margin(material, principal_stretches("equibiaxial", np.array(high))))) < 1e-9


def test_tension_covers_compression():
    """Uniaxial compression is equibiaxial tension: losses in one are found by tension in the other."""
    material = get("tpu-0deg-mooney-rivlin-5")
    low, _ = stable_range(material, "uniaxial")
    _, high = stable_range(material, "equibiaxial")
    assert low == pytest.approx(high**-2, rel=1e-6)
    assert stable_up_to(material, 0.999 * high)
    assert not stable_up_to(material, 1.001 * high)


def test_cancelling_constants_are_sensitive_to_their_digits():
    assert digit_sensitivity(get("tpu-0deg-mooney-rivlin-9"), 6.0, digits=5) > 1.0
    assert digit_sensitivity(get("tpu-0deg-mooney-rivlin-2"), 6.0, digits=5) < 1e-4


LOCKS = {
    "gent": {"mu": 0.1, "Jm": 1.0},
    "van-der-waals": {"mu": 0.1, "lambda_m": 2.0, "a": 0.2, "beta": 0.0},
    "extended-tube": {"Gc": 0.1, "delta": 0.7, "Ge": 0.1, "beta": 1.0},
}
"""Materials that lock, at these excesses of I1 over 3."""
EXCESS = {"gent": 1.0, "van-der-waals": 1.0, "extended-tube": 0.7**-2}


@pytest.mark.parametrize("name", LOCKS)
def test_a_material_locks_where_its_chains_are_at_their_end(name):
    material = create(name, LOCKS[name])
    found = locking(material)
    assert [(mode, *sorted(places)) for mode, places in found.items()] == [(m, "compression", "tension") for m in MODES]
    for mode, places in found.items():
        for stretch in places.values():
            excess = (principal_stretches(mode, np.array(stretch)) ** 2).sum() - 3.0
            assert excess == pytest.approx(EXCESS[name], rel=1e-9)
    assert verdict(material).locked == found
    assert stable_up_to(material, 6.0)
    assert locking(material, 0.95, 1.05) == {}
    assert locking(create("neo-hookean", {"C10": 0.1})) == {}


@pytest.mark.parametrize(
    "energy",
    [
        "-mu*Jm/2*log(1 - (I1 - 3)/Jm)",  # no value beyond
        "-mu*Jm/2*log(1 - (lambda1**2 + lambda2**2 + lambda3**2 - 3)/Jm)",
        "mu/2*(I1 - 3)/(1 - (I1 - 3)/Jm)",  # a pole, with values beyond that nothing comes to
        "mu/2*(I1 - 3)/(1 - (I1 - 3)/Jm)**2",
    ],
)
@pytest.mark.filterwarnings("error")
def test_an_energy_of_the_users_own_locks_as_the_packages_do(energy):
    constants = {"mu": {"unit": "MPa"}, "Jm": {"start": [1.0]}}
    kind = define_model({"name": "mine", "energy": energy, "constants": constants})
    material, gent = kind(mu=0.1, Jm=1.0), create("gent", LOCKS["gent"])
    assert verdict(material).stable
    assert str(verdict(material)) == str(verdict(gent))
    beyond = np.array([1.7, 3.0])
    assert np.all(np.isnan(material.uniaxial(beyond)))
    assert np.all(np.isposinf(material.principal(principal_stretches("uniaxial", beyond))[0]))
    assert np.all(np.isfinite(material.uniaxial(np.array([0.6, 1.0, 1.6]))))


@pytest.mark.parametrize(
    "energy",
    [
        "mu/200*(exp(100*(I1 - 3)) - 1)",
        "mu/200*(exp(100*(I2 - 3)) - 1)",
        "mu/40*(exp(20*(lambda1**2 + lambda2**2 + lambda3**2 - 3)) - 1)",
    ],
)
@pytest.mark.parametrize("mu", [0.05, 5.0])
@pytest.mark.filterwarnings("error")
def test_an_energy_that_overflows_locks_and_is_not_lost_just_before(energy, mu):
    material = define_model({"name": "mine", "energy": energy, "constants": {"mu": {"unit": "MPa"}}})(mu=mu)
    assert "tension" in locking(material)["equibiaxial"]
    assert verdict(material).stable


def test_an_energy_that_overflows_is_lost_where_it_falls():
    energy = "mu/2*(I1 - 3)*(1 + exp(100*(I1 - 3))*(5 - I1))"
    material = define_model({"name": "mine", "energy": energy, "constants": {"mu": {"unit": "MPa"}}})(mu=0.05)
    assert verdict(material).lost["uniaxial"]["tension"] < 2.0


@pytest.mark.parametrize("name", LOCKS)
@pytest.mark.parametrize("largest", [1.2, 2.0, 6.0])
def test_digits_are_judged_short_of_where_a_material_locks(name, largest):
    assert 1e-4 < digit_sensitivity(create(name, LOCKS[name]), largest) < 0.02


def test_verdict_says_it_in_words():
    locks = "stable in stretches 0.8–2; locks: uniaxial beyond 1.68, equibiaxial beyond 1.36, planar beyond 1.62"
    assert str(verdict(create("gent", LOCKS["gent"]), 0.8, 2.0)) == locks
    assert str(verdict(get("tpu-0deg-mooney-rivlin-2"))) == "stable in stretches 0.3–6"
    assert "equibiaxial beyond 1.1" in str(verdict(get("tpu-0deg-mooney-rivlin-5")))
