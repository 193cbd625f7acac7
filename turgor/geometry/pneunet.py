"""The pneumatic network finger: a row of thin-walled chambers on a layered base, joined by one air passage."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import NonNegativeLength, PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.chamber import Chamber, CrossSection
from turgor.geometry.drawing import AIR, Distance, Mark, Pointer, View, along, rectangle
from turgor.geometry.path import Piece
from turgor.geometry.section import CUTS

_STUDY = "Esmalipour and Ajri, PneuNet geometry study, Table 1"
_STUDY_FORMS = "Esmalipour and Ajri, PneuNet geometry study, section 4; half-round assumed"
_ASSUMED = "assumed"

Point = tuple[float, float, float]


class PneuNet(Actuator):
    """A finger along x from its mount at x = 0, chambers upward along z from the bottom at z = 0, middle plane y = 0.

    Surfaces ``mount`` and ``tip-face`` (the end faces), ``cavity`` (the walls of all chambers and of the passage),
    ``outer`` (the rest of the skin) and, of the half model, ``symmetry``; regions ``body`` and ``base`` (the second
    bottom layer, if there is one); markers ``base``, ``tip`` and ``centreline``: the ends and all nodes of the
    bottom's middle line, from mount to tip.
    """

    template: ClassVar[str] = "pneunet"

    chambers: int = parameter(8, "number of chambers", _ASSUMED, ge=1, le=60)
    chamber_length: PositiveLength = parameter("3 mm", "inside of a chamber along the finger", f"{_STUDY}: a")
    chamber_width: PositiveLength = parameter("10 mm", "inside of a chamber across the finger", f"{_STUDY}: b")
    chamber_height: PositiveLength = parameter(
        "13 mm", "inside of a chamber from the floor of the passage", f"{_STUDY}: h"
    )
    gap: PositiveLength = parameter("2 mm", "distance between the outsides of two chambers", f"{_STUDY}: distance l_e")
    wall: PositiveLength = parameter("2 mm", "thickness of the chamber walls that face the gaps", f"{_STUDY}: S")
    side_wall: PositiveLength = parameter("2 mm", "thickness of the chamber walls at both sides", f"{_STUDY}: S")
    top_wall: PositiveLength = parameter("2 mm", "thickness of the chamber walls on top", f"{_STUDY}: S")
    end_wall: PositiveLength = parameter("3 mm", "thickness of the solid at mount and tip", _ASSUMED)
    tunnel_height: PositiveLength = parameter("2 mm", "height of the air passage", _ASSUMED)
    tunnel_width: PositiveLength = parameter("4 mm", "width of the air passage", _ASSUMED)
    tunnel_roof: PositiveLength = parameter("2 mm", "thickness of the solid over the passage in a gap", _ASSUMED)
    first_layer: PositiveLength = parameter("2 mm", "thickness of the bottom under the chambers", f"{_STUDY}: tb")
    second_layer: NonNegativeLength = parameter("1 mm", "thickness of the layer below it, region 'base'", _ASSUMED)
    cross_section: CrossSection = parameter(
        "square", "shape of the chambers across the finger; its outside runs parallel to it", _STUDY_FORMS
    )
    symmetric: bool = parameter(False, "only the half y ≥ 0, with the surface 'symmetry'", _ASSUMED)

    @property
    def length(self) -> float:
        """Length of the finger from mount to tip in mm."""
        return float(2 * self.end_wall + self.chambers * self.chamber_length + (self.chambers - 1) * self._spacing)

    @property
    def default_size(self) -> float:
        """One element through the thinnest wall of the chambers and of the passage."""
        return float(min(self.wall, self.side_wall, self.top_wall, self.end_wall, self.first_layer, self.tunnel_roof))

    @property
    def _spacing(self) -> float:
        """Distance between the insides of two chambers."""
        return float(2 * self.wall + self.gap)

    @property
    def _floor(self) -> float:
        """Height of the floor of chambers and passage."""
        return float(self.first_layer + self.second_layer)

    @property
    def _chamber(self) -> Chamber:
        """The section across a chamber."""
        return Chamber(self.cross_section, self.chamber_width, self.chamber_height, self.side_wall, self.top_wall)

    def check(self) -> None:
        """Raise InputError if the chambers' walls meet, the passage does not fit them, or its roof fills the gaps."""
        if self.tunnel_height >= self.chamber_height * (1 - 1e-9):
            self._refuse("tunnel_height", "the air passage is as high as the chambers", self.chamber_height)
        if self.cross_section == "half-round" and 2.0 * self.chamber_height < self.chamber_width:
            self._refuse("chamber_width", "the chambers are too low for a half circle", 2.0 * self.chamber_height)
        if self.top_wall > self._chamber.thickest_top * (1 + 1e-9):
            self._refuse("top_wall", "the outsides of the sides meet below the top", self._chamber.thickest_top)
        room = 2.0 * self._chamber.room(self.tunnel_height)
        if self.tunnel_width > room * (1 + 1e-9):
            self._refuse("tunnel_width", "the air passage is wider than the chambers at its roof", room)
        room = self.chamber_height + self.top_wall - self.tunnel_height
        if self.tunnel_roof >= room * (1 - 1e-9):
            self._refuse("tunnel_roof", "the roof of the passage fills the gaps: the chambers' walls meet", room)

    def _refuse(self, key: str, problem: str, limit: float) -> None:
        raise InputError(problem, key=key, value=f"{getattr(self, key):g} mm", expected=f"less than {limit:.4g} mm")

    def views(self) -> list[View]:
        """Show the section along the finger, the walls around the first gap, and the section across a chamber."""
        top, length = self._floor + self.chamber_height + self.top_wall, self.length
        starts = list(self._chamber_starts())
        first = (starts[0], starts[0] + self.chamber_length)
        aside = max(0.03 * length, 0.07 * top)
        whole = View(
            "section along the middle plane y = 0, from mount to tip",
            self._along(),
            [Pointer("chambers", (starts[-1] + 0.5 * self.chamber_length, top), 90)],
            notes={"mount": (-aside, 0.5 * top), "tip": (length + 0.7 * aside, 0.0)},
        )
        end_wall = Distance("end_wall", (0, 0), (self.end_wall, 0), -1)
        if self.chambers == 1:
            title = f"{whole.title}; one chamber has neither gaps nor a passage"
            marks = [*whole.marks, end_wall, Distance("chamber_length", (first[0], 0), (first[1], 0), -2)]
            return [replace(whole, title=title, marks=marks), self._across(top)]
        gap = first[1] + self.wall
        roof = self._floor + self.tunnel_height
        measures = [
            Distance("chamber_length", (first[0], top), (first[1], top), 1),
            end_wall,
            Distance("wall", (first[1], top), (gap, top), 2),
            Distance("gap", (gap, top), (gap + self.gap, top), 3),
            Distance("tunnel_roof", (gap, roof), (gap, roof + self.tunnel_roof)),
            Distance("tunnel_height", (gap + self.gap, self._floor), (gap + self.gap, roof), -4),
        ]
        end = min(length, starts[1] + self.chamber_length + self.wall)
        detail = View("the first chambers, larger", whole.areas, measures, window=(0.0, end, 0.0, top))
        return [whole, detail, self._across(top)]

    def _along(self) -> list[tuple[str, FloatArray]]:
        """Return the areas of the section along the middle plane."""
        starts, floor = list(self._chamber_starts()), self._floor
        areas = [("body", np.array(self._profile()))]
        if self.second_layer:
            areas.append(("base", rectangle(0, self.length, 0, self.second_layer)))
        areas += [(AIR, rectangle(x, x + self.chamber_length, floor, floor + self.chamber_height)) for x in starts]
        if self.chambers > 1:
            areas.append(
                (AIR, rectangle(starts[0], starts[-1] + self.chamber_length, floor, floor + self.tunnel_height))
            )
        return areas

    def _across(self, top: float) -> View:
        chamber, low, floor = self._chamber, self.second_layer, np.array([0.0, self._floor])
        side, half, width = chamber.half_width, 0.5 * self.chamber_width, 0.5 * self.tunnel_width
        roof, ceiling = self._floor + self.tunnel_height, top - self.top_wall
        # A wall is measured across the face of the room, at half the height of a triangle's side.
        slope = chamber.slope
        foot = np.array([half * (0.5 if slope else 1.0), self._floor + (0.5 if slope else 0.3) * self.chamber_height])
        if self.cross_section == "half-round":
            foot[1] = self._floor + 0.5 * min(self.chamber_height - half, self.chamber_height)
        across = self.side_wall * np.array([math.sin(slope), math.cos(slope)] if slope else [1.0, 0.0])
        outer = foot + across
        marks: list[Mark] = [
            Distance("chamber_width", (-half, self._floor), (half, self._floor), 5),
            Distance("side_wall", (float(foot[0]), float(foot[1])), (float(outer[0]), float(outer[1]))),
            Distance("chamber_height", (-side, self._floor), (-side, ceiling), 1),
            Distance("top_wall", (side, ceiling), (side, top), -1),
            Distance("first_layer", (side, low), (side, self._floor), -1),
            Pointer("cross_section", (-0.5 * side, top) if self.cross_section == "square" else (0.0, top), 90),
            *([Distance("second_layer", (-side, 0.0), (-side, low), 1)] if low else []),
        ]
        areas = [("body", along(chamber.outside(-self.first_layer)) + floor)]
        if low:
            areas.append(("base", rectangle(-side, side, 0.0, low)))
        areas.append((AIR, along(chamber.inside()) + floor))
        if self.chambers == 1:
            return View("section across the chamber", areas, marks)
        areas.append((AIR, rectangle(-width, width, self._floor, roof)))
        marks.append(Distance("tunnel_width", (-width, roof), (width, roof), 1))
        return View("section across a chamber; the passage behind it", areas, marks)

    def draw(self) -> Shape:
        """Draw the comb-shaped body less the air, on top of the base layer."""
        occ = cad.occ()
        half = self._chamber.half_width
        start = 0.0 if self.symmetric else -half
        body = [(3, cad.prism([(x, start, z) for x, z in self._profile()], (0.0, half - start, 0.0)))]
        if self.cross_section == "square":
            air = [(3, occ.addBox(*corner, *extent)) for corner, extent in self._chamber_boxes(start)]
        else:
            outside = self._swept(self._chamber.outside(-self.first_layer), 0.0, self.length)
            body, _ = occ.intersect(body, [outside])
            inside = self._chamber.inside()
            air = [self._swept(inside, x, self.chamber_length) for x in self._chamber_starts()]
        air += [(3, occ.addBox(*corner, *extent)) for corner, extent in self._passage(start)]
        (solid,), _ = occ.cut(body, air)
        solids = [solid]
        if self.second_layer > 0.0:
            solids.append((3, occ.addBox(0, start, 0, self.length, half - start, self.second_layer)))
        ends = np.array([[0.0, 0.0, 0.0], [self.length, 0.0, 0.0]])
        line = occ.addLine(*(occ.addPoint(*end) for end in ends))
        _, pieces = occ.fragment(solids, [(1, line)])
        occ.synchronize()
        regions = {
            name: [tag for _, tag in piece]
            for name, piece in zip(("body", "base"), pieces[: len(solids)], strict=False)
        }
        tags = [tag for piece in regions.values() for tag in piece]
        return Shape(
            regions=regions,
            surfaces=cad.named_skin(cad.boundary(tags), "x", self.length, CUTS["half" if self.symmetric else "full"]),
            markers={"base": ends[:1], "tip": ends[1:], "centreline": ends},
        )

    def _chamber_starts(self) -> Iterator[float]:
        """Yield the x at which the inside of each chamber begins."""
        for number in range(self.chambers):
            yield self.end_wall + number * (self.chamber_length + self._spacing)

    def _profile(self) -> list[tuple[float, float]]:
        """Corners (x, z) of the body's outline above the second layer: a comb."""
        low, top = self.second_layer, self._floor + self.chamber_height + self.top_wall
        roof = self._floor + self.tunnel_height + self.tunnel_roof
        corners = [(0.0, low), (self.length, low), (self.length, top)]
        for start in reversed(list(self._chamber_starts())[1:]):
            corners += [(start - self.wall, top), (start - self.wall, roof)]
            corners += [(start - self.wall - self.gap, roof), (start - self.wall - self.gap, top)]
        return [*corners, (0.0, top)]

    def _swept(self, outline: list[Piece], start: float, length: float) -> tuple[int, int]:
        """Draw what has this outline across the finger, its floor at that of the chambers, from x = `start` on."""
        occ = cad.occ()
        solid = (3, cad.sweep(cad.plane_face(outline), (0.0, -length, 0.0)))
        # Drawn in the plane y = 0 and turned about z, the sweep along −y runs along x.
        occ.rotate([solid], 0, 0, 0, 0, 0, 1, 0.5 * math.pi)
        occ.translate([solid], start, 0, self._floor)
        return solid

    def _chamber_boxes(self, side: float) -> Iterator[tuple[Point, Point]]:
        """Yield corner and extent of each chamber, halved if the body begins at y = `side` = 0."""
        width, low = self.chamber_width, 0.0 if side == 0.0 else -0.5
        for x in self._chamber_starts():
            yield (
                (x, low * width, self._floor),
                (self.chamber_length, (0.5 - low) * width, self.chamber_height),
            )

    def _passage(self, side: float) -> Iterator[tuple[Point, Point]]:
        """Yield corner and extent of the air passage, if there is any, halved like the chambers."""
        width, low, starts = self.tunnel_width, 0.0 if side == 0.0 else -0.5, list(self._chamber_starts())
        if self.chambers > 1:
            extent = (starts[-1] - starts[0], (0.5 - low) * width, self.tunnel_height)
            yield (starts[0], low * width, self._floor), extent
