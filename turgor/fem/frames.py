"""Block stiffnesses in the frames of obliquely supported nodes, and their products with nodal fields."""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.constraints import Constraints
from turgor.fem.term import pack_symmetric

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class BlockFrames:
    """Turns the few blocks that touch a node with a frame of its own into that frame: K ← T K Tᵀ.

    Parameters
    ----------
    constraints
        Where the frames stand.
    groups
        The nodes of each term's blocks, ``(n_blocks, nodes_per_block)``.
    """

    def __init__(self, constraints: Constraints, groups: Sequence[Ints]) -> None:
        d = constraints.fixed.shape[1]
        frames = np.broadcast_to(np.eye(d), (len(constraints.fixed), d, d))
        framed = np.zeros(len(frames), bool)
        if len(constraints.frame_nodes):
            frames = frames.copy()
            frames[constraints.frame_nodes] = constraints.frames
            framed[constraints.frame_nodes] = True
        self._touched = [np.flatnonzero(framed[group].any(axis=1)) for group in groups]
        self._turns = [_block_diagonal(frames[group[rows]]) for group, rows in zip(groups, self._touched, strict=True)]

    def turn(self, group: int, packed: Floats) -> None:
        """Turn the packed blocks ``(n_blocks, packed)`` of one group, in place."""
        rows, turn = self._touched[group], self._turns[group]
        if len(rows):
            blocks = unpack_symmetric(packed[rows], turn.shape[1])
            turned = np.empty((len(rows), packed.shape[1]))
            pack_symmetric(turn @ blocks @ turn.transpose(0, 2, 1), turned)
            packed[rows] = turned


def unpack_symmetric(packed: Floats, size: int) -> Floats:
    """Return the full symmetric blocks ``(n_blocks, size, size)`` of packed upper triangles."""
    row, col = np.triu_indices(size)
    blocks = np.empty((len(packed), size, size))
    blocks[:, row, col] = packed
    blocks[:, col, row] = packed
    return blocks


def _block_diagonal(frames: Floats) -> Floats:
    """Return ``(k, n d, n d)`` from the frames ``(k, n, d, d)`` of each block's nodes."""
    k, n, d = frames.shape[:3]
    turn = np.zeros((k, n, d, n, d))
    at = np.arange(n)
    turn[:, at, :, at, :] = frames.transpose(1, 0, 2, 3)
    return turn.reshape(k, n * d, n * d)


@nb.njit(cache=True)
def block_products(nodes, packed, field, out):  # type: ignore[no-untyped-def]
    """Add the products of packed symmetric blocks with a nodal ``field (n_points, d)`` to ``out (n_points, d)``."""
    d = field.shape[1]
    n = d * nodes.shape[1]
    here, there = np.empty(n), np.empty(n)
    for block in range(len(nodes)):
        for row in range(n):
            here[row] = field[nodes[block, row // d], row % d]
        there[:] = 0.0
        at = 0
        for row in range(n):
            values = packed[block, at : at + n - row]
            above, total = here[row], values[0] * here[row]
            for k in range(1, n - row):
                total += values[k] * here[row + k]
                there[row + k] += values[k] * above
            there[row] += total
            at += n - row
        for row in range(n):
            out[nodes[block, row // d], row % d] += there[row]
