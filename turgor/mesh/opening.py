"""Cavities cut open by symmetry planes: what closes them, and the field whose flux is their volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.mesh.faces import rim_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FLAT = 1e-9
"""A rim lies in a plane if it leaves it by no more than this part of the body's size."""


_CLOSED = {
    2: "a closed line, or one that ends on symmetry lines across x or y",
    3: "a closed surface, or one whose rim lies in symmetry planes across x, y or z",
}


@dataclass(frozen=True, eq=False)
class VolumeField:
    """The field v(x) = M (x − origin)/tr M with M = diag(axes): of unit divergence, and without flux in closing planes.

    The flux of v through a cavity's wall is the enclosed volume, although the planes that close it are not meshed.

    Attributes
    ----------
    origin
        ``(d,)``, mm; on every closing plane whose axis counts.
    axes
        ``(d,)``, one where the axis counts, zero where two parallel planes close the cavity across it.
    rim
        Nodes on the rim ``(k,)`` and, for each, the axis across which its plane lies ``(k,)``: they must stay in it.
    """

    origin: Floats
    axes: Floats
    rim: tuple[Ints, Ints]


def volume_field(points: Floats, faces: Ints, name: str, revolved: bool = False) -> VolumeField:
    """Find the planes across the axes that close the cavity of this wall, and the field that fits them.

    Parameters
    ----------
    points
        ``(n_points, d)``.
    faces
        The wall ``(k, nodes_per_face)``; in two dimensions its edges, and lines take the place of planes.
    name
        Name of the cavity, for the message.
    revolved
        Whether the plane is turned about y: then the axis x = 0 closes a cavity, but no other line across x does.

    Raises
    ------
    InputError
        If the wall has a rim outside such planes, that is, if the cavity leaks.
    """
    edges = rim_edges(faces)
    d = points.shape[1]
    tolerance = FLAT * float(np.ptp(points, axis=0).max())
    place = points[edges]
    # A symmetry plane bounds the model: the whole mesh lies on one side of it.
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    if revolved:
        ends[:, 0] = 0.0
    outermost = (np.abs(place[:, 0, None, :] - ends) <= tolerance).any(axis=1)
    flat = (np.ptp(place, axis=1) <= tolerance) & outermost
    if not flat.any(axis=1).all():
        leak = place[np.argmin(flat.any(axis=1)), -1].round(3).tolist()
        raise InputError(
            f"the cavity leaks: its wall ends near {leak} mm",
            key=name,
            expected=_CLOSED[d] + (" or on the axis" if revolved else ""),
        )
    origin, axes = np.zeros(d), np.ones(d)
    nodes, across = [], []
    # An edge along an axis may lie in two planes; those that leave no choice come first.
    planes: list[list[float]] = [[] for _ in range(d)]
    for edge in np.argsort(flat.sum(axis=1), kind="stable"):
        axis = _plane_of(place[edge], flat[edge], planes, tolerance)
        nodes.append(edges[edge])
        across.append(np.full(edges.shape[1], axis))
    for axis, levels in enumerate(planes):
        if len(levels) == 1:
            origin[axis] = levels[0]
        elif len(levels) > 1:
            axes[axis] = 0.0
    if not axes.any():
        raise InputError("parallel planes close the cavity across every axis", key=name, expected="a closed surface")
    rim = (np.concatenate([np.empty(0, np.int32), *nodes]), np.concatenate([np.empty(0, np.int32), *across]))
    return VolumeField(origin, axes, (rim[0].astype(np.int32), rim[1].astype(np.int32)))


def _plane_of(place: Floats, flat: NDArray[np.bool_], planes: list[list[float]], tolerance: float) -> int:
    """Return the axis across which the plane of one rim edge lies, preferring planes met before; note new ones."""
    options = np.flatnonzero(flat)
    for axis in options:
        if any(abs(place[0, axis] - level) <= 2 * tolerance for level in planes[axis]):
            return int(axis)
    planes[options[0]].append(float(place[0, options[0]]))
    return int(options[0])
