"""One fixed camera that sees every state of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

AZIMUTH, ELEVATION = float(np.radians(28.0)), float(np.radians(18.0))
"""By how much the camera is turned and raised from the side of the motion."""

_MARGIN = 1.08


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    Parameters
    ----------
    target
        Point in the middle of the picture, shape ``(3,)``, mm.
    towards
        Unit vector from the target to the camera, shape ``(3,)``.
    up
        Unit vector that points up in the picture, shape ``(3,)``.
    half_height
        Half of the picture's height in mm.
    side
        Coordinate axis, 0 to 2, that the camera looks along most.
    """

    target: FloatArray
    towards: FloatArray
    up: FloatArray
    half_height: float
    side: int


def camera_for(points: FloatArray, aspect: float, cuts: FloatArray | None = None) -> Camera:
    """Return the camera that sees all `points` ``(n, 3)`` in a picture of width/height `aspect`.

    It looks from the side at the plane of the motion, across which the body moves least, turned and raised a little so
    that depth shows; straight at a body that is flat. Up is z, or y where z is the direction it looks along. Into a
    body that is cut it looks from the cut, and if there are several, so that it sees all of them.

    Parameters
    ----------
    points
        What is to be seen.
    aspect
        Width over height.
    cuts
        Unit vectors along the axes out of the planes that the body is cut by, ``(c, 3)``.
    """
    extents = np.ptp(points, axis=0)
    cuts = np.zeros((0, 3)) if cuts is None else cuts
    open_sides = np.flatnonzero(np.any(cuts, axis=0)) if len(cuts) else np.arange(3)
    side = int(open_sides[np.argmin(extents[open_sides])])
    azimuth, elevation = (AZIMUTH, ELEVATION) if extents[side] > 0.0 else (0.0, 0.0)
    vertical = np.eye(3)[1 if side == 2 else 2]
    # Looking along +y with z up (and along −x or −z alike) leaves the first in-plane axis pointing right.
    facing = np.eye(3)[side] * (-1.0 if side == 1 else 1.0)
    facing = next((cut for cut in cuts if cut[side]), facing)
    across = np.cross(vertical, facing)
    azimuth *= -1.0 if (cuts @ across < 0.0).any() else 1.0
    elevation *= -1.0 if (cuts @ vertical < 0.0).any() else 1.0
    level = np.cos(azimuth) * facing + np.sin(azimuth) * across
    towards = np.cos(elevation) * level + np.sin(elevation) * vertical
    right = np.cross(vertical, towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
    seen = points @ np.column_stack([right, up])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle = 0.5 * (low + high)
    depth = float((points @ towards).mean())
    half_width, half_height = 0.5 * (high - low)
    return Camera(
        target=middle[0] * right + middle[1] * up + depth * towards,
        towards=towards,
        up=up,
        half_height=float(_MARGIN * max(half_height, half_width / aspect)),
        side=side,
    )
