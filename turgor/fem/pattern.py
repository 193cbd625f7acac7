"""The sparse pattern that every term's stiffness goes into, built once per system.

Each term couples the degrees of freedom of its blocks of nodes (the ten nodes of a tetrahedron, the six
of a face) and hands over dense symmetric block matrices as packed upper triangles. The pattern is the upper
triangle, in compressed rows, of the matrix over the free degrees of freedom; which packed entries add up to
which stored value is sorted out here once, so that an assembly is one pass over a list: without
locks, in parallel over rows, and in the same order (hence to the same bits) every time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


def packed_size(n_dofs: int) -> int:
    """Return the number of entries in the packed upper triangle of an ``n_dofs`` square matrix."""
    return n_dofs * (n_dofs + 1) // 2


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
    row_start, column
        The compressed rows, zero-based, columns ascending; the first entry of each row is its diagonal.
    n_free, n_stored
        Number of unknowns and of stored entries.
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
        node_start, node_column = _node_pattern(n_nodes, [*groups, *couplings])
        dof_start = _dof_row_starts(node_start, dimension)
        place = np.empty(dof_start[-1], np.int32)
        column = np.empty(dof_start[-1], np.int32)
        self.row_start = np.zeros(self.n_free + 1, np.int32)
        number = np.cumsum(free, dtype=np.int32) - np.int32(1)
        shape = (node_start, node_column, dof_start, dimension)
        self.n_stored = int(_number(*shape, free, number, place, self.row_start, column))
        self.column = column[: self.n_stored]
        self._places = (*shape, place)
        sizes = [len(group) * packed_size(group.shape[1] * dimension) for group in groups]
        self.packed_offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self._sources = self._sources_of(groups)

    def sum_blocks(self, packed: Floats, out: Floats) -> None:
        """Add up the `packed` block entries (all groups, one after the other) into the stored values `out`."""
        out[:] = 0.0
        _gather(packed, *self._sources, out)

    def covers(self, nodes: Ints) -> bool:
        """Whether all nodes of each block ``(n_blocks, nodes_per_block)`` are coupled in this pattern."""
        node_start, node_column, *_ = self._places
        return bool(_all_coupled(nodes, node_start, node_column))

    def add_blocks(self, nodes: Ints, packed: Floats, out: Floats) -> None:
        """Add packed blocks ``(n_blocks, packed)`` that the pattern covers to the stored values `out`."""
        node_start, node_column, dof_start, dimension, place = self._places
        pairs = _find_pairs(nodes, node_start, node_column)
        _add(nodes, pairs, packed, node_start, dof_start, dimension, place, out)

    def graph(self) -> sp.csr_matrix:
        """Return which nodes are coupled, both ways, ``(n_nodes, n_nodes)``.

        Its values are one more than the places of the blocks among those on and above the diagonal, which
        :meth:`expand` goes through; negative below it.
        """
        node_start, node_column, *_ = self._places
        names = np.arange(1, len(node_column) + 1)
        n = len(node_start) - 1
        upper = sp.csr_matrix((names, node_column, node_start), shape=(n, n))
        return sp.csr_matrix(upper - sp.triu(upper, 1).T)

    def expand(self, values: Floats, above: Longs, below: Longs, width: Longs, out: Floats) -> None:
        """Write the stored values as whole scalar rows, those of fixed components as identity.

        The blocks of nodes on and above the diagonal go to the places `above` ``(n_blocks,)`` of `out`, their
        transposes to `below`, in the rows of the later node: from there on, the scalar rows of each node, of `width`
        entries ``(n_nodes,)``, lie one behind the other.
        """
        node_start, node_column, dof_start, dimension, place = self._places
        _expand(values, above, below, width, node_start, node_column, dof_start, dimension, place, out)

    def _sources_of(self, groups: Sequence[Ints]) -> tuple[Longs, Ints]:
        """Return the packed entries of the groups that add up to each stored value, and where each begins.

        They are sought by pairs of nodes, of which there are nine times fewer.
        """
        node_start, node_column, _, dimension, _ = self._places
        pairs = [_find_pairs(group, node_start, node_column) for group in groups]
        start = np.zeros(len(node_column) + 1, np.int64)
        for found in pairs:
            start[1:] += np.bincount(found.ravel(), minlength=len(node_column))
        np.cumsum(start, out=start)
        at, source, code = start[:-1].copy(), np.empty(start[-1], np.int32), np.empty(start[-1], np.int32)
        begin = 0
        for group, found in zip(groups, pairs, strict=True):
            _list_sources(group, found, begin, dimension, at, source, code)
            begin += len(group) * packed_size(group.shape[1] * dimension)
        first, single = _spread(start, source, code, *self._places, self.n_stored)
        return first, single


def _node_pattern(n_nodes: int, groups: Sequence[Ints]) -> tuple[NDArray[np.int64], Ints]:
    # Two nodes are coupled where a block holds both: the nonzeros of AᵀA, A the block-node incidence.
    incidences = [
        sp.csr_matrix(
            (np.ones(group.size, np.float32), group.ravel(), np.arange(0, group.size + 1, group.shape[1])),
            shape=(len(group), n_nodes),
        )
        for group in groups
        if len(group)
    ]
    incidence = sp.vstack([*incidences, sp.csr_matrix((0, n_nodes), dtype=np.float32)], format="csr")
    coupled = sp.triu(incidence.T @ incidence, format="csr")
    coupled.sort_indices()
    return coupled.indptr.astype(np.int64), coupled.indices.astype(np.int32)


def _dof_row_starts(node_start: NDArray[np.int64], dimension: int) -> NDArray[np.int64]:
    # Row i of a node's diagonal block holds dimension - i entries of that block, then whole blocks.
    blocks = np.diff(node_start)
    lengths = dimension * blocks[:, None] - np.arange(dimension)
    lengths[blocks == 0] = 0
    return np.concatenate([[0], np.cumsum(lengths.ravel())]).astype(np.int64)


@nb.njit(cache=True)
def _number(node_start, node_column, dof_start, dimension, free, number, place, row_start, column):  # type: ignore[no-untyped-def]
    """Number the entries whose row and column are free; fill their `place`, −1 for the others, and the rows."""
    at = 0
    for a in range(len(node_start) - 1):
        for i in range(dimension):
            row = a * dimension + i
            entry = dof_start[row]
            for m in range(node_start[a], node_start[a + 1]):
                for k in range(i if m == node_start[a] else 0, dimension):
                    other = node_column[m] * dimension + k
                    place[entry] = -1
                    if free[row] and free[other]:
                        place[entry] = at
                        column[at] = number[other]
                        at += 1
                    entry += 1
            if free[row]:
                row_start[number[row] + 1] = at
    return at


@nb.njit(cache=True, parallel=True)
def _find_pairs(group, node_start, node_column):  # type: ignore[no-untyped-def]
    """Return the place of each block's pairs of nodes among all coupled pairs, ``(n_blocks, n (n + 1)/2)``."""
    n = group.shape[1]
    found = np.empty((len(group), n * (n + 1) // 2), np.int32)
    for block in nb.prange(len(group)):
        at = 0
        for p in range(n):
            for q in range(p, n):
                low = min(group[block, p], group[block, q])
                high = max(group[block, p], group[block, q])
                first, last = node_start[low], node_start[low + 1] - 1
                while first < last:
                    middle = (first + last) // 2
                    if node_column[middle] < high:
                        first = middle + 1
                    else:
                        last = middle
                found[block, at] = first
                at += 1
    return found


UPPER, AS_IT_IS, TRANSPOSED, FOLDED = 0, 1, 2, 3
"""How a pair's entries go into the stored ones: of one node, of an earlier and a later one, of a later and an earlier
one, and of two places in a block that are the same node."""


@nb.njit(cache=True)
def _list_sources(group, found, begin, dimension, at, source, code):  # type: ignore[no-untyped-def]
    """List where the packed entries of each pair begin, `source`, and how its rows follow each other, `code`."""
    n = group.shape[1]
    rows = n * dimension
    size = rows * (rows + 1) // 2
    for block in range(len(group)):
        pair = 0
        for p in range(n):
            row = p * dimension
            diagonal = begin + block * size + row * rows - row * (row - 1) // 2
            for q in range(p, n):
                a, b = group[block, p], group[block, q]
                how = UPPER if p == q else AS_IT_IS if a < b else TRANSPOSED if a > b else FOLDED
                k = at[found[block, pair]]
                at[found[block, pair]] += 1
                source[k] = diagonal + (q - p) * dimension
                code[k] = 4 * (rows - row) + how
                pair += 1


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
def _spread(start, source, code, node_start, node_column, dof_start, d, place, n_stored):  # type: ignore[no-untyped-def]
    """Return for each stored entry the packed ones that add up to it, in the order of the entries."""
    begin = np.zeros(n_stored + 1, np.int64)
    single = np.empty(d * d * len(source), np.int32)
    at = 0
    for a in range(len(node_start) - 1):
        for i in range(d):
            for m in range(node_start[a], node_start[a + 1]):
                row = dof_start[a * d + i] + d * (m - node_start[a]) - i
                for k in range(i if m == node_start[a] else 0, d):
                    entry = place[row + k]
                    if entry < 0:
                        continue
                    for n in range(start[m], start[m + 1]):
                        how, width = code[n] & 3, code[n] >> 2
                        r, c = (k, i) if how == TRANSPOSED else (i, k)
                        # Each row of a packed triangle begins one entry earlier than the one before.
                        single[at] = source[n] + r * width - r * (r + 1) // 2 + c
                        at += 1
                        if how == FOLDED and i != k:
                            single[at] = source[n] + c * width - c * (c + 1) // 2 + r
                            at += 1
                    begin[entry + 1] = at
    return begin, single[:at].copy()


@nb.njit(cache=True)
def _add(group, found, packed, node_start, dof_start, d, place, out):  # type: ignore[no-untyped-def]
    """Add packed blocks to the stored values, entry by entry: for few of them no list is worth while."""
    n = group.shape[1]
    for block in range(len(group)):
        m = 0
        for row in range(n * d):
            p, i = row // d, row % d
            for col in range(row, n * d):
                q, k = col // d, col % d
                a, b = group[block, p], group[block, q]
                # Of the two nodes the earlier one has the row; at a single node the lower component has it.
                r, c = (k, i) if a > b or (a == b and i > k) else (i, k)
                low = min(a, b)
                rank = found[block, p * n - p * (p - 1) // 2 + q - p] - node_start[low]
                entry = place[dof_start[low * d + r] + d * rank - r + c]
                if entry >= 0:
                    out[entry] += packed[block, m]
                m += 1


@nb.njit(cache=True, parallel=True)
def _gather(packed, start, source, out):  # type: ignore[no-untyped-def]
    n_chunks = 64
    for chunk in nb.prange(n_chunks):
        for k in range(chunk * len(out) // n_chunks, (chunk + 1) * len(out) // n_chunks):
            total = 0.0
            for m in range(start[k], start[k + 1]):
                total += packed[source[m]]
            out[k] += total


@nb.njit(cache=True, parallel=True)
def _expand(values, above, below, width, node_start, node_column, dof_start, d, place, out):  # type: ignore[no-untyped-def]
    for a in nb.prange(len(width)):
        for m in range(node_start[a], node_start[a + 1]):
            rank, b = m - node_start[a], node_column[m]
            for i in range(d):
                for k in range(i if rank == 0 else 0, d):
                    entry = place[dof_start[a * d + i] + d * rank - i + k]
                    value = values[entry] if entry >= 0 else 1.0 * (rank == 0 and i == k)
                    out[above[m] + i * width[a] + k] = value
                    out[below[m] + k * width[b] + i] = value
