"""Fits of material models to tests: constants, how well they match, and whether they are stable in use."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.materials.compressible import fit_bulk_modulus, fit_compressible
from turgor.materials.fit_result import CONSTRAINED, Fit, FitReport, biaxial_ratios, recommend
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.inequalities import Limits
from turgor.materials.least_squares import Problem, Solution, solve
from turgor.materials.measurement import MaterialTest, Specimen
from turgor.materials.models.ogden import OgdenModel
from turgor.materials.registry import find_model
from turgor.materials.registry import models as known_models
from turgor.materials.stability import digit_sensitivity, principal_stretches, stable_up_to, verdict
from turgor.materials.statistics import statistics
from turgor.materials.testdata import read_tests

LOG = logger("materials")

Data = str | Path | MaterialTest
Model = str | type[Hyperelastic]

PLAUSIBLE_RATIOS = {1.5: (1.0, 1.5), 2.0: (0.95, 1.8)}
"""Equibiaxial over uniaxial stress, by stretch, that a constrained fit keeps where only uniaxial tension is known."""

SAMPLES_OF_STABILITY = (24, 200)
"""Stretches of each mode at which a constrained fit keeps stability; the finer ones where it is lost in between and
the model is linear, for that takes no time."""


def fit(
    data: Data | Sequence[Data],
    models: Model | Sequence[Model] = "all",
    *,
    strain_range: str | tuple[float, float] | None = None,
    error: Literal["absolute", "relative"] = "absolute",
    weights: Sequence[float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    stability: Literal["prefer", "require", "ignore"] = "prefer",
    stable_to: float | None = None,
    specimen: Specimen | None = None,
) -> FitReport:
    """Fit material models to one or several tests by least squares of the nominal stress.

    Parameters
    ----------
    data
        Files or tests; several are fitted together.
    models
        Names of models, files of user models (``*.yaml``), classes, or ``"all"``: every model of the package with no
        more constants than the tests have points; a warning says which are left out.
    strain_range
        Engineering strains between which the tests are used: ``(0, 3)``, ``"0:3"`` or ``"0:300%"``.
    error
        ``"absolute"``: every point counts by its residual in MPa; ``"relative"``: by residual over stress.
    weights
        One factor for each test, in the order of reading; its points count by its square. A test with 0 is shown,
        but nothing is fitted to it or counted of it.
    bounds
        Narrower bounds of constants by name, in MPa or as numbers, for every model that has them.
    stability
        ``"prefer"``: plain fits, and beside those that something speaks against, where that is quick, a constrained
        one; ``"require"``: every fit constrained to be stable; ``"ignore"``: plain fits only.
    stable_to
        The largest principal stretch to which the material must be stable; by default that of the tests.
    specimen
        What the files do not say: mode, dimensions, source of the strain.

    Returns
    -------
    FitReport
        The fits, best first, and the recommended one, if any is stable.

    Raises
    ------
    InputError
        If the data, a name or an option is wrong.
    """
    kinds, named = _kinds(models)
    span = parse_strain_range(strain_range)
    tests = _tests(data, specimen)
    mechanical = tuple(test for test in tests if test.mode != "volumetric")
    if span:
        mechanical = tuple(test.within(*span) for test in mechanical)
    if not mechanical:
        raise InputError("there is only a volumetric test", key="data", expected="a test that changes the shape")
    if error not in ("absolute", "relative"):
        raise InputError("unknown kind of error", key="error", value=error, expected="absolute or relative")
    problem = Problem(mechanical, _factors(mechanical, weights), error == "relative", dict(bounds or {}))
    stretch = largest_stretch(mechanical) if stable_to is None else stable_to
    if not 1.0 <= stretch < np.inf:
        raise InputError("this is no largest stretch", key="stable_to", value=stable_to, expected="a number from 1 up")
    volumetric = [test for test in tests if test.mode == "volumetric"]
    fits: list[Fit] = []
    left_out, remark = _left_out(kinds, named, problem)
    if remark:
        LOG.warning("%s", remark)
    for kind in kinds:
        if kind not in left_out:
            fits.extend(_fits_of(kind, problem, stability, stretch, volumetric))
    if not fits:
        raise InputError("no constants of these models keep the limits", key="models", expected="other models")
    fits.sort(key=lambda found: found.aic - 2.0 * len(found.parameters) if error == "relative" else found.residual_norm)
    largest = max(float(np.abs(test.stress).max()) for test in problem.counted)
    best, reason = recommend(fits, largest)
    reason += f". {remark.capitalize()}" if remark else ""
    return FitReport(tuple(fits), best.model if best else None, reason, mechanical + tuple(volumetric), span, error)


def _kinds(names: Model | Sequence[Model]) -> tuple[list[type[Hyperelastic]], set[type[Hyperelastic]]]:
    """Return the models to fit, and which of them were asked for by name."""
    chosen = [names] if isinstance(names, (str, type)) else list(names)
    if not chosen:
        raise InputError("no model is named", key="models", expected="names of models, or all")
    named = {name: find_model(name) for name in chosen if name != "all"}
    found: list[type[Hyperelastic]] = []
    for name in chosen:
        found.extend(known_models().values() if name == "all" else [named[name]])
    kinds = list(dict.fromkeys(found))
    called = [kind.name for kind in kinds]
    if twice := next((name for name in called if called.count(name) > 1), None):
        # A fit is known by the name of its model.
        expected = "models with a name of their own each, every one once"
        raise InputError("two of the models have the same name", key="models", value=twice, expected=expected)
    return kinds, set(named.values())


def _left_out(
    kinds: Sequence[type[Hyperelastic]], named: set[type[Hyperelastic]], problem: Problem
) -> tuple[list[type[Hyperelastic]], str]:
    """Return the models that nobody named and that have more constants than the tests points, and what says so."""
    points = len(problem.of_counted.stress)
    many = [kind for kind in kinds if kind not in named and len(kind.constants()) > points]
    listing = ", ".join(f"{kind.name} ({len(kind.constants())} constants)" for kind in many)
    return many, f"models left out, for the tests have only {points} points: {listing}" if many else ""


def _tests(data: Data | Sequence[Data], specimen: Specimen | None) -> tuple[MaterialTest, ...]:
    items = [data] if isinstance(data, (str, Path, MaterialTest)) else list(data)
    tests: list[MaterialTest] = []
    for item in items:
        tests.extend([item] if isinstance(item, MaterialTest) else read_tests(item, specimen))
    if not tests:
        raise InputError("no test data are given", key="data", expected="at least one file")
    for test in tests:
        if not len(test.stretch):
            raise InputError("a test without points", file=test.file or None, key="data", expected="some points")
    return tuple(test.doubted for test in tests)


def _factors(tests: Sequence[MaterialTest], weights: Sequence[float] | None) -> tuple[float, ...]:
    factors = tuple(1.0 for _ in tests) if weights is None else tuple(float(weight) for weight in weights)
    if len(factors) != len(tests) or not all(0 <= f < np.inf for f in factors) or not any(factors):
        expected = f"{len(tests)} numbers, one for each test, none negative"
        raise InputError("these weights do not fit the tests", key="weights", value=weights, expected=expected)
    return factors


_RANGE = re.compile(r"\s*(?P<low>[^:]*?)\s*(?P<low_percent>%?)\s*:\s*(?P<high>[^:]*?)\s*(?P<high_percent>%?)\s*")


def parse_strain_range(text: str | tuple[float, float] | None) -> tuple[float, float] | None:
    """Read a range of engineering strain: ``"0:3"``, ``"0:300%"``, ``":2"`` or a pair of numbers.

    Raises
    ------
    InputError
        If it is not a range, or is empty.
    """
    if text is None:
        return None
    wrong = InputError(
        "this is not a range of strain", key="strain range", value=text, expected="two strains such as 0:3 or 0:300%"
    )
    if isinstance(text, str):
        match = _RANGE.fullmatch(text)
        if match is None:
            raise wrong
        percent = 0.01 if match["high_percent"] or match["low_percent"] else 1.0
        try:
            low = percent * float(match["low"]) if match["low"] else -np.inf
            high = percent * float(match["high"]) if match["high"] else np.inf
        except ValueError:
            raise wrong from None
    else:
        low, high = (float(value) for value in text)
    if not low < high:
        raise InputError("this range of strain is empty", key="strain range", value=text)
    return low, high


def largest_stretch(tests: Sequence[MaterialTest]) -> float:
    """Return the largest principal stretch that any of the tests reaches."""
    largest = 1.0
    for test in tests:
        if test.mode == "simple-shear":
            gamma = float(np.abs(test.stretch).max())
            largest = max(largest, 0.5 * (gamma + np.sqrt(gamma**2 + 4.0)))
        elif test.mode != "volumetric":
            largest = max(largest, float(principal_stretches(test.mode, test.stretch).max()))
    return largest


def _fits_of(
    kind: type[Hyperelastic], problem: Problem, stability: str, stretch: float, volumetric: Sequence[MaterialTest]
) -> list[Fit]:
    """Fit one model, plainly or constrained or both."""
    if stability not in ("prefer", "require", "ignore"):
        expected = "prefer, require or ignore"
        raise InputError("unknown choice", key="stability", value=stability, expected=expected)
    biaxial_measured = any(test.mode in ("equibiaxial", "planar") for test in problem.counted)
    found = []
    if stability != "require":
        plain = solve(kind, problem)
        if plain is not None:
            found.append(_judged(kind, problem, plain, stretch, volumetric, constrained=False))
    searched = sum(not constant.linear for constant in kind.constants())
    # Limits do not move a single modulus: they do not depend on its size. Linear models are constrained in no time; the
    # two terms of Ogden's, which fit most rubbers, are worth a second.
    several = len(kind.constants()) - searched > 1
    quick = several and (not searched or (issubclass(kind, OgdenModel) and searched <= 2))
    wanted = stability == "require" or (stability == "prefer" and quick and found and found[0].objections)
    if wanted:
        ratios = {} if biaxial_measured else PLAUSIBLE_RATIOS
        for samples in SAMPLES_OF_STABILITY:
            kept = solve(kind, problem, Limits(stretch, biaxial=ratios, samples=samples))
            judged = None if kept is None else _judged(kind, problem, kept, stretch, volumetric, constrained=True)
            if judged is None or judged.stable or (searched and stability == "prefer"):
                break
        if judged is not None and judged.stable:
            found.append(judged)
    return found


def _judged(
    kind: type[Hyperelastic],
    problem: Problem,
    solution: Solution,
    stretch: float,
    volumetric: Sequence[MaterialTest],
    *,
    constrained: bool,
) -> Fit:
    """Turn constants into a fit with its numbers and verdicts."""
    remark = ""
    material: Hyperelastic | None = None
    try:
        found = fit_bulk_modulus(kind.of(_named(kind, solution)), volumetric)
        if any(test.has_lateral for test in problem.counted):
            found, solution = fit_compressible(found, problem, in_proportion=constrained)
            remark = f"compressible, fitted to the lateral strain: Poisson's ratio {found.poisson_ratio:.4g}"
        material = found
    except InputError as wrong:
        remark = str(wrong)
    parameters = _named(kind, solution)
    counts = problem.weights > 0
    residual, stress = solution.residual[counts], problem.stress[counts]
    squares = float(residual @ residual)
    spread = float(np.sum((stress - stress.mean()) ** 2))
    size = float(np.linalg.norm(stress))
    numbers = statistics(solution.jacobian, solution.weighted)
    n = len(parameters)  # the bulk modulus, where it was fitted too, comes behind them
    intervals = zip(parameters.items(), numbers.half_widths[:n].tolist(), strict=True)
    return Fit(
        model=kind.name + (CONSTRAINED if constrained else ""),
        material=material,
        parameters=parameters,
        units={constant.name: constant.unit for constant in kind.constants()},
        rmse=float(np.sqrt(squares / len(residual))),
        residual_norm=float(np.sqrt(squares)),
        relative_rmse=float(np.sqrt(squares)) / size if size > 0 else float("nan"),
        r2=1.0 - squares / spread if spread > 0 else float("nan"),
        aic=numbers.aic,
        bic=numbers.bic,
        stable=material is not None and stable_up_to(material, stretch),
        stability=verdict(material) if material else None,
        confidence={} if constrained else {name: (v - half, v + half) for (name, v), half in intervals},
        correlation=numbers.correlation[:n, :n],
        digit_sensitivity=digit_sensitivity(material, largest_stretch(problem.tests)) if material else np.inf,
        biaxial_ratios=biaxial_ratios(material) if material else {},
        biaxial_measured=any(test.mode == "equibiaxial" for test in problem.counted),
        remark=remark,
    )


def _named(kind: type[Hyperelastic], solution: Solution) -> dict[str, float]:
    return {c.name: float(v) for c, v in zip(kind.constants(), solution.values, strict=True)}
