"""Compressible fits: the bulk modulus from volumetric tests, and all constants where lateral strain was measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.least_squares import Problem, predict
from turgor.materials.measurement import MaterialTest

_ITERATIONS = 60
_TRANSVERSE = {"uniaxial": (1, 2), "equibiaxial": (2,), "planar": (2,)}
"""The directions in which each mode is free to contract."""


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
    The lateral stress vanishes; it grows with the lateral stretch, whose root is found by bisection in its logarithm
    between full incompressibility and no contraction at all, then by Newton's method.
    """
    x = np.asarray(stretch, dtype=float)
    low, high = np.full_like(x, np.log(1e-3)), np.full_like(x, np.log(1e3))
    for _ in range(_ITERATIONS):
        middle = 0.5 * (low + high)
        lateral_stress = _principal_stress(material, mode, x, np.exp(middle))[..., 2]
        above = lateral_stress > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    lateral = np.exp(0.5 * (low + high))
    return lateral, _principal_stress(material, mode, x, lateral)[..., 0]


def _principal_stress(material: Hyperelastic, mode: str, stretch: Array, lateral: Array) -> Array:
    """Nominal principal stresses ``(n, 3)``; the third direction is a free one."""
    stretches = np.stack([stretch, np.ones_like(stretch), lateral], axis=-1)
    if mode == "uniaxial":
        stretches[..., 1] = lateral
    elif mode == "equibiaxial":
        stretches[..., 1] = stretch
    J = stretches.prod(axis=-1)[..., None]
    bar = stretches / np.cbrt(J)
    _, slope, _ = material.principal(bar)
    t = bar * slope
    deviator = t - t.mean(axis=-1, keepdims=True)
    stress: Array = (deviator + J * material.volumetric.pressure(J)) / stretches
    return stress


def fit_compressible(material: Hyperelastic, problem: Problem) -> tuple[Hyperelastic, Array, str]:
    """Fit all constants and the bulk modulus to stress and lateral stretch together.

    Parameters
    ----------
    material
        The incompressible fit, the start.
    problem
        The tests; those without lateral stretch count by their stress alone, at the same compressibility.

    Returns
    -------
    tuple
        The material, the residual of its nominal stress at all points, and a remark that names Poisson's ratio.
    """
    kind = type(material)
    scale = np.array([max(abs(value), 1e-6) for value in material.parameters.values()])
    stress_scale = float(np.abs(problem.stress * problem.weights).max())

    def built(x: Array) -> Hyperelastic:
        trial = kind.trial((x[:-1] * scale).tolist())
        law = dataclasses.replace(material.volumetric, bulk_modulus=float(np.exp(x[-1])) * material.shear_modulus)
        object.__setattr__(trial, "volumetric", law)
        return trial

    def residual(x: Array) -> Array:
        trial = built(x)
        parts = []
        for test, weight in zip(problem.tests, problem.point_weights, strict=True):
            lateral, stress = _response(trial, test)
            parts.append(weight * (stress - test.stress) / stress_scale)
            if test.lateral is not None:
                parts.append((lateral - test.lateral) / float(np.ptp(test.lateral) or 1.0))
        return np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3)

    starts = [np.append(np.array(list(material.parameters.values())) / scale, np.log(k)) for k in (1.5, 5.0, 50.0)]
    found = min((least_squares(residual, s, xtol=1e-14, ftol=1e-14, gtol=1e-14) for s in starts), key=lambda f: f.cost)
    final = built(found.x)
    checked = dataclasses.replace(kind.of(final.parameters), volumetric=final.volumetric)
    errors = [_response(checked, test)[1] - test.stress for test in problem.tests]
    remark = f"compressible, fitted to the lateral strain: Poisson's ratio {checked.poisson_ratio:.4g}"
    return checked, np.concatenate(errors), remark


def _response(material: Hyperelastic, test: MaterialTest) -> tuple[Array, Array]:
    if test.mode in _TRANSVERSE:
        return free_response(material, test.mode, test.stretch)
    return np.ones_like(test.stretch), predict(material, test)
