"""The coarse level of multigrid: factorised while it is small, else a cycle of algebraic multigrid."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.common.log import logger
from turgor.common.optional import is_available, require
from turgor.solver.linear import Pardiso, solver_in_use

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

log = logger("solver")

FACTORISED = 100_000
"""Unknowns up to which the coarse level is factorised.

At 36 000 both cost the same, and the factorisation saves iterations where the first tangent is indefinite.
"""


class CoarseSolver(Protocol):
    """Solves with a symmetric matrix of one pattern, or nearly."""

    def factorise(self, values: Floats) -> None:
        """Take the matrix with these stored values of its upper triangle."""
        ...

    def solve(self, right: Floats) -> Floats:
        """Return the solution ``(n,)``, or something near it that is linear in `right` and symmetric."""
        ...


def make_coarse_solver(row_start: Ints, column: Ints, points: Floats, free: NDArray[np.bool_]) -> CoarseSolver:
    """Return what suits a matrix, given as for :class:`SmoothedAggregation`."""
    n = len(row_start) - 1
    if n > FACTORISED and is_available("pyamg"):
        return SmoothedAggregation(row_start, column, points, free)
    if n > FACTORISED:
        log.warning("the coarse level has %d unknowns; with the package 'pyamg' it need not be factorised", n)
    kind = solver_in_use()
    return Pardiso(row_start, column, single=True) if kind is Pardiso else kind(row_start, column)


class SmoothedAggregation:
    """One V-cycle of PyAMG's smoothed aggregation (Vaněk, Mandel and Brezina 1996), symmetric.

    Parameters
    ----------
    row_start, column
        The upper triangle in compressed rows, zero-based.
    points
        Places of the nodes ``(n, 3)``, for the rigid-body modes, which all levels can represent.
    free
        Which of their components are unknown, ``(n, 3)``.
    """

    def __init__(self, row_start: Ints, column: Ints, points: Floats, free: NDArray[np.bool_]) -> None:
        self._pyamg: Any = require("pyamg", "algebraic multigrid")
        self._row_start, self._column = row_start, column
        self._modes = rigid_body_modes(points) * free.reshape(-1, 1)

    def factorise(self, values: Floats) -> None:
        """Build the levels."""
        n = len(self._row_start) - 1
        upper = sp.csr_matrix((values, self._column, self._row_start), shape=(n, n))
        levels = self._pyamg.smoothed_aggregation_solver(
            (upper + sp.triu(upper, 1).T).tobsr((3, 3)),
            B=self._modes,
            strength=("symmetric", {"theta": 0.0}),
            presmoother=("block_gauss_seidel", {"sweep": "forward"}),
            postsmoother=("block_gauss_seidel", {"sweep": "backward"}),
            improve_candidates=None,
            max_coarse=300,
        )
        self._cycle = levels.aspreconditioner()

    def solve(self, right: Floats) -> Floats:
        """Return what one cycle makes of a right-hand side."""
        return np.asarray(self._cycle @ right)


def rigid_body_modes(points: Floats) -> Floats:
    """Return the three translations and three rotations about the centre, ``(3 n, 6)``, of points ``(n, 3)``."""
    x, y, z = ((points - points.mean(axis=0)) / np.ptp(points, axis=0).max()).T
    modes = np.zeros((len(points), 3, 6))
    modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
    modes[:, 0, 3], modes[:, 1, 3] = -y, x
    modes[:, 1, 4], modes[:, 2, 4] = -z, y
    modes[:, 2, 5], modes[:, 0, 5] = -x, z
    return modes.reshape(-1, 6)
