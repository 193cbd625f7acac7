"""The reinforced tube: a soft capped tube inside a stiffer printed grid of rings and one longitudinal band."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.drawing import AIR, Distance, Mark, Pointer, View, circle, rectangle, ring_sector
from turgor.geometry.section import CUTS, TURN

_PAPER = "Quasi-static FEA model for a multi-material soft pneumatic actuator in SOFA, section III"
_ASSUMED = "assumed, the paper's drawing gives no numbers"


class ReinforcedTube(Actuator):
    """A capped tube along z from the mount at z = 0; rings around it and a band along its side x < 0.

    The band hardly stretches, so the pressurised tube bends towards −x; y = 0 is its plane of symmetry.

    Regions ``body`` and ``reinforcement``, which share the nodes between them; surfaces ``mount`` and ``tip-face`` (end
    faces), ``cavity``, ``outer`` and, of the half model, ``symmetry``; markers ``base`` and ``tip`` (centres of the
    end faces) and ``centreline`` (the band's outside at y = 0, from its lower to its upper end).
    """

    template: ClassVar[str] = "reinforced-tube"

    inner_diameter: PositiveLength = parameter("10 mm", "diameter of the cavity", _PAPER)
    outer_diameter: PositiveLength = parameter("18 mm", "outside of the soft tube", _PAPER)
    length: PositiveLength = parameter("115 mm", "length, caps included", _PAPER)
    cavity_length: PositiveLength = parameter("100 mm", "length of the cavity, in the middle of the tube", _PAPER)
    thickness: PositiveLength = parameter("0.8 mm", "thickness of rings and band", _PAPER)
    rings: int = parameter(20, "number of rings, in the middle of the length", _ASSUMED, ge=2, le=200)
    ring_width: PositiveLength = parameter("2 mm", "extent of a ring along the tube", _ASSUMED)
    ring_spacing: PositiveLength = parameter("3 mm", "distance between two rings", _ASSUMED)
    band_width: PositiveLength = parameter("8 mm", "width of the band along the arc of the soft tube", _ASSUMED)
    symmetric: bool = parameter(False, "only the half y ≥ 0, with the surface 'symmetry'", _ASSUMED)

    @property
    def default_size(self) -> float:
        """Two elements through the soft wall, one across a ring."""
        return float(min(0.25 * (self.outer_diameter - self.inner_diameter), self.ring_width))

    @property
    def reinforced_length(self) -> float:
        """Distance from the first ring's lower edge to the last one's upper edge in mm."""
        return float(self.rings * self.ring_width + (self.rings - 1) * self.ring_spacing)

    @property
    def _model(self) -> str:
        return "half" if self.symmetric else "full"

    def check(self) -> None:
        """Raise InputError if cavity, rings or band do not fit the tube."""
        limits = {
            "inner_diameter": (self.outer_diameter, "the cavity is as wide as the tube"),
            "cavity_length": (self.length, "the cavity is as long as the tube: no cap is left"),
            "band_width": (0.5 * math.pi * self.outer_diameter, "the band covers more than half of the tube"),
        }
        for key, (limit, problem) in limits.items():
            value = getattr(self, key)
            if value >= limit:
                raise InputError(problem, key=key, value=f"{value:g} mm", expected=f"less than {limit:g} mm")
        if self.reinforced_length > self.length:
            problem = f"the rings take {self.reinforced_length:g} mm and the tube has {self.length:g} mm"
            raise InputError(
                problem, key="rings", value=self.rings, expected="fewer or narrower rings, or less spacing"
            )

    def views(self) -> list[View]:
        """Show the section along the axis, the side with the band, and the section between two rings."""
        inner, outer, length = 0.5 * self.inner_diameter, 0.5 * self.outer_diameter, self.length
        margin, low = 0.5 * (length - self.cavity_length), 0.5 * (length - self.reinforced_length)
        pitch, reach = self.ring_width + self.ring_spacing, outer + self.thickness
        rings = [
            ("reinforcement", rectangle(z, z + self.ring_width, -reach, reach))
            for z in (low + number * pitch for number in range(self.rings))
        ]
        tube, air = rectangle(0, length, -outer, outer), rectangle(margin, length - margin, -inner, inner)
        band = rectangle(low, length - low, outer, reach)
        section = View(
            "section y = 0 along the axis; the band is on top",
            [*rings, ("body", tube), (AIR, air), ("reinforcement", band)],
            [
                Distance("length", (0, -outer), (length, -outer), -5),
                Distance("cavity_length", (margin, -outer), (length - margin, -outer), -4),
                Distance("inner_diameter", (0.3 * length, -inner), (0.3 * length, inner)),
                Distance("outer_diameter", (length, -outer), (length, outer), -1),
                Pointer("rings", (low + (self.rings - 1) * pitch + 0.5 * self.ring_width, -reach), -90, 1.5),
            ],
            notes={"mount": (-0.03 * length, 0.0), "cavity": (0.5 * length, 0.0)},
        )
        return [section, self._side_view(tube, rings, low), self._ring_view()]

    def _side_view(self, tube: FloatArray, rings: list[tuple[str, FloatArray]], low: float) -> View:
        inner, reach = 0.5 * self.outer_diameter, 0.5 * self.outer_diameter + self.thickness
        half_angle = 0.5 * self.band_width / inner
        half, first, pitch = reach * math.sin(half_angle), low + self.ring_width, self.ring_width + self.ring_spacing
        marks: list[Mark] = [
            Distance("ring_width", (low, reach), (first, reach), 1),
            Distance("ring_spacing", (first, reach), (low + pitch, reach), 2),
        ]
        areas = [("body", tube), *rings, ("reinforcement", rectangle(low, self.length - low, -half, half))]
        end = low + min(self.rings, 5) * pitch
        return View(
            "seen from the side of the band, the end at the mount", areas, marks, window=(0, end, -reach, reach)
        )

    def _ring_view(self) -> View:
        inner, outer = 0.5 * self.inner_diameter, 0.5 * self.outer_diameter
        reach, half_angle = outer + self.thickness, 0.5 * self.band_width / outer
        band = ring_sector(outer, reach, math.pi - half_angle, math.pi + half_angle)
        foot = circle(outer, math.pi - half_angle, math.pi - half_angle)[0]
        areas = [("body", circle(outer)), (AIR, circle(inner)), ("reinforcement", band)]
        marks: list[Mark] = [
            Distance("thickness", (-reach, 0), (-outer, 0)),
            Pointer("band_width", (float(foot[0]), float(foot[1])), 150, 2),
        ]
        return View(
            "section between two rings; the band's width is measured along the tube's outside",
            areas,
            marks,
            [circle(outer, math.pi - half_angle, math.pi + half_angle)],
        )

    def draw(self) -> Shape:
        """Draw the tube, the rings and the band around it, and make their interface common."""
        occ = cad.occ()
        margin = 0.5 * (self.length - self.cavity_length)
        solid = cad.cylinder(0.0, self.length, 0.5 * self.outer_diameter, TURN[self._model])
        air = cad.cylinder(margin, self.length - margin, 0.5 * self.inner_diameter, TURN[self._model])
        (tube,), _ = occ.cut([solid], [air])
        ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, self.length]])
        low = 0.5 * (self.length - self.reinforced_length)
        outside = -0.5 * self.outer_diameter - self.thickness
        line = np.array([[outside, 0.0, low], [outside, 0.0, self.length - low]])
        points = [(0, occ.addPoint(*place)) for place in (*ends, *line)]
        edge = (1, occ.addLine(points[2][1], points[3][1]))
        reinforcement = self._reinforcement()
        _, pieces = occ.fragment([tube, *reinforcement], [*points[:2], edge])
        occ.synchronize()
        body = [tag for _, tag in pieces[0]]
        stiff = sorted({tag for piece in pieces[1 : 1 + len(reinforcement)] for _, tag in piece})
        return Shape(
            regions={"body": body, "reinforcement": stiff},
            surfaces=cad.named_skin(cad.boundary(body + stiff), "z", self.length, CUTS[self._model]),
            markers={"base": ends[:1], "tip": ends[1:], "centreline": line},
        )

    def _reinforcement(self) -> list[tuple[int, int]]:
        """Draw rings and band as one solid, a shell from which the windows are cut."""
        occ = cad.occ()
        inner, outer = 0.5 * self.outer_diameter, 0.5 * self.outer_diameter + self.thickness
        start = 0.5 * (self.length - self.reinforced_length)
        end = self.length - start
        shell, _ = occ.cut(
            [cad.cylinder(start, end, outer, TURN[self._model])], [cad.cylinder(start, end, inner, TURN[self._model])]
        )
        half_angle = 0.5 * self.band_width / inner
        pitch = self.ring_width + self.ring_spacing
        windows = [
            self._window(start + number * pitch + self.ring_width, half_angle, 2.0 * outer)
            for number in range(self.rings - 1)
        ]
        solids, _ = occ.cut(shell, windows)
        return [(int(dimension), int(tag)) for dimension, tag in solids]

    def _window(self, low: float, half_angle: float, reach: float) -> tuple[int, int]:
        """Draw the sector between two rings, all around but for the band around the side x < 0."""
        occ = cad.occ()
        begin = 0.0 if self.symmetric else -(math.pi - half_angle)
        angle = math.pi - half_angle - begin
        sector = occ.addCylinder(0, 0, low, 0, 0, self.ring_spacing, reach, angle=angle)
        occ.rotate([(3, sector)], 0, 0, 0, 0, 0, 1, begin)
        return 3, int(sector)
