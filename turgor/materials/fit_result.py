"""What a fit gives back: every model with its numbers, the recommended one, and the band that good fits span."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.measurement import MaterialTest
from turgor.materials.registry import find_model
from turgor.materials.stability import Verdict

CONSTRAINED = " (constrained)"
"""What the label of a fit ends in that was made to keep the limits."""

SENSITIVITY_LIMIT = 0.03
"""Rounding the constants to four digits may change the stress by so much of its largest value."""

BIAXIAL_RATIOS = {1.5: (0.9, 2.0), 2.0: (0.85, 2.2)}
"""Equibiaxial over uniaxial stress of elastomers by stretch: neo-Hookean 1.30 and 1.13, Treloar's rubber 1.47 both."""

GOOD_ENOUGH = 0.0045
"""RMSE relative to the largest stress below which fewer constants are worth more than a closer fit: batches of the
same elastomer differ by 10 % and more."""

LEAST_R2 = 0.5
"""A fit that explains less of the tests' variance does not follow them."""

CLOSE_TO_BEST = 1.35
"""RMSE relative to the best usable fit's below which fewer constants are worth more than a closer fit."""

_BAND_RMSE = 0.02
"""Usable fits whose RMSE is below so much of the largest stress, or twice the best one's, span the band."""


@dataclass(frozen=True)
class Fit:
    """One model fitted to the tests.

    Attributes
    ----------
    model
        Printed name, followed by ``" (constrained)"`` where the fit was made to keep the limits.
    material
        The fitted material, ``None`` where its initial shear modulus is not positive.
    units
        Constant → the unit of its value, empty for a pure number.
    rmse, residual_norm
        Of the nominal stress over all points, MPa; the norm is √Σr².
    relative_rmse
        √(Σr²/Σs²): the RMSE over the root mean square of the measured stress.
    r2
        Coefficient of determination.
    aic, bic
        Akaike's and the Bayesian information criterion of the least-squares cost.
    confidence
        95 % intervals of the constants, linearised; empty for constrained fits.
    correlation
        Of the constants' errors, ``(constants, constants)``.
    stable
        Drucker's inequality holds in tension and compression of all modes as far as the largest principal stretch
        of the tests; ``stability`` says where it is lost at all.
    """

    model: str
    material: Hyperelastic | None
    parameters: dict[str, float]
    rmse: float
    residual_norm: float
    relative_rmse: float
    r2: float
    aic: float
    bic: float
    stable: bool
    stability: Verdict | None
    units: Mapping[str, str] = field(default_factory=dict)
    confidence: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    correlation: Array = field(default_factory=lambda: np.zeros((0, 0)))
    digit_sensitivity: float = np.inf
    biaxial_ratios: Mapping[float, float] = field(default_factory=dict)
    biaxial_measured: bool = False
    remark: str = ""

    @property
    def constrained(self) -> bool:
        """Whether the fit was made to keep the limits."""
        return self.model.endswith(CONSTRAINED)

    @property
    def objections(self) -> tuple[str, ...]:
        """Why this fit should not be used, most serious first; empty if nothing speaks against it."""
        found = []
        if not self.stable:
            found.append("unstable in the range of the tests")
        if not self.digit_sensitivity < SENSITIVITY_LIMIT:
            found.append("its constants cancel each other: four digits do not fix its stress")
        if not self.biaxial_measured:
            found += implausible_ratios(self.biaxial_ratios)[:1]
        return tuple(found)

    @property
    def biaxial_ratio(self) -> float:
        """Equibiaxial over uniaxial nominal stress at a stretch of 1.5."""
        return self.biaxial_ratios.get(1.5, np.nan)

    def as_dict(self) -> dict[str, object]:
        """Return the fit in plain values, keys ending in their unit; what is not finite is ``None``.

        ``units`` is the unit of all constants that have one, ``parameter_units`` that of each, empty for a pure number.
        """
        return {
            "model": self.model,
            "parameters": dict(self.parameters),
            "units": "MPa",
            "parameter_units": dict(self.units),
            "rmse_MPa": self.rmse,
            "residual_norm_MPa": self.residual_norm,
            "relative_rmse": _finite(self.relative_rmse),
            "r2": _finite(self.r2),
            "aic": _finite(self.aic),
            "bic": _finite(self.bic),
            "confidence_95": {name: [_finite(low), _finite(high)] for name, (low, high) in self.confidence.items()},
            "correlation": [[_finite(value) for value in row] for row in self.correlation.tolist()],
            "stable": self.stable,
            "stability": str(self.stability) if self.stability else self.remark,
            "initial_shear_modulus_MPa": self.material.shear_modulus if self.material else None,
            "bulk_modulus_MPa": self.material.bulk_modulus if self.material else None,
            "poisson_ratio": self.material.poisson_ratio if self.material else None,
            "digit_sensitivity": _finite(self.digit_sensitivity),
            "biaxial_ratio": _finite(self.biaxial_ratio),
            "constrained": self.constrained,
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
    strain_range: tuple[float, float] | None = None
    error: str = "absolute"

    def __getitem__(self, model: str) -> Fit:
        """Return the fit of a model by its name or label."""
        for found in self.fits:
            if found.model == model:
                return found
        name = find_model(model).name
        for found in self.fits:
            if found.model in (name, name + CONSTRAINED):
                return found
        raise InputError("this model was not fitted", key="models", value=model)

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
    def measured_volume(self) -> bool:
        """Whether a test tells how the volume changes, so that the bulk modulus is fitted too."""
        return any(test.mode == "volumetric" or test.has_lateral for test in self.tests)

    @property
    def largest_stress(self) -> float:
        """Largest measured nominal stress in MPa."""
        return max(float(np.abs(test.stress).max()) for test in self.tests)

    @property
    def good(self) -> tuple[Fit, ...]:
        """The fits that nothing speaks against and that the tests alone hardly tell apart."""
        usable = [fit for fit in self.fits if not fit.objections]
        if not usable:
            return ()
        limit = max(2.0 * min(fit.rmse for fit in usable), _BAND_RMSE * self.largest_stress)
        return tuple(fit for fit in usable if fit.rmse <= limit)

    def band(self, mode: str, stretch: ArrayLike) -> tuple[Array, Array]:
        """Return the least and the largest nominal stress that the good fits predict in a mode.

        Parameters
        ----------
        mode
            ``"uniaxial"``, ``"equibiaxial"`` or ``"planar"``.
        stretch
            Stretches, ``(n,)``.
        """
        x = np.asarray(stretch, dtype=float)
        with np.errstate(over="ignore", invalid="ignore"):
            curves = [_response(fit.material, mode)(x) for fit in self.good if fit.material is not None]
        if not curves:
            return np.full_like(x, np.nan), np.full_like(x, np.nan)
        # A material beyond its locking stretch has no stress (NaN): fmin and fmax leave it out.
        return np.fmin.reduce(curves), np.fmax.reduce(curves)

    @property
    def data(self) -> dict[str, object]:
        """What was read, dropped and assumed, in plain values."""
        return {
            "tests": [test.as_dict() for test in self.tests],
            "strain_range": [_finite(end) for end in self.strain_range] if self.strain_range else None,
            "error": self.error,
        }

    def as_dict(self) -> dict[str, object]:
        """Return everything in plain values, as ``turgor fit --json`` prints it."""
        stretches = (1.25, 1.5, 2.0, 2.5, 3.0)
        bands = {}
        for mode in ("equibiaxial", "planar"):
            low, high = self.band(mode, stretches)
            bands[mode] = {
                "stretch": list(stretches),
                "low_MPa": [_finite(value) for value in low.tolist()],
                "high_MPa": [_finite(value) for value in high.tolist()],
            }
        return {
            "fits": [fit.as_dict() for fit in self.fits],
            "recommended": self.recommended,
            "reason": self.reason,
            "band_of_good_fits": bands,
            "data": self.data,
        }


def biaxial_ratios(material: Hyperelastic) -> dict[float, float]:
    """Return equibiaxial over uniaxial nominal stress at the stretches of :data:`BIAXIAL_RATIOS`."""
    with np.errstate(over="ignore", invalid="ignore"):
        return {x: float(material.equibiaxial(x) / material.uniaxial(x)) for x in BIAXIAL_RATIOS}


def implausible_ratios(ratios: Mapping[float, float]) -> list[str]:
    """Say of each ratio outside :data:`BIAXIAL_RATIOS` what is wrong with it; a locked material (NaN) passes."""
    return [
        f"its equibiaxial stress at a stretch of {x:g} is {ratio:.2g} times the uniaxial one "
        f"(elastomers: {BIAXIAL_RATIOS[x][0]:g} to {BIAXIAL_RATIOS[x][1]:g})"
        for x, ratio in ratios.items()
        if ratio < BIAXIAL_RATIOS[x][0] or ratio > BIAXIAL_RATIOS[x][1]
    ]


def _response(material: Hyperelastic, mode: str) -> Callable[[ArrayLike], Array]:
    return {"uniaxial": material.uniaxial, "equibiaxial": material.equibiaxial, "planar": material.planar}[mode]


def recommend(fits: Sequence[Fit], largest_stress: float) -> tuple[Fit | None, str]:
    """Choose among `fits`, never an unstable one, and say why.

    Nothing must speak against the choice, if that can be had. Of the fits whose RMSE is below
    :data:`GOOD_ENOUGH` of the largest stress, the one with the fewest constants; if there is none, of those below
    :data:`CLOSE_TO_BEST` times the best one's.
    """
    usable = [fit for fit in fits if fit.stable and fit.r2 > LEAST_R2]
    if not usable:
        return None, "no fit that is stable in the range of the tests follows them"
    fewest = min(len(fit.objections) for fit in usable)
    usable = [fit for fit in usable if len(fit.objections) == fewest]
    closest = min(fit.rmse for fit in usable)
    enough = GOOD_ENOUGH * largest_stress
    limit = enough if closest <= enough else CLOSE_TO_BEST * closest
    close = [fit for fit in usable if fit.rmse <= limit]
    best = min(close, key=lambda fit: (len(fit.parameters), fit.constrained, fit.rmse))
    reason = "the fewest constants of the usable fits that are close to the data"
    reason = (
        f"{best.model}: {reason}; RMSE {best.rmse:.3g} MPa ({best.rmse / largest_stress:.2%} of the largest stress), "
        "stable as far as the tests go"
    )
    passed_over = [f"{fit.model}: {fit.objections[0]}" for fit in fits if fit.rmse < best.rmse and fit.objections]
    if passed_over:
        reason += ". Closer to the data, but not to be used: " + "; ".join(passed_over)
    if best.objections:
        reason += ". Use with care: " + "; ".join(best.objections)
    return best, reason


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
