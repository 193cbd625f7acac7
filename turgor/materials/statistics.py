"""Statistics of a least-squares fit: information criteria, confidence intervals, correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from turgor.materials.kinematics import Array

LEVEL = 0.95


@dataclass(frozen=True)
class Statistics:
    """Half widths of the 95 % intervals ``(n,)``, correlation ``(n, n)``, and Akaike's and the Bayesian criterion."""

    half_widths: Array
    correlation: Array
    aic: float
    bic: float


def statistics(jacobian: Array, residuals: Sequence[Array]) -> Statistics:
    """Linearised statistics at the minimum of the sum of squared residuals.

    Parameters
    ----------
    jacobian
        Derivatives of the weighted residuals by the constants, ``(n, k)``.
    residuals
        The weighted residuals in parts, each of a variance of its own; together ``(n,)``.

    Notes
    -----
    The covariance is (JᵀJ)⁻¹ JᵀVJ (JᵀJ)⁻¹ with the variances V of the parts, the mean of their squared residuals times
    n/(n − k): s² (JᵀJ)⁻¹ of one part (Seber and Wild 1989, §2.1; White 1980 for several). Constants that the tests do
    not determine have infinite widths. AIC = Σ m ln(cost/m) + 2 p over the parts of m residuals each, BIC with p ln n,
    where p counts the constants and the variances.
    """
    n, k = jacobian.shape
    sizes = np.array([len(part) for part in residuals])
    variances = np.array([max(float(part @ part), 1e-300) for part in residuals]) / sizes
    logarithm, p = float(sizes @ np.log(variances)), k + len(residuals)
    norms = np.linalg.norm(jacobian, axis=0)
    half_widths, correlation = np.full(k, np.inf), np.eye(k)
    if n > k and np.all(np.isfinite(jacobian)) and np.all(norms > 0):
        U, s, Vt = np.linalg.svd(jacobian / norms, full_matrices=False)
        if s[-1] > 1e-12 * s[0]:
            root = np.sqrt(np.repeat(variances, sizes) * n / (n - k))
            spread = (Vt.T / s) @ (U * root[:, None]).T
            covariance = spread @ spread.T
            deviation = np.sqrt(np.diag(covariance))
            half_widths = stdtrit(n - k, 0.5 + LEVEL / 2.0) * deviation / norms
            correlation = covariance / np.outer(deviation, deviation)
    return Statistics(half_widths, correlation, logarithm + 2.0 * p, float(logarithm + p * np.log(n)))
