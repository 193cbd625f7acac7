"""Nodes along lines: markers."""

from __future__ import annotations

import numpy as np

from turgor.common.errors import InputError
from turgor.mesh.tet10 import FloatArray, IntArray


def nodes_on_polyline(points: FloatArray, line: FloatArray, name: str) -> IntArray:
    """Return the nodes on a polyline in order from its first point to its last.

    Parameters
    ----------
    points
        Shape ``(n, d)``.
    line
        Shape ``(k, d)``; a single point asks for the node there.
    name
        For the message.

    Raises
    ------
    InputError
        If no node lies on it.
    """
    tolerance = 1e-6 * float(np.ptp(points, axis=0).max())
    starts, ends = (line, line) if len(line) == 1 else (line[:-1], line[1:])
    found: list[int] = []
    for start, end in zip(starts, ends, strict=True):
        along = end - start
        fraction = np.clip((points - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        near = np.flatnonzero(np.linalg.norm(points - start - fraction[:, None] * along, axis=1) < tolerance)
        found += [int(node) for node in near[np.argsort(fraction[near])] if node not in found[-1:]]
    if not found:
        raise InputError("no node of the mesh lies on this marker", key=name, value=line.tolist())
    return np.array(found, dtype=np.int32)
