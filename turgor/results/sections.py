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

    With Q_i the rotations of the slices, a the body's axis and t_i the axis carried along, each small rotation vector
    log(Q_{i+1} Q_iᵀ) is split along and across t_i. Twist is the sum of the parts along. The sum of the parts across
    gives the axis and the number of whole turns of the bending, whose angle is that between the axes of the two faces.
    The length is that of circular arcs from centre to centre.

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
    rotations, before, after = _fitted_slices(mesh, displacement)
    axis = _axis(mesh)
    steps = (rotations[1:] * rotations[:-1].inv()).as_rotvec()
    carried = rotations.apply(axis)
    middle = carried[1:] + carried[:-1]
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    along = np.einsum("ij,ij->i", steps, middle)
    across = steps - along[:, None] * middle
    # A circular arc of angle φ is longer than its chord by (φ/2) / sin(φ/2); np.sinc(x) is sin(πx)/(πx).
    chords = np.einsum("ij,ij->i", np.diff(after, axis=0), middle)
    arcs = chords / np.sinc(np.linalg.norm(across, axis=1) / (2.0 * math.pi))
    return Motion(
        bending=_unwrapped_angle(carried, across.sum(axis=0)),
        twist=float(along.sum()),
        elongation=float(arcs.sum() - (np.diff(before, axis=0) @ axis).sum()),
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


def _fitted_slices(mesh: Mesh, displacement: FloatArray) -> tuple[Rotation, FloatArray, FloatArray]:
    """Rotation of each slice and its centre before and after, ``(k, 3)``, from the mount to the tip face."""
    rotations, before, after = [], [], []
    for nodes, at_rest, now in _groups(mesh, displacement):
        rotation = _rotation_of_whole(mesh, displacement, nodes)
        if rotation is not None:
            rotations.append(rotation)
            before.append(in_space(at_rest))
            after.append(in_space(now))
    return Rotation.from_matrix(np.array(rotations)), np.array(before), np.array(after)


def _groups(mesh: Mesh, displacement: FloatArray) -> Iterator[tuple[npt.NDArray[Any], FloatArray, FloatArray]]:
    """Yield the nodes of the mount, of each slice and of the tip face, with the centre ``(d,)`` before and after."""
    whole, places = symmetry_of(mesh), mesh.points + displacement
    yield mesh.surface_nodes(MOUNT), surface_middle(mesh, MOUNT), surface_middle(mesh, MOUNT, displacement)
    for nodes in _slices(mesh):
        if len(nodes):
            yield nodes, whole.middle(mesh.points[nodes].mean(axis=0)), whole.middle(places[nodes].mean(axis=0))
    yield mesh.surface_nodes(TIP_FACE), surface_middle(mesh, TIP_FACE), surface_middle(mesh, TIP_FACE, displacement)


def _slices(mesh: Mesh) -> list[npt.NDArray[np.intp]]:
    """Nodes of each slice, by the station of the reference line that is nearest."""
    line = _reference_line(mesh)
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    stations = (np.arange(SLICES) + 0.5) / SLICES * lengths[-1]
    places = np.column_stack([np.interp(stations, lengths, coordinate) for coordinate in line.T])
    nearest = KDTree(places).query(mesh.points)[1]
    return [np.flatnonzero(nearest == station) for station in range(SLICES)]


def _reference_line(mesh: Mesh) -> FloatArray:
    if CENTRELINE in mesh.markers and len(mesh.marker(CENTRELINE)) > 1:
        return np.asarray(mesh.points[mesh.marker(CENTRELINE)])
    return np.array([surface_middle(mesh, name) for name in (MOUNT, TIP_FACE)])


def _axis(mesh: Mesh) -> FloatArray:
    """Unit vector along the reference line where it reaches the tip face."""
    line = _reference_line(mesh)
    direction = symmetry_of(mesh).along(line[-1] - line[-2])
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
