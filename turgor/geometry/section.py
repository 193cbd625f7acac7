"""How much of a body is drawn: the whole, a part between planes of symmetry, or a plane that stands for the body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
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


TURN: Mapping[str, float] = MappingProxyType({"full": 2.0 * math.pi, "half": math.pi, "quarter": 0.5 * math.pi})
"""Model of a body around z → angle in rad, from the x axis on, that is drawn of it."""

CUTS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "full": {},
        "half": {"symmetry": "y"},
        "quarter": {"symmetry-x": "x", "symmetry-y": "y"},
        "axisymmetric": {"axis": "x"},
    }
)
"""Model of a body → the names of the cuts through it and the axes across which they lie, all through the origin."""
