"""Statistics of a least-squares fit: information criteria, confidence intervals, correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student_t

from turgor.materials.kinematics import Array

LEVEL = 0.95


@dataclass(frozen=True)
class Statistics:
    """Half widths of the 95 % intervals ``(n,)``, correlation ``(n, n)``, and Akaike's and the Bayesian criterion."""

    half_widths: Array
    correlation: Array
    aic: float
    bic: float


def statistics(jacobian: Array, weights: Array, cost: float) -> Statistics:
    """Linearised statistics at the minimum of Σ (weight · residual)².

    Parameters
    ----------
    jacobian
        Derivatives of the prediction by the constants, ``(points, constants)``.
    weights
        Weight of each point, ``(points,)``.
    cost
        Σ (weight · residual)².

    Notes
    -----
    The covariance is s² (JᵀW²J)⁻¹ with s² = cost/(points − constants) (Seber and Wild 1989, §2.1); constants that the
    tests do not determine have infinite widths. AIC = n ln(cost/n) + 2 k, BIC = n ln(cost/n) + k ln n with k the
    constants and the variance.
    """
    n, k = jacobian.shape
    logarithm = n * np.log(max(cost, 1e-300) / n)
    aic, bic = logarithm + 2.0 * (k + 1), logarithm + (k + 1) * np.log(n)
    A = jacobian * weights[:, None]
    norms = np.linalg.norm(A, axis=0)
    half_widths, correlation = np.full(k, np.inf), np.eye(k)
    if n > k and np.all(np.isfinite(A)) and np.all(norms > 0):
        _, s, Vt = np.linalg.svd(A / norms, full_matrices=False)
        if s[-1] > 1e-12 * s[0]:
            scaled = (Vt.T / s**2) @ Vt
            deviation = np.sqrt(np.diag(scaled))
            half_widths = student_t.ppf(0.5 + LEVEL / 2.0, n - k) * np.sqrt(cost / (n - k)) * deviation / norms
            correlation = scaled / np.outer(deviation, deviation)
    return Statistics(half_widths, correlation, float(aic), float(bic))
