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
        dof_column = np.empty(dof_start[-1], np.int32)
        _fill_columns(node_start, node_column, dof_start, dimension, dof_column)
        dof_row = np.repeat(np.arange(n_nodes * dimension, dtype=np.int32), np.diff(dof_start))
        stored = free[dof_row] & free[dof_column]
        self.n_stored = int(stored.sum())
        number = np.cumsum(free, dtype=np.int32) - np.int32(1)
        self.column = number[dof_column[stored]]
        counts = np.bincount(number[dof_row[stored]], minlength=self.n_free)
        self.row_start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        place = np.where(stored, np.cumsum(stored) - 1, -1)

        sizes = [len(group) * packed_size(group.shape[1] * dimension) for group in groups]
        self.packed_offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        target = np.empty(self.packed_offsets[-1], np.int32)
        for group, begin, end in zip(groups, self.packed_offsets[:-1], self.packed_offsets[1:], strict=True):
            block_target = target[begin:end].reshape(len(group), packed_size(group.shape[1] * dimension))
            _find_targets(group, node_start, node_column, dof_start, dimension, place, block_target)
        self._source_start, self._source = _invert(target, self.n_stored)
        self._places = (node_start, node_column, dof_start, dimension, place)

    def sum_blocks(self, packed: Floats, out: Floats) -> None:
        """Add up the `packed` block entries (all groups, one after the other) into the stored values `out`."""
        _gather(packed, self._source_start, self._source, out)

    def covers(self, nodes: Ints) -> bool:
        """Whether all nodes of each block ``(n_blocks, nodes_per_block)`` are coupled in this pattern."""
        node_start, node_column, *_ = self._places
        return bool(_all_coupled(nodes, node_start, node_column))

    def add_blocks(self, nodes: Ints, packed: Floats, out: Floats) -> None:
        """Add packed blocks ``(n_blocks, packed)`` that the pattern covers to the stored values `out`."""
        target = np.empty(packed.shape, np.int32)
        _find_targets(nodes, *self._places, target)
        inside = target >= 0
        out += np.bincount(target[inside], packed[inside], minlength=self.n_stored)

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
def _fill_columns(node_start, node_column, dof_start, dimension, dof_column):  # type: ignore[no-untyped-def]
    for a in range(len(node_start) - 1):
        if node_start[a + 1] == node_start[a]:
            continue
        for i in range(dimension):
            at = dof_start[a * dimension + i]
            for k in range(i, dimension):
                dof_column[at] = a * dimension + k
                at += 1
            for m in range(node_start[a] + 1, node_start[a + 1]):
                for k in range(dimension):
                    dof_column[at] = node_column[m] * dimension + k
                    at += 1


@nb.njit(cache=True, parallel=True)
def _find_targets(group, node_start, node_column, dof_start, dimension, place, target):  # type: ignore[no-untyped-def]
    """Fill ``target (n_blocks, packed)``: the stored place of each packed entry, -1 where a dof is fixed."""
    n_local = group.shape[1]
    for block in nb.prange(len(group)):
        # Rank of the later node's block in the earlier node's row, for each pair.
        rank = np.zeros((n_local, n_local), np.int64)
        for p in range(n_local):
            for q in range(n_local):
                low, high = group[block, p], group[block, q]
                if low < high:
                    first, last = node_start[low], node_start[low + 1] - 1
                    while first < last:
                        middle = (first + last) // 2
                        if node_column[middle] < high:
                            first = middle + 1
                        else:
                            last = middle
                    rank[p, q] = first - node_start[low]
        m = 0
        for row in range(n_local * dimension):
            p, i = row // dimension, row % dimension
            for col in range(row, n_local * dimension):
                q, k = col // dimension, col % dimension
                a, b = group[block, p], group[block, q]
                if a == b:
                    entry = dof_start[a * dimension + min(i, k)] + abs(k - i)
                elif a < b:
                    entry = dof_start[a * dimension + i] + dimension * rank[p, q] - i + k
                else:
                    entry = dof_start[b * dimension + k] + dimension * rank[q, p] - k + i
                target[block, m] = place[entry]
                m += 1


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
def _invert(target, n_stored):  # type: ignore[no-untyped-def]
    """Counting sort: for each stored entry, the packed entries that add up to it."""
    start = np.zeros(n_stored + 1, np.int64)
    for entry in target:
        if entry >= 0:
            start[entry + 1] += 1
    for k in range(n_stored):
        start[k + 1] += start[k]
    at = start[:-1].copy()
    source = np.empty(start[-1], np.int32)
    for m in range(len(target)):
        entry = target[m]
        if entry >= 0:
            source[at[entry]] = m
            at[entry] += 1
    return start, source


@nb.njit(cache=True, parallel=True)
def _gather(packed, source_start, source, out):  # type: ignore[no-untyped-def]
    n_chunks = 64
    for chunk in nb.prange(n_chunks):
        for k in range(chunk * len(out) // n_chunks, (chunk + 1) * len(out) // n_chunks):
            total = 0.0
            for m in range(source_start[k], source_start[k + 1]):
                total += packed[source[m]]
            out[k] = total


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
