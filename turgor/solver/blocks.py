"""A symmetric matrix in rows of 3 × 3 blocks, one for each pair of coupled nodes, and the sweeps of a smoother over it.

The three scalar rows of a node lie one behind the other, each over all its blocks: the entries of the right-hand
vector are gathered once for the three, and the sums run over memory that lies side by side.

Nodes are numbered by reverse Cuthill and McKee (1969), so that neighbours are near, and cut into portions that touch
the next and the last one only. Gauss–Seidel goes through every other portion, all of them at once, then through the
rest: the result does not depend on the number of threads, and the backward sweep is the transpose of the forward one.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, inverse, jit, parallel
from turgor.fem.pattern import SparsePattern

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]

PORTIONS = 16
"""Most portions that the nodes are cut into."""


class BlockRows:
    """The rows of one pattern in the order of their nodes.

    Parameters
    ----------
    pattern
        Of a system in space.

    Attributes
    ----------
    order, rank
        The node at each place, and the place of each node, ``(n_nodes,)``.
    start, column
        The blocks of each row and their places, ascending.
    diagonal
        Where in them the diagonal block is, ``(n_nodes,)``.
    bounds
        Where the portions of the nodes begin and end, ``(n_portions + 1,)``.
    """

    def __init__(self, pattern: SparsePattern) -> None:
        graph = pattern.graph()
        structure = sp.csr_matrix((np.ones(graph.nnz, np.int8), graph.indices, graph.indptr), shape=graph.shape)
        self.order: Ints = scipy.sparse.csgraph.reverse_cuthill_mckee(structure, symmetric_mode=True).astype(np.int32)
        self.rank: Ints = np.argsort(self.order).astype(np.int32)
        ordered = graph[self.order][:, self.order]
        ordered.sort_indices()
        self.start = ordered.indptr.astype(np.int64)
        self.column = ordered.indices.astype(np.int32)
        row = np.repeat(np.arange(len(self.order)), np.diff(self.start))
        self.diagonal = np.flatnonzero(row == self.column)
        bandwidth = int(np.abs(row - self.column).max())
        portions = max(1, min(PORTIONS, len(self.order) // (bandwidth + 1)))
        self.bounds = np.linspace(0, len(self.order), portions + 1).astype(np.int64)
        self._pattern = pattern
        count = np.diff(self.start)
        place = 9 * self.start[row] + 3 * (np.arange(len(row)) - self.start[row])
        self._above = _sorted_by(place, ordered.data)
        # The diagonal blocks are their own transposes.
        self._below = _sorted_by(place, np.where(row == self.column, ordered.data, -ordered.data))
        self._width = 3 * count[self.rank]

    def values(self, stored: Floats) -> Floats:
        """Return the values of the rows, identity where components are fixed, from the stored ones of the pattern."""
        out = np.empty(9 * len(self.column))
        self._pattern.expand(stored, self._above, self._below, self._width, out)
        return out


def _sorted_by(place: NDArray[np.int64], name: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places of those blocks whose names are positive, in the order of the names."""
    known = name > 0
    return np.asarray(place[known][np.argsort(name[known])])


@parallel
def multiply(start, column, values, x, out):  # type: ignore[no-untyped-def]
    """Write the product of block rows with ``x (3 n,)`` into `out`."""
    n = len(start) - 1
    for chunk in nb.prange(CHUNKS):
        near = np.empty(widest(start), x.dtype)
        for a in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            gather_blocks(column[start[a] : start[a + 1]], x, near)
            for i in range(3):
                out[3 * a + i] = row_product(start, values, a, i, 0, start[a + 1] - start[a], near)


@parallel
def sweep_forward(start, column, diagonal, bounds, values, inverses, right, x, odd):  # type: ignore[no-untyped-def]
    """Go forward by Gauss–Seidel through the portions of even or odd number; first the even ones, from zero."""
    for half in nb.prange((len(bounds) - odd) // 2):
        near = np.empty(widest(start), x.dtype)
        rest = np.empty(3, x.dtype)
        low, high = bounds[2 * half + odd], bounds[2 * half + odd + 1]
        for a in range(low, high):
            # All that comes later is zero still, and with the even portions the neighbours' are, too.
            first, last = start[a], start[a + 1] if odd else diagonal[a]
            while not odd and column[first] < low:
                first += 1
            gather_blocks(column[first:last], x, near)
            for i in range(3):
                done = row_product(start, values, a, i, first - start[a], last - start[a], near)
                rest[i] = right[3 * a + i] - done
            for i in range(3):
                x[3 * a + i] = inverses[a, i, 0] * rest[0] + inverses[a, i, 1] * rest[1] + inverses[a, i, 2] * rest[2]


@parallel
def sweep_backward(start, column, bounds, values, inverses, right, x, odd):  # type: ignore[no-untyped-def]
    """Go backward by Gauss–Seidel through the portions of even or odd number; first the odd ones."""
    for half in nb.prange((len(bounds) - odd) // 2):
        near = np.empty(widest(start), x.dtype)
        rest = np.empty(3, x.dtype)
        for a in range(bounds[2 * half + odd + 1] - 1, bounds[2 * half + odd] - 1, -1):
            gather_blocks(column[start[a] : start[a + 1]], x, near)
            for i in range(3):
                done = row_product(start, values, a, i, 0, start[a + 1] - start[a], near)
                rest[i] = right[3 * a + i] - done
            for i in range(3):
                x[3 * a + i] += inverses[a, i, 0] * rest[0] + inverses[a, i, 1] * rest[1] + inverses[a, i, 2] * rest[2]


@jit
def widest(start):  # type: ignore[no-untyped-def]
    """Return the number of entries in the longest row."""
    most = 0
    for a in range(len(start) - 1):
        most = max(most, start[a + 1] - start[a])
    return 3 * most


@jit
def gather_blocks(column, x, near):  # type: ignore[no-untyped-def]
    """Write the entries of `x` that belong to the nodes in `column` side by side into `near`."""
    for j in range(len(column)):
        for k in range(3):
            near[3 * j + k] = x[3 * column[j] + k]


@jit
def row_product(start, values, a, i, first, last, near):  # type: ignore[no-untyped-def]
    """Return the product of the blocks `first` to `last` of scalar row `i` of node `a` with `near`."""
    begin = 9 * start[a] + 3 * i * (start[a + 1] - start[a])
    row = values[begin + 3 * first : begin + 3 * last]
    total = 0.0
    for m in range(len(row)):
        total += row[m] * near[m]
    return total


@parallel
def invert_diagonal(start, diagonal, values, inverses):  # type: ignore[no-untyped-def]
    """Fill ``inverses (n, 3, 3)`` with those of the diagonal blocks.

    Of a block that is not positive definite it is that of the sizes of its diagonal entries, so that the smoother
    stays definite.
    """
    for a in nb.prange(len(diagonal)):
        begin, width = 9 * start[a] + 3 * (diagonal[a] - start[a]), 3 * (start[a + 1] - start[a])
        d = np.empty((3, 3))
        for i in range(3):
            for k in range(3):
                d[i, k] = values[begin + i * width + k]
        minor = d[0, 0] * d[1, 1] - d[0, 1] * d[1, 0]
        determinant = inverse(d, inverses[a])
        if not (d[0, 0] > 0.0 and minor > 0.0 and determinant > 0.0):
            inverses[a] = 0.0
            for i in range(3):
                if d[i, i] != 0.0:
                    inverses[a, i, i] = 1.0 / abs(d[i, i])
