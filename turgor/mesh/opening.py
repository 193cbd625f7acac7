"""Cavities with openings: what closes them (symmetry planes, caps), and the field whose flux is their volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.mesh.cells import face_fluxes
from turgor.mesh.faces import rim_edges

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FLAT = 1e-9
"""A rim lies in a plane if it leaves it by no more than this part of the body's size."""


_CLOSED = {
    2: "a closed line, or one that ends on symmetry lines across x or y",
    3: "a closed surface, one whose rim lies in symmetry planes across x, y or z, or a cap over each opening",
}


@dataclass(frozen=True, eq=False)
class Cap:
    """A surface that nothing is made of, from the rim of an opening to the middle of its nodes; it moves with them.

    It is a fan of six-node triangles that meets the curved edges of the rim exactly, so that wall and cap enclose a
    volume without a gap. Their positions are linear in those of the rim, on which the force on the cap acts.

    Attributes
    ----------
    nodes
        Nodes of the rim ``(n,)``.
    faces
        Triangles ``(e, 6)`` of rim nodes, the middle and the points half-way to it; normals out of the air.
    weights
        For each axis the matrix ``(n_places, n)`` from the rim to all these places, relative to the field's origin.
    """

    nodes: Ints
    faces: Ints
    weights: tuple[sp.csr_matrix, ...]

    def places(self, x: Floats) -> Floats:
        """Return the corners and middles of the triangles for nodal positions `x` relative to the field's origin."""
        rim = x[self.nodes]
        return np.column_stack([matrix @ rim[:, axis] for axis, matrix in enumerate(self.weights)])


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
    caps
        What closes the other openings.
    """

    origin: Floats
    axes: Floats
    rim: tuple[Ints, Ints]
    caps: tuple[Cap, ...] = field(default=())

    def enclosed(self, x: Floats, faces: Ints) -> float:
        """Return the volume (in the plane: area) that the wall encloses with its nodes at `x` ``(n_points, d)``."""
        relative = x - self.origin
        air = -self._flux(relative, faces)  # the wall's normals point into the air
        return air + sum(self._flux(cap.places(relative), cap.faces) for cap in self.caps)

    def _flux(self, x: Floats, faces: Ints) -> float:
        flux, _ = face_fluxes(x[faces], self.axes)
        return float(flux.sum() / self.axes.sum())


def volume_field(
    points: Floats, faces: Ints, name: str, revolved: bool = False, caps: Mapping[str, Ints] | None = None
) -> VolumeField:
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
    caps
        Edges ``(e, 3)`` of the rims that are closed by caps, by the caps' names; those of other cavities do not matter.

    Raises
    ------
    InputError
        If the wall has a rim outside such planes, that is, if the cavity leaks, or a cap does not fit.
    """
    edges = rim_edges(faces)
    capped = [_own(edges, cap) for cap in (caps or {}).values()]
    covered = np.any([np.zeros(len(edges), bool), *capped], axis=0)
    whole = edges
    edges = edges[~covered]
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
    closing = [
        _cap(points, whole[own], planes, tolerance, cap_name)
        for cap_name, own in zip(caps or {}, capped, strict=True)
        if own.any()
    ]
    return VolumeField(origin, axes, (rim[0].astype(np.int32), rim[1].astype(np.int32)), tuple(closing))


def _own(edges: Ints, cap: Ints) -> NDArray[np.bool_]:
    """Say which of the edges of a wall's rim are edges of the cap."""
    size = int(max(edges.max(initial=0), cap.max(initial=0))) + 1
    keys = [np.sort(some[:, :2], axis=1).astype(np.int64) @ [size, 1] for some in (edges, cap)]
    return np.isin(keys[0], keys[1])


def _cap(points: Floats, edges: Ints, planes: list[list[float]], tolerance: float, name: str) -> Cap:
    """Return the cap over the rim of these edges ``(e, 3)``: two ends, in the sense of the wall, and the middle.

    Where the rim ends, it must end in one of the symmetry `planes`, in which the middle of the cap then lies too.
    """
    nodes, index = np.unique(edges, return_inverse=True)
    local = index.reshape(edges.shape)
    # Each node counts by the length of rim around it: Simpson's rule on the edges.
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    share = np.bincount(local.ravel(), np.outer(length, [1.0, 1.0, 4.0]).ravel()) / (6.0 * length.sum())
    ends = nodes[np.bincount(local[:, :2].ravel(), minlength=len(nodes)) == 1]
    in_plane = np.zeros((len(ends), len(planes)), bool)
    for axis, levels in enumerate(planes):
        met = [np.abs(points[ends, axis] - level) <= tolerance for level in levels]
        if sum(bool(some.any()) for some in met) > 1:
            problem = f"the rim under the cap ends in two parallel symmetry planes across {'xyz'[axis]}"
            expected = "a model that is cut once across this axis: the middle of a cap lies in one plane only"
            raise InputError(problem, key=f"caps.{name}", expected=expected)
        if len(levels) == 1:
            in_plane[:, axis] = met[0]
    held: NDArray[np.bool_] = np.any(in_plane, axis=0)
    closed: NDArray[np.bool_] = np.any(in_plane, axis=1)
    if not closed.all():
        place = points[ends[int(np.argmin(closed))]].round(3).tolist()
        raise InputError(f"the rim under the cap ends near {place} mm", key=f"caps.{name}", expected="a closed rim")
    corners = np.unique(local[:, :2])
    n, half = len(nodes), np.full(len(nodes), -1)
    half[corners] = len(nodes) + 1 + np.arange(len(corners))
    start, end, middle = local.T
    faces = np.column_stack([start, end, np.full(len(edges), n), middle, half[end], half[start]])
    weights = [_to_places(np.zeros(n) if flat else share, corners) for flat in held]
    return Cap(nodes.astype(np.int32), np.ascontiguousarray(faces, dtype=np.int32), tuple(weights))


def _to_places(share: Floats, corners: NDArray[np.intp]) -> sp.csr_matrix:
    """Return the matrix from the rim's nodes to themselves, the middle, and the points half-way to it from corners."""
    n = len(share)
    apex = sp.csr_matrix(share)
    half = 0.5 * (sp.identity(n, format="csr")[corners] + sp.csr_matrix(np.ones((len(corners), 1))) @ apex)
    return sp.vstack([sp.identity(n), apex, half]).tocsr()


def _plane_of(place: Floats, flat: NDArray[np.bool_], planes: list[list[float]], tolerance: float) -> int:
    """Return the axis across which the plane of one rim edge lies, preferring planes met before; note new ones."""
    options = np.flatnonzero(flat)
    for axis in options:
        if any(abs(place[0, axis] - level) <= 2 * tolerance for level in planes[axis]):
            return int(axis)
    planes[options[0]].append(float(place[0, options[0]]))
    return int(options[0])
