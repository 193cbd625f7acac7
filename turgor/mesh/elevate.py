"""Cells of other programs as second-order cells of ours: the nodes that they lack are added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turgor.common.rows import row_numbers
from turgor.mesh.cells import CELLS, Cell, Floats, Ints


@dataclass(frozen=True)
class Kind:
    """A kind of cell of another program: the cell of ours that it becomes, and how many of its nodes it has."""

    cell: str
    n_nodes: int

    @property
    def linear(self) -> bool:
        """Whether the kind has corners only."""
        return self.n_nodes == CELLS[self.cell].n_corners


KINDS = {
    "tetra": Kind("tet10", 4),
    "tetra10": Kind("tet10", 10),
    "hexahedron": Kind("hex27", 8),
    "hexahedron20": Kind("hex27", 20),
    "hexahedron27": Kind("hex27", 27),
    "triangle": Kind("tri6", 3),
    "triangle6": Kind("tri6", 6),
    "quad": Kind("quad9", 4),
    "quad8": Kind("quad9", 8),
    "quad9": Kind("quad9", 9),
}
"""The kinds of cells that become ours, by their names in meshio; their nodes are in VTK's order, as ours."""


def completed(points: Floats, cells: Ints, kind: Kind) -> tuple[Floats, Ints]:
    """Return the points and the second-order cells that `cells` ``(m, kind.n_nodes)`` become; shapes do not change.

    The place of each node that is added is that of the cell as the other program means it: half-way along a straight
    edge, and in a face or centre where the polynomials of its own nodes (multilinear, or the serendipity ones of 20 and
    8 nodes) put it. Cells that share the nodes around it share the node.
    """
    cell = CELLS[kind.cell]
    added = np.arange(kind.n_nodes, cell.n_nodes)
    if not len(added):
        return points, cells
    weights = _weights(cell, kind.n_nodes)[added]
    shared = [np.flatnonzero(np.abs(_support(cell)[node]) > 0.0).astype(np.int32) for node in added]
    columns, blocks = [], [points]
    count = len(points)
    for group in _groups(shared):
        of_group = [k for k, nodes in enumerate(shared) if len(nodes) == group]
        keys = np.sort(np.stack([cells[:, shared[k]] for k in of_group], axis=1).reshape(-1, group), axis=1)
        _, first, inverse = np.unique(row_numbers(keys), return_index=True, return_inverse=True)
        places = np.einsum("kn,mni->mki", weights[of_group], points[cells])
        blocks.append(places.reshape(-1, points.shape[1])[first])
        columns.append(count + inverse.reshape(len(cells), len(of_group)))
        count += len(first)
    return np.vstack(blocks), np.hstack([cells, *columns]).astype(np.int32)


def _groups(shared: list[Ints]) -> list[int]:
    """Return the numbers of corners around the added nodes in the order of the nodes: edges, faces, centre."""
    return list(dict.fromkeys(len(nodes) for nodes in shared))


def _support(cell: Cell) -> Floats:
    """Return for each node which corners it lies between: the multilinear functions of the corners there."""
    corners = cell.nodes[: cell.n_corners]
    if cell.simplex:
        return np.column_stack([1.0 - cell.nodes.sum(axis=1), cell.nodes])
    factors = np.where(corners[None] == 1.0, cell.nodes[:, None], 1.0 - cell.nodes[:, None])
    return np.asarray(factors.prod(axis=2))


def _weights(cell: Cell, n_given: int) -> Floats:
    """Return the functions ``(n_nodes, n_given)`` of the given nodes at every node of the cell."""
    linear = _support(cell)
    if n_given == cell.n_corners:
        return linear
    # Serendipity: the multilinear functions, corrected by those of the middles of the edges, 1 − x² along the edge
    # times the multilinear ones across it.
    edges = np.array(cell.edges)
    bubbles = np.empty((cell.n_nodes, len(edges)))
    for number, (a, b) in enumerate(edges):
        along = int(np.flatnonzero(cell.nodes[a] != cell.nodes[b])[0])
        x = cell.nodes[:, along]
        bubbles[:, number] = 4.0 * x * (1.0 - x) * (linear[:, a] + linear[:, b])
    corrected = linear.copy()
    for number, (a, b) in enumerate(edges):
        corrected[:, [a, b]] -= 0.5 * bubbles[:, number, None]
    return np.hstack([corrected, bubbles])
