"""Least squares of a model's constants to tests: linear where W is linear in them, variable projection elsewhere.

W of most models is linear in its moduli once the exponents and limits are held. The moduli are then eliminated by a
linear least-squares problem at every trial value of the others (variable projection, Golub and Pereyra 1973), so that
only one to four constants are searched for, from a fixed list of starts: the same data always give the same fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.measurement import MaterialTest

STARTS_POLISHED = 6
"""So many of the best starts are followed to their minimum."""

SCREENING_POINTS = 60
"""Starts are compared on so many points of each test."""

_TINY = 1e-300


def predict(material: Hyperelastic, test: MaterialTest) -> Array:
    """Return the nominal stress of the incompressible `material` at the stretches of a `test`, in MPa."""
    responses = {
        "uniaxial": material.uniaxial,
        "equibiaxial": material.equibiaxial,
        "planar": material.planar,
        "simple-shear": material.simple_shear,
    }
    return responses[test.mode](test.stretch)


@dataclass(frozen=True)
class Problem:
    """The tests of one fit with the weight of each of their points, ``sqrt(weight) / scale``."""

    tests: tuple[MaterialTest, ...]
    point_weights: tuple[Array, ...]

    @property
    def stress(self) -> Array:
        """Measured nominal stresses of all tests, one after the other."""
        return np.concatenate([test.stress for test in self.tests])

    @property
    def weights(self) -> Array:
        """Weights of all points."""
        return np.concatenate(self.point_weights)

    def prediction(self, material: Hyperelastic) -> Array:
        """Nominal stresses of `material` at all points, one test after the other."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.concatenate([predict(material, test) for test in self.tests])

    def thinned(self, points: int) -> Problem:
        """Return the problem with at most about `points` points of each test, evenly chosen."""
        tests, weights = [], []
        for test, weight in zip(self.tests, self.point_weights, strict=True):
            chosen = np.unique(np.linspace(0, len(test.stretch) - 1, points).astype(int))
            tests.append(MaterialTest(test.mode, test.stretch[chosen], test.stress[chosen]))
            weights.append(weight[chosen])
        return Problem(tuple(tests), tuple(weights))


@dataclass(frozen=True)
class Solution:
    """Constants in the model's order, the weighted cost, and the Jacobian of the stresses by the constants."""

    values: Array
    cost: float
    jacobian: Array


def solve(model: type[Hyperelastic], problem: Problem, *, nonnegative: bool = False) -> Solution:
    """Fit the constants of `model`.

    Parameters
    ----------
    model
        The class of material.
    problem
        Tests and weights.
    nonnegative
        Keep every modulus at or above zero.

    Raises
    ------
    InputError
        If the tests have fewer points than the model has constants.
    """
    constants = model.constants()
    if len(problem.stress) < len(constants):
        raise InputError(
            f"{model.name} has {len(constants)} constants, the tests have only {len(problem.stress)} points",
            key="models",
            expected="more points or a model with fewer constants",
        )
    linear = _Linear(model, problem, nonnegative)
    if not linear.searched:
        best: tuple[float, ...] = ()
    else:
        best = _search(model, problem, linear, nonnegative)
    values = linear.constants(np.array(best))
    residual = linear.weights * (linear.prediction(values) - linear.stress)
    return Solution(values, float(residual @ residual), _jacobian(model, problem, values, linear))


class _Linear:
    """The linear problem of the moduli at given values of the constants that are searched for."""

    def __init__(self, model: type[Hyperelastic], problem: Problem, nonnegative: bool) -> None:
        self.model, self.problem = model, problem
        constants = model.constants()
        self.moduli = [i for i, constant in enumerate(constants) if constant.linear]
        self.searched = [i for i, constant in enumerate(constants) if not constant.linear]
        self.lower = np.array([0.0 if nonnegative else constants[i].bounds[0] for i in self.moduli])
        self.stress, self.weights = problem.stress, problem.weights
        self.scale = float(np.linalg.norm(self.weights * self.stress)) or 1.0

    def prediction(self, values: Array) -> Array:
        return self.problem.prediction(self.model.trial(list(values)))

    def columns(self, searched: Array) -> Array:
        """Stresses per unit of each modulus, ``(points, moduli)``."""
        columns = []
        for i in self.moduli:
            values = np.zeros(len(self.moduli) + len(self.searched))
            values[self.searched] = searched
            values[i] = 1.0
            columns.append(self.prediction(values))
        return np.column_stack(columns)

    def solve(self, searched: Array) -> tuple[Array, Array]:
        """Return the best moduli and the weighted residual, relative to the norm of the weighted stress."""
        A = self.columns(searched) * (self.weights / self.scale)[:, None]
        y = self.weights * self.stress / self.scale
        if not np.all(np.isfinite(A)):
            return np.zeros(len(self.moduli)), np.full_like(y, 1e3)
        norms = np.maximum(np.linalg.norm(A, axis=0), _TINY)
        scaled = A / norms
        x = np.linalg.lstsq(scaled, y, rcond=None)[0]
        if np.any(x < self.lower * norms):
            x = lsq_linear(scaled, y, bounds=(self.lower * norms, np.inf), method="bvls").x
        return x / norms, scaled @ x - y

    def residual(self, searched: Array) -> Array:
        return self.solve(searched)[1]

    def constants(self, searched: Array) -> Array:
        values = np.zeros(len(self.moduli) + len(self.searched))
        values[self.searched] = searched
        values[self.moduli] = self.solve(searched)[0]
        return values


def _search(model: type[Hyperelastic], problem: Problem, linear: _Linear, nonnegative: bool) -> tuple[float, ...]:
    constants = model.constants()
    bounds = np.array([constants[i].bounds for i in linear.searched]).T
    coarse = _Linear(model, problem.thinned(SCREENING_POINTS), nonnegative)
    starts = model.starts()
    costs = [float(np.sum(coarse.residual(np.array(start)) ** 2)) for start in starts]
    chosen = [starts[i] for i in np.argsort(costs, kind="stable")[:STARTS_POLISHED]]
    minima = [_descend(coarse, start, bounds, 1e-8) for start in chosen]
    nearest = min(minima, key=lambda found: float(found.cost))
    polished = _descend(linear, nearest.x, bounds, 1e-15)
    return tuple(float(value) for value in polished.x)


def _descend(linear: _Linear, start: Sequence[float] | Array, bounds: Array, tolerance: float) -> OptimizeResult:
    inside = np.clip(start, bounds[0] + 1e-9 * np.abs(bounds[0]), bounds[1] - 1e-9 * np.abs(bounds[1]))
    return least_squares(
        linear.residual,
        inside,
        bounds=bounds,
        jac="3-point",
        x_scale=np.maximum(np.abs(inside), 0.1),
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=200,
    )


def _jacobian(model: type[Hyperelastic], problem: Problem, values: Array, linear: _Linear) -> Array:
    """Derivatives of the (unweighted) stresses by all constants, ``(points, constants)``."""
    J = np.empty((len(linear.stress), len(values)))
    J[:, linear.moduli] = linear.columns(values[linear.searched])
    for i in linear.searched:
        step = 1e-6 * max(abs(values[i]), 1e-2)
        up, down = values.copy(), values.copy()
        up[i] += step
        down[i] -= step
        J[:, i] = (linear.prediction(up) - linear.prediction(down)) / (2.0 * step)
    return J
