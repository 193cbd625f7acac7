"""Fields of directions in the reference state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Constant:
    """The same direction everywhere: `vector`, of any length but zero."""

    vector: Vector

    def __post_init__(self) -> None:
        _check_direction("vector", self.vector)

    def at(self, places: Floats) -> Floats:
        """Return the direction at `places` ``(k, 3)``, ``(k, 3)``."""
        return np.broadcast_to(np.asarray(self.vector, float), places.shape)


@dataclass(frozen=True)
class Helical:
    """The tangent of helices about an axis.

    Attributes
    ----------
    angle
        Winding angle in rad, measured from the axis: 0 is along the axis, π/2 around it. Positive angles wind
        right-handed, that is, anticlockwise as they rise, seen against the axis.
    axis
        Direction of the axis.
    origin
        A point on the axis, mm.
    """

    angle: float
    axis: Vector = (0.0, 0.0, 1.0)
    origin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        _check_direction("axis", self.axis)

    def at(self, places: Floats) -> Floats:
        """Return the unit tangent at `places` ``(k, 3)``, ``(k, 3)``; zero on the axis, where there is none."""
        axis = np.asarray(self.axis, float) / np.linalg.norm(self.axis)
        if self.angle == 0.0:
            return np.broadcast_to(axis, places.shape)
        arm = places - np.asarray(self.origin, float)
        around = np.cross(axis, arm)
        radius = np.linalg.norm(around, axis=1, keepdims=True)
        defined = radius > 1e-12 * max(1.0, float(np.abs(arm).max()))
        around = np.divide(around, radius, out=np.zeros_like(around), where=defined)
        return np.where(defined, np.cos(self.angle) * axis + np.sin(self.angle) * around, 0.0)


Direction = Constant | Helical


def _check_direction(name: str, vector: Vector) -> None:
    size = float(np.linalg.norm(vector))
    if not (np.isfinite(size) and size > 0.0):
        raise InputError("this is no direction", key=name, value=vector, expected="three numbers, not all zero")
