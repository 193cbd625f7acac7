"""The flexible generalised minimal residual method (Saad 1993), and the softest direction of a symmetric matrix.

Flexible, as a preconditioner in single precision is not linear to the last digits of a double. The directions are made
orthogonal by kernels of our own: NumPy's products of vectors start threads each time, which on a busy machine takes
longer than everything else.
"""

from __future__ import annotations

from collections.abc import Callable

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, parallel

Floats = NDArray[np.float64]
Preconditioner = Callable[[Floats], tuple[Floats, Floats]]

RESTART = 60
"""Directions that are kept; then the method begins anew from where it is."""

SURE = 0.5
ENOUGH = 12
"""The least eigenvalue counts as found where its equation leaves this part of it, after so many directions at least.

Of indefinite matrices the first eight at most had negative energies among them: columns of two meshes next to their
buckling loads and far beyond, six random vectors each.
"""

CANCELLED = 0.7
"""A direction that shrinks below this part of itself is made orthogonal once more, as rounding has left it oblique
(Daniel et al. 1976)."""


class Room:
    """Memory for the directions of Krylov spaces, one space at a time.

    Kept, as the system takes long to hand out as much of it anew for each linear problem; what is not written to takes
    none.
    """

    def __init__(self) -> None:
        self._floats = np.empty(0)

    def rows(self, count: int, n: int) -> Floats:
        """Return rows ``(count, n)`` with whatever was left in them."""
        if len(self._floats) < count * n:
            self._floats = np.empty(count * n)
        return self._floats[: count * n].reshape(count, n)


def gmres(
    preconditioner: Preconditioner, right: Floats, accuracy: float, most: int, room: Room
) -> tuple[Floats, int, bool]:
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
    room
        Where the directions are kept meanwhile.

    Returns
    -------
    solution, iterations, converged
        By the residual that the products with the matrix leave.
    """
    solution, residual, done = np.zeros_like(right), right, 0
    goal = accuracy * _length(right)
    while _length(residual) > goal and done < most:
        change, product, steps = _cycle(preconditioner, residual, goal, min(RESTART, most - done), room)
        solution, done = solution + change, done + steps
        before, residual = _length(residual), residual - product
        if not _length(residual) < before:
            return solution, done, False
    return solution, done, _length(residual) <= goal


def softest(preconditioner: Preconditioner, n: int, most: int, room: Room) -> tuple[Floats, float] | None:
    """Find the direction in which a symmetric positive definite matrix is softest, by a random vector's Krylov space.

    It belongs to the least eigenvalue of the preconditioned matrix (Arnoldi's method; Saad 2011, sec. 6.2). A
    preconditioner that nearly solves for the soft modes leaves the eigenvalue that is about to change its sign alone
    below the others, where the method finds it first.

    Parameters
    ----------
    preconditioner
        As for :func:`gmres`.
    n
        Number of unknowns.
    most
        Iterations allowed.
    room
        Where the directions are kept meanwhile.

    Returns
    -------
    direction, energy
        The direction ``(n,)`` and its product with the matrix and itself. ``None`` where a direction has a negative
        energy, or none is found to be the softest.
    """
    start = np.random.default_rng(0).standard_normal(n)
    space = _Krylov(preconditioner, start / _length(start), most, room)
    for k in range(1, most + 1):
        left = float(space.grow()[-1])
        if k < ENOUGH:
            continue
        values, vectors = np.linalg.eig(space.columns[:k, :k])
        least = int(np.argmin(values.real))
        if left * abs(vectors[-1, least]) <= SURE * abs(values[least].real):
            energies = space.improved[:k] @ space.basis[: k + 1].T @ space.columns[: k + 1, :k]
            sizes = np.sqrt(np.abs(np.diag(energies)))
            if not np.linalg.eigvalsh((energies + energies.T) / np.outer(sizes, sizes))[0] > 0.0:
                return None
            weights, direction = vectors[:, least].real, np.zeros(n)
            _add_combined(space.improved, weights, direction)
            return direction, float(weights @ energies @ weights)
    return None


class _Krylov:
    """A space that grows by one direction after another, orthonormal, and what the matrix makes of the improved ones.

    Attributes
    ----------
    basis
        The directions, ``(most + 1, n)``.
    improved
        What the preconditioner makes of them, ``(most, n)``.
    columns
        The matrix times the improved ones in terms of the basis, ``(most + 1, most)``.
    """

    def __init__(self, preconditioner: Preconditioner, first: Floats, most: int, room: Room) -> None:
        self._preconditioner = preconditioner
        rows = room.rows(2 * most + 1, len(first))
        self.basis, self.improved = rows[: most + 1], rows[most + 1 :]
        self.basis[0] = first
        self.columns = np.zeros((most + 1, most))
        self._size = 0

    def grow(self) -> Floats:
        """Take one direction more; return its column, ``(size + 2,)``, the length that was left of it last."""
        k = self._size
        self.improved[k], direction = self._preconditioner(self.basis[k])
        column = _orthogonalised(self.basis[: k + 1], direction)
        self.columns[: k + 2, k], length = column, float(column[-1])
        np.divide(direction, length or np.inf, out=self.basis[k + 1])
        self._size += 1
        return column


def _cycle(
    preconditioner: Preconditioner, residual: Floats, goal: float, most: int, room: Room
) -> tuple[Floats, Floats, int]:
    """Lessen the residual to `goal`, or as far as `most` directions reach.

    Returns the change, the product of the matrix with it, and how many directions were taken.
    """
    size = _length(residual)
    space = _Krylov(preconditioner, residual / size, most, room)
    triangle = np.zeros((most, most))
    rotations: list[tuple[float, float]] = []
    target = [size]
    for step in range(most):
        column = space.grow()
        length = float(column[-1])
        for k, (c, s) in enumerate(rotations):
            column[k : k + 2] = c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]
        radius = float(np.hypot(column[step], length))
        if radius == 0.0:
            break
        c, s = float(column[step]) / radius, length / radius
        rotations.append((c, s))
        column[step] = radius
        triangle[: step + 1, step] = column[: step + 1]
        target.append(-s * target[step])
        target[step] *= c
        if abs(target[-1]) <= goal or length == 0.0:
            break
    n = len(rotations)
    if n == 0:
        return np.zeros_like(residual), np.zeros_like(residual), 1
    weights = np.asarray(np.linalg.solve(triangle[:n, :n], target[:n]), float)
    change, product = np.zeros_like(residual), np.zeros_like(residual)
    _add_combined(space.improved, weights, change)
    _add_combined(space.basis, space.columns[: n + 1, :n] @ weights, product)
    return change, product, n


def _orthogonalised(basis: Floats, direction: Floats) -> Floats:
    """Take from `direction`, in place, its parts along the rows of `basis`; return these and the length left."""
    parts = np.zeros(len(basis) + 1)
    for _ in range(2):
        products = _products(basis, direction)
        parts[:-1] += products[:-1]
        parts[-1] = np.sqrt(_add_combined(basis, -products[:-1], direction))
        if parts[-1] > CANCELLED * np.sqrt(products[-1]):
            break
    return parts


def _length(vector: Floats) -> float:
    return float(np.sqrt(_products(np.empty((0, len(vector))), vector)[0]))


def _products(basis: Floats, vector: Floats) -> Floats:
    """Return the products of the rows of `basis` and of `vector` itself with it."""
    parts = np.empty((CHUNKS, len(basis) + 1))
    _project(basis, vector, parts)
    return np.asarray(parts.sum(axis=0))


def _add_combined(basis: Floats, weights: Floats, out: Floats) -> float:
    """Add the sum of the first rows of `basis`, one for each of `weights` and times it, to `out`; return its square."""
    squares = np.empty(CHUNKS)
    _combine(basis, weights, out, squares)
    return float(squares.sum())


@parallel
def _project(basis, vector, out):  # type: ignore[no-untyped-def]
    """Fill `out` ``(CHUNKS, n + 1)`` with the products of the rows of `basis` and of `vector` with it, by chunks."""
    n = len(vector)
    for chunk in nb.prange(CHUNKS):
        first, last = chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS
        here = vector[first:last]
        for k in range(len(basis) + 1):
            row = basis[k, first:last] if k < len(basis) else here
            total = 0.0
            for m in range(len(row)):
                total += row[m] * here[m]
            out[chunk, k] = total


@parallel
def _combine(basis, weights, out, squares):  # type: ignore[no-untyped-def]
    n = len(out)
    for chunk in nb.prange(CHUNKS):
        first, last = chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS
        here = out[first:last]
        for k in range(len(weights)):
            row, weight = basis[k, first:last], weights[k]
            for m in range(len(row)):
                here[m] += weight * row[m]
        square = 0.0
        for m in range(len(here)):
            square += here[m] * here[m]
        squares[chunk] = square
