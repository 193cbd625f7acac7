"""Which nodes blocks of nodes couple: the blocks of each node, the neighbours of each node, the parts of a body.

Blocks are the cells, faces and other groups of nodes that terms work on. Everything is done node by node from the
blocks that a node belongs to, so that neighbours need no sorting of all pairs and threads no locks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Incidence:
    """Blocks of nodes, one after the other, and where each node is found in them.

    Attributes
    ----------
    nodes
        The nodes of all blocks.
    first
        Where each block begins among them, ``(n_blocks + 1,)``.
    start, place
        Where each node's places begin, ``(n_nodes + 1,)``, and the places at which it is found, ascending.
    block
        The block of each place.
    """

    nodes: Ints
    first: Longs
    start: Longs
    place: Longs
    block: Ints

    @classmethod
    def of(cls, n_nodes: int, groups: Sequence[Ints]) -> Incidence:
        """Return that of groups of blocks, each ``(n_blocks, nodes_per_block)``."""
        nodes = np.concatenate([np.zeros(0, np.int32), *(group.ravel() for group in groups)]).astype(np.int32)
        widths = np.concatenate([np.zeros(0, np.int64), *(np.full(len(g), g.shape[1]) for g in groups)])
        first = np.concatenate([[0], np.cumsum(widths)]).astype(np.int64)
        block = np.repeat(np.arange(len(widths), dtype=np.int32), widths)
        start, place = _places(n_nodes, nodes)
        return cls(nodes, first, start, place, block)

    @property
    def arrays(self) -> tuple[Ints, Longs, Longs, Longs, Ints]:
        """What compiled functions take."""
        return self.nodes, self.first, self.start, self.place, self.block


def coupled(incidence: Incidence) -> tuple[Longs, Ints]:
    """Return which nodes share a block, as the upper triangle of a matrix in compressed rows.

    The starts ``(n_nodes + 1,)`` and the columns, ascending, of which the first is the diagonal. A node in no block is
    left without any.
    """
    n = len(incidence.start) - 1
    start, column = np.zeros(n + 1, np.int64), np.empty(0, np.int32)
    _list_later(*incidence.arrays, start[1:], column)
    np.cumsum(start, out=start)
    column = np.empty(start[-1], np.int32)
    _list_later(*incidence.arrays, start[:-1].copy(), column)
    # To columns and back to rows: that sorts them.
    upper = sp.csr_matrix((np.ones(len(column), np.int8), column, start), shape=(n, n)).tocsc().tocsr()
    return start, np.asarray(upper.indices, np.int32)


def both_ways(start: Longs, column: Ints) -> tuple[Longs, Ints, Longs]:
    """Return the rows of the whole matrix whose upper triangle is given, ascending, and the names of their entries.

    A name is one more than the place of the entry in the triangle; negative below the diagonal.
    """
    full = np.zeros_like(start)
    columns, names = np.empty(0, np.int32), np.empty(0, np.int64)
    _list_both_ways(start, column, full[1:], columns, names)
    np.cumsum(full, out=full)
    columns, names = np.empty(full[-1], np.int32), np.empty(full[-1], np.int64)
    _list_both_ways(start, column, full[:-1].copy(), columns, names)
    return full, columns, names


def parts(cells: Ints, n_nodes: int) -> tuple[int, Ints]:
    """Return how many parts that share no node cells ``(m, n)`` make up, and the part of each node ``(n_nodes,)``."""
    root = np.arange(n_nodes, dtype=np.int32)
    _join(cells, root)
    _, part = np.unique(root, return_inverse=True)
    return int(part.max()) + 1, part.astype(np.int32)


@nb.njit(cache=True)
def _places(n_nodes, nodes):  # type: ignore[no-untyped-def]
    start = np.zeros(n_nodes + 1, np.int64)
    for a in nodes:
        start[a + 1] += 1
    for a in range(n_nodes):
        start[a + 1] += start[a]
    at, place = start[:-1].copy(), np.empty(len(nodes), np.int64)
    for k in range(len(nodes)):
        a = nodes[k]
        place[at[a]] = k
        at[a] += 1
    return start, place


@nb.njit(cache=True, parallel=True)
def _list_later(nodes, first, start, place, block, at, column):  # type: ignore[no-untyped-def]
    """List the nodes, itself and later ones, that share a block with each node, from ``at[a]`` on, which moves on.

    With room for none they are only counted.
    """
    n = len(start) - 1
    for chunk in nb.prange(CHUNKS):
        seen = np.full(n, -1, np.int32)
        for a in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            for k in place[start[a] : start[a + 1]]:
                e = block[k]
                for b in nodes[first[e] : first[e + 1]]:
                    if b >= a and seen[b] != a:
                        seen[b] = a
                        if len(column):
                            column[at[a]] = b
                        at[a] += 1


@nb.njit(cache=True)
def _list_both_ways(start, column, at, columns, names):  # type: ignore[no-untyped-def]
    """List the entries of each row and their names from ``at[a]`` on, which moves on; only count them without room."""
    # Rows come one after the other, so that what is left of a diagonal is there, ascending, before the rest.
    for a in range(len(start) - 1):
        for m in range(start[a], start[a + 1]):
            b = column[m]
            if len(columns):
                columns[at[a]], names[at[a]] = b, m + 1
            at[a] += 1
            if b != a:
                if len(columns):
                    columns[at[b]], names[at[b]] = a, -(m + 1)
                at[b] += 1


@nb.njit(cache=True)
def _join(cells, root):  # type: ignore[no-untyped-def]
    """Point every node to the lowest one of its part."""
    for e in range(len(cells)):
        one = _find(root, cells[e, 0])
        for b in cells[e]:
            other = _find(root, b)
            if other < one:
                root[one] = other
                one = other
            else:
                root[other] = one
    for a in range(len(root)):
        root[a] = _find(root, a)


@nb.njit(cache=True)
def _find(root, a):  # type: ignore[no-untyped-def]
    while root[a] != a:
        root[a] = root[root[a]]
        a = root[a]
    return a
