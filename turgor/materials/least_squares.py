"""Least squares of a model's constants to tests: linear where W is linear in them, variable projection elsewhere.

W of most models is linear in its moduli once the exponents and limits are held. The moduli are then eliminated by a
linear least-squares problem at every trial value of the others (variable projection, Golub and Pereyra 1973), so that
only one to four constants are searched for, from a fixed list of starts: the same data always give the same fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.inequalities import Limits
from turgor.materials.kinematics import Array
from turgor.materials.measurement import MaterialTest

STARTS_FOLLOWED = 10
"""So many of the best starts are followed to a minimum on the thinned tests (fewer where limits make that slow)."""

STARTS_LIMITED = 6

MINIMA_POLISHED = 3
"""So many of the best minima are followed on all points."""

SCREENING_POINTS = 40
"""Starts are compared on so many points of each test."""

RELATIVE_FLOOR = 0.02
"""With relative error, stresses below so much of a test's largest are weighted as if they were that large."""

_TINY = 1e-300
FAR = 1e3
"""Residual of a trial that has no finite stress or keeps no limit, relative to the measured stress."""


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
    """The tests of one fit and how much each counts: Σ (weight · residual)² of their points is made least.

    Attributes
    ----------
    tests
        Tests with a stress, at least one.
    factors
        What the weights of each test's points are multiplied by; a test with 0 does not count at all.
    relative
        Whether a point counts by its residual over its stress instead of by its residual.
    bounds
        Narrower bounds of the constants of any model by name.
    """

    tests: tuple[MaterialTest, ...]
    factors: tuple[float, ...]
    relative: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def counted(self) -> tuple[MaterialTest, ...]:
        """The tests that count."""
        return tuple(test for test, factor in zip(self.tests, self.factors, strict=True) if factor > 0)

    @property
    def of_counted(self) -> Problem:
        """The problem of these tests alone."""
        return replace(self, tests=self.counted, factors=tuple(factor for factor in self.factors if factor > 0))

    @property
    def point_weights(self) -> tuple[Array, ...]:
        """Weights of the points of each test."""
        return tuple(self._weights_of(*pair) for pair in zip(self.tests, self.factors, strict=True))

    def _weights_of(self, test: MaterialTest, factor: float) -> Array:
        size = np.abs(test.stress)
        if not self.relative or not np.any(size):
            return np.full_like(size, factor)
        weights: Array = factor / np.maximum(size, RELATIVE_FLOOR * size.max())
        return weights

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
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return np.concatenate([predict(material, test) for test in self.tests])

    def thinned(self, points: int) -> Problem:
        """Return the problem with at most about `points` points of each test, evenly chosen."""
        tests = []
        for test in self.tests:
            chosen = np.unique(np.linspace(0, len(test.stretch) - 1, points).astype(int))
            tests.append(MaterialTest(test.mode, test.stretch[chosen], test.stress[chosen]))
        return replace(self, tests=tuple(tests))


@dataclass(frozen=True)
class Solution:
    """What least squares found.

    Attributes
    ----------
    values
        Constants in the model's order.
    residual
        Predicted less measured nominal stress at all points, MPa.
    weighted
        The weighted residuals that count, by what was measured: of the stress, and of the lateral stretch if fitted.
    jacobian
        Derivatives of these, one after the other, by the constants, ``(residuals, constants)``.
    """

    values: Array
    residual: Array
    weighted: tuple[Array, ...]
    jacobian: Array


def solve(model: type[Hyperelastic], problem: Problem, limits: Limits | None = None) -> Solution | None:
    """Fit the constants of `model`.

    Parameters
    ----------
    model
        The class of material.
    problem
        Tests, weights and bounds.
    limits
        Inequalities that the material must keep, such as stability.

    Returns
    -------
    Solution or None
        ``None`` if no constants keep the limits.

    Raises
    ------
    InputError
        If the tests that count have fewer points than the model has constants.
    """
    constants, points = model.constants(), len(problem.of_counted.stress)
    if points < len(constants):
        raise InputError(
            f"{model.name} has {len(constants)} constants, the tests have only {points} points",
            key="models",
            expected="more points or a model with fewer constants",
        )
    linear = _Linear(model, problem.of_counted, limits)
    best = _search(model, linear) if linear.searched else np.zeros(0)
    moduli, relative = linear.solve(best)
    if relative[0] == FAR:
        return None
    values = linear.assemble(moduli, best)
    residual = problem.prediction(model.trial(list(values))) - problem.stress
    jacobian = _jacobian(values, linear) * linear.weights[:, None]
    return Solution(values, residual, (linear.weights * residual[problem.weights > 0],), jacobian)


def bounds_of(model: type[Hyperelastic], problem: Problem) -> Array:
    """Return the bounds of each constant, narrowed by those of the problem, ``(constants, 2)``.

    Raises
    ------
    InputError
        If nothing is left between them.
    """
    return np.array([_narrowed(c.bounds, problem.bounds.get(c.name), c.name) for c in model.constants()])


def central_difference(function: Callable[[Array], Array], values: Array, i: int) -> Array:
    """Return the derivative of `function` by the `i`-th of its `values`."""
    step = np.zeros_like(values)
    step[i] = 1e-6 * max(abs(values[i]), 1e-2)
    derivative: Array = (function(values + step) - function(values - step)) / (2.0 * step[i])
    return derivative


class _Linear:
    """The linear problem of the moduli at given values of the constants that are searched for."""

    def __init__(self, model: type[Hyperelastic], problem: Problem, limits: Limits | None) -> None:
        self.model, self.problem, self.limits = model, problem, limits
        constants = model.constants()
        bounds = bounds_of(model, problem)
        self.moduli = [i for i, constant in enumerate(constants) if constant.linear]
        self.searched = [i for i, constant in enumerate(constants) if not constant.linear]
        self.bounds = bounds[self.moduli].T
        self.searched_bounds = bounds[self.searched].T
        self.stress, self.weights = problem.stress, problem.weights
        self.scale = float(np.linalg.norm(self.weights * self.stress)) or 1.0

    def coarse(self, points: int) -> _Linear:
        return _Linear(self.model, self.problem.thinned(points), self.limits)

    def prediction(self, values: Array) -> Array:
        return self.problem.prediction(self.model.trial(list(values)))

    def assemble(self, moduli: Array, searched: Array) -> Array:
        values = np.zeros(len(self.moduli) + len(self.searched))
        values[self.searched] = searched
        values[self.moduli] = moduli
        return values

    def units(self, searched: Array) -> list[Hyperelastic]:
        """Materials in which one modulus is 1 MPa and the others are zero."""
        return [self.model.trial(list(self.assemble(unit, searched))) for unit in np.eye(len(self.moduli))]

    def columns(self, searched: Array) -> Array:
        """Stresses per unit of each modulus, ``(points, moduli)``."""
        return np.column_stack([self.problem.prediction(material) for material in self.units(searched)])

    def solve(self, searched: Array) -> tuple[Array, Array]:
        """Return the best moduli and the weighted residual, relative to the norm of the weighted stress."""
        y = self.weights * self.stress / self.scale
        A = self.columns(searched) * (self.weights / self.scale)[:, None]
        norms = np.maximum(np.linalg.norm(A, axis=0), _TINY)
        far = np.zeros(len(self.moduli)), np.full_like(y, FAR)
        if not np.all(np.isfinite(norms)):
            return far
        scaled = A / norms
        x: Array | None = np.linalg.lstsq(scaled, y, rcond=None)[0]
        assert x is not None
        low, high = self.bounds * norms
        if self.limits is not None:
            x = self.limits.enforce(scaled, y, x, self.units(searched), norms, *_as_rows(low, high))
        elif np.any(x < low) or np.any(x > high):
            x = lsq_linear(scaled, y, bounds=(low, high), method="bvls").x
        if x is None:
            return far
        return x / norms, scaled @ x - y

    def residual(self, searched: Array) -> Array:
        return self.solve(searched)[1]


def _narrowed(own: tuple[float, float], given: tuple[float, float] | None, name: str) -> tuple[float, float]:
    low, high = own if given is None else (max(own[0], given[0]), min(own[1], given[1]))
    if not low < high:
        raise InputError("these bounds leave nothing", key=f"bounds of {name}", value=given, expected=f"within {own}")
    return low, high


def _as_rows(low: Array, high: Array) -> tuple[Array, Array]:
    """Write low ≤ x ≤ high as rows · x ≥ floors, the infinite ones left out."""
    eye = np.eye(len(low))
    rows = np.vstack([eye[np.isfinite(low)], -eye[np.isfinite(high)]])
    return rows, np.concatenate([low[np.isfinite(low)], -high[np.isfinite(high)]])


def _search(model: type[Hyperelastic], linear: _Linear) -> Array:
    coarse = linear.coarse(SCREENING_POINTS)
    low, high = linear.searched_bounds
    starts = list(dict.fromkeys(tuple(np.clip(start, low, high)) for start in model.starts()))
    costs = [float(np.sum(coarse.residual(np.array(start)) ** 2)) for start in starts]
    followed = STARTS_FOLLOWED if linear.limits is None else STARTS_LIMITED
    chosen = [starts[i] for i in np.argsort(costs, kind="stable")[:followed]]
    minima = sorted((_descend(coarse, start, 1e-6, "2-point") for start in chosen), key=lambda found: float(found.cost))
    distinct = [m for i, m in enumerate(minima) if i == 0 or m.cost > minima[i - 1].cost * (1.0 + 1e-4)]
    if linear.limits is not None:  # the limits make kinks, at which more digits are not to be had
        ends = [_descend(linear, found.x, 1e-8, "2-point") for found in distinct[:MINIMA_POLISHED]]
        return np.asarray(min(ends, key=lambda found: float(found.cost)).x, dtype=float)
    closer = [_descend(linear, found.x, 1e-9, "2-point") for found in distinct[:MINIMA_POLISHED]]
    best = min(closer, key=lambda found: float(found.cost))
    return np.asarray(_descend(linear, best.x, 1e-15, "3-point", 500).x, dtype=float)


def _descend(
    linear: _Linear, start: Sequence[float] | Array, tolerance: float, jacobian: str, evaluations: int = 100
) -> OptimizeResult:
    low, high = linear.searched_bounds
    width = np.minimum(high - low, 1.0)
    inside = np.clip(start, low + 1e-9 * width, high - 1e-9 * width)
    return least_squares(
        linear.residual,
        inside,
        bounds=(low, high),
        jac=jacobian,
        x_scale=np.maximum(np.abs(inside), 0.1),
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=evaluations,
    )


def _jacobian(values: Array, linear: _Linear) -> Array:
    """Derivatives of the (unweighted) stresses by all constants, ``(points, constants)``."""
    J = np.empty((len(linear.stress), len(values)))
    J[:, linear.moduli] = linear.columns(values[linear.searched])
    for i in linear.searched:
        J[:, i] = central_difference(linear.prediction, values, i)
    return J
