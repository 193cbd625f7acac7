"""The flexible generalised minimal residual method (Saad 1993).

Flexible, as a preconditioner in single precision is not linear to the last digits of a double.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Operator = Callable[[Floats], Floats]

RESTART = 60
"""Directions that are kept; then the method begins anew from where it is."""


def gmres(
    operator: Operator, preconditioner: Operator, right: Floats, start: Floats, accuracy: float, most: int
) -> tuple[Floats, int, bool]:
    """Solve a linear system of any symmetry or sign.

    Parameters
    ----------
    operator, preconditioner
        The matrix and an approximate inverse, as functions of a vector ``(n,)``.
    right, start
        Right-hand side and first guess, ``(n,)``.
    accuracy
        Part of the guess's residual (its norm) at which the solution is good enough.
    most
        Iterations allowed.

    Returns
    -------
    solution, iterations, converged
        Of the residual itself, not of its recursion.
    """
    solution, done = start, 0
    residual = right - operator(start)
    goal = accuracy * float(np.linalg.norm(residual))
    while float(np.linalg.norm(residual)) > goal and done < most:
        change, steps = _cycle(operator, preconditioner, residual, goal, min(RESTART, most - done))
        solution, done = solution + change, done + steps
        before, residual = float(np.linalg.norm(residual)), right - operator(solution)
        if not float(np.linalg.norm(residual)) < before:
            return solution, done, False
    return solution, done, float(np.linalg.norm(residual)) <= goal


def _cycle(
    operator: Operator, preconditioner: Operator, residual: Floats, goal: float, most: int
) -> tuple[Floats, int]:
    """Return what lessens the residual to `goal`, or as far as `most` directions reach, and how many were taken."""
    size = float(np.linalg.norm(residual))
    basis, improved = [residual / size], []
    triangle = np.zeros((most, most))
    rotations: list[tuple[float, float]] = []
    target = [size]
    for step in range(most):
        improved.append(preconditioner(basis[step]))
        direction = operator(improved[step])
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
        return np.zeros_like(residual), 1
    weights = np.linalg.solve(triangle[:n, :n], target[:n])
    return np.asarray(sum(weight * known for weight, known in zip(weights, improved, strict=False))), n
