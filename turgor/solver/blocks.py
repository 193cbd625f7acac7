"""A symmetric matrix of 3 × 3 blocks, one for each pair of coupled nodes, and the sweep of a smoother over it.

Only the blocks on the diagonal and left of it are stored. The three scalar rows of a node lie one behind the other,
each over all its blocks: a row is read once, and serves with the entries of a vector that it gathers for its own sum
and, transposed, with what it adds to the sums of earlier rows.

Nodes are numbered by reverse Cuthill and McKee (1969), so that neighbours are near, and cut into portions that touch
the next and the last one only. Every other portion comes first, then the rest in two turns, so that no two portions of
a turn touch a common one: Gauss–Seidel goes through all portions of a turn at once, and its result does not depend on
the number of threads. Within a portion nodes of one colour, which are not coupled, follow each other, so that a row
need not wait for the one before it.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph
from numpy.typing import NDArray

from turgor.fem.kernels import inverse, jit, parallel
from turgor.fem.pattern import BlockLayout, SparsePattern

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

PORTIONS = 16
"""Most portions that the nodes are cut into."""


class BlockMatrix:
    """The matrix of one pattern in an order of its nodes.

    Parameters
    ----------
    pattern
        Of a system in space.

    Attributes
    ----------
    order, rank
        The node at each place, and the place of each node, ``(n_nodes,)``.
    start, column
        Where the blocks left of the diagonal begin in each row, ``(n_nodes + 1,)``, and their columns, ascending.
    values
        Of these blocks and then of those on the diagonal, in single precision, placed as `layout` says.
    layout
        Where the blocks of the pattern stand among them.
    diagonal
        The blocks on the diagonal, ``(n_nodes, 3, 3)``.
    structure
        A one for each block on either side, ``(n_nodes, n_nodes)``.
    """

    def __init__(self, pattern: SparsePattern) -> None:
        graph = pattern.graph()
        self.order, self._bounds = _portions(graph)
        self.rank = _ranks(self.order)
        count = len(self._bounds) - 1
        half = (count + 1) // 2
        self._turns = (np.arange(half), np.arange(half, count, 2), np.arange(half + 1, count, 2))
        n = len(self.order)
        start, column, names = _reordered(graph.indptr, graph.indices, graph.data, self.order, self.rank)
        self.structure = sp.csr_matrix((np.ones(len(column), np.int8), column, start), shape=(n, n))
        widths = _earlier(start, column)
        self.start: Longs = np.concatenate([[0], np.cumsum(widths)])
        self.column: Ints = np.empty(self.start[-1], np.int32)
        self._widest = 3 * int(widths.max())
        begin = 9 * len(self.column)
        self.values: Singles = np.zeros(begin + 9 * n, np.float32)
        self.diagonal: Singles = self.values[begin:].reshape(n, 3, 3)
        self.layout = _laid_out(start, column, names, self.start, self.column)
        self._inverse = np.empty((n, 3, 3))
        self._replaced = np.zeros(0, np.intp)

    def update(self) -> None:
        """Make ready to sweep with the values."""
        indefinite = np.zeros(len(self.order), np.bool_)
        _invert_diagonal(self.diagonal, self._inverse, indefinite)
        # Of a block that is not positive definite the sweeps take the sizes of its diagonal entries, as they must stay
        # definite.
        self._replaced = np.flatnonzero(indefinite)
        blocks = self.diagonal[self._replaced].astype(float)
        sizes = np.abs(blocks[:, [0, 1, 2], [0, 1, 2]])
        sizes[sizes == 0.0] = 1.0
        self._inverse[self._replaced] = np.eye(3) / sizes[:, None, :]
        self._added = np.eye(3) * sizes[:, None, :] - blocks

    def sweep(self, right: Floats, x: Floats) -> tuple[Floats, Floats]:
        """Return what a sweep of Gauss–Seidel makes of `x` ``(3 n_nodes,)``, and the product with it."""
        found, product, target = np.empty_like(x), right.copy(), right.copy()
        for portions in self._turns:
            _take_later(self.start, self.column, self.values, self._widest, self._bounds, portions, x, target)
        if len(self._replaced):
            target += self._excess(x)
        for portions in self._turns:
            _sweep(
                *(self.start, self.column, self.values, self._widest, self._bounds, portions),
                *(self._inverse, target, x, found, product),
            )
        if len(self._replaced):
            product -= self._excess(found - x)
        return found, product

    def _excess(self, x: Floats) -> Floats:
        """Return the product with what the diagonal blocks of the sweeps have more than those of the matrix."""
        excess = np.zeros((len(self.order), 3))
        at = x.reshape(-1, 3)[self._replaced]
        excess[self._replaced] = (self._added @ at[:, :, None])[:, :, 0]
        return excess.ravel()


def _ranks(order: Ints) -> Ints:
    """Return the place of each number in an order of all."""
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order), dtype=np.int32)
    return rank


def _reordered(start: Ints, column: Ints, names: Longs, order: Ints, rank: Ints) -> tuple[Ints, Ints, Longs]:
    """Return the rows of a matrix whose nodes follow in another order, their columns ascending."""
    new_start = np.concatenate([[0], np.cumsum(np.diff(start)[order])]).astype(np.int32)
    new_column, new_names = np.empty_like(column), np.empty_like(names)
    _reorder(start, column, names, order, rank, new_start, new_column, new_names)
    return new_start, new_column, new_names


def _laid_out(start: Ints, column: Ints, names: Longs, left_start: Longs, left: Ints) -> BlockLayout:
    """Fill `left` with the columns left of the diagonal; return how the blocks of pairs stand.

    They are named as by :meth:`SparsePattern.graph`.
    """
    n_pairs = (len(column) + len(start) - 1) // 2
    place, width, turned = np.empty(n_pairs, np.int64), np.full(n_pairs, 3), np.empty(n_pairs, np.bool_)
    _lay_out(start, column, names, left_start, left, place, width, turned)
    return BlockLayout(place, width, turned)


def _portions(graph: sp.csr_matrix) -> tuple[Ints, Longs]:
    """Return an order of the nodes and the bounds of their portions."""
    structure = sp.csr_matrix((np.ones(graph.nnz, np.int8), graph.indices, graph.indptr), shape=graph.shape)
    near = scipy.sparse.csgraph.reverse_cuthill_mckee(structure, symmetric_mode=True).astype(np.int32)
    n = len(near)
    rank = _ranks(near)
    bandwidth = int(np.abs(np.repeat(rank, np.diff(graph.indptr)) - rank[graph.indices]).max())
    count = max(1, min(PORTIONS, n // (bandwidth + 1)))
    cuts = np.linspace(0, n, count + 1).astype(np.int64)
    sizes = cuts[1:] - cuts[:-1]
    portion = np.repeat(np.arange(count), sizes)
    colour = _coloured(graph.indptr, graph.indices, near)
    bounds = np.concatenate([[0], np.cumsum(np.concatenate([sizes[::2], sizes[1::2]]))])
    return near[np.lexsort((colour[near], portion, portion % 2))], bounds


@nb.njit(cache=True)
def _reorder(start, column, names, order, rank, new_start, new_column, new_names):  # type: ignore[no-untyped-def]
    """Write each row into the columns, in whose rows its numbers then ascend: which nodes are coupled is symmetric."""
    at = new_start[:-1].copy()
    for a in range(len(order)):
        for k in range(start[order[a]], start[order[a] + 1]):
            b = rank[column[k]]
            new_column[at[b]], new_names[at[b]] = a, names[k] if a == b else -names[k]
            at[b] += 1


@nb.njit(cache=True)
def _earlier(start, column):  # type: ignore[no-untyped-def]
    """Return how many columns of each row are left of the diagonal."""
    counts = np.zeros(len(start) - 1, np.int64)
    for a in range(len(counts)):
        counts[a] = np.searchsorted(column[start[a] : start[a + 1]], a)
    return counts


@nb.njit(cache=True)
def _lay_out(start, column, names, left_start, left, place, width, turned):  # type: ignore[no-untyped-def]
    for a in range(len(start) - 1):
        count = left_start[a + 1] - left_start[a]
        for k in range(count + 1):
            name = names[start[a] + k]
            pair = abs(name) - 1
            turned[pair] = name < 0
            if k < count:
                left[left_start[a] + k] = column[start[a] + k]
                place[pair], width[pair] = 9 * left_start[a] + 3 * k, 3 * count
            else:
                place[pair] = 9 * (len(left) + a)


@nb.njit(cache=True)
def _coloured(start, column, order):  # type: ignore[no-untyped-def]
    """Give each node, one after the other, the first colour that none of its neighbours has."""
    colour = np.full(len(order), -1, np.int32)
    taken = np.full(len(order) + 1, -1)
    for a in order:
        for b in column[start[a] : start[a + 1]]:
            if colour[b] >= 0:
                taken[colour[b]] = a
        free = 0
        while taken[free] == a:
            free += 1
        colour[a] = free
    return colour


@parallel
def _take_later(start, column, values, widest, bounds, portions, x, out):  # type: ignore[no-untyped-def]
    """Take from earlier rows of `out` what the rows of portions, of which no two touch a common one, share in `x`."""
    for k in nb.prange(len(portions)):
        near = np.empty(widest, x.dtype)
        for a in range(bounds[portions[k]], bounds[portions[k] + 1]):
            _add_transposed(start, column, values, a, -x[3 * a], -x[3 * a + 1], -x[3 * a + 2], near, out)


@parallel
def _sweep(start, column, values, widest, bounds, portions, inverses, target, x, found, product):  # type: ignore[no-untyped-def]
    """Go through the rows of such portions; add what the change from `x` makes of the rows before to `product`."""
    for k in nb.prange(len(portions)):
        near = np.empty(widest, x.dtype)
        rest = np.empty(3, x.dtype)
        for a in range(bounds[portions[k]], bounds[portions[k] + 1]):
            _gather_blocks(column[start[a] : start[a + 1]], found, near)
            for i in range(3):
                rest[i] = target[3 * a + i] - _row_product(start, values, a, i, near)
            for i in range(3):
                found[3 * a + i] = (
                    inverses[a, i, 0] * rest[0] + inverses[a, i, 1] * rest[1] + inverses[a, i, 2] * rest[2]
                )
            for i in range(3):
                rest[i] = found[3 * a + i] - x[3 * a + i]
            _add_transposed(start, column, values, a, rest[0], rest[1], rest[2], near, product)


@jit
def _add_transposed(start, column, values, a, x0, x1, x2, near, out):  # type: ignore[no-untyped-def]
    """Add the product of row `a`, transposed, with the entries of its node to those of the nodes of its blocks."""
    first, last = start[a], start[a + 1]
    width = 3 * (last - first)
    row0 = values[9 * first : 9 * first + width]
    row1 = values[9 * first + width : 9 * first + 2 * width]
    row2 = values[9 * first + 2 * width : 9 * first + 3 * width]
    for m in range(width):
        near[m] = row0[m] * x0 + row1[m] * x1 + row2[m] * x2
    for j in range(last - first):
        b = 3 * column[first + j]
        for i in range(3):
            out[b + i] += near[3 * j + i]


@jit
def _gather_blocks(column, x, near):  # type: ignore[no-untyped-def]
    """Write the entries of `x` that belong to the nodes in `column` side by side into `near`."""
    for j in range(len(column)):
        for k in range(3):
            near[3 * j + k] = x[3 * column[j] + k]


@jit
def _row_product(start, values, a, i, near):  # type: ignore[no-untyped-def]
    """Return the product of scalar row `i` of row `a` with `near`."""
    width = 3 * (start[a + 1] - start[a])
    begin = 9 * start[a] + i * width
    row = values[begin : begin + width]
    total = 0.0
    for m in range(len(row)):
        total += row[m] * near[m]
    return total


@parallel
def _invert_diagonal(diagonal, inverses, indefinite):  # type: ignore[no-untyped-def]
    """Fill ``inverses (n, 3, 3)``; say which blocks are not positive definite."""
    for a in nb.prange(len(diagonal)):
        d = np.empty((3, 3))
        for i in range(3):
            for k in range(3):
                d[i, k] = diagonal[a, i, k]
        minor = d[0, 0] * d[1, 1] - d[0, 1] * d[1, 0]
        determinant = inverse(d, inverses[a])
        indefinite[a] = not (d[0, 0] > 0.0 and minor > 0.0 and determinant > 0.0)
