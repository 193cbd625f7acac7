"""The whole that a half or a quarter of a body stands for: the images of its points, and the middles of its surfaces.

What is said of a slice or of a face, a mean or a rotation that fits it, is meant of the whole one. Half a ring turns
when the ring only widens, so that its images belong to it before anything is fitted to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turgor.fem.section import Section, surface_areas
from turgor.mesh.cells import face_cell
from turgor.mesh.mesh import Mesh
from turgor.mesh.symmetry import planes_of_symmetry

FloatArray = npt.NDArray[np.float64]

MOUNT, TIP_FACE = "mount", "tip-face"

_MOST = 360
"""Images, the body among them; planes at an angle that no circle is a multiple of would have images without end."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """The images x ↦ T x + c of a body in its planes of symmetry, and theirs in turn; the first is the body itself.

    Parameters
    ----------
    turns
        The matrices T, ``(g, d, d)``.
    shifts
        The vectors c, ``(g, d)``, mm.
    """

    turns: FloatArray
    shifts: FloatArray

    def places(self, places: FloatArray) -> FloatArray:
        """Return all images of `places` ``(k, d)``, image by image: ``(g · k, d)``."""
        images = self.vectors(places).reshape(len(self.turns), *places.shape) + self.shifts[:, None]
        return np.asarray(images.reshape(-1, places.shape[1]))

    def vectors(self, vectors: FloatArray) -> FloatArray:
        """Return all images of `vectors` ``(k, d)``, such as displacements, in the same order: ``(g · k, d)``."""
        return np.asarray(np.einsum("gij,kj->gki", self.turns, vectors).reshape(-1, vectors.shape[1]))

    def middle(self, places: FloatArray) -> FloatArray:
        """Return the middle of all images of each of the `places` ``(..., d)``: it lies in every plane of symmetry."""
        return np.asarray(places @ self.turns.mean(axis=0).T + self.shifts.mean(axis=0))

    def along(self, vector: FloatArray) -> FloatArray:
        """Return the part of a `vector` ``(d,)`` that its images share."""
        return np.asarray(self.turns.mean(axis=0) @ vector)


@lru_cache(maxsize=8)
def symmetry_of(mesh: Mesh) -> Symmetry:
    """Return the symmetry of the cross-sections between the surfaces ``mount`` and ``tip-face``.

    Raises
    ------
    InputError
        If the mesh lacks one of the two.
    """
    d = mesh.dimension
    images = [(np.eye(d), np.zeros(d))]
    mirrors = list(_mirrors(mesh))
    for turn, shift in images:  # grows meanwhile: an image has images, too
        for mirror, offset in mirrors:
            new = mirror @ turn
            if len(images) < _MOST and all(np.abs(new - known).max() > 1e-6 for known, _ in images):
                images.append((new, mirror @ shift + offset))
    turns, shifts = zip(*images, strict=True)
    return Symmetry(np.array(turns), np.array(shifts))


def surface_middle(
    mesh: Mesh, name: str, displacement: FloatArray | None = None, section: Section | None = None
) -> FloatArray:
    """Return the middle ``(d,)`` of a surface of the whole, the mean over its area at rest, mm.

    Parameters
    ----------
    mesh
        With the surfaces ``mount`` and ``tip-face``.
    name
        Of the surface.
    displacement
        Of the nodes, ``(n, d)``, that moves it; left out, none.
    section
        What a plane mesh stands for, if areas do not go with the lengths of its edges.
    """
    faces = mesh.surface(name)
    places = mesh.points if displacement is None else mesh.points + displacement
    _, areas = surface_areas(mesh.points, faces, section)
    shares = areas @ face_cell(faces).shape_at_quadrature / areas.sum()
    return symmetry_of(mesh).middle(np.einsum("ka,kai->i", shares, places[faces]))


def _mirrors(mesh: Mesh) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield T and c of the mirror in each plane that halves both the mount and the tip face.

    One that touches only one of them, or neither, lies across the body: behind it are other cross-sections.
    """
    ends = [mesh.surface_nodes(name) for name in (MOUNT, TIP_FACE)]
    for plane in planes_of_symmetry(mesh):
        if all(np.isin(plane.faces, nodes).any() for nodes in ends):
            n = plane.normal
            yield np.eye(mesh.dimension) - 2.0 * np.outer(n, n), 2.0 * (plane.point @ n) * n
