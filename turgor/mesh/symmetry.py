"""The planes in which a mesh is cut, and behind which the body goes on as its mirror image."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.cells import face_fluxes
from turgor.mesh.mesh import Mesh

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

_PARALLEL, _ASIDE = float(np.cos(np.radians(1.0))), float(np.sin(np.radians(1.0)))
"""Cosine and sine of the angle by which faces, and lines, of one plane of symmetry may look aside."""

_OFF = 1e-3
"""Part of the mesh's extent by which they may lie off it."""


@dataclass(frozen=True, eq=False)
class SymmetryPlane:
    """A plane of symmetry.

    Attributes
    ----------
    point
        A point of it, ``(d,)``, mm.
    normal
        Unit normal out of the body, ``(d,)``.
    faces
        The faces that lie in it, ``(k, n)``.
    off
        How far what lies in it may be off it, mm.
    """

    point: FloatArray
    normal: FloatArray
    faces: IntArray
    off: float

    def height(self, places: FloatArray) -> FloatArray:
        """Return how far `places` ``(..., d)`` are in front of the plane, on the body's side, mm."""
        return np.asarray((self.point - places) @ self.normal)

    def holds(self, lines: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which of some straight `lines` ``(n, 2, d)``, given by their ends, lie in the plane."""
        near = (np.abs(self.height(lines)) <= self.off).all(axis=1)
        # One that is shorter than what the plane may be off could also cross it.
        span = lines[:, 1] - lines[:, 0]
        return np.asarray(near & (np.abs(span @ self.normal) <= _ASIDE * np.linalg.norm(span, axis=1)))

    def check_behind(self, mesh: Mesh, consequence: str, key: str) -> None:
        """Raise InputError if the body reaches behind the plane, where its mirror image should be."""
        height = self.height(mesh.points)
        if height.min() < -self.off:
            raise InputError(
                f"the body reaches through its plane of symmetry, so that {consequence}",
                key=key,
                value=f"{-height.min():.4g} mm behind it at {mesh.points[height.argmin()].round(3).tolist()} mm",
                expected="a body on one side of each surface 'symmetry…', or another name of the surface",
            )


def planes_of_symmetry(mesh: Mesh) -> Iterator[SymmetryPlane]:
    """Yield each plane that the surfaces ``symmetry…`` of a mesh lie in, the one of the largest face first."""
    # A surface may have the cuts of two planes, and a plane two surfaces.
    faces = np.concatenate([mesh.surface(name) for name in mesh.symmetry_planes] or [np.empty((0, 3), np.int32)])
    off = _OFF * float(np.ptp(mesh.points, axis=0).max())
    while len(faces):
        normals = face_fluxes(mesh.points[faces])[1]
        sizes = np.linalg.norm(normals, axis=1)
        largest = int(np.argmax(sizes))
        middles = mesh.points[faces].mean(axis=1)
        looks_alike = normals @ normals[largest] >= _PARALLEL * sizes * sizes[largest]
        here = looks_alike & (np.abs((middles - middles[largest]) @ normals[largest]) <= off * sizes[largest])
        normal = normals[here].sum(axis=0)
        yield SymmetryPlane(middles[largest], normal / np.linalg.norm(normal), faces[here], off)
        faces = faces[~here]


def part_in_front(planes: Sequence[SymmetryPlane]) -> float:
    """Return what part of a ball around a point of some planes is in front of all of them.

    Parameters
    ----------
    planes
        At most three: a cut, an edge or a corner.

    Returns
    -------
    float
        One without a plane, a half of one, a quarter of two square to each other.
    """
    if len(planes) < 2:
        return 0.5 ** len(planes)
    cosines = [first.normal @ second.normal for first, second in itertools.combinations(planes, 2)]
    between = np.pi - np.arccos(np.clip(cosines, -1.0, 1.0))
    # Of three, the excess of the spherical triangle over π is its solid angle.
    return float(between[0] / (2.0 * np.pi) if len(planes) == 2 else (between.sum() - np.pi) / (4.0 * np.pi))
