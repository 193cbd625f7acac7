"""What a plane drawing stands for, told by the shape itself so that nobody has to say it twice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class PlaneSection:
    """A plane drawing of a body in space.

    Parameters
    ----------
    kind
        ``plane-strain`` (a slice of a long body that keeps its thickness), ``plane-stress`` (a thin sheet with free
        faces) or ``axisymmetric`` (turned about the second axis, the first is the radius).
    thickness
        Extent across the plane in mm; None for a body of revolution.
    """

    kind: Literal["plane-strain", "plane-stress", "axisymmetric"]
    thickness: float | None = None
