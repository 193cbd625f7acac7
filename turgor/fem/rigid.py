"""Rigid bodies that an actuator may touch: their signed distance and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


class RigidBody(Protocol):
    """A body that keeps its shape."""

    @property
    def reference_point(self) -> Floats:
        """The point ``(3,)`` that torque is taken about, mm."""
        ...

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the signed distance of points ``(n, 3)`` and its derivatives.

        Returns
        -------
        distance
            ``(n,)``, mm: negative inside; outside it may be less than the true one where an edge is nearest.
        normal
            Its gradient ``(n, 3)``, of unit length.
        curvature
            Its second derivative ``(n, 3, 3)``, 1/mm.
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

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the height over the plane; see :meth:`RigidBody.distance`."""
        normal = _unit(self.normal)
        height = (x - self.point) @ normal
        return height, np.broadcast_to(normal, x.shape), np.zeros((len(x), 3, 3))


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

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the surface; see :meth:`RigidBody.distance`."""
        reach, normal = _direction(x - self.centre)
        return reach - self.radius, normal, _round(reach, normal, np.eye(3))


@dataclass(frozen=True)
class Cylinder:
    """A round bar between two points, with flat ends."""

    start: Vector
    end: Vector
    radius: float

    def __post_init__(self) -> None:
        _check_length(self.radius, "radius")
        _check_direction((self.end[0] - self.start[0], self.end[1] - self.start[1], self.end[2] - self.start[2]), "end")

    @property
    def reference_point(self) -> Floats:
        """The middle of the axis."""
        return np.asarray(np.add(self.start, self.end) / 2, float)

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the mantle or the nearer end; see :meth:`RigidBody.distance`."""
        span = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(span))
        axis = span / length
        across = np.eye(3) - np.outer(axis, axis)
        away = x - self.reference_point
        along = away @ axis
        reach, normal = _direction(away @ across)
        curvature = _round(reach, normal, across)
        end = np.abs(along) - 0.5 * length
        at_end = end > reach - self.radius
        normal = np.where(at_end[:, None], np.where(along > 0.0, 1.0, -1.0)[:, None] * axis, normal)
        curvature[at_end] = 0.0
        return np.maximum(end, reach - self.radius), normal, curvature


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

    def distance(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the distance from the nearest face's plane; see :meth:`RigidBody.distance`."""
        away = x - self.reference_point
        heights = np.abs(away) - 0.5 * np.subtract(self.upper, self.lower)
        axis = np.argmax(heights, axis=1)
        row = np.arange(len(x))
        normal = np.zeros_like(x)
        normal[row, axis] = np.where(away[row, axis] > 0.0, 1.0, -1.0)
        return heights[row, axis], normal, np.zeros((len(x), 3, 3))


def _direction(away: Floats) -> tuple[Floats, Floats]:
    """Return lengths ``(n,)`` and unit vectors ``(n, 3)``; of a vector without length, any."""
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


def _check_length(length: float, key: str) -> None:
    if not length > 0.0:
        raise InputError("a length must be positive", key=key, value=length)
