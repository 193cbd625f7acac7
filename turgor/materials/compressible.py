"""Compressible fits: the bulk modulus from volumetric tests, and all constants where lateral strain was measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.least_squares import FAR, Problem, Solution, bounds_of, central_difference, predict
from turgor.materials.measurement import MaterialTest

_ITERATIONS = 60
_FOUND = 1e-14
"""Change of the logarithm of a lateral stretch below which Newton's method has found it."""

_STARTS = (1.5, 5.0, 50.0)
"""Ratios of bulk to shear modulus from which compressible fits are searched."""

_LOADED = {"uniaxial": np.array([1.0, 0, 0]), "equibiaxial": np.array([1.0, 1, 0]), "planar": np.array([1.0, 0, 0])}
"""The directions that take the stretch of each mode."""

_FREE = {"uniaxial": np.array([0, 1.0, 1]), "equibiaxial": np.array([0, 0, 1.0]), "planar": np.array([0, 0, 1.0])}
"""Those in which it is free to contract."""


def fit_bulk_modulus(material: Hyperelastic, tests: Sequence[MaterialTest]) -> Hyperelastic:
    """Return the material with its bulk modulus fitted to volumetric tests; unchanged without any.

    The mean stress U'(J) is linear in K, so that the fit is K = Σ u s / Σ u² with u = U'/K.
    """
    if not tests:
        return material
    J = np.concatenate([test.stretch for test in tests])
    stress = np.concatenate([test.stress for test in tests])
    unit = dataclasses.replace(material.volumetric, bulk_modulus=1.0).pressure(J)
    K = float(unit @ stress / (unit @ unit))
    if not K > 0:
        raise InputError(
            "the volumetric test gives no positive bulk modulus", file=tests[0].file, expected="pressure with J < 1"
        )
    return dataclasses.replace(material, volumetric=dataclasses.replace(material.volumetric, bulk_modulus=K))


def free_response(material: Hyperelastic, mode: str, stretch: Array) -> tuple[Array, Array]:
    """Return lateral stretch and nominal stress of the compressible material whose other faces are free.

    Parameters
    ----------
    material
        Any material; its volumetric part is used.
    mode
        ``"uniaxial"``, ``"equibiaxial"`` or ``"planar"``.
    stretch
        Stretch in the direction of the load, ``(n,)``.

    Notes
    -----
    The lateral stress vanishes. Its root is found by Newton's method in the logarithm of the lateral stretch, from that
    of an incompressible material; bounds that close in on it halve what a step would leave.
    """
    along, free = _LOADED[mode], _FREE[mode]
    given = np.log(np.asarray(stretch, dtype=float))[:, None] * along
    lateral = -given.sum(axis=1) / free.sum()
    low, high = np.full_like(lateral, np.log(1e-3)), np.full_like(lateral, np.log(1e3))
    for _ in range(_ITERATIONS):
        stress, slope = _free_stress(material, given + lateral[:, None] * free, free)
        above = stress[:, 2] > 0.0
        low, high = np.where(above, low, lateral), np.where(above, lateral, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = lateral - stress[:, 2] / slope
        before, lateral = lateral, np.where((low <= newton) & (newton <= high), newton, 0.5 * (low + high))
        if np.abs(lateral - before).max(initial=0.0) <= _FOUND:
            break
    stress, _ = _free_stress(material, given + lateral[:, None] * free, free)
    return np.exp(lateral), stress[:, 0] / stretch


def _free_stress(material: Hyperelastic, logarithms: Array, free: Array) -> tuple[Array, Array]:
    """Return the principal Kirchhoff stresses ``(n, 3)``, and the derivative of the third as the `free` ones grow.

    By the logarithms of the stretches, ``(n, 3)``.
    """
    mean = logarithms.mean(axis=1, keepdims=True)
    J, bar = np.exp(3.0 * mean), np.exp(logarithms - mean)
    _, slope, curvature = material.principal(bar)
    stress, turned = bar * slope, free - free.mean()
    change = stress * turned + bar * (curvature @ (bar * turned)[..., None])[..., 0]
    volume = J * material.volumetric.pressure(J)
    growth = free.sum() * (volume + J**2 * material.volumetric.stiffness(J))
    total = stress - stress.mean(axis=1, keepdims=True) + volume
    return total, change[:, 2] - change.mean(axis=1) + growth[:, 0]


def fit_compressible(
    material: Hyperelastic, problem: Problem, *, in_proportion: bool = False
) -> tuple[Hyperelastic, Solution]:
    """Fit all constants and the bulk modulus to stress and lateral stretch together.

    Parameters
    ----------
    material
        The incompressible fit, the start.
    problem
        The tests; those without lateral stretch count by their stress alone, at the same compressibility.
    in_proportion
        Whether to fit only how large the moduli are, all by one factor, beside the bulk modulus: a material that was
        made to keep limits keeps them.

    Returns
    -------
    tuple
        The material, and the solution, whose Jacobian ends in a column for the logarithm of the bulk modulus.

    Raises
    ------
    InputError
        If the constants found are not those of a material.
    """
    fitted = _Lateral(material, problem)
    search = fitted.search_in_proportion if in_proportion else fitted.search
    values = min((search(ratio) for ratio in _STARTS), key=lambda x: float(np.sum(fitted.residual(x) ** 2)))
    found = fitted.material(values)
    found = dataclasses.replace(type(material).of(found.parameters), volumetric=found.volumetric)
    errors = np.concatenate([_response(found, test)[1] - test.stress for test in problem.tests])
    jacobian = np.column_stack([central_difference(fitted.residual, values, i) for i in range(len(values))])
    return found, Solution(values[:-1], errors, fitted.residuals(values), jacobian)


class _Lateral:
    """Residuals of stress and lateral stretch, relative to the largest, by the constants and the logarithm of K."""

    def __init__(self, material: Hyperelastic, problem: Problem) -> None:
        self.start, self.kind = material, type(material)
        self.constants = np.array(list(material.parameters.values()))
        self.bounds = bounds_of(self.kind, problem)
        counted = problem.of_counted
        self.parts = list(zip(counted.tests, counted.factors, counted.point_weights, strict=True))
        self.largest = max(float(np.abs(weights * test.stress).max()) for test, _, weights in self.parts)
        self.heaviest = max(problem.factors)

    def material(self, values: Array) -> Hyperelastic:
        trial = self.kind.trial(values[:-1].tolist())
        law = dataclasses.replace(self.start.volumetric, bulk_modulus=float(np.exp(values[-1])))
        object.__setattr__(trial, "volumetric", law)
        return trial

    def residuals(self, values: Array) -> tuple[Array, Array]:
        """Return those of the stress and those of the lateral stretch."""
        trial = self.material(values)
        of_stress, of_stretch = [], []
        for test, factor, weights in self.parts:
            lateral, stress = _response(trial, test)
            of_stress.append(weights / self.largest * (stress - test.stress))
            if test.lateral is not None and test.has_lateral:
                measured = np.isfinite(test.lateral)
                weight = factor / self.heaviest / float(np.ptp(test.lateral[measured]) or 1.0)
                of_stretch.append(weight * (lateral - test.lateral)[measured])
        return _finite(np.concatenate(of_stress)), _finite(np.concatenate(of_stretch))

    def residual(self, values: Array) -> Array:
        return np.concatenate(self.residuals(values))

    def search(self, ratio: float) -> Array:
        """Return the values found from the constants of the start and a bulk modulus of so many shear moduli."""
        scale = np.append(np.maximum(np.abs(self.constants), 1e-6), 1.0)
        low, high = np.vstack([self.bounds, [-np.inf, np.inf]]).T / scale
        start = np.clip(np.append(self.constants, np.log(ratio * self.start.shear_modulus)) / scale, low, high)
        return scale * _least(lambda x: self.residual(scale * x), start, (low, high))

    def search_in_proportion(self, ratio: float) -> Array:
        """Return the values found if the moduli change by one factor only."""
        linear = np.array([constant.linear for constant in self.kind.constants()])

        def values(x: Array) -> Array:
            return np.append(np.where(linear, np.exp(x[0]), 1.0) * self.constants, x[1])

        start = np.array([0.0, np.log(ratio * self.start.shear_modulus)])
        return values(_least(lambda x: self.residual(values(x)), start, (-np.inf, np.inf)))


def _least(residual: Callable[[Array], Array], start: Array, bounds: tuple[ArrayLike, ArrayLike]) -> Array:
    found = least_squares(residual, start, bounds=bounds, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return np.asarray(found.x, dtype=float)


def _finite(residual: Array) -> Array:
    return np.nan_to_num(residual, nan=FAR, posinf=FAR, neginf=-FAR)


def _response(material: Hyperelastic, test: MaterialTest) -> tuple[Array, Array]:
    if test.mode in _FREE:
        return free_response(material, test.mode, test.stretch)
    return np.ones_like(test.stretch), predict(material, test)
