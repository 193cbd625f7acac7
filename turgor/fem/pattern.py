"""The sparse pattern that every term's stiffness goes into, built once per system.

Each term couples the degrees of freedom of its blocks of nodes (the ten nodes of a tetrahedron, the six
of a face) and hands over dense symmetric block matrices as packed upper triangles. The pattern is the upper
triangle, in compressed rows, of the matrix over the free degrees of freedom; which parts of which blocks add up to
which pair of nodes is sorted out here once, so that an assembly is one pass over a list: without
locks, in parallel over nodes, and in the same order (hence to the same bits) every time.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.incidence import Incidence, both_ways, coupled
from turgor.fem.kernels import CHUNKS

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


def packed_size(n_dofs: int) -> int:
    """Return the number of entries in the packed upper triangle of an ``n_dofs`` square matrix."""
    return n_dofs * (n_dofs + 1) // 2


@dataclass(frozen=True, eq=False)
class BlockLayout:
    """Where the blocks of coupled nodes stand in an array, each in three rows of three entries.

    Attributes
    ----------
    place
        Of the pairs of nodes on and above the diagonal, where their blocks begin, ``(n_pairs,)``.
    width
        By how much each of a block's rows stands behind the one before.
    turned
        Whether it stands there transposed.
    """

    place: Longs
    width: Longs
    turned: NDArray[np.bool_]


class SparsePattern:
    """Upper-triangular compressed rows over the free degrees of freedom, and the map from blocks into it.

    Parameters
    ----------
    n_nodes, dimension
        Size of the mesh; the degrees of freedom of node ``a`` are ``a * dimension + i``.
    groups
        For each term, the nodes that its blocks couple, ``(n_blocks, nodes_per_block)``.
    free
        Which degrees of freedom are unknown, ``(n_nodes * dimension,)``.
    couplings
        Nodes that are coupled too, ``(n, nodes_per_block)``: room for the blocks of :meth:`add_blocks`, which come and
        go with contact.

    Attributes
    ----------
    n_free
        Number of unknowns.
    packed_offsets
        Where each group's packed entries begin in the shared buffer, ``(n_groups + 1,)``.
    """

    def __init__(
        self,
        n_nodes: int,
        dimension: int,
        groups: Sequence[Ints],
        free: NDArray[np.bool_],
        couplings: Sequence[Ints] = (),
    ) -> None:
        self.free = free
        self.n_free = int(free.sum())
        self._dimension = dimension
        self._node_start, self._node_column = coupled(Incidence.of(n_nodes, [*groups, *couplings]))
        sizes = [len(group) * packed_size(group.shape[1] * dimension) for group in groups]
        self.packed_offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self._groups = groups

    @property
    def row_start(self) -> Ints:
        """Where the rows begin, zero-based, ``(n_free + 1,)``."""
        return self._rows[1]

    @property
    def column(self) -> Ints:
        """The columns of the stored entries, ascending in each row, the first of which is its diagonal."""
        return self._rows[2]

    @property
    def n_stored(self) -> int:
        """Number of stored entries."""
        return len(self.column)

    @property
    def blocks_per_node(self) -> float:
        """How many blocks of the upper triangle, the diagonal's included, a node has on average."""
        return len(self._node_column) / (len(self._node_start) - 1)

    def sum_blocks(self, packed: Floats, out: Floats) -> None:
        """Add up the `packed` block entries (all groups, one after the other) into the stored values `out`."""
        number, row_start, _ = self._rows
        nodes = (self._node_start, self._node_column)
        _sum_into_rows(packed, *self._pairs, *nodes, number, row_start, self._dimension, out)

    def covers(self, nodes: Ints) -> bool:
        """Whether all nodes of each block ``(n_blocks, nodes_per_block)`` are coupled in this pattern."""
        return bool(_all_coupled(nodes, self._node_start, self._node_column))

    def add_blocks(self, nodes: Ints, packed: Floats, out: Floats) -> None:
        """Add packed blocks ``(n_blocks, packed)`` that the pattern covers to the stored values `out`."""
        _add(nodes, packed, *self._rows, self._dimension, out)

    def graph(self) -> sp.csr_matrix:
        """Return which nodes are coupled, both ways, ``(n_nodes, n_nodes)``.

        Its values are one more than the places of the blocks among those on and above the diagonal, which
        :meth:`sum_into_layout` goes through; negative below it.
        """
        start, column, names = both_ways(self._node_start, self._node_column)
        n = len(start) - 1
        return sp.csr_matrix((names, column, start), shape=(n, n))

    def sum_into_layout(self, packed: Floats, layout: BlockLayout, out: NDArray[np.floating]) -> None:
        """Add up the `packed` block entries of a system in space into blocks, fixed components being identity."""
        places = (layout.place, layout.width, layout.turned)
        nodes = (self._node_start, self._node_column, self.free.reshape(-1, 3))
        _sum_into_layout(packed, *self._pairs, *places, *nodes, out)

    @functools.cached_property
    def _rows(self) -> tuple[Ints, Ints, Ints]:
        """The number of each degree of freedom among the unknowns, −1 if it is fixed, and the compressed rows.

        Only a factorisation asks for them.
        """
        number = np.where(self.free, np.cumsum(self.free, dtype=np.int32) - np.int32(1), np.int32(-1))
        column = np.empty(len(self._node_column) * self._dimension**2, np.int32)
        row_start = np.zeros(self.n_free + 1, np.int32)
        n_stored = _number(self._node_start, self._node_column, number, self._dimension, row_start, column)
        return number, row_start, column[:n_stored]

    @functools.cached_property
    def _pairs(self) -> tuple[Longs, Ints, Ints]:
        """For each pair of coupled nodes, where the packed entries that add up to it begin, and how they follow."""
        incidence = Incidence.of(len(self._node_start) - 1, self._groups)
        where = (*incidence.arrays, self._node_start, self._node_column)
        sizes = [np.full(len(group), packed_size(group.shape[1] * self._dimension)) for group in self._groups]
        begin = np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64)
        start, none = np.zeros(len(self._node_column) + 1, np.int64), np.empty(0, np.int32)
        _list_sources(*where, begin, self._dimension, start[1:], none, none)
        np.cumsum(start, out=start)
        source, code = np.empty(start[-1], np.int32), np.empty(start[-1], np.int32)
        _list_sources(*where, begin, self._dimension, start[:-1].copy(), source, code)
        return start, source, code


@nb.njit(cache=True)
def _number(node_start, node_column, number, d, row_start, column):  # type: ignore[no-untyped-def]
    """Fill the compressed rows of the unknowns; return how many entries they have."""
    at = 0
    for a in range(len(node_start) - 1):
        for i in range(d):
            row = number[a * d + i]
            if row < 0:
                continue
            for m in range(node_start[a], node_start[a + 1]):
                for k in range(i if m == node_start[a] else 0, d):
                    other = number[node_column[m] * d + k]
                    if other >= 0:
                        column[at] = other
                        at += 1
            row_start[row + 1] = at
    return at


UPPER, AS_IT_IS, TRANSPOSED, FOLDED = 0, 1, 2, 3
"""How a pair's entries go into the stored ones: of one node, of an earlier and a later one, of a later and an earlier
one, and of two places in a block that are the same node."""


@nb.njit(cache=True, parallel=True)
def _list_sources(  # type: ignore[no-untyped-def]
    nodes, first, start, place, block, row_start, column, begin, dimension, at, source, code
):
    """List where the packed entries of each pair begin, `source`, and how its rows follow each other, `code`.

    From ``at[m]`` on, which moves on; without room they are only counted.
    """
    n = len(start) - 1
    for chunk in nb.prange(CHUNKS):
        where = np.empty(n, np.int64)
        for a in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            for m in range(row_start[a], row_start[a + 1]):
                where[column[m]] = m
            for k in place[start[a] : start[a + 1]]:
                e = block[k]
                rows = (first[e + 1] - first[e]) * dimension
                for other in range(first[e], first[e + 1]):
                    b = nodes[other]
                    if b < a or (b == a and other < k):
                        continue
                    m = where[b]
                    if len(source):
                        row = (min(k, other) - first[e]) * dimension
                        diagonal = begin[e] + row * rows - row * (row - 1) // 2
                        how = (UPPER if k == other else FOLDED) if a == b else (AS_IT_IS if k < other else TRANSPOSED)
                        source[at[m]] = diagonal + abs(other - k) * dimension
                        code[at[m]] = 4 * (rows - row) + how
                    at[m] += 1


@nb.njit(cache=True)
def _all_coupled(group, node_start, node_column):  # type: ignore[no-untyped-def]
    for block in range(len(group)):
        for p in range(group.shape[1]):
            for q in range(group.shape[1]):
                low, high = group[block, p], group[block, q]
                if low < high:
                    row = node_column[node_start[low] : node_start[low + 1]]
                    at = np.searchsorted(row, high)
                    if at == len(row) or row[at] != high:
                        return False
    return True


@nb.njit(cache=True)
def _add(group, packed, number, row_start, column, d, out):  # type: ignore[no-untyped-def]
    """Add packed blocks to the stored values, entry by entry: for few of them no list is worth while."""
    n = group.shape[1]
    for block in range(len(group)):
        at = 0
        for first in range(n * d):
            one = number[group[block, first // d] * d + first % d]
            for second in range(first, n * d):
                other = number[group[block, second // d] * d + second % d]
                row, col = min(one, other), max(one, other)
                if row >= 0:
                    entry = row_start[row] + np.searchsorted(column[row_start[row] : row_start[row + 1]], col)
                    # The mirror image of an entry between two places of one node and component is the entry itself.
                    out[entry] += packed[block, at] * (2.0 if row == col and first != second else 1.0)
                at += 1


@nb.njit(cache=True, parallel=True)
def _sum_into_rows(packed, start, source, code, node_start, node_column, number, row_start, d, out):  # type: ignore[no-untyped-def]
    n_chunks = 64
    n = len(node_start) - 1
    for chunk in nb.prange(n_chunks):
        block, at = np.empty((3, 3)), np.empty(3, np.int64)
        for a in range(chunk * n // n_chunks, (chunk + 1) * n // n_chunks):
            for i in range(d):
                at[i] = row_start[max(number[a * d + i], 0)]
            for m in range(node_start[a], node_start[a + 1]):
                _sum_pair(packed, start[m], start[m + 1], source, code, d, block)
                b = node_column[m]
                for i in range(d):
                    if number[a * d + i] >= 0:
                        for k in range(i if b == a else 0, d):
                            if number[b * d + k] >= 0:
                                out[at[i]] = block[i, k]
                                at[i] += 1


@nb.njit(cache=True, parallel=True)
def _sum_into_layout(  # type: ignore[no-untyped-def]
    packed, start, source, code, place, widths, turned, node_start, node_column, free, out
):
    n_chunks = 64
    n = len(free)
    for chunk in nb.prange(n_chunks):
        block = np.empty((3, 3))
        for a in range(chunk * n // n_chunks, (chunk + 1) * n // n_chunks):
            for m in range(node_start[a], node_start[a + 1]):
                _sum_pair(packed, start[m], start[m + 1], source, code, 3, block)
                b = node_column[m]
                for i in range(3):
                    for k in range(3):
                        if not (free[a, i] and free[b, k]):
                            block[i, k] = 1.0 * (a == b and i == k)
                to, width = place[m], widths[m]
                for i in range(3):
                    for k in range(3):
                        out[to + i * width + k] = block[k, i] if turned[m] else block[i, k]


@nb.njit(cache=True, inline="always")
def _sum_pair(packed, first, last, source, code, d, block):  # type: ignore[no-untyped-def]
    """Add up the packed entries of one pair of nodes into its `block`, of which d rows and columns count.

    Written out and with indices that cannot count from the end: loops over the nine take far longer.
    """
    one, two = np.uint64(1), np.uint64(2)
    s00 = s01 = s02 = s10 = s11 = s12 = s20 = s21 = s22 = 0.0
    for k in range(first, last):
        how, width = code[k] & 3, code[k] >> 2
        # Each row of a packed triangle begins one entry earlier than the one before.
        r0, r1, r2 = np.uint64(source[k]), np.uint64(source[k] + width - 1), np.uint64(source[k] + 2 * width - 3)
        if how == UPPER:
            s00 += packed[r0]
            s01 += packed[r0 + one]
            s11 += packed[r1 + one]
            s10 += packed[r0 + one]
            if d == 3:
                s02 += packed[r0 + two]
                s12 += packed[r1 + two]
                s22 += packed[r2 + two]
                s20 += packed[r0 + two]
                s21 += packed[r1 + two]
            continue
        if how != TRANSPOSED:
            s00 += packed[r0]
            s01 += packed[r0 + one]
            s10 += packed[r1]
            s11 += packed[r1 + one]
            if d == 3:
                s02 += packed[r0 + two]
                s12 += packed[r1 + two]
                s20 += packed[r2]
                s21 += packed[r2 + one]
                s22 += packed[r2 + two]
        if how != AS_IT_IS:
            s00 += packed[r0]
            s10 += packed[r0 + one]
            s01 += packed[r1]
            s11 += packed[r1 + one]
            if d == 3:
                s20 += packed[r0 + two]
                s21 += packed[r1 + two]
                s02 += packed[r2]
                s12 += packed[r2 + one]
                s22 += packed[r2 + two]
    block[0, 0], block[0, 1], block[0, 2] = s00, s01, s02
    block[1, 0], block[1, 1], block[1, 2] = s10, s11, s12
    block[2, 0], block[2, 1], block[2, 2] = s20, s21, s22
