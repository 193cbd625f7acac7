"""The section across a PneuNet's chamber: the room inside, and a wall of one thickness around it, cut off on top."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from turgor.geometry.path import Piece, polygon

CrossSection = Literal["square", "triangle", "half-round"]


@dataclass(frozen=True)
class Chamber:
    """A chamber seen along the finger, its floor on the line z = 0, lengths in mm.

    Parameters
    ----------
    shape
        ``square`` (a rectangle), ``triangle`` (on its base) or ``half-round`` (upright sides under a half circle).
    width, height
        Of the room: its largest width, and its height in the middle.
    side_wall
        Thickness of the wall across its faces; the outside of a triangle or half circle runs parallel to the inside.
    top_wall
        Height over the room at which the outside is cut off flat.
    """

    shape: CrossSection
    width: float
    height: float
    side_wall: float
    top_wall: float

    @property
    def half_width(self) -> float:
        """Half of the width of the outside at the floor."""
        return 0.5 * self.width + self.side_wall / (math.sin(self.slope) if self.shape == "triangle" else 1.0)

    @property
    def thickest_top(self) -> float:
        """Height over the room at which the outsides of both sides meet."""
        return math.inf if self.shape == "square" else self.side_wall / math.cos(self.slope)

    @property
    def slope(self) -> float:
        """Slope in rad of a triangle's sides; 0 for the other shapes, whose sides stand upright."""
        return math.atan2(self.height, 0.5 * self.width) if self.shape == "triangle" else 0.0

    @property
    def _spring(self) -> float:
        """Height at which the half circle begins."""
        return self.height - 0.5 * self.width

    def room(self, height: float) -> float:
        """Return half of the width of the room at a `height` over the floor, at most that of the room."""
        if self.shape == "triangle":
            return 0.5 * self.width * (1.0 - height / self.height)
        above = height - self._spring
        if self.shape == "half-round" and above > 0.0:
            return math.sqrt(max((0.5 * self.width) ** 2 - above**2, 0.0))
        return 0.5 * self.width

    def inside(self) -> list[Piece]:
        """Return the closed outline of the room."""
        half = 0.5 * self.width
        if self.shape == "triangle":
            return polygon([(-half, 0.0), (half, 0.0), (0.0, self.height)])
        if self.shape == "square":
            return polygon([(-half, 0.0), (half, 0.0), (half, self.height), (-half, self.height)])
        return self._arched(half, 0.0, self.height)

    def outside(self, bottom: float) -> list[Piece]:
        """Return the closed outline of the solid, down to the height `bottom` ≤ 0."""
        half, top = self.half_width, self.height + self.top_wall
        if self.shape == "half-round":
            return self._arched(half, bottom, top)
        ridge = half
        if self.shape == "triangle":
            ridge = _or_none(half - top / math.tan(self.slope), half)
        corners = [(-half, bottom), (half, bottom), (half, 0.0), (ridge, top), (-ridge, top), (-half, 0.0)]
        return polygon(corners)

    def _arched(self, radius: float, bottom: float, top: float) -> list[Piece]:
        """Return upright sides under a half circle that is cut off flat at `top`."""
        centre = (0.0, self._spring)
        ridge = _or_none(math.sqrt(max(radius**2 - (top - self._spring) ** 2, 0.0)), radius)
        return [
            Piece((-radius, bottom), (radius, bottom)),
            Piece((radius, bottom), (radius, self._spring)),
            Piece((radius, self._spring), (ridge, top), centre),
            Piece((ridge, top), (-ridge, top)),
            Piece((-ridge, top), (-radius, self._spring), centre),
            Piece((-radius, self._spring), (-radius, bottom)),
        ]


def _or_none(ridge: float, width: float) -> float:
    """Return half of the width of a ridge, or 0 where it is no more than rounding leaves of a sharp one."""
    return ridge if ridge > 1e-6 * width else 0.0
