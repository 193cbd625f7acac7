"""How the cross-sections of a slender body turn: the rotation of slices from the mount to the tip.

A body is sliced between its surfaces ``mount`` and ``tip-face``, along the marker ``centreline`` where it has one, else
along the straight line between the two faces. Each slice gets the rotation that fits its displacement best (Kabsch,
1976, *Acta Cryst.* A32, 922), so that bulging walls do not count. Between neighbours the rotation is small, and adding
up these small rotations tells 311° from −49°. Of half a body the slices are those of the whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from turgor.mesh.mesh import Mesh, in_space
from turgor.results.symmetry import MOUNT, TIP_FACE, surface_middle, symmetry_of

FloatArray = npt.NDArray[np.float64]

CENTRELINE = "centreline"

OUT_OF_PLANE = np.sin(np.radians(30.0))
"""Sine of the angle by which axes may leave a plane in which the body is said to bend."""

SLICES = 32
"""Slices between the mount and the tip face; a body may turn by less than 180° from one to the next."""


@dataclass(frozen=True)
class Motion:
    """How the tip face has moved against the mount.

    Parameters
    ----------
    bending
        Angle in rad by which the axis of the body has turned, never negative; counts on beyond π where the body bends
        in a plane, while that of a coil is the one between the axes of its ends.
    twist
        Rotation about the axis in rad, added up along the body; positive turns right-handed about mount → tip.
    elongation
        Change in mm of the length of the line through the centres of the slices.
    """

    bending: float
    twist: float
    elongation: float


def motion(mesh: Mesh, displacement: FloatArray) -> Motion:
    """Return how the tip face has moved against the mount.

    With Q_i the rotations of the slices, a_i the direction of the reference line from slice to slice at rest and t_i
    this carried along, each small rotation vector log(Q_{i+1} Q_iᵀ) is split along and across t_i. Twist is the sum of
    the parts along. The sum of the parts across gives the axis and the number of whole turns of the bending, whose
    angle is that between the axes of the two faces. The length is that of circular arcs from centre to centre.

    Parameters
    ----------
    mesh
        With the surfaces ``mount`` and ``tip-face``.
    displacement
        Shape ``(n, d)``, mm.

    Raises
    ------
    InputError
        If the mesh lacks one of the two surfaces.
    """
    rotations, before, after, tangents = _fitted_slices(mesh, displacement)
    steps = (rotations[1:] * rotations[:-1].inv()).as_rotvec()
    middle = rotations[1:].apply(tangents) + rotations[:-1].apply(tangents)
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    along = np.einsum("ij,ij->i", steps, middle)
    across = steps - along[:, None] * middle
    # A circular arc of angle φ is longer than its chord by (φ/2) / sin(φ/2); np.sinc(x) is sin(πx)/(πx).
    chords = np.einsum("ij,ij->i", np.diff(after, axis=0), middle)
    arcs = chords / np.sinc(np.linalg.norm(across, axis=1) / (2.0 * math.pi))
    return Motion(
        bending=_unwrapped_angle(rotations.apply(_axis(mesh)), across.sum(axis=0)),
        twist=float(along.sum()),
        elongation=float(arcs.sum() - np.einsum("ij,ij->", np.diff(before, axis=0), tangents)),
    )


def seen_from_mount(mesh: Mesh, displacement: FloatArray, vector: FloatArray) -> FloatArray:
    """Return `vector` ``(3,)`` as it looks to someone who turns with the mount."""
    nodes = mesh.surface_nodes(MOUNT)
    rotation = _rotation_of_whole(mesh, displacement, nodes)
    assert rotation is not None, "in space a surface never lies on a line"
    return np.asarray(rotation.T @ vector)


def _unwrapped_angle(carried: FloatArray, accumulated: FloatArray) -> float:
    """Angle from the first to the last of the axes ``carried (k, 3)``.

    Where all lie near one plane, about its normal, the direction of `accumulated`, with as many whole turns as its
    length tells. Out of a plane whole turns mean nothing: the axes of a coil go around its own.
    """
    start, end = carried[0], carried[-1]
    normal = np.cross(start, end)
    size = float(np.linalg.norm(accumulated))
    if size == 0.0 or np.abs(carried @ accumulated).max() > OUT_OF_PLANE * size:
        return math.atan2(float(np.linalg.norm(normal)), float(start @ end))
    angle = math.copysign(math.atan2(float(np.linalg.norm(normal)), float(start @ end)), float(normal @ accumulated))
    whole_turns = round((size - angle) / (2.0 * math.pi))
    return abs(angle + 2.0 * math.pi * whole_turns)


def _fitted_slices(mesh: Mesh, displacement: FloatArray) -> tuple[Rotation, FloatArray, FloatArray, FloatArray]:
    """Rotation of each slice, its centre before and after, and the line's directions at rest to the next ``(k, 3)``."""
    rotations, before, after, stations = [], [], [], []
    for nodes, station, at_rest, now in _groups(mesh, displacement):
        rotation = _rotation_of_whole(mesh, displacement, nodes)
        if rotation is not None:
            rotations.append(rotation)
            before.append(in_space(at_rest))
            after.append(in_space(now))
            stations.append(station)
    tangents = np.array([_direction(mesh, step) for step in np.diff(stations, axis=0)])
    return Rotation.from_matrix(np.array(rotations)), np.array(before), np.array(after), tangents


def _groups(mesh: Mesh, displacement: FloatArray) -> Iterator[tuple[Any, FloatArray, FloatArray, FloatArray]]:
    """Yield the nodes of the mount, of each slice and of the tip face, its station, and its centre before and after."""
    whole, places, stations = symmetry_of(mesh), mesh.points + displacement, _stations(mesh)
    ends = [(surface_middle(mesh, name), surface_middle(mesh, name, displacement)) for name in (MOUNT, TIP_FACE)]
    yield mesh.surface_nodes(MOUNT), stations[0], *ends[0]
    for nodes, station in zip(_slices(mesh), stations[1:-1], strict=True):
        if len(nodes):
            centres = (whole.middle(where[nodes].mean(axis=0)) for where in (mesh.points, places))
            yield nodes, station, *centres
    yield mesh.surface_nodes(TIP_FACE), stations[-1], *ends[1]


def _slices(mesh: Mesh) -> list[npt.NDArray[np.intp]]:
    """Nodes of each slice, by the station of the reference line that is nearest."""
    nearest = KDTree(_stations(mesh)[1:-1]).query(mesh.points)[1]
    return [np.flatnonzero(nearest == station) for station in range(SLICES)]


def _stations(mesh: Mesh) -> FloatArray:
    """Return the places on the reference line of the mount, of each slice and of the tip face, ``(SLICES + 2, d)``."""
    line = _reference_line(mesh)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    stations = np.concatenate([[0.0], (np.arange(SLICES) + 0.5) / SLICES, [1.0]]) * lengths[-1]
    return np.column_stack([np.interp(stations, lengths, coordinate) for coordinate in line.T])


def _reference_line(mesh: Mesh) -> FloatArray:
    if CENTRELINE in mesh.markers and len(mesh.marker(CENTRELINE)) > 1:
        return np.asarray(mesh.points[mesh.marker(CENTRELINE)])
    return np.array([surface_middle(mesh, name) for name in (MOUNT, TIP_FACE)])


def _axis(mesh: Mesh) -> FloatArray:
    """Unit vector along the reference line where it reaches the tip face."""
    line = _reference_line(mesh)
    return _direction(mesh, line[-1] - line[-2])


def _direction(mesh: Mesh, vector: FloatArray) -> FloatArray:
    """Unit vector ``(3,)`` along the part of a `vector` ``(d,)`` that its images share."""
    direction = symmetry_of(mesh).along(vector)
    return np.asarray(in_space(direction / np.linalg.norm(direction)))


def _rotation_of_whole(mesh: Mesh, displacement: FloatArray, nodes: npt.NDArray[Any]) -> FloatArray | None:
    """Best rotation ``(3, 3)`` of `nodes` ``(k,)`` together with their images; None where nothing fixes it."""
    whole = symmetry_of(mesh)
    return _best_rotation(whole.places(mesh.points[nodes]), whole.vectors(displacement[nodes]))


def _best_rotation(points: FloatArray, displacement: FloatArray) -> FloatArray | None:
    """Least-squares rotation ``(3, 3)`` of `points` ``(k, d)`` to their displaced places; None where nothing fixes it.

    In space points on a line leave it open, in the plane two points tell it.
    """
    d = points.shape[1]
    if len(points) < d:
        return None
    before = points - points.mean(axis=0)
    after = before + displacement - displacement.mean(axis=0)
    spread = np.linalg.svd(before, compute_uv=False)
    if spread[d - 2] < 1e-3 * spread[0] or spread[0] == 0.0:
        return None
    left, _, right = np.linalg.svd(after.T @ before)
    left[:, -1] *= np.linalg.det(left @ right)
    rotation = np.eye(3)
    rotation[:d, :d] = left @ right
    return rotation
