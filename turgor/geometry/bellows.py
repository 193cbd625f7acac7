"""The bellows: a wall of one thickness, folded into round-edged convolutions, with an inlet in the bottom."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal

import numpy as np
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.common.units import Angle, PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, Shape, parameter
from turgor.geometry.blocks import AXIS, Block, Blocks
from turgor.geometry.drawing import Distance, Mark, Pointer, Turn, View, along
from turgor.geometry.path import Piece, Step, offset_path
from turgor.geometry.section import CUTS, TURN, PlaneSection

_ANNEX = "San Martin Lopez, Flexible TPU pneumatic actuator simulation, annex 1"
_ASSUMED = "assumed"


class Bellows(Actuator):
    """A body of revolution around z, standing on the plane z = 0, where the inlet opens.

    Surfaces ``mount`` (the ring around the inlet), ``tip-face`` (the flat top), ``outer``, ``cavity`` (inside and wall
    of the inlet, whose rim lies in the plane z = 0, so that the volume is closed); of the half model ``symmetry`` (the
    cut y = 0), of the quarter ``symmetry-x`` and ``symmetry-y`` (the cuts x = 0 and y = 0), of the axisymmetric one
    ``axis``; region ``body``; markers ``base`` (on the inlet's rim) and ``tip`` (centre of the top).
    """

    template: ClassVar[str] = "bellows"

    convolutions: int = parameter(3, "number of outward folds", _ASSUMED, ge=1, le=30)
    crest_radius: PositiveLength = parameter("15.73 mm", "outside of the wall at a crest", f"{_ANNEX}: half of C")
    root_radius: PositiveLength = parameter(
        "7.1 mm", "outside of the wall at a root", f"{_ANNEX}: chosen so that the height is D, 26.5 mm"
    )
    wall: PositiveLength = parameter("1.23 mm", "thickness of the wall everywhere", f"{_ANNEX}: A")
    rounding: PositiveLength = parameter("1.5 mm", "radius of the wall's middle surface at all edges", f"{_ANNEX}: F")
    # A flatter flank would meet the plates in arcs too short to mesh, a steeper one make a corrugated tube.
    flank_angle: Angle = parameter(
        "16.26 deg", "slope of the flanks against the horizontal", f"{_ANNEX}: E", degrees=(5, 75)
    )
    inlet_radius: PositiveLength = parameter("1.62 mm", "radius of the inlet in the bottom", f"{_ANNEX}: half of B")
    mount_radius: PositiveLength = parameter("5 mm", "outer radius of the ring that is held", _ASSUMED)
    model: Literal["full", "half", "quarter", "axisymmetric"] = parameter(
        "full", "the whole, the half y ≥ 0, the quarter x, y ≥ 0, or the section of radius and height", _ASSUMED
    )

    @property
    @override
    def per_circle(self) -> int:
        # The edges' tight arcs are cut across a wall nearly as thick as their radius: shorter elements gain little.
        return 8

    @property
    def section(self) -> PlaneSection | None:
        """One half of the section through the axis, turned about it; None for a model in space."""
        return PlaneSection("axisymmetric") if self.model == "axisymmetric" else None

    @property
    def default_size(self) -> float:
        """One element through the wall, three in the section, where they cost little."""
        return float(self.wall if self.model != "axisymmetric" else self.wall / 3.0)

    @property
    def height(self) -> float:
        """Overall height in mm."""
        return float(self._top() + 0.5 * self.wall)

    @property
    def _crest(self) -> float:
        """Radius at which the arcs of the crests are centred."""
        return float(self.crest_radius - 0.5 * self.wall - self.rounding)

    @property
    def _root(self) -> float:
        """Radius at which the arcs of the roots and of the plates' edges are centred."""
        return float(self.root_radius - 0.5 * self.wall + self.rounding)

    def check(self) -> None:
        """Raise InputError if the wall cannot be folded like this."""
        depth = self._crest - self._root
        if self.rounding <= 0.5 * self.wall:
            self._refuse("rounding", "the wall meets itself inside its bends", f"more than {self.wall / 2:g} mm")
        if depth <= 0.0:
            limit = self.crest_radius - 2 * self.rounding
            self._refuse("root_radius", "the roots leave no room for flanks", f"less than {limit:g} mm")
        if self._root - self.rounding - 0.5 * self.wall <= 0.0:
            self._refuse("root_radius", "the walls of the roots meet on the axis", f"more than {self.wall:g} mm")
        if self.inlet_radius >= self.mount_radius:
            self._refuse("inlet_radius", "the inlet is wider than its mount", f"less than {self.mount_radius:g} mm")
        if self.mount_radius >= self._root:
            self._refuse("mount_radius", "the mount is wider than the flat bottom", f"less than {self._root:g} mm")

    def _refuse(self, key: str, problem: str, expected: str) -> None:
        raise InputError(problem, key=key, value=f"{getattr(self, key):g} mm", expected=expected)

    def _steps(self) -> list[Step]:
        """Return the wall's middle line from the inlet outward, up through the folds and in along the top."""
        angle, bend = self.flank_angle, math.pi - 2 * self.flank_angle
        depth = self._crest - self._root
        outer_flank = depth / math.cos(angle)
        # Between a crest and a root the flank is a tangent that crosses from one circle's side to the other's.
        flank = (depth + 2 * self.rounding * math.sin(angle)) / math.cos(angle)
        fold = [Step(flank, -bend, self.rounding), Step(flank, bend, self.rounding)]
        return [
            Step(self._root - self.inlet_radius, angle, self.rounding),
            Step(outer_flank, bend, self.rounding),
            *(fold * (self.convolutions - 1)),
            Step(outer_flank, angle, self.rounding),
            Step(self._root),
        ]

    def _line(self, distance: float) -> list[Piece]:
        return offset_path((self.inlet_radius, 0.5 * self.wall), self._steps(), distance)

    def _top(self) -> float:
        """Height of the middle line of the top."""
        return self._line(0.0)[-1].end[1]

    def views(self) -> list[View]:
        """Show the section through the axis, all of it and its right half larger."""
        outside, inside = along(self._line(-0.5 * self.wall)), along(self._line(0.5 * self.wall))
        half, mirror = np.vstack([outside, inside[::-1]]), np.array([-1.0, 1.0])
        both = np.vstack([outside, outside[::-1] * mirror, inside * mirror, inside[::-1]])
        axis = np.array([[0.0, -0.05 * self.height], [0.0, 1.05 * self.height]])
        crest = float(outside[np.argmax(outside[:, 0]), 1])
        marks: list[Mark] = [
            Distance("inlet_radius", (0, 0), (self.inlet_radius, 0), -1),
            Distance("mount_radius", (0, 0), (self.mount_radius, 0), -2),
            Distance("crest_radius", (0, crest), (self.crest_radius, crest)),
            Distance("wall", (0, self.height - self.wall), (0, self.height), 1),
        ]
        notes = {
            "tip-face": (0.5 * self.crest_radius, 1.04 * self.height),
            "cavity": (0.25 * self.crest_radius, 0.8 * self.height),
        }
        whole = View(
            "section through the axis",
            [("body", both)],
            [Pointer("convolutions", (-self.crest_radius, crest), 180)],
            [axis],
            notes=notes,
        )
        return [whole, View("the right half, larger", [("body", half)], [*marks, *self._fold_marks()], [axis])]

    def _fold_marks(self) -> list[Mark]:
        """Return what is measured at the first fold: its rounding, slope and, where folds meet, the root."""
        pieces = self._line(0.0)
        arcs = [piece for piece in pieces if piece.centre is not None]
        # The first arc leads from the bottom into the flank, the next ones around the first crest.
        (x, z), slope = arcs[0].end, self.flank_angle
        reach = 0.6 * (self._crest - self._root) / math.cos(slope)
        middle = along(arcs[1:2])[12]
        marks: list[Mark] = [
            Turn("flank_angle", (x, z), 0.0, slope, reach),
            Pointer("rounding", (float(middle[0]), float(middle[1])), 0, 3),
        ]
        if self.convolutions > 1:
            line = along(self._line(-0.5 * self.wall))
            low, high = 0.25 * self.height / self.convolutions, 1.6 * self.height / self.convolutions
            among = line[(line[:, 1] > low) & (line[:, 1] < high) & (line[:, 0] <= self.root_radius * (1 + 1e-9))]
            height = float(among[np.argmin(np.abs(among[:, 0] - self.root_radius)), 1])
            marks.append(Distance("root_radius", (0, height), (self.root_radius, height), 0))
        return marks

    def draw(self) -> Shape:
        """Draw the wall's section in the plane y = 0 and turn it around z."""
        occ = cad.occ()
        outside, inside = self._line(-0.5 * self.wall), self._line(0.5 * self.wall)
        outside[:1] = [
            Piece(outside[0].start, (self.mount_radius, 0.0)),
            Piece((self.mount_radius, 0.0), outside[0].end),
        ]
        section = cad.plane_face(
            [
                *outside,
                Piece(outside[-1].end, inside[-1].end),
                *(Piece(piece.end, piece.start, piece.centre) for piece in reversed(inside)),
                Piece(inside[0].start, outside[0].start),
            ]
        )
        tip, base = np.array([[0.0, 0.0, self.height]]), np.array([[self.inlet_radius, 0.0, 0.0]])
        if self.model == "axisymmetric":
            face = cad.with_points(section, tip, 2)
            markers = {"base": base[:, [0, 2]], "tip": tip[:, [0, 2]]}
            return Shape({"body": [face]}, self._surfaces(cad.boundary([face], 2), 2), markers, dimension=2)
        swept = occ.revolve([(2, section)], 0, 0, 0, 0, 0, 1, TURN[self.model])
        occ.remove([(2, section)])
        body = cad.with_points(next(tag for dimension, tag in swept if dimension == 3), tip)
        return Shape({"body": [body]}, self._surfaces(cad.boundary([body])), {"base": base, "tip": tip})

    def blocks(self) -> Blocks:
        """Return the pieces of the wall, one after the other, the first one cut where the mount ends."""
        outside, inside = self._line(-0.5 * self.wall), self._line(0.5 * self.wall)
        cuts = (self.mount_radius, 0.0), (self.mount_radius, self.wall)
        for line, cut in zip((outside, inside), cuts, strict=True):
            line[:1] = [Piece(line[0].start, cut), Piece(cut, line[0].end)]
        last = len(outside) - 1
        parts = []
        for number, (under, over) in enumerate(zip(outside, inside, strict=True)):
            sides = (
                under,
                Piece(under.end, over.end),
                Piece(over.end, over.start, over.centre),
                Piece(over.start, under.start),
            )
            skin = {0: "mount", last: "tip-face"}.get(number, "outer")
            names = (skin, AXIS if number == last else None, "cavity", "cavity" if number == 0 else None)
            parts.append(Block("body", sides, names))
        tip, base = np.array([[0.0, 0.0, self.height]]), np.array([[self.inlet_radius, 0.0, 0.0]])
        return Blocks(parts, {"base": base, "tip": tip})

    def _surfaces(self, faces: list[int], dimension: int = 3) -> dict[str, list[int]]:
        cuts = {name: cad.faces_in_plane(faces, axis, 0.0, dimension) for name, axis in CUTS[self.model].items()}
        bottom = cad.faces_in_plane(faces, "z", 0.0, dimension)
        cut = {face for tags in cuts.values() for face in tags}
        rest = [face for face in faces if face not in cut and face not in bottom]
        outside, cavity = cad.skins(rest, dimension)
        reach = self.mount_radius * (1 + 1e-6)

        def is_ring(low: Any, high: Any) -> bool:
            return bool(max(high[:2]) < reach)

        mount = cad.faces_where(bottom, is_ring, dimension)
        tip = cad.faces_in_plane(outside, "z", self.height, dimension)
        outer = [face for face in outside + bottom if face not in tip + mount]
        return {"mount": mount, "tip-face": tip, "outer": outer, "cavity": cavity, **cuts}
