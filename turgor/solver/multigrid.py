"""Two levels of p-multigrid: second-order elements smoothed, first-order ones on the same corners solved.

One cycle is an approximate inverse. Its coarse space, the piecewise linear displacements, contains the rigid-body modes
and nearly the soft bending modes; what it lacks is rough, and one sweep of Gauss–Seidel smooths that (Helenbrook,
Mavriplis and Atkins 2003). A sweep before the correction as well would make the cycle symmetric, which GMRES does not
need, and would cost more than it saves in iterations. The matrix is in single precision, which halves the memory that
goes by.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, jit, parallel
from turgor.fem.pattern import SparsePattern
from turgor.mesh.cells import body_cell, cells_of_corners
from turgor.solver.blocks import BlockMatrix
from turgor.solver.coarse import make_coarse_solver

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


UNCHANGED = 0.03
"""The coarse level is kept while the diagonal blocks differ by less than this part from those that it was made of."""


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
    fine
        The matrix, in whose order of nodes all vectors are.
    free
        Which components are unknown, ``(n_nodes, 3)``.
    """

    def __init__(self, pattern: SparsePattern, points: Floats, cells: Ints) -> None:
        self.fine = BlockMatrix(pattern)
        self.free = pattern.free.reshape(-1, 3)[self.fine.order]
        corners, self._up = corner_interpolation(self.fine.rank[cells])
        self._down = self._up.T.tocsr()
        coupled = sp.csr_matrix(self._down @ (self.fine.structure @ self._up))
        coupled.sort_indices()
        self._start, self._column = coupled.indptr.astype(np.int64), coupled.indices.astype(np.int32)
        self._coarse_free = self.free[corners]
        self._upper, self._mirrored, self._known = _upper(self._start, self._column, self._coarse_free)
        places = points[self.fine.order][corners]
        self._made_of = np.zeros_like(self.fine.diagonal)
        self._solver = make_coarse_solver(self._upper.indptr, self._upper.indices, places, self._coarse_free)

    def update(self) -> None:
        """Take the matrix with the values of :attr:`fine`.

        Raises
        ------
        SingularMatrixError
            If the coarse matrix is singular.
        """
        self.fine.update()
        change = float(np.linalg.norm(self.fine.diagonal - self._made_of))
        if change > UNCHANGED * float(np.linalg.norm(self._made_of)):
            self._update_coarse()

    def _update_coarse(self) -> None:
        fine, up, down = self.fine, self._up, self._down
        coarse = np.zeros(9 * len(self._column))
        _project(
            *(fine.start, fine.column, fine.values, fine.diagonal, self.free),
            *(up.indptr, up.indices, up.data, down.indptr, down.indices, down.data),
            *(self._start, self._column, coarse),
        )
        upper = (coarse[self._upper.data] + coarse[self._mirrored]) * self._known
        upper[self._upper.indptr[:-1]] += ~self._coarse_free.ravel()
        self._solver.factorise(upper)
        self._made_of = fine.diagonal.copy()

    def apply(self, right: Floats) -> tuple[Floats, Floats]:
        """Return what one cycle makes of a right-hand side ``(3 n_nodes,)``, and the product of the matrix with it."""
        coarse = (self._down @ (right.reshape(-1, 3) * self.free)) * self._coarse_free
        x = (self._up @ self._solver.solve(coarse.ravel()).reshape(-1, 3)) * self.free
        return self.fine.sweep(right, x.ravel())


def corner_interpolation(cells: Ints) -> tuple[Ints, sp.csr_matrix]:
    """Return the nodes at the corners of second-order cells, ascending, and the matrix from values there to all nodes.

    The matrix is ``(n_nodes, n_corners)``.
    """
    cell = body_cell(cells)
    corners, number = cells_of_corners(cells)
    n_nodes = int(cells.max()) + 1
    # Cells that share a node agree on it: whichever has it speaks.
    place = np.full(n_nodes, -1)
    place[cells.ravel()] = np.arange(cells.size)
    assert place.min() >= 0
    owner, local = np.divmod(place, cell.n_nodes)
    weights = cell.corner_shape_at_nodes[local]
    row, at = np.nonzero(weights > 1e-12)
    return corners, sp.csr_matrix((weights[row, at], (row, number[owner[row], at])), shape=(n_nodes, len(corners)))


def _upper(
    start: NDArray[np.int64], column: Ints, free: NDArray[np.bool_]
) -> tuple[sp.csr_matrix, NDArray[np.int64], NDArray[np.bool_]]:
    """Return the scalar upper triangle of block rows, its values being their places among those of the rows.

    And for each of its entries the place of its mirror image, and whether it couples free components.
    """
    n = len(start) - 1
    row_start = np.empty(3 * n + 1, np.int32)
    size = 9 * (len(column) - n) // 2 + 6 * n
    columns, places, mirrored = np.empty(size, np.int32), np.empty(size, np.int64), np.empty(size, np.int64)
    _list_upper(start, column, row_start, columns, places, mirrored)
    is_free = free.ravel()
    upper = sp.csr_matrix((places, columns, row_start), shape=(3 * n, 3 * n))
    return upper, mirrored, np.repeat(is_free, np.diff(row_start)) & is_free[columns]


@nb.njit(cache=True)
def _list_upper(start, column, row_start, columns, places, mirrored):  # type: ignore[no-untyped-def]
    n, at = len(start) - 1, 0
    # Rows come one after the other, and meet the blocks of a later one in its order.
    met = start[:-1].copy()
    for a in range(n):
        first, count = start[a], start[a + 1] - start[a]
        on = first + np.searchsorted(column[first : first + count], a)
        for i in range(3):
            row_start[3 * a + i] = at
            for m in range(on, first + count):
                b = column[m]
                its_count = start[b + 1] - start[b]
                for k in range(i if b == a else 0, 3):
                    columns[at] = 3 * b + k
                    places[at] = 9 * first + 3 * (m - first) + 3 * i * count + k
                    mirrored[at] = 9 * start[b] + 3 * (met[b] - start[b]) + 3 * k * its_count + i
                    at += 1
        for m in range(on, first + count):
            met[column[m]] += 1
    row_start[3 * n] = at


@parallel
def _project(  # type: ignore[no-untyped-def]
    start,
    column,
    values,
    diagonal,
    free,
    up_start,
    up_column,
    up,
    down_start,
    down_column,
    down,
    coarse_start,
    coarse_column,
    out,
):
    """Add to the coarse block rows `out` what, with its transpose, makes the Galerkin product ``Pᵀ A P``.

    That is the product with the blocks left of the diagonal and half of those on it. Fixed components are identity in
    A; what that adds is left out where it is on the diagonal and is nothing elsewhere.
    """
    n = len(coarse_start) - 1
    for chunk in nb.prange(CHUNKS):
        place = np.empty(n, np.int64)
        own = np.empty(9, np.float32)
        for row in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            width = 3 * (coarse_start[row + 1] - coarse_start[row])
            for m in range(coarse_start[row], coarse_start[row + 1]):
                place[coarse_column[m]] = 9 * coarse_start[row] + 3 * (m - coarse_start[row])
            for child in range(down_start[row], down_start[row + 1]):
                a, share = down_column[child], down[child]
                for i in range(3):
                    for k in range(3):
                        own[3 * i + k] = diagonal[a, i, k] if free[a, i] and free[a, k] else 0.0
                parents = (up_start, up_column, up, place, width, out)
                _add_to_parents(0.5 * share, own, 0, 3, a, *parents)
                first, last = start[a], start[a + 1]
                for m in range(first, last):
                    at = 9 * first + 3 * (m - first)
                    _add_to_parents(share, values, at, 3 * (last - first), column[m], *parents)


@jit
def _add_to_parents(share, values, at, stride, b, up_start, up_column, up, place, width, out):  # type: ignore[no-untyped-def]
    """Add a fine block at ``values[at]``, of a row that a coarse node has a share in, to the columns of b's parents."""
    one, two = np.uint64(1), np.uint64(2)
    r0, r1, r2 = np.uint64(at), np.uint64(at + stride), np.uint64(at + 2 * stride)
    v00, v01, v02 = share * values[r0], share * values[r0 + one], share * values[r0 + two]
    v10, v11, v12 = share * values[r1], share * values[r1 + one], share * values[r1 + two]
    v20, v21, v22 = share * values[r2], share * values[r2 + one], share * values[r2 + two]
    for parent in range(up_start[b], up_start[b + 1]):
        w, to = up[parent], place[up_column[parent]]
        t0, t1, t2 = np.uint64(to), np.uint64(to + width), np.uint64(to + 2 * width)
        out[t0] += w * v00
        out[t0 + one] += w * v01
        out[t0 + two] += w * v02
        out[t1] += w * v10
        out[t1 + one] += w * v11
        out[t1 + two] += w * v12
        out[t2] += w * v20
        out[t2 + one] += w * v21
        out[t2 + two] += w * v22
