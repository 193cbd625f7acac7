"""Faces and rims of the current drawing as rules see them: of a CAD solid, or of patches of facets."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from turgor.geometry import cad
from turgor.geometry.actuator import FloatArray
from turgor.geometry.space import Place


@dataclass(frozen=True, eq=False)
class CadFace:
    """A face of a solid that the CAD kernel knows exactly."""

    tag: int
    looks_both_ways = False

    @property
    def tags(self) -> tuple[int, ...]:
        """Its tag in the drawing."""
        return (self.tag,)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner."""
        return cad.bounds(2, self.tag)

    @functools.cached_property
    def samples(self) -> FloatArray:
        """Its vertices, and some points inside it."""
        gmsh = cad.kernel()
        vertices = gmsh.model.getBoundary([(2, self.tag)], oriented=False, recursive=True)
        points = [np.array(gmsh.model.getValue(0, tag, [])) for _, tag in vertices]
        inner = np.array(gmsh.model.getValue(2, self.tag, self._parameters)).reshape(-1, 3)
        return np.vstack([*points, inner])

    @functools.cached_property
    def normals(self) -> FloatArray:
        """Normals at sample points, pointing out of the solid."""
        gmsh = cad.kernel()
        normals = np.array(gmsh.model.getNormal(self.tag, self._parameters)).reshape(-1, 3)
        # gmsh's normal follows the surface, not the solid: a short step along it tells on which side the solid lies.
        low, high = self.bounds
        place = np.array(gmsh.model.getValue(2, self.tag, self._parameters[:2]))
        step = place + 1e-4 * np.linalg.norm(high - low) * normals[0]
        volumes, _ = gmsh.model.getAdjacencies(2, self.tag)
        return -normals if gmsh.model.isInside(3, volumes[0], step.tolist()) else normals

    def distance(self, place: Place) -> float:
        """Return its distance from a place, mm."""
        point = cad.occ().addPoint(*place)
        distance = float(cad.occ().getDistance(0, point, 2, self.tag)[0])
        cad.occ().remove([(0, point)])
        return distance

    @functools.cached_property
    def _parameters(self) -> list[float]:
        """u, v, u, v, … of a grid of points that lie on the trimmed face."""
        gmsh = cad.kernel()
        (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(2, self.tag)
        grid = [(u, v) for u in np.linspace(u0, u1, 7)[1:-1] for v in np.linspace(v0, v1, 7)[1:-1]]
        on_face = [pair for pair in grid if gmsh.model.isInside(2, self.tag, pair, parametric=True)]
        return [float(number) for pair in on_face or grid for number in pair]


@dataclass(frozen=True, eq=False)
class Patch:
    """A smooth part of a surface of facets.

    Parameters
    ----------
    tags
        Of the faces in the drawing that make it up, since gmsh cuts those that it cannot parametrise as one.
    corners
        Its facets ``(k, 3, 3)``, anticlockwise seen from outside the solid.
    """

    tags: tuple[int, ...]
    corners: FloatArray
    looks_both_ways = False

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner."""
        return self.samples.min(axis=0), self.samples.max(axis=0)

    @functools.cached_property
    def samples(self) -> FloatArray:
        """Its corners, each once."""
        return np.unique(self.corners.reshape(-1, 3), axis=0)

    @functools.cached_property
    def normals(self) -> FloatArray:
        """Normals of its facets."""
        across = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        size = np.linalg.norm(across, axis=1)
        kept = size > 1e-6 * size.max()  # rounding turns slivers
        return np.asarray(across[kept] / size[kept, None])

    def distance(self, place: Place) -> float:
        """Return its distance from a place, mm: from its corners and the middles of its facets."""
        known = np.vstack([self.samples, self.corners.mean(axis=1)])
        return float(np.linalg.norm(known - np.array(place), axis=1).min())


@dataclass(frozen=True, eq=False)
class Rim:
    """A closed line of edges in the skin of the solid, which a cap may close.

    Parameters
    ----------
    edges
        Tags of its edges.
    samples
        Points on them ``(k, 3)``.
    """

    edges: frozenset[int]
    samples: FloatArray
    looks_both_ways = True

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner."""
        return self.samples.min(axis=0), self.samples.max(axis=0)

    @property
    def normals(self) -> FloatArray:
        """Normal of the plane that fits it best."""
        _, _, axes = np.linalg.svd(self.samples - self.samples.mean(axis=0))
        return np.asarray(axes[2:])

    def distance(self, place: Place) -> float:
        """Return its distance from a place, mm, by sample points: the narrowest of rims around it is nearest."""
        return float(np.linalg.norm(self.samples - np.array(place), axis=1).min())


def rims(faces: Iterable[CadFace | Patch]) -> list[Rim]:
    """Return the closed lines along which the `faces` end, each once: outlines of faces, and of holes in them."""
    gmsh = cad.kernel()
    found: dict[frozenset[int], Rim] = {}
    for face in faces:
        pairs = [(2, tag) for tag in face.tags]
        edges = [abs(tag) for _, tag in gmsh.model.getBoundary(pairs, combined=False, oriented=False)]
        # An edge that the face meets on both sides is where its parametrisation begins and ends.
        for line in _lines({tag for tag in edges if edges.count(tag) == 1}):
            found.setdefault(line, Rim(line, np.vstack([_along(tag) for tag in sorted(line)])))
    return list(found.values())


def _lines(edges: Collection[int]) -> list[frozenset[int]]:
    """Group edges into lines that hang together by their ends."""
    gmsh = cad.kernel()
    ends = {edge: {tag for _, tag in gmsh.model.getBoundary([(1, edge)], oriented=False)} for edge in edges}
    lines: list[frozenset[int]] = []
    left = sorted(edges)
    while left:
        line = {left.pop(0)}
        front = set(ends[min(line)])
        while joined := [edge for edge in left if ends[edge] & front]:
            line |= set(joined)
            front |= set().union(*(ends[edge] for edge in joined))
            left = [edge for edge in left if edge not in joined]
        lines.append(frozenset(line))
    return lines


def _along(edge: int) -> FloatArray:
    gmsh = cad.kernel()
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, edge)
    return np.array(gmsh.model.getValue(1, edge, np.linspace(start, end, 9).tolist())).reshape(-1, 3)
