"""Two levels of p-multigrid: second-order elements smoothed, first-order ones on the same corners solved.

One cycle is a symmetric approximate inverse. Its coarse space, the piecewise linear displacements, contains the
rigid-body modes and nearly the soft bending modes; what it lacks is rough, and one sweep of Gauss–Seidel before and
after smooths that (Helenbrook, Mavriplis and Atkins 2003). The smoother's matrix is in single precision, which halves
the memory that goes by: it need not be more accurate than the cycle.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, parallel
from turgor.fem.pattern import SparsePattern
from turgor.mesh.cells import body_cell
from turgor.solver.blocks import BlockRows, invert_diagonal, multiply, sweep_backward, sweep_forward
from turgor.solver.coarse import make_coarse_solver

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class TwoLevels:
    """The cycle of one mesh and pattern.

    Parameters
    ----------
    pattern
        Of a system in space without rigid bodies and oblique supports.
    points, cells
        The mesh: ``(n_points, 3)`` and its second-order cells ``(m, n)``.

    Attributes
    ----------
    rows
        The rows of the fine matrix, in whose order of nodes all vectors are.
    free
        Which components are unknown, ``(n_nodes, 3)``.
    """

    def __init__(self, pattern: SparsePattern, points: Floats, cells: Ints) -> None:
        self.rows = BlockRows(pattern)
        self.free = pattern.free.reshape(-1, 3)[self.rows.order]
        self._up = corner_interpolation(self.rows.rank[cells])
        self._down = self._up.T.tocsr()
        structure = sp.csr_matrix(
            (np.ones(len(self.rows.column)), self.rows.column, self.rows.start), shape=(len(self.free),) * 2
        )
        coupled = sp.csr_matrix(self._down @ (structure @ self._up))
        coupled.sort_indices()
        self._start, self._column = coupled.indptr.astype(np.int64), coupled.indices.astype(np.int32)
        corners = np.asarray(self._up.argmax(axis=0)).ravel()
        self._coarse_free = self.free[corners]
        self._coarse = _upper(self._start, self._column)
        places = points[self.rows.order][corners]
        self._solver = make_coarse_solver(self._coarse.indptr, self._coarse.indices, places, self._coarse_free)
        self._inverse = np.empty((len(self.free), 3, 3))
        self._fine = np.empty(0, np.float32)

    def update(self, values: Floats) -> None:
        """Take the matrix with these values of its rows.

        Raises
        ------
        SingularMatrixError
            If the coarse matrix is singular.
        """
        rows = self.rows
        self._fine = values.astype(np.float32)
        invert_diagonal(rows.start, rows.diagonal, values, self._inverse)
        coarse = np.zeros(9 * len(self._column))
        _project(
            *(rows.start, rows.column, values, self.free.astype(float)),
            *(self._up.indptr, self._up.indices, self._up.data, self._down.indptr, self._down.indices, self._down.data),
            *(self._start, self._column, self._coarse_free.astype(float), coarse),
        )
        upper = coarse[self._coarse.data]
        upper[self._coarse.indptr[:-1]] += ~self._coarse_free.ravel()
        self._solver.factorise(upper)

    def apply(self, right: Floats) -> Floats:
        """Return what one cycle makes of a right-hand side ``(3 n_nodes,)``."""
        rows, fine = self.rows, self._fine
        x, product = np.zeros_like(right), np.empty_like(right)
        for odd in (0, 1):
            sweep_forward(rows.start, rows.column, rows.diagonal, rows.bounds, fine, self._inverse, right, x, odd)
        multiply(rows.start, rows.column, fine, x, product)
        rest = (right - product).reshape(-1, 3) * self.free
        coarse = (self._down @ rest) * self._coarse_free
        correction = self._up @ self._solver.solve(coarse.ravel()).reshape(-1, 3)
        x += (correction * self.free).ravel()
        for odd in (1, 0):
            sweep_backward(rows.start, rows.column, rows.bounds, fine, self._inverse, right, x, odd)
        return x


def corner_interpolation(cells: Ints) -> sp.csr_matrix:
    """Return the matrix ``(n_nodes, n_corners)`` from values at the corners of second-order cells to all nodes.

    Corners are numbered in the order of their nodes.
    """
    cell = body_cell(cells)
    corners, number = np.unique(cells[:, : cell.n_corners], return_inverse=True)
    number = number.reshape(len(cells), cell.n_corners)
    n_nodes = int(cells.max()) + 1
    # Cells that share a node agree on it: the first one that has it speaks.
    nodes, first = np.unique(cells, return_index=True)
    assert len(nodes) == n_nodes
    owner, local = np.divmod(first, cell.n_nodes)
    weights = cell.corner_shape_at_nodes[local]
    row, at = np.nonzero(weights > 1e-12)
    return sp.csr_matrix((weights[row, at], (row, number[owner[row], at])), shape=(n_nodes, len(corners)))


def _upper(start: NDArray[np.int64], column: Ints) -> sp.csr_matrix:
    """Return the scalar upper triangle of block rows, its values being their places among those of the rows."""
    count = np.diff(start)
    row = np.repeat(np.arange(len(count)), count)
    block = np.arange(len(column)) - start[row]
    i, k = np.arange(3)[:, None], np.arange(3)
    places = 9 * start[row][:, None, None] + 3 * i * count[row][:, None, None] + 3 * block[:, None, None] + k
    rows, columns = np.broadcast_arrays(3 * row[:, None, None] + i, 3 * column[:, None, None] + k)
    above = columns >= rows
    n = 3 * len(count)
    upper = sp.csr_matrix((places[above], (rows[above], columns[above])), shape=(n, n))
    upper.sort_indices()
    upper.indptr, upper.indices = upper.indptr.astype(np.int32), upper.indices.astype(np.int32)
    return upper


@parallel
def _project(  # type: ignore[no-untyped-def]
    start,
    column,
    values,
    free,
    up_start,
    up_column,
    up,
    down_start,
    down_column,
    down,
    coarse_start,
    coarse_column,
    coarse_free,
    out,
):
    """Add the Galerkin product ``Pᵀ A P`` of block rows, free components only, to the coarse block rows `out`."""
    n = len(coarse_start) - 1
    for chunk in nb.prange(CHUNKS):
        place = np.empty(n, np.int64)
        block = np.empty((3, 3))
        for row in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            width = 3 * (coarse_start[row + 1] - coarse_start[row])
            for m in range(coarse_start[row], coarse_start[row + 1]):
                place[coarse_column[m]] = 9 * coarse_start[row] + 3 * (m - coarse_start[row])
            for child in range(down_start[row], down_start[row + 1]):
                a = down_column[child]
                fine_width = 3 * (start[a + 1] - start[a])
                for m in range(start[a], start[a + 1]):
                    b = column[m]
                    at = 9 * start[a] + 3 * (m - start[a])
                    for i in range(3):
                        for k in range(3):
                            block[i, k] = down[child] * free[a, i] * free[b, k] * values[at + i * fine_width + k]
                    for parent in range(up_start[b], up_start[b + 1]):
                        to = place[up_column[parent]]
                        for i in range(3):
                            for k in range(3):
                                weight = up[parent] * coarse_free[row, i] * coarse_free[up_column[parent], k]
                                out[to + i * width + k] += weight * block[i, k]
