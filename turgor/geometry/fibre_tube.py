"""The fibre tube: a capped tube of two layers with fibres wound between them on standard or tilted helices."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np
from scipy.optimize import brentq

from turgor.common.errors import InputError
from turgor.common.units import Angle, PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.blocks import Blocks, capped_tube
from turgor.geometry.drawing import AIR, Distance, Mark, Pointer, Turn, View, circle, rectangle

_THESIS = "Geer, Coiling motion of plant-inspired soft actuators (2019), section 2.2"
_ASSUMED = "assumed"

_POINTS_PER_TURN = 72


class FibreTube(Actuator):
    """A capped tube along z from the mount at z = 0; fibres run on the surface between its layers.

    Fibre k of n follows x = r cos t, y = ±r sin t, z = p t / 2π + A cos t, shifted along z by k p / n; A = r tan α
    (Geer, 2019, eqs. 1–5). The fibre length in the middle of the tube is wound all around: its last loops reach up to
    2 A beyond, over the caps, which hold the fibres' ends. Ends cut off where the cavity ends would let the wall bulge
    there. Where a loop leaves the tube and enters it again, each part is a curve of its own.

    Regions ``inner-layer`` (with the caps) and ``outer-layer``; surfaces ``mount``, ``tip-face``, ``outer`` and
    ``cavity``; curves ``fibre-1``, ``fibre-2``, … (parts: ``fibre-1-2``, …); markers ``base`` and ``tip`` (centres of
    the end faces) and ``centreline`` (along the outside at y = 0, x > 0).
    """

    template: ClassVar[str] = "fibre-tube"

    inner_diameter: PositiveLength = parameter("12.7 mm", "diameter of the cavity", _THESIS)
    inner_layer: PositiveLength = parameter("1.7 mm", "thickness inside the fibres", _THESIS)
    outer_layer: PositiveLength = parameter("1.8 mm", "thickness outside the fibres", _THESIS)
    length: PositiveLength = parameter("339 mm", "length, caps included", _THESIS)
    cap: PositiveLength = parameter("17 mm", "thickness of either end cap", _THESIS)
    fibre_length: PositiveLength = parameter("305 mm", "part of the length that is wound all around", _THESIS)
    fibres: int = parameter(2, "number of fibres", _THESIS, ge=1, le=64)
    pitch: PositiveLength = parameter("15 mm", "rise of a fibre in one turn", "assumed: the thesis prints none")
    tilt: Angle = parameter(
        "51 deg", "tilt of the helix; 0 is a standard one", f"{_THESIS}: 41, 51 and 61 deg", degrees=(0, 75)
    )
    winding: Literal["left", "right", "both"] = parameter(
        "right", "sense: 'right' turns anticlockwise as it rises, 'both' alternates from fibre to fibre", _ASSUMED
    )

    @property
    def default_size(self) -> float:
        """One element, not quite twice as long as thick, through each layer."""
        return float(1.75 * min(self.inner_layer, self.outer_layer))

    @property
    def fibre_radius(self) -> float:
        """Radius of the surface between the layers in mm."""
        return float(0.5 * self.inner_diameter + self.inner_layer)

    def check(self) -> None:
        """Raise InputError if caps or fibres do not fit the tube."""
        if 2.0 * self.cap >= self.length:
            expected = f"less than half of the length, {self.length / 2:g} mm"
            raise InputError("the caps meet: no cavity is left", key="cap", value=f"{self.cap:g} mm", expected=expected)
        if self.fibre_length > self.length:
            value, expected = f"{self.fibre_length:g} mm", f"at most {self.length:g} mm"
            raise InputError("the fibres are longer than the tube", key="fibre_length", value=value, expected=expected)
        if not self._curves():
            value, expected = f"{self.fibre_length:g} mm", "a longer part of the tube"
            raise InputError("no fibre fits on this length", key="fibre_length", value=value, expected=expected)

    def views(self) -> list[View]:
        """Show the section along the axis, the fibres of one end from the side, and the section across."""
        inner, between = 0.5 * self.inner_diameter, self.fibre_radius
        outer, length, low = between + self.outer_layer, self.length, 0.5 * (self.length - self.fibre_length)
        section = View(
            "section along the axis",
            [
                ("outer-layer", rectangle(0, length, -outer, outer)),
                ("inner-layer", rectangle(0, length, -between, between)),
                (AIR, rectangle(self.cap, length - self.cap, -inner, inner)),
            ],
            [
                Distance("length", (0, -outer), (length, -outer), -4),
                Distance("cap", (0, -outer), (self.cap, -outer), -1),
                Distance("fibre_length", (low, -outer), (length - low, -outer), -2),
            ],
            notes={"mount": (-0.035 * length, 0.0)},
        )
        across = View(
            "section across the axis",
            [("outer-layer", circle(outer)), ("inner-layer", circle(between)), (AIR, circle(inner))],
            [
                Distance("inner_diameter", (-inner, 0), (inner, 0)),
                Distance("inner_layer", (0, inner), (0, between)),
                Distance("outer_layer", (0, -outer), (0, -between)),
                Pointer("winding", (between, 0.0), 0, 3),
            ],
        )
        return [section, self._fibre_view(outer), across]

    def _fibre_view(self, outer: float) -> View:
        """Show one loop of every fibre where the first has its crossing nearest to the middle of the tube."""
        radius, middle = self.fibre_radius, 0.5 * self.length
        lines = [curve[:, [2, 0]] for curve in self._curves().values()]
        reach = max(2.2 * self.pitch, 2.2 * radius * math.tan(self.tilt), 2.0 * outer)
        window = (middle - reach, middle + reach, -outer, outer)
        low = 0.5 * (self.length - self.fibre_length)
        # On the side x = 0 the first fibre passes at t = 2π k + π/2, a quarter of a pitch beyond whole ones.
        start = low + self.pitch * (math.floor((middle - low) / self.pitch) + 0.25)
        tilted = math.pi / 2 - self.tilt
        marks: list[Mark] = [
            Distance("pitch", (start, 0.0), (start + self.pitch, 0.0)),
            Pointer("fibres", (middle - 0.5 * reach, outer), 90, 1.5),
        ]
        if self.tilt > 0.0:
            marks.append(Turn("tilt", (start, 0.0), tilted, math.pi / 2, 0.9 * outer))
        title = "the fibres in the middle of the tube, seen along y, near and far sides of their loops"
        area = [("inner-layer", rectangle(0, self.length, -outer, outer))]
        return View(title, area, marks, fibres=lines, window=window)

    def draw(self) -> Shape:
        """Draw the two layers with their common surface, and list the fibres."""
        occ = cad.occ()
        inside, between = 0.5 * self.inner_diameter, self.fibre_radius
        outside = between + self.outer_layer
        air = cad.cylinder(self.cap, self.length - self.cap, inside)
        (inner,), _ = occ.cut([cad.cylinder(0.0, self.length, between)], [air])
        hole = cad.cylinder(0.0, self.length, between)
        (outer,), _ = occ.cut([cad.cylinder(0.0, self.length, outside)], [hole])
        ends = np.vstack([self._markers()["base"], self._markers()["tip"]])
        _, pieces = occ.fragment([inner, outer], [(0, occ.addPoint(*end)) for end in ends])
        occ.synchronize()
        regions = {
            name: [tag for _, tag in pieces[number]] for number, name in enumerate(("inner-layer", "outer-layer"))
        }
        tags = [tag for piece in regions.values() for tag in piece]
        return Shape(
            regions=regions,
            surfaces=cad.named_skin(cad.boundary(tags), "z", self.length, {}),
            markers=self._markers(),
            curves=self._curves(),
        )

    def _markers(self) -> dict[str, FloatArray]:
        ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, self.length]])
        outside = np.array([self.fibre_radius + self.outer_layer, 0.0, 0.0])
        return {"base": ends[:1], "tip": ends[1:], "centreline": ends + outside}

    def blocks(self) -> Blocks:
        """Return the caps' middles and both layers."""
        radii = (0.5 * self.inner_diameter, self.fibre_radius, self.fibre_radius + self.outer_layer)
        parts = capped_tube(radii, ("inner-layer", "inner-layer", "outer-layer"), self.cap, self.length)
        return Blocks(parts, self._markers(), self._curves())

    def _curves(self) -> dict[str, FloatArray]:
        curves = {}
        for number in range(self.fibres):
            sense = {"right": 1, "left": -1, "both": 1 - 2 * (number % 2)}[self.winding]
            for part, points in enumerate(self._parts(number, sense), start=1):
                curves[f"fibre-{number + 1}" + (f"-{part}" if part > 1 else "")] = points
        return curves

    def _parts(self, number: int, sense: int) -> list[FloatArray]:
        """Return the parts of one fibre inside the tube, the longest first."""
        radius, amplitude = self.fibre_radius, self.fibre_radius * math.tan(self.tilt)
        low = 0.5 * (self.length - self.fibre_length)
        start = low + self.pitch * number / self.fibres
        # The mean line begins A before the fibre length, so that the upper side of the first loop begins with it.
        reach = (low - amplitude - start) / self.pitch, (low + self.fibre_length + amplitude - start) / self.pitch
        turn = 2.0 * math.pi * np.linspace(*reach, math.ceil((reach[1] - reach[0]) * _POINTS_PER_TURN) + 1)

        def height(angle: FloatArray) -> FloatArray:
            rise: FloatArray = start + self.pitch * angle / (2.0 * math.pi) + amplitude * np.cos(angle)
            return rise

        parts = [part for part in _spans(turn, height, self.length) if len(part) > 2]
        parts.sort(key=len, reverse=True)
        return [np.column_stack([radius * np.cos(part), sense * radius * np.sin(part), height(part)]) for part in parts]


def _spans(turn: FloatArray, height: Callable[[FloatArray], FloatArray], length: float) -> list[FloatArray]:
    """Return the parts of `turn` with 0 ≤ height ≤ `length`, each with the angles at which it leaves that range."""
    ends = []
    for level in (0.0, length):
        above = height(turn) > level
        for index in np.flatnonzero(above[1:] != above[:-1]):
            bracket = turn[index], turn[index + 1]
            ends.append(brentq(lambda angle, level=level: height(angle) - level, *bracket, xtol=1e-14))
    angles = np.unique(np.append(turn, ends))
    # An end that rounding parts from a point of the helix would leave a segment without a direction.
    angles = angles[np.diff(angles, prepend=-np.inf) > 1e-9]
    inside = np.abs(height(0.5 * (angles[:-1] + angles[1:])) - 0.5 * length) < 0.5 * length
    changes = np.flatnonzero(np.diff(inside, prepend=False, append=False))
    return [angles[start : end + 1] for start, end in zip(changes[::2], changes[1::2], strict=True)]
