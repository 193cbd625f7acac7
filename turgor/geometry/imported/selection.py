"""Rules that select faces of an imported solid, whose tags mean nothing to a person."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from turgor.common.errors import InputError
from turgor.geometry import cad
from turgor.geometry.space import Cylinder, Direction, Place, unit


class Selection(BaseModel):
    """Which faces are meant; of several rules all must hold.

    Parameters
    ----------
    within
        Two opposite corners of a box that holds the whole face.
    inside
        A cylinder that holds the face's vertices and sample points.
    normal
        Direction, which need not have length one, of the outward normal of a flat face.
    angle
        Largest angle in degrees between `normal` and the face's.
    nearest
        Of the faces that the other rules leave, the one nearest to this point.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    within: tuple[Place, Place] | None = None
    inside: Cylinder | None = None
    normal: Direction | None = None
    angle: Annotated[float, Field(gt=0.0, lt=90.0)] = 5.0
    nearest: Place | None = None

    def pick(self, faces: list[int], key: str) -> list[int]:
        """Return those of the `faces` of the current model that are meant.

        Raises
        ------
        InputError
            If there is no rule, or no face follows them; `key` names the selection.
        """
        if self.within is None and self.inside is None and self.normal is None and self.nearest is None:
            raise InputError("no rule says which faces", key=key, expected="within, inside, normal or nearest")
        found = [face for face in faces if self._in_box(face) and self._in_cylinder(face) and self._faces_along(face)]
        if self.nearest is not None and found:
            point = cad.occ().addPoint(*self.nearest)
            distances = [cad.occ().getDistance(0, point, 2, face)[0] for face in found]
            cad.occ().remove([(0, point)])
            found = [found[int(np.argmin(distances))]]
        if not found:
            raise InputError("no face follows these rules", key=key, value=self.model_dump(exclude_none=True))
        return found

    def _in_box(self, face: int) -> bool:
        if self.within is None:
            return True
        low, high = cad.bounds(2, face)
        corners = np.array(self.within)
        slack = 1e-6 * max(1.0, float(np.abs(corners).max()))
        return bool((low > corners.min(axis=0) - slack).all() and (high < corners.max(axis=0) + slack).all())

    def _in_cylinder(self, face: int) -> bool:
        if self.inside is None:
            return True
        return bool(self.inside.contains(_samples(face)).all())

    def _faces_along(self, face: int) -> bool:
        if self.normal is None:
            return True
        normals = outward_normals(face)
        return bool((normals @ unit(self.normal) > math.cos(math.radians(self.angle))).all())


def outward_normals(face: int) -> Any:
    """Return the normals ``(k, 3)`` at sample points of a face of one solid, pointing out of it."""
    gmsh = cad.kernel()
    places = _parameters(face)
    normals = np.array(gmsh.model.getNormal(face, places)).reshape(-1, 3)
    # gmsh's normal follows the surface, not the solid: a short step along it tells on which side the solid lies.
    low, high = cad.bounds(2, face)
    step = np.array(gmsh.model.getValue(2, face, places[:2])) + 1e-4 * np.linalg.norm(high - low) * normals[0]
    volumes, _ = gmsh.model.getAdjacencies(2, face)
    return -normals if gmsh.model.isInside(3, volumes[0], step.tolist()) else normals


def _samples(face: int) -> Any:
    """Return points of a face ``(k, 3)``: its vertices, and some inside it."""
    gmsh = cad.kernel()
    vertices = gmsh.model.getBoundary([(2, face)], oriented=False, recursive=True)
    points = [np.array(gmsh.model.getValue(0, tag, [])) for _, tag in vertices]
    inner = np.array(gmsh.model.getValue(2, face, _parameters(face))).reshape(-1, 3)
    return np.vstack([*points, inner])


def _parameters(face: int) -> list[float]:
    """Return u, v, u, v, … of a grid of points that lie on the trimmed face."""
    gmsh = cad.kernel()
    (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(2, face)
    grid = [(u, v) for u in np.linspace(u0, u1, 7)[1:-1] for v in np.linspace(v0, v1, 7)[1:-1]]
    on_face = [pair for pair in grid if gmsh.model.isInside(2, face, pair, parametric=True)]
    return [float(number) for pair in on_face or grid for number in pair]
