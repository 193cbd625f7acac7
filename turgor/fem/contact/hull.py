"""The surface of a rigid body in flat pieces, for programs that know only such."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from turgor.common.errors import InputError
from turgor.fem.rigid import Box, Cylinder, Plane, RigidBody, Sphere

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FAR = 100.0
"""A plane reaches so many times the size of the model."""

FINEST = 6
"""A triangle of a ball is cut in four at most so many times."""

MOST_SIDES = 2000


@dataclass(frozen=True, eq=False)
class Hull:
    """Vertices ``(n, d)``, pieces ``(m, d)`` (triangles or, in the plane, edges) and the point that torque is about."""

    vertices: Floats
    pieces: Ints
    reference_point: Floats


def hull(body: RigidBody, points: Floats, error: float, key: str) -> Hull:
    """Return the surface of a body.

    Parameters
    ----------
    body
        A plane, box, cylinder or sphere, with as many coordinates as the model.
    points
        The model's nodes ``(n, d)``, which a plane must reach beyond.
    error
        How far a piece may be off a round surface, mm.
    key
        Where the case names the body.

    Raises
    ------
    InputError
        For any other body.
    """
    d = points.shape[1]
    if isinstance(body, Plane):
        vertices, pieces = _plane(body, points)
    elif isinstance(body, Box):
        corners = np.array(np.meshgrid(*zip(body.lower, body.upper, strict=True), indexing="ij")).reshape(d, -1).T
        vertices, pieces = _convex(corners)
    elif isinstance(body, Sphere):
        rim = _circle(body.radius, error) if d == 2 else body.radius * _ball(body.radius, error)
        vertices, pieces = _convex(rim + body.centre)
    elif isinstance(body, Cylinder):
        vertices, pieces = _convex(_bar(body, error))
    else:
        raise InputError(
            "the barrier does not know this body",
            key=key,
            value=type(body).__name__,
            expected="a plane, box, cylinder or sphere, or method: penalty",
        )
    return Hull(vertices, pieces.astype(np.int32), body.reference_point)


def _plane(body: Plane, points: Floats) -> tuple[Floats, Ints]:
    """Return one large triangle (or edge) around where the model stands over the plane."""
    normal = np.asarray(body.normal, float) / np.linalg.norm(body.normal)
    middle = points.mean(axis=0)
    middle = middle - (middle - body.point) @ normal * normal
    _, _, frame = np.linalg.svd(normal[None])
    size = FAR * float(np.linalg.norm(np.ptp(points, axis=0)))
    if len(normal) == 2:
        return middle + size * np.array([[-1.0], [1.0]]) * frame[1], np.array([[0, 1]])
    angle = 2.0 * np.pi * np.arange(3) / 3.0
    return middle + size * np.column_stack([np.cos(angle), np.sin(angle)]) @ frame[1:], np.array([[0, 1, 2]])


def _convex(vertices: Floats) -> tuple[Floats, Ints]:
    """Return the hull of points that all lie on it."""
    return vertices, np.asarray(ConvexHull(vertices).simplices)


def _circle(radius: float, error: float) -> Floats:
    """Return points on a circle around the origin, the chords between them no farther from it than `error`."""
    sides = min(MOST_SIDES, max(8, int(np.ceil(np.pi / np.arccos(1.0 - min(0.5, error / radius))))))
    angle = 2.0 * np.pi * np.arange(sides) / sides
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _ball(radius: float, error: float) -> Floats:
    """Return points on the unit sphere: an icosahedron whose triangles are cut in four until they are near enough."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    points = np.array([[0.0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    points = np.vstack([np.roll(points, k, axis=1) for k in range(3)])
    points /= np.linalg.norm(points, axis=1)[:, None]
    for _ in range(FINEST):
        corners = points[ConvexHull(points).simplices]
        if radius * (1.0 - np.linalg.norm(corners.mean(axis=1), axis=1).min()) <= error:
            break
        middles = np.vstack([corners[:, a] + corners[:, b] for a, b in ((0, 1), (1, 2), (2, 0))])
        middles /= np.linalg.norm(middles, axis=1)[:, None]
        points = np.vstack([points, np.unique(middles.round(12), axis=0)])
    return points


def _bar(body: Cylinder, error: float) -> Floats:
    """Return points on the rims of both ends; in the plane the corners of the rectangle."""
    start, end = np.asarray(body.start, float), np.asarray(body.end, float)
    axis = (end - start) / np.linalg.norm(end - start)
    _, _, frame = np.linalg.svd(axis[None])
    circle = _circle(body.radius, error) if len(axis) == 3 else body.radius * np.array([[-1.0], [1.0]])
    rim = circle @ frame[1:]
    return np.vstack([start + rim, end + rim])
