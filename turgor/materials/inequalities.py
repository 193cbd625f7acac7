"""Inequalities that a fitted material must keep: stable over a range, plausible in biaxial tension, no cancelling.

All are linear in the moduli once a direction is chosen: vᵀ D v ≥ 0 for the matrix D of Drucker's inequality, which is
itself linear in W. The least-squares problem with such rows is solved exactly by Lawson and Hanson's reduction to
non-negative least squares (Solving Least Squares Problems, 1974, ch. 23); the directions v that matter are found by
adding the eigenvectors of the matrices that are not yet positive definite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import nnls

from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.stability import MODES, drucker_matrix, principal_stretches

_ROUNDS = 30
_AT_REST = np.array([1.0, -1.0]) / 2.0
"""(1, −1) D (1, −1)ᵀ of the undeformed body is 4 μ: so scaled, it is μ."""


@dataclass(frozen=True)
class Limits:
    """What a fitted material must keep.

    Attributes
    ----------
    largest_stretch
        Drucker's inequality holds wherever no principal stretch exceeds it.
    margin
        The smallest eigenvalue of Drucker's matrix stays above this part of the initial shear modulus.
    biaxial
        Bounds of the ratio of equibiaxial to uniaxial nominal stress by stretch; empty where it is measured.
    cancellation
        No modulus adds more than so many times the measured stress: four digits then fix the response.
    samples
        Stretches of each mode at which stability is kept.
    """

    largest_stretch: float
    margin: float = 0.02
    biaxial: Mapping[float, tuple[float, float]] = field(default_factory=dict)
    cancellation: float = 8.0
    samples: int = 24

    def enforce(
        self, A: Array, y: Array, free: Array, units: Sequence[Hyperelastic], norms: Array, rows: Array, floors: Array
    ) -> Array | None:
        """Return the x that minimises |A x − y| within the limits, or ``None`` if there is none.

        Parameters
        ----------
        A, y
            Scaled problem: ``(points, moduli)`` with columns of norm 1 and ``(points,)`` of norm 1.
        free
            Its solution without limits, returned if it keeps them.
        units
            The material of each unit modulus.
        norms
            Scale of each column: the moduli are ``x / norms``.
        rows, floors
            More inequalities, rows · x ≥ floors.
        """
        matrices = self._matrices(units, norms)
        mu = _initial_shear_moduli(units, norms)
        biaxial = self._biaxial_rows(units, norms)
        n = A.shape[1]
        fixed = np.vstack([rows, biaxial, mu[None, :], np.eye(n), -np.eye(n)])
        floor = np.concatenate([floors, np.zeros(len(biaxial) + 1), np.full(2 * n, -self.cancellation)])
        scale = np.abs(matrices).max(axis=(1, 2, 3))
        if np.all(self._violation(matrices, mu, free) <= 1e-9 * scale) and np.all(fixed @ free >= floor):
            return free
        G, h = fixed, floor
        x = least_squares_above(A, y, G, h)
        if x is None:
            return None
        for _ in range(_ROUNDS):
            values, vectors = np.linalg.eigh(np.einsum("skij,k->sij", matrices, x))
            violated = values[:, 0] < self.margin * float(mu @ x) - 1e-9 * scale * np.abs(x).max()
            if not np.any(violated):
                break
            v = vectors[violated, :, 0]
            cuts = np.einsum("si,skij,sj->sk", v, matrices[violated], v) - self.margin * mu
            G, h = np.vstack([G, cuts]), np.concatenate([h, np.zeros(len(cuts))])
            found = least_squares_above(A, y, G, h)
            if found is None:
                return None
            x = found
        return x

    def _violation(self, matrices: Array, mu: Array, x: Array) -> Array:
        smallest = np.linalg.eigvalsh(np.einsum("skij,k->sij", matrices, x))[:, 0]
        missing: Array = self.margin * float(mu @ x) - smallest
        return missing

    def _matrices(self, units: Sequence[Hyperelastic], norms: Array) -> Array:
        """Drucker's matrices of the unit moduli on the three paths, ``(samples, moduli, 2, 2)``."""
        path = np.exp(np.log(self.largest_stretch) * np.linspace(0.0, 1.0, self.samples) ** 1.5)
        stretches = np.concatenate([principal_stretches(mode, path) for mode in MODES])
        with np.errstate(over="ignore", invalid="ignore"):
            columns = [drucker_matrix(unit, stretches) / norm for unit, norm in zip(units, norms, strict=True)]
        matrices = np.stack(columns, axis=1)
        return matrices[np.all(np.isfinite(matrices), axis=(1, 2, 3))]

    def _biaxial_rows(self, units: Sequence[Hyperelastic], norms: Array) -> Array:
        rows = []
        for stretch, (low, high) in self.biaxial.items():
            uniaxial = np.array([float(unit.uniaxial(stretch)) for unit in units]) / norms
            equibiaxial = np.array([float(unit.equibiaxial(stretch)) for unit in units]) / norms
            rows += [equibiaxial - low * uniaxial, high * uniaxial - equibiaxial]
        return np.array([row for row in rows if np.all(np.isfinite(row))]).reshape(-1, len(units))


def _initial_shear_moduli(units: Sequence[Hyperelastic], norms: Array) -> Array:
    rest = np.stack([drucker_matrix(unit, np.ones(3)) for unit in units])
    return np.asarray(np.einsum("i,kij,j->k", _AT_REST, rest, _AT_REST) / norms)


def least_squares_above(A: Array, y: Array, G: Array, h: Array) -> Array | None:
    """Return the x that minimises |A x − y| subject to G x ≥ h (Lawson and Hanson 1974, LSI and LDP).

    Parameters
    ----------
    A, y
        ``(m, n)`` and ``(m,)``; singular values below round-off are lifted to it.
    G, h
        ``(rows, n)`` and ``(rows,)``.

    Returns
    -------
    ndarray or None
        ``None`` if no x keeps all inequalities.
    """
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    s = np.maximum(s, 1e-12 * s[0])
    target = U.T @ y
    rows = G @ (Vt.T / s)
    floors = h - rows @ target
    size = np.maximum(np.hypot(np.linalg.norm(rows, axis=1), floors), 1e-300)
    E = np.vstack([rows.T, floors]) / size
    goal = np.zeros(len(s) + 1)
    goal[-1] = 1.0
    try:
        u, distance = nnls(E, goal, maxiter=20 * E.shape[1])
    except RuntimeError:  # no convergence: rows that are parallel to round-off
        return None
    r = E @ u - goal
    if distance < 1e-10 or abs(r[-1]) < 1e-14:
        return None
    x: Array = Vt.T @ ((target - r[:-1] / r[-1]) / s)
    return x
