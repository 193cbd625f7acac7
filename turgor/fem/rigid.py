"""Rigid bodies that an actuator may touch: their signed distance and its derivatives.

Places have d coordinates, three in space and two in the plane of a plane model. There a plane is a line, a sphere
a circle, a box a rectangle, and a cylinder a rectangle around its axis; what they look like across the plane follows
from the model (in a body of revolution, a circle on the axis is a sphere and one off it a ring).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError

Floats = NDArray[np.float64]
Vector = tuple[float, ...]


class RigidBody(Protocol):
    """A body that keeps its shape."""

    @property
    def reference_point(self) -> Floats:
        """The point ``(d,)`` that torque is taken about, mm."""
        ...

    @property
    def depth(self) -> float:
        """How deep inside it a point may be, mm: farther on it comes out on the other side."""
        ...

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the signed distance of points ``(n, d)`` and its derivatives.

        Returns
        -------
        distance
            ``(n,)``, mm: negative inside; outside it may be less than the true one where an edge is nearest.
        normal
            Its gradient ``(n, d)``, of unit length.
        curvature
            Its second derivative ``(n, d, d)``, 1/mm.
        """
        ...


@dataclass(frozen=True)
class Plane:
    """Everything behind a plane: `normal` points out of the body, to where the actuator is."""

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        _check_direction(self.normal, "normal")

    @property
    def reference_point(self) -> Floats:
        """The given point."""
        return np.asarray(self.point, float)

    @property
    def depth(self) -> float:
        """Without end."""
        return np.inf

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the height over the plane; see :meth:`RigidBody.distance`."""
        normal = _unit(self.normal)
        height = (x - self.point) @ normal
        return height, np.broadcast_to(normal, x.shape), np.zeros((*x.shape, x.shape[1]))

    def section(self) -> Self:
        """Return the line; see :data:`Sectioned`."""
        _check_plane(self.normal, "normal")
        return replace(self, point=self.point[:2], normal=self.normal[:2])

    def turned(self) -> str:
        """Return "cone" if it leans; see :data:`Sectioned`."""
        return "cone" if self.normal[0] != 0.0 else ""


@dataclass(frozen=True)
class Sphere:
    """A ball."""

    centre: Vector
    radius: float

    def __post_init__(self) -> None:
        _check_length(self.radius, "radius")

    @property
    def reference_point(self) -> Floats:
        """The centre."""
        return np.asarray(self.centre, float)

    @property
    def depth(self) -> float:
        """The radius."""
        return self.radius

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the surface; see :meth:`RigidBody.distance`."""
        reach, normal = _direction(x - self.centre)
        return reach - self.radius, normal, _round(reach, normal, np.eye(x.shape[1]))

    def section(self) -> Self:
        """Return the circle; see :data:`Sectioned`."""
        _check_plane(self.centre, "centre")
        return replace(self, centre=self.centre[:2])

    def turned(self) -> str:
        """Return "ring" if it is beside the axis; see :data:`Sectioned`."""
        return "ring" if self.centre[0] != 0.0 else ""


@dataclass(frozen=True)
class Cylinder:
    """A round bar between two points, with flat ends."""

    start: Vector
    end: Vector
    radius: float

    def __post_init__(self) -> None:
        _check_length(self.radius, "radius")
        _check_direction(tuple(np.subtract(self.end, self.start)), "end")

    @property
    def reference_point(self) -> Floats:
        """The middle of the axis."""
        return np.asarray(np.add(self.start, self.end) / 2, float)

    @property
    def depth(self) -> float:
        """The radius, or half of the length if that is less."""
        return min(self.radius, 0.5 * float(np.linalg.norm(np.subtract(self.end, self.start))))

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the mantle or the nearer end; see :meth:`RigidBody.distance`."""
        span = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(span))
        axis = span / length
        across = np.eye(x.shape[1]) - np.outer(axis, axis)
        away = x - self.reference_point
        along = away @ axis
        reach, normal = _direction(away @ across)
        curvature = _round(reach, normal, across)
        end = np.abs(along) - 0.5 * length
        at_end = end > reach - self.radius
        normal = np.where(at_end[:, None], np.where(along > 0.0, 1.0, -1.0)[:, None] * axis, normal)
        curvature[at_end] = 0.0
        return np.maximum(end, reach - self.radius), normal, curvature

    def section(self) -> Cylinder | Sphere:
        """Return the circle of a cylinder across the plane, the rectangle of one in it; see :data:`Sectioned`."""
        if len(self.start) > 2 and self.start[:2] == self.end[:2] and self.start[2] * self.end[2] < 0.0:
            return Sphere(self.start[:2], self.radius)
        _check_plane(self.start, "start")
        _check_plane(self.end, "end")
        return replace(self, start=self.start[:2], end=self.end[:2])

    def turned(self) -> str:
        """Return "ring" if it is not on the axis; see :data:`Sectioned`."""
        if self.start[2] or self.end[2]:
            raise InputError(
                "a bar across the plane of the model is no body of revolution about the y axis",
                key="end",
                value=self.end,
                expected="a bar in the plane z = 0, or a sphere, which beside the axis stands for a ring",
            )
        return "ring" if self.start[0] or self.end[0] else ""


@dataclass(frozen=True)
class Box:
    """A block with faces across the axes, between two opposite corners."""

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        for low, high in zip(self.lower, self.upper, strict=True):
            _check_length(high - low, "upper")

    @property
    def reference_point(self) -> Floats:
        """The centre."""
        return np.asarray(np.add(self.lower, self.upper) / 2, float)

    @property
    def depth(self) -> float:
        """Half of the shortest edge."""
        return 0.5 * float(np.min(np.subtract(self.upper, self.lower)))

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the nearest face's plane; see :meth:`RigidBody.distance`."""
        away = x - self.reference_point
        heights = np.abs(away) - 0.5 * np.subtract(self.upper, self.lower)
        axis = np.argmax(heights, axis=1)
        row = np.arange(len(x))
        normal = np.zeros_like(x)
        normal[row, axis] = np.where(away[row, axis] > 0.0, 1.0, -1.0)
        return heights[row, axis], normal, np.zeros((*x.shape, x.shape[1]))

    def section(self) -> Self:
        """Return the rectangle; see :data:`Sectioned`."""
        if len(self.lower) > 2 and not self.lower[2] < 0.0 < self.upper[2]:
            raise InputError("the box does not reach across the plane z = 0", key="lower", value=self.lower)
        return replace(self, lower=self.lower[:2], upper=self.upper[:2])

    def turned(self) -> str:
        """Return "disc"; see :data:`Sectioned`."""
        if any(self.lower[axis] != -self.upper[axis] for axis in (0, 2)):
            raise InputError(
                "a box beside the y axis is no body of revolution about it",
                key="lower",
                value=self.lower,
                expected="a box with the axis in its middle, which stands for a disc, or a cylinder along y in the "
                "plane z = 0, which beside the axis stands for a ring",
            )
        return "disc"


Sectioned = Plane | Sphere | Cylinder | Box
"""Bodies that a plane model may meet too.

Their method ``section`` returns what the plane z = 0 cuts out of them, in two coordinates (themselves if they have only
two), and raises InputError if they do not look the same in front of and behind that plane. Given in space, their method
``turned`` returns what that section becomes when a body of revolution turns it about y, if that is another body than
they are, else nothing; it raises InputError if they reach out of the plane where nothing that is turned does.
"""


def _direction(away: Floats) -> tuple[Floats, Floats]:
    """Return lengths ``(n,)`` and unit vectors ``(n, d)``; of a vector without length, any."""
    reach = np.linalg.norm(away, axis=1)
    return reach, away / np.where(reach > 0.0, reach, 1.0)[:, None]


def _round(reach: Floats, normal: Floats, across: Floats) -> Floats:
    """Return the second derivative of the distance from a point or an axis, `across` being what varies around it."""
    bent = across - np.einsum("ni,nj->nij", normal, normal)
    return np.asarray(bent / np.where(reach > 0.0, reach, np.inf)[:, None, None])


def _unit(vector: Vector) -> Floats:
    return np.asarray(np.divide(vector, np.linalg.norm(vector)))


def _check_direction(vector: Vector, key: str) -> None:
    if not np.linalg.norm(vector) > 0.0:
        raise InputError("this direction has no length", key=key, value=vector)


def _check_plane(vector: Vector, key: str) -> None:
    if any(vector[2:]):
        raise InputError("this does not lie in the plane z = 0 of the model", key=key, value=vector)


def _check_length(length: float, key: str) -> None:
    if not length > 0.0:
        raise InputError("a length must be positive", key=key, value=length)
