"""The flexible generalised minimal residual method (Saad 1993).

Flexible, as a preconditioner in single precision is not linear to the last digits of a double.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Preconditioner = Callable[[Floats], tuple[Floats, Floats]]

RESTART = 60
"""Directions that are kept; then the method begins anew from where it is."""


def gmres(preconditioner: Preconditioner, right: Floats, accuracy: float, most: int) -> tuple[Floats, int, bool]:
    """Solve a linear system of any symmetry or sign, from zero.

    Parameters
    ----------
    preconditioner
        Returns the product of an approximate inverse with a vector ``(n,)``, and that of the matrix with this product.
    right
        Right-hand side, ``(n,)``.
    accuracy
        Part of it (its norm) that the solution may leave.
    most
        Iterations allowed.

    Returns
    -------
    solution, iterations, converged
        By the residual itself, not by its recursion.
    """
    solution, residual, done = np.zeros_like(right), right, 0
    goal = accuracy * float(np.linalg.norm(right))
    while float(np.linalg.norm(residual)) > goal and done < most:
        change, product, steps = _cycle(preconditioner, residual, goal, min(RESTART, most - done))
        solution, done = solution + change, done + steps
        before, residual = float(np.linalg.norm(residual)), residual - product
        if not float(np.linalg.norm(residual)) < before:
            return solution, done, False
    return solution, done, float(np.linalg.norm(residual)) <= goal


def _cycle(preconditioner: Preconditioner, residual: Floats, goal: float, most: int) -> tuple[Floats, Floats, int]:
    """Lessen the residual to `goal`, or as far as `most` directions reach.

    Returns the change, the product of the matrix with it, and how many directions were taken.
    """
    size = float(np.linalg.norm(residual))
    basis, improved, products = [residual / size], [], []
    triangle = np.zeros((most, most))
    rotations: list[tuple[float, float]] = []
    target = [size]
    for step in range(most):
        found, direction = preconditioner(basis[step])
        improved.append(found)
        products.append(direction.copy())
        column = np.zeros(step + 1)
        for _ in range(2):  # once more, so that rounding leaves them orthogonal (Giraud et al. 2005)
            part = np.array([known @ direction for known in basis])
            for weight, known in zip(part, basis, strict=True):
                direction -= weight * known
            column += part
        length = float(np.linalg.norm(direction))
        for k, (c, s) in enumerate(rotations):
            column[k : k + 2] = c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]
        radius = float(np.hypot(column[step], length))
        if radius == 0.0:
            break
        c, s = float(column[step]) / radius, length / radius
        rotations.append((c, s))
        column[step] = radius
        triangle[: step + 1, step] = column
        target.append(-s * target[step])
        target[step] *= c
        if abs(target[-1]) <= goal or length == 0.0:
            break
        basis.append(direction / length)
    n = len(rotations)
    if n == 0:
        return np.zeros_like(residual), np.zeros_like(residual), 1
    weights = np.asarray(np.linalg.solve(triangle[:n, :n], target[:n]), float)
    return _combined(weights, improved), _combined(weights, products), n


def _combined(weights: Floats, vectors: list[Floats]) -> Floats:
    return np.asarray(sum(weight * known for weight, known in zip(weights, vectors, strict=False)))
