"""A symmetric matrix of 3 × 3 blocks, one for each pair of coupled nodes, and the sweeps of a smoother over it.

The blocks left of the diagonal lie in rows, those right of it in rows in reverse order, each as a sweep goes through
them: going backward through memory takes three times as long. The three scalar rows of a node lie one behind the
other, each over all its blocks: the entries of a vector are gathered once for the three, and the sums run over memory
that lies side by side.

Nodes are numbered by reverse Cuthill and McKee (1969), so that neighbours are near, and cut into portions that touch
the next and the last one only. Every other portion comes first, then the rest: Gauss–Seidel goes through all portions
of one half at once, its result does not depend on the number of threads, and the backward sweep is the transpose of
the forward one. Within a portion nodes of one colour, which are not coupled, follow each other, so that a row need not
wait for the one before it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, inverse, jit, parallel
from turgor.fem.pattern import BlockLayout, SparsePattern

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

PORTIONS = 16
"""Most portions that the nodes are cut into."""


@dataclass(frozen=True, eq=False)
class Triangle:
    """The blocks on one side of the diagonal: row c is that of node c, or `backward` that of the c-th from the end.

    Attributes
    ----------
    start, column
        Where each row begins, ``(n_nodes + 1,)``, and the nodes of its blocks, ascending.
    values
        Of the scalar rows, ``(9 n_blocks,)``: a view of those of :class:`BlockMatrix`.
    """

    start: Longs
    column: Ints
    values: Singles
    backward: bool

    def add_product(self, x: Floats, out: Floats) -> None:
        """Add the product with ``x (3 n_nodes,)`` to `out`."""
        _add_product(self.start, self.column, self.values, self.backward, x, out)


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
    values
        Of all blocks, in single precision, placed as `layout` says.
    layout
        Where the blocks of the pattern stand among them.
    earlier, later
        The blocks left and right of the diagonal.
    diagonal
        Those on it, ``(n_nodes, 3, 3)``.
    structure
        A one for each block, ``(n_nodes, n_nodes)``.
    """

    def __init__(self, pattern: SparsePattern) -> None:
        graph = pattern.graph()
        self.order, self._bounds = _portions(graph)
        self.rank: Ints = np.argsort(self.order).astype(np.int32)
        half = len(self._bounds) // 2
        self._halves = ((0, half), (half, len(self._bounds) - 1))
        ordered = graph[self.order][:, self.order]
        ordered.sort_indices()
        n, blocks = len(self.order), ordered.nnz
        self.structure = sp.csr_matrix((np.ones(blocks), ordered.indices, ordered.indptr), shape=ordered.shape)
        self.values: Singles = np.zeros(9 * blocks, np.float32)
        row, column, name = np.repeat(np.arange(n), np.diff(ordered.indptr)), ordered.indices, ordered.data
        place, width = np.empty(blocks, np.int64), np.full(blocks, 3)
        self.earlier = self._triangle(row, column, 0, place, width, backward=False)
        self.later = self._triangle(row, column, len(self.earlier.values), place, width, backward=True)
        on, begin = np.flatnonzero(row == column), len(self.earlier.values) + len(self.later.values)
        place[on] = begin + 9 * np.arange(n)
        self.diagonal: Singles = self.values[begin:].reshape(n, 3, 3)
        # The diagonal blocks are their own transposes.
        self.layout = BlockLayout(
            *_named(place, width, name), *_named(place, width, np.where(row == column, name, -name))
        )
        self._inverse = np.empty((n, 3, 3))
        self._replaced = np.zeros(0, np.intp)

    def _triangle(
        self, row: Longs, column: Ints, begin: int, place: Longs, width: Longs, *, backward: bool
    ) -> Triangle:
        """Return one side of the diagonal, whose values begin at `begin`; fill the places and widths of its blocks."""
        n = len(self.order)
        entries = np.flatnonzero(column > row if backward else column < row)
        if backward:
            entries = entries[np.argsort(-row[entries], kind="stable")]
        counts = np.bincount(row[entries], minlength=n)
        start = np.concatenate([[0], np.cumsum(counts[::-1] if backward else counts)])
        first = np.repeat(start[:-1], np.diff(start))
        place[entries] = begin + 9 * first + 3 * (np.arange(len(entries)) - first)
        width[entries] = 3 * counts[row[entries]]
        values = self.values[begin : begin + 9 * len(entries)]
        return Triangle(start, np.ascontiguousarray(column[entries], np.int32), values, backward)

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

    def product(self, x: Floats) -> Floats:
        """Return the product with a vector ``(3 n_nodes,)``."""
        out = (self.diagonal @ x.reshape(-1, 3, 1)).ravel()
        self.earlier.add_product(x, out)
        self.later.add_product(x, out)
        return out

    def sweep_forward(self, right: Floats) -> tuple[Floats, Floats]:
        """Return what Gauss–Seidel makes of zero going forward, and what it leaves of the right-hand side."""
        x = np.empty_like(right)
        self._sweep(self.earlier, self._halves, right, x)
        # It balances all but what comes later in each row.
        later = -self._excess(x)
        self.later.add_product(x, later)
        return x, -later

    def sweep_backward(self, right: Floats, x: Floats) -> tuple[Floats, Floats]:
        """Return what Gauss–Seidel makes of `x` going backward, and the product with it."""
        before = np.zeros_like(x)
        self.earlier.add_product(x, before)
        target = right - before + self._excess(x)
        found = np.empty_like(x)
        self._sweep(self.later, self._halves[::-1], target, found)
        # It balances all but what has changed earlier in each row.
        product = target - self._excess(found)
        self.earlier.add_product(found, product)
        return found, product

    def _sweep(self, side: Triangle, halves: tuple[tuple[int, int], ...], right: Floats, x: Floats) -> None:
        for first, last in halves:
            _sweep(
                *(side.start, side.column, side.values, side.backward, self._bounds),
                *(self._inverse, right, first, last, x),
            )

    def _excess(self, x: Floats) -> Floats:
        """Return the product with what the diagonal blocks of the sweeps have more than those of the matrix."""
        excess = np.zeros((len(self.order), 3))
        if len(self._replaced):
            at = x.reshape(-1, 3)[self._replaced]
            excess[self._replaced] = (self._added @ at[:, :, None])[:, :, 0]
        return excess.ravel()


def _portions(graph: sp.csr_matrix) -> tuple[Ints, Longs]:
    """Return an order of the nodes and the bounds of their portions."""
    structure = sp.csr_matrix((np.ones(graph.nnz, np.int8), graph.indices, graph.indptr), shape=graph.shape)
    near = scipy.sparse.csgraph.reverse_cuthill_mckee(structure, symmetric_mode=True).astype(np.int32)
    n = len(near)
    rank = np.argsort(near).astype(np.int32)
    bandwidth = int(np.abs(np.repeat(rank, np.diff(graph.indptr)) - rank[graph.indices]).max())
    count = max(1, min(PORTIONS, n // (bandwidth + 1)))
    cuts = np.linspace(0, n, count + 1).astype(np.int64)
    sizes = cuts[1:] - cuts[:-1]
    portion = np.repeat(np.arange(count), sizes)
    colour = _coloured(graph.indptr, graph.indices, near)
    bounds = np.concatenate([[0], np.cumsum(np.concatenate([sizes[::2], sizes[1::2]]))])
    return near[np.lexsort((colour[near], portion, portion % 2))], bounds


def _named(place: Longs, width: Longs, name: Longs) -> tuple[Longs, Longs]:
    """Return places and widths of those blocks whose names, counted from one, are positive, in their order."""
    known = name > 0
    order = np.empty(int(known.sum()), np.int64)
    order[name[known] - 1] = np.flatnonzero(known)
    return place[order], width[order]


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
def _add_product(start, column, values, backward, x, out):  # type: ignore[no-untyped-def]
    n = len(start) - 1
    for chunk in nb.prange(CHUNKS):
        near = np.empty(_widest(start), x.dtype)
        for c in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            a = n - 1 - c if backward else c
            _gather_blocks(column[start[c] : start[c + 1]], x, near)
            for i in range(3):
                out[3 * a + i] += _row_product(start, values, c, i, near)


@parallel
def _sweep(start, column, values, backward, bounds, inverses, right, first, last, x):  # type: ignore[no-untyped-def]
    """Go through the rows of some portions, of which none touches another."""
    n = len(start) - 1
    for portion in nb.prange(first, last):
        near = np.empty(_widest(start), x.dtype)
        rest = np.empty(3, x.dtype)
        begin = n - bounds[portion + 1] if backward else bounds[portion]
        for c in range(begin, begin + bounds[portion + 1] - bounds[portion]):
            a = n - 1 - c if backward else c
            _gather_blocks(column[start[c] : start[c + 1]], x, near)
            for i in range(3):
                rest[i] = right[3 * a + i] - _row_product(start, values, c, i, near)
            for i in range(3):
                x[3 * a + i] = inverses[a, i, 0] * rest[0] + inverses[a, i, 1] * rest[1] + inverses[a, i, 2] * rest[2]


@jit
def _widest(start):  # type: ignore[no-untyped-def]
    """Return the number of entries in the longest row."""
    most = 0
    for a in range(len(start) - 1):
        most = max(most, start[a + 1] - start[a])
    return 3 * most


@jit
def _gather_blocks(column, x, near):  # type: ignore[no-untyped-def]
    """Write the entries of `x` that belong to the nodes in `column` side by side into `near`."""
    for j in range(len(column)):
        for k in range(3):
            near[3 * j + k] = x[3 * column[j] + k]


@jit
def _row_product(start, values, c, i, near):  # type: ignore[no-untyped-def]
    """Return the product of scalar row `i` of row `c` with `near`."""
    width = 3 * (start[c + 1] - start[c])
    begin = 9 * start[c] + i * width
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
