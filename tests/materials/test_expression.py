"""Models that a user writes as an expression."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.fem.supports import Prescribed, Sliding
from turgor.fem.system import System
from turgor.materials import create, expression, find_model
from turgor.materials.expression import define_model
from turgor.materials.fit import fit
from turgor.materials.measurement import MaterialTest
from turgor.mesh.structured import box
from turgor.solver.path import solve_path

HERE = Path(__file__).parent


def model(energy: str, **constants):
    return define_model({"name": "mine", "energy": energy, "constants": constants or {"mu": {"unit": "MPa"}}})


def test_known_models_come_out_the_same():
    yeoh = model("a*(I1-3) + b*(I1-3)**2", a={"unit": "MPa"}, b={"unit": "MPa"})
    written = yeoh(a=0.1, b=0.02)
    built = create("yeoh-2", {"C10": 0.1, "C20": 0.02})
    F = np.eye(3) + 0.3 * np.random.default_rng(0).standard_normal((5, 3, 3))
    F = F[np.linalg.det(F) > 0.2]
    np.testing.assert_allclose(written.tangent(F), built.tangent(F), rtol=1e-12, atol=1e-12)
    assert written.shear_modulus == pytest.approx(built.shear_modulus)
    ogden = model(
        "2*mu/alpha**2*(lambda1**alpha + lambda2**alpha + lambda3**alpha - 3)",
        mu={"unit": "MPa"},
        alpha={"start": [1, 3], "bounds": [0.1, 9]},
    )
    written, built = ogden(mu=0.1, alpha=3.3), create("ogden-1", {"mu1": 0.1, "alpha1": 3.3})
    np.testing.assert_allclose(written.tangent(F), built.tangent(F), rtol=1e-11, atol=1e-11)
    assert written.shear_modulus == pytest.approx(0.1)


ALPHA = {"mu": {"unit": "MPa"}, "alpha": {"start": [2.0]}}
MODULI = {"mu": {"unit": "MPa"}, "c": {"unit": "MPa"}}


def test_the_root_of_a_square_is_a_magnitude():
    """√((I₁ − 3)²) is I₁ − 3; at 5 there is a kink, and the stress of the part behind it has the opposite sign."""
    written = model("mu*sqrt((I1-3)**2)/2", mu={"unit": "MPa"})(mu=0.1)
    bent = model("mu*(I1-3)/2 + c*sqrt((I1-5)**2)", **MODULI)(mu=0.1, c=0.02)
    smooth = model("mu*(I1-3) + c*((I1-5)**2)**1.5", **MODULI)(mu=0.3, c=0.001)
    built = create("neo-hookean", {"C10": 0.05})
    F = np.stack([np.eye(3), np.diag([1.5, 0.8, 0.9]), np.diag([2.8, 0.6, 0.6])])
    np.testing.assert_allclose(written.tangent(F), built.tangent(F), rtol=1e-12, atol=1e-12)
    assert written.shear_modulus == pytest.approx(0.1)
    x = np.array([1.4, 2.5])  # I1 is 3.4 and 7.1
    share = np.array([0.05 - 0.02, 0.05 + 0.02])
    np.testing.assert_allclose(bent.uniaxial(x), 2.0 * share * (x - x**-2), rtol=1e-12)
    share = 0.3 + 0.003 * (lambda y: y * np.abs(y))(x**2 + 2.0 / x - 5.0)
    np.testing.assert_allclose(smooth.uniaxial(x), 2.0 * share * (x - x**-2), rtol=1e-12)
    assert np.all(np.isfinite(bent.tangent(F)))


M = "(lambda_m**2 - 3)"
ETA = f"sqrt((I1-3)/{M})"
ROUGH = {
    "power": ("mu/2*(I1-3) + c*(I1-3)**1.5", {}, {}),
    "exponent": ("mu/2*(I1-3) + c*(I1-3)**a", {"a": {"start": [1.5]}}, {"a": 1.5}),
    "other": ("mu/2*(I1-3) + c*(I2-3)**1.5 + 0*c", {}, {}),
    "logarithm": ("mu/2*(I1-3) + c*(I1-3)**2*log(I1-3)", {}, {}),
}
"""Energies without a second derivative, or without a value, at rest."""


@pytest.mark.parametrize("name", ROUGH)
def test_energies_that_are_rough_at_rest(name):
    energy, further, values = ROUGH[name]
    material = create(model(energy, **MODULI, **further), {"mu": 0.1, "c": 0.02, **values}, bulk_modulus=2.0)
    assert material.shear_modulus == pytest.approx(0.1, rel=1e-5)
    assert float(material.energy(np.eye(3))) == pytest.approx(0.0, abs=1e-20)
    assert np.abs(material.stress(np.eye(3))).max() < 1e-15
    linear = create("neo-hookean", {"C10": 0.05}, bulk_modulus=2.0).tangent(np.eye(3))
    np.testing.assert_allclose(material.tangent(np.eye(3)), linear, atol=1e-6)
    # From rest on, through where the guard begins, the tangent is the slope of the stress.
    direction = np.array([[0.3, 0.2, 0.0], [0.0, -0.5, 0.1], [0.4, 0.0, 0.2]])
    sizes = np.array([0.0, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2])[:, None, None]
    tangent, step = material.tangent(np.eye(3) + sizes * direction), 1e-6 + 1e-3 * sizes
    more, less = (material.stress(np.eye(3) + (sizes + side * step) * direction) for side in (1.0, -1.0))
    slope = (more - less) / (2.0 * step)
    np.testing.assert_allclose(np.einsum("nijkl,kl->nij", tangent, direction), slope, rtol=1e-6, atol=1e-6)


def test_the_van_der_waals_solid_comes_out_the_same_to_rest():
    constants = {"mu": {"unit": "MPa"}, "lambda_m": {"start": [5.0]}, "a": {"start": [0.2]}}
    energy = f"mu*(-{M}*(log(1 - {ETA}) + {ETA}) - 2/3*a*((I1-3)/2)**1.5)"
    written = model(energy, **constants)(mu=0.1, lambda_m=5.0, a=0.2)
    built = create("van-der-waals", {"mu": 0.1, "lambda_m": 5.0, "a": 0.2, "beta": 0.0})
    direction = np.array([[0.3, 0.2, 0.0], [0.0, -0.5, 0.1], [0.4, 0.0, 0.2]])
    F = np.eye(3) + np.array([0.0, 1e-8, 1e-6, 1e-4, 1e-2, 0.3])[:, None, None] * direction
    np.testing.assert_allclose(written.stress(F), built.stress(F), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(written.tangent(F), built.tangent(F), rtol=1e-6, atol=1e-6)


def test_a_body_of_a_rough_energy_is_stretched_from_rest():
    kind = model("mu/2*(I1-3) + c*(I1-3)**1.5", **MODULI)
    block, up = box((1.0, 1.0, 1.0), (1, 1, 1), "hex27"), [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    material = kind(mu=0.1, c=0.02)
    system = System(block, {"body": material}, [*up, Prescribed("z1", (None, None, 0.2))])
    state = solve_path(system, [1.0])[-1].state
    pull = system.forces(state)[0][block.points[:, 2] > 0.99, 2].sum()
    assert pull == pytest.approx(float(material.uniaxial(1.2)), rel=1e-3)


def test_constants_without_an_energy_are_refused():
    kind = model("2*mu/alpha**2*(lambda1**alpha + lambda2**alpha + lambda3**alpha - 3)", **ALPHA)
    with pytest.raises(InputError, match=r"mine give an initial shear modulus of nan"):
        kind(mu=0.1, alpha=0.0)


def test_functions_that_cannot_be_evaluated_are_refused_by_name(monkeypatch):
    monkeypatch.delitem(expression._EVALUATED, "DiracDelta")
    with pytest.raises(InputError, match=r"energy: .* hold DiracDelta"):
        model("mu*sqrt((I1-5)**2)")


def test_a_file_is_a_model_wherever_a_name_is():
    file = str(HERE / "user_invariants.yaml")
    material = create(file, {"a": "0.05 MPa", "b": "1e-5 MPa", "c": "0.02 MPa"}, poisson=0.45)
    assert material.name == "test-carroll"
    assert material.poisson_ratio == pytest.approx(0.45)
    assert float(material.energy(np.eye(3))) == pytest.approx(0.0, abs=1e-15)
    assert find_model(file)(a=0.05, b=1e-5, c=0.02).parameters == pytest.approx(material.parameters)


@pytest.mark.parametrize("name", ["user_invariants.yaml", "user_stretches.yaml"])
def test_fit_recovers_a_user_model(name):
    kind = find_model(str(HERE / name))
    values = {c.name: 0.05 / 30.0**i if c.linear else 3.1 for i, c in enumerate(kind.constants())}
    if name == "user_invariants.yaml":
        values = {"a": 0.05, "b": 2e-6, "c": 0.03}
    material = kind(**values)
    x = np.linspace(0.7, 3.0, 60)
    tests = [MaterialTest(mode, x, getattr(material, mode)(x)) for mode in ("uniaxial", "equibiaxial")]
    found = fit(tests, str(HERE / name)).fits[0]
    assert found.parameters == pytest.approx(values, rel=1e-6)


@pytest.mark.parametrize(
    "energy",
    [
        "__import__('os').system('touch /tmp/owned')",
        "mu*(I1-3) if I1 else mu",
        "mu*[I1][0]",
        "(lambda: mu*I1)()",
        "mu*I1.real",
        "mu*exp(I1, 2)",
        "mu*(I1-3) + True",
        "mu*I1**(9**9**9)",
        "mu*(I1-3); I1",
        "mu*(I1 -",
        "mu*I3",
        "mu*foo(I1)",
        "mu*(I1-3) + lambda1",
        "mu",
        "",
        "mu*I1" + "+mu*I1" * 400,
        "mu*(I1/0)",
        "mu*(I1-3)*sqrt(-2)",
        "mu*(I1-3)*log(0)",
        "I1 - 3",
        "mu**2*(I1-3)",
        "mu*(I1-3) + 1",
        "mu*(lambda1**2 + 2*lambda2**2 + lambda3**2 - 4)",
    ],
)
def test_anything_else_is_refused(energy):
    with pytest.raises(InputError, match=r"energy|deformation"):
        model(energy)


@pytest.mark.parametrize(
    "document",
    [
        None,
        [],
        {"name": "x"},
        {"name": "X y", "energy": "mu*I1", "constants": {"mu": {"unit": "MPa"}}},
        {"name": "x", "energy": "mu*I1", "constants": {}},
        {"name": "x", "energy": "mu*I1", "constants": {"mu": {"unit": "mm"}}},
        {"name": "x", "energy": "mu*I1", "constants": {"mu": {"unit": "MPa", "extra": 1}}},
        {"name": "x", "energy": "mu*I1", "constants": {"I1": {"unit": "MPa"}}},
        {"name": "x", "energy": "mu*I1**n", "constants": {"mu": {"unit": "MPa"}, "n": {"start": ["a"]}}},
        {"name": "x", "energy": "mu*I1**n", "constants": {"mu": {"unit": "MPa"}, "n": {"start": 5, "bounds": [0, 1]}}},
        {"name": "x", "energy": "mu*I1", "constants": {"mu": {"unit": "MPa"}, "k": {"unit": "MPa"}}},
        {"name": "x", "energy": "mu*I1+k-k", "constants": {"mu": {"unit": "MPa"}, "k": {"unit": "MPa"}}},
        {"name": "x", "energy": "mu*I1", "constants": {"mu": {"unit": "MPa"}}, "code": "import os"},
    ],
)
def test_wrong_documents(document):
    with pytest.raises(InputError):
        define_model(document)


@pytest.mark.parametrize(
    "name", ["density", "volumetric", "program", "name", "parameters", "shear_modulus", "exp", "I1", "lambda", "a-b", 3]
)
def test_constants_do_not_take_names_that_have_a_meaning(name):
    document = {"name": "x", "energy": "mu*(I1-3)", "constants": {"mu": {"unit": "MPa"}, name: {"unit": "MPa"}}}
    with pytest.raises(InputError, match="cannot be the name of a constant") as found:
        define_model(document)
    assert found.value.key == f"constants.{name}"


def test_wrong_files_are_named(tmp_path):
    file = tmp_path / "model.yaml"
    with pytest.raises(InputError, match=r"model\.yaml"):
        find_model(str(file))
    file.write_text("name: [")
    with pytest.raises(InputError, match=r"model.yaml.*YAML"):
        find_model(str(file))
    file.write_text("!!python/object/apply:os.system ['true']")
    with pytest.raises(InputError, match=r"model.yaml.*YAML"):
        find_model(str(file))
    file.write_text("name: x\nenergy: mu*I3\nconstants: {mu: {unit: MPa}}")
    with pytest.raises(InputError, match=r"model.yaml.*I3"):
        find_model(str(file))
