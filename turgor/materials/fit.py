"""Fits of material models to tests: constants, how well they match, and whether they are stable in use."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.least_squares import Problem, solve
from turgor.materials.measurement import MaterialTest
from turgor.materials.registry import find_model
from turgor.materials.registry import models as known_models
from turgor.materials.stability import Verdict, digit_sensitivity, principal_stretches, stable_up_to, verdict
from turgor.materials.testdata import read_tests

SENSITIVITY_LIMIT = 0.02
"""Rounding the constants to four digits may change the stress by so much of its largest value."""

BIAXIAL_RATIOS = (0.9, 2.0)
"""Equibiaxial over uniaxial stress at a stretch of 1.5: neo-Hookean 1.30, Treloar's natural rubber 1.47."""

Data = str | Path | MaterialTest


@dataclass(frozen=True)
class Fit:
    """One model fitted to the tests.

    ``rmse`` and ``residual_norm`` (√Σr²) are of the nominal stress in MPa over all points; ``r2`` is the coefficient
    of determination; ``stable`` says whether Drucker's inequality holds in tension and compression of all modes as
    far as the largest principal stretch of the tests; ``stability`` where it is lost at all.
    """

    model: str
    material: Hyperelastic | None
    parameters: dict[str, float]
    rmse: float
    residual_norm: float
    r2: float
    stable: bool
    stability: Verdict | None
    digit_sensitivity: float = np.inf
    biaxial_ratio: float = np.nan
    remark: str = ""

    @property
    def objections(self) -> tuple[str, ...]:
        """Why this fit should not be used, most serious first; empty if nothing speaks against it."""
        found = []
        if not self.stable:
            found.append("unstable in the range of the tests")
        if not self.digit_sensitivity < SENSITIVITY_LIMIT:
            found.append("its constants cancel each other: four digits do not fix its stress")
        low, high = BIAXIAL_RATIOS
        if not low <= self.biaxial_ratio <= high:
            found.append(
                f"its equibiaxial stress at a stretch of 1.5 is {self.biaxial_ratio:.2g} times the uniaxial one "
                f"(elastomers: {low:g} to {high:g})"
            )
        return tuple(found)

    def as_dict(self) -> dict[str, object]:
        """Return the fit in plain values, keys ending in their unit."""
        return {
            "model": self.model,
            "parameters": dict(self.parameters),
            "units": "MPa",
            "rmse_MPa": self.rmse,
            "residual_norm_MPa": self.residual_norm,
            "r2": self.r2,
            "stable": self.stable,
            "stability": str(self.stability) if self.stability else self.remark,
            "initial_shear_modulus_MPa": self.material.shear_modulus if self.material else None,
            "objections": list(self.objections),
            "remark": self.remark,
        }


@dataclass(frozen=True)
class FitReport:
    """Every fit of one set of tests, best first, and the one that is recommended."""

    fits: tuple[Fit, ...]
    recommended: str | None
    reason: str
    tests: tuple[MaterialTest, ...]
    strain_range: tuple[float, float] | None

    def __getitem__(self, model: str) -> Fit:
        """Return the fit of a model by its name."""
        return next(fit for fit in self.fits if fit.model == find_model(model).name)

    @property
    def best(self) -> Hyperelastic:
        """The material of the recommended fit.

        Raises
        ------
        InputError
            If no fit is stable in the range of the tests.
        """
        material = self[self.recommended].material if self.recommended else None
        if material is None:
            raise InputError(
                "none of these models gives a material that is stable in the range of the tests",
                key="models",
                value=", ".join(fit.model for fit in self.fits),
                file=self.tests[0].file or None,
                expected="other models (all tries every one) or a narrower strain range",
            )
        return material

    @property
    def data(self) -> dict[str, object]:
        """What was read, dropped and assumed, in plain values."""
        return {
            "tests": [test.as_dict() for test in self.tests],
            "strain_range": list(self.strain_range) if self.strain_range else None,
        }

    def as_dict(self) -> dict[str, object]:
        """Return everything in plain values, as ``turgor fit --json`` prints it."""
        return {
            "fits": [fit.as_dict() for fit in self.fits],
            "recommended": self.recommended,
            "reason": self.reason,
            "data": self.data,
        }


def fit(
    data: Data | Sequence[Data],
    models: str | Sequence[str] = "all",
    *,
    strain_range: str | tuple[float, float] | None = None,
) -> FitReport:
    """Fit material models to one or several tests by least squares of the nominal stress.

    Parameters
    ----------
    data
        Files or tests; several are fitted together.
    models
        Names of models, or ``"all"``.
    strain_range
        Engineering strains between which the tests are used: ``(0, 3)``, ``"0:3"`` or ``"0:300%"``.

    Returns
    -------
    FitReport
        The fits, best first, and the recommended one: the best that is stable in the range in use, if any.

    Raises
    ------
    InputError
        If the data, a name or the strain range is wrong.
    """
    kinds = _kinds(models)
    span = parse_strain_range(strain_range)
    tests = _tests(data)
    if span:
        tests = tuple(test.within(*span) for test in tests)
    problem = Problem(tests, tuple(np.ones_like(test.stress) for test in tests))
    fits = sorted((_fit_one(kind, problem) for kind in kinds), key=lambda found: found.residual_norm)
    best, reason = _recommend(fits)
    return FitReport(tuple(fits), best.model if best else None, reason, tests, span)


def _kinds(names: str | Sequence[str]) -> list[type[Hyperelastic]]:
    chosen = [names] if isinstance(names, str) else list(names)
    if not chosen:
        raise InputError("no model is named", key="models", expected="names of models, or all")
    if "all" in chosen:
        return list(known_models().values())
    return list(dict.fromkeys(find_model(name) for name in chosen))


def _tests(data: Data | Sequence[Data]) -> tuple[MaterialTest, ...]:
    items = [data] if isinstance(data, (str, Path, MaterialTest)) else list(data)
    tests: list[MaterialTest] = []
    for item in items:
        tests.extend([item] if isinstance(item, MaterialTest) else read_tests(item))
    if not tests:
        raise InputError("no test data are given", key="data", expected="at least one file")
    return tuple(tests)


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
    expected = "two strains such as 0:3 or 0:300%"
    if isinstance(text, str):
        match = _RANGE.fullmatch(text)
        if match is None:
            raise InputError("this is not a range of strain", key="strain range", value=text, expected=expected)
        percent = 0.01 if match["high_percent"] or match["low_percent"] else 1.0
        try:
            low = percent * float(match["low"]) if match["low"] else -np.inf
            high = percent * float(match["high"]) if match["high"] else np.inf
        except ValueError:
            raise InputError(
                "this is not a range of strain", key="strain range", value=text, expected=expected
            ) from None
    else:
        low, high = (float(value) for value in text)
    if not low < high:
        raise InputError("this range of strain is empty", key="strain range", value=text, expected=expected)
    return low, high


def _fit_one(kind: type[Hyperelastic], problem: Problem) -> Fit:
    solution = solve(kind, problem)
    parameters = {c.name: float(v) for c, v in zip(kind.constants(), solution.values, strict=True)}
    residual = problem.prediction(kind.trial(list(solution.values))) - problem.stress
    squares = float(residual @ residual)
    spread = float(np.sum((problem.stress - problem.stress.mean()) ** 2))
    try:
        material = kind.of(parameters)
        remark = ""
    except InputError as error:
        material, remark = None, str(error)
    largest = largest_stretch(problem.tests)
    return Fit(
        model=kind.name,
        material=material,
        parameters=parameters,
        rmse=float(np.sqrt(squares / len(residual))),
        residual_norm=float(np.sqrt(squares)),
        r2=1.0 - squares / spread if spread > 0 else float("nan"),
        stable=material is not None and stable_up_to(material, largest),
        stability=verdict(material) if material else None,
        digit_sensitivity=digit_sensitivity(material, largest) if material else np.inf,
        biaxial_ratio=float(material.equibiaxial(1.5) / material.uniaxial(1.5)) if material else np.nan,
        remark=remark,
    )


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


def _recommend(fits: Sequence[Fit]) -> tuple[Fit | None, str]:
    """Choose the best fit, preferring those that nothing speaks against; never an unstable one."""
    usable = [candidate for candidate in fits if candidate.stable]
    if not usable:
        return None, "no fit is stable in the range of the tests"
    best = min(usable, key=lambda candidate: (len(candidate.objections), candidate.residual_norm))
    reason = f"RMSE {best.rmse:.3g} MPa, stable as far as the tests go"
    passed_over = [f"{fit.model}: {fit.objections[0]}" for fit in fits if fit.residual_norm < best.residual_norm]
    if passed_over:
        reason += ". Closer to the data, but not recommended: " + "; ".join(passed_over)
    if best.objections:
        reason += ". Use with care: " + "; ".join(best.objections)
    return best, reason
