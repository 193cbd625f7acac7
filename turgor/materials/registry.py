"""The models by name, and materials made from a name and its constants."""

from __future__ import annotations

import dataclasses
import functools
import importlib
import inspect
import math
import pkgutil
from collections.abc import Mapping
from difflib import get_close_matches

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.materials import models as package
from turgor.materials.expression import load_model
from turgor.materials.hyperelastic import Constant, Hyperelastic
from turgor.materials.models.ogden import OgdenModel
from turgor.materials.volumetric import LAWS, bulk_modulus_from

CONVENTIONS: dict[str, str] = {"abaqus": "W = Σ 2 μ/α² (Σ λ^α − 3)", "ogden": "W = Σ μ/α (Σ λ^α − 3)"}
"""The two ways in which Ogden's constants are printed."""


@functools.cache
def models() -> dict[str, type[Hyperelastic]]:
    """Return every model by its printed name, in the order of their files and lines.

    A model is found by itself: a class with a ``name`` in a file of ``turgor/materials/models``.
    """
    found: dict[str, type[Hyperelastic]] = {}
    for module_info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{module_info.name}")
        for _, member in inspect.getmembers(module, inspect.isclass):
            if issubclass(member, Hyperelastic) and member.name and member.__module__ == module.__name__:
                assert member.name not in found, f"two models are called {member.name}"
                found[member.name] = member
    return found


def is_model_file(name: str) -> bool:
    """Say whether the name of a model is the path of a file that holds one."""
    return str(name).endswith((".yaml", ".yml"))


def find_model(name: str | type[Hyperelastic]) -> type[Hyperelastic]:
    """Return the model that is called `name`, has it among its aliases, or is written in the file `name` (``*.yaml``).

    A model itself is returned as it is.

    Raises
    ------
    InputError
        If there is none; the message suggests near names.
    """
    if isinstance(name, type):
        return name
    if is_model_file(name):
        return load_model(name)
    for model in models().values():
        if name == model.name or name in model.aliases:
            return model
    near = get_close_matches(str(name), models(), n=3)
    expected = " or ".join(near) if near else "one of " + ", ".join(models())
    raise InputError("there is no material model of this name", key="model", value=name, expected=expected)


def create(
    model: str | type[Hyperelastic],
    constants: Mapping[str, object],
    *,
    bulk_modulus: object = None,
    D1: object = None,
    poisson: object = None,
    volumetric: str = "quadratic",
    density: object = None,
    convention: str | None = None,
) -> Hyperelastic:
    """Make a material from the name of its model and its constants.

    Parameters
    ----------
    model
        Printed name, such as ``"ogden-2"``, the file of a user's model, or a class.
    constants
        Every constant of the model by name: text with its unit (``"0.07 MPa"``) or a float in the internal unit.
    bulk_modulus, D1, poisson
        At most one: K (pressure), D1 = 2/K (compliance) or Poisson's ratio. Without any of them the material is
        nearly incompressible, K = 1e4 μ.
    volumetric
        Name of the volumetric law, ``"quadratic"`` or ``"logarithmic"``.
    density
        Mass per reference volume, text with unit or t/mm³.
    convention
        For Ogden's models, how the constants are printed: ``"abaqus"`` (the default), W = Σ 2 μ/α² (Σ λ^α − 3), or
        ``"ogden"``, W = Σ μ/α (Σ λ^α − 3).

    Raises
    ------
    InputError
        If the model is unknown, a constant is missing, unknown or has a wrong unit, or the initial shear modulus
        is not positive.
    """
    kind = find_model(model)
    values = _read_constants(kind, constants)
    K = _read(bulk_modulus, "pressure", "bulk_modulus")
    d1 = _read(D1, "compliance", "D1")
    nu = _read(poisson, "number", "poisson")
    rho = _read(density, "density", "density")
    if volumetric not in LAWS:
        raise InputError("unknown volumetric law", key="volumetric", value=volumetric, expected=" or ".join(LAWS))
    if convention is not None:
        _check_convention(kind, convention)
    if issubclass(kind, OgdenModel):
        values = _abaqus_form(kind, values, convention)
    material = dataclasses.replace(kind.of(values), density=rho)
    bulk = bulk_modulus_from(material.shear_modulus, bulk_modulus=K, D1=d1, poisson=nu)
    return dataclasses.replace(material, volumetric=LAWS[volumetric](bulk))


def _read_constants(kind: type[Hyperelastic], constants: Mapping[str, object]) -> dict[str, float]:
    wanted = {constant.name: constant for constant in kind.constants()}
    listing = ", ".join(f"{c.name} [{c.unit}]" if c.unit else c.name for c in wanted.values())
    missing = [name for name in wanted if name not in constants]
    unknown = [str(name) for name in constants if name not in wanted]
    if unknown:
        raise InputError(f"{kind.name} has no such constant", key=", ".join(unknown), expected=listing)
    if missing:
        raise InputError(f"a constant of {kind.name} is missing", key=", ".join(missing), expected=listing)
    return {name: _constant(constants[name], constant) for name, constant in wanted.items()}


def _constant(value: object, constant: Constant) -> float:
    number = _read(value, constant.dimension, constant.name)
    if number is None:
        raise InputError("this constant has no value", key=constant.name)
    return number


def _read(value: object, dimension: str, key: str) -> float | None:
    """Return a quantity as an internal float; text carries its unit, a float is internal already."""
    if value is None:
        return None
    if isinstance(value, bool):
        raise InputError("this is not a number", key=key, value=value)
    if isinstance(value, (int, float)):
        number = float(value)
    elif dimension == "number":
        try:
            number = float(str(value))
        except ValueError:
            raise InputError("this is not a number", key=key, value=value, expected="a number without unit") from None
    else:
        number = to_internal(value, dimension, key=key)
    if not math.isfinite(number):
        raise InputError("the number is not finite", key=key, value=value)
    return number


def _check_convention(kind: type[Hyperelastic], convention: str) -> None:
    if not issubclass(kind, OgdenModel):
        raise InputError("only Ogden's models have a convention", key="convention", value=convention)
    if convention not in CONVENTIONS:
        expected = " or ".join(f"'{name}' ({formula})" for name, formula in CONVENTIONS.items())
        raise InputError("unknown convention", key="convention", value=convention, expected=expected)


def _abaqus_form(kind: type[OgdenModel], values: dict[str, float], convention: str | None) -> dict[str, float]:
    """Return Ogden constants in Abaqus's convention; refuse a reading whose initial shear modulus is not positive."""
    readings = {"abaqus": dict(values), "ogden": dict(values)}
    for i in range(1, kind.terms + 1):
        readings["ogden"][f"mu{i}"] *= values[f"alpha{i}"] / 2.0
    chosen = convention or "abaqus"
    trials = {name: kind.trial(list(reading.values())) for name, reading in readings.items()}
    if trials[chosen].shear_modulus <= 0 and all(values[f"alpha{i}"] for i in range(1, kind.terms + 1)):
        at_double = "; ".join(
            f"read as '{name}', {CONVENTIONS[name]}: μ = {trial.shear_modulus:.4g} MPa and "
            f"{float(trial.uniaxial(2.0)):.4g} MPa at 100 % strain"
            for name, trial in trials.items()
        )
        raise InputError(
            f"these constants of {kind.name}, read in the convention '{chosen}', give an initial shear modulus that is "
            f"not positive",
            key="convention",
            expected=f"the convention in which they are printed ({at_double})",
        )
    return readings[chosen]
