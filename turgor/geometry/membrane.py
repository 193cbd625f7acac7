"""The segmented membrane actuator: a thin sheet over a row of long chambers, each with its own inlet from below."""

from __future__ import annotations

import itertools
from typing import ClassVar, Literal

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.drawing import AIR, Distance, Mark, Pointer, View, circle, rectangle
from turgor.geometry.path import polygon
from turgor.geometry.section import CUTS, PlaneSection

_THESIS = "San Martin Lopez, Flexible TPU pneumatic actuator simulation, section 2.2"
_ASSUMED = "assumed"


class Membrane(Actuator):
    """A block on the plane z = 0: base, zone with the chambers, membrane; chambers along y, side by side along x.

    A chamber with its inlet is a T: the pressure acts on its walls and on the inlet, which opens in the plane z = 0.

    Regions ``base``, ``body`` (the zone) and ``membrane``; surfaces ``mount`` (the bottom), ``membrane-face`` (the
    top), ``outer`` (the sides), ``cavity``, or ``cavity-1``, ``cavity-2``, … along x if there are several, and the cuts
    ``symmetry`` (y = 0, of the half model) or ``symmetry-x`` and ``symmetry-y`` (of the quarter); markers ``tip`` (on
    the middle of the membrane over the middle chamber), ``centreline`` (along that chamber to its far end, from its
    near end or the cut; none in the plane) and ``base`` (corner of the bottom).
    """

    template: ClassVar[str] = "membrane"

    segments: int = parameter(7, "number of chambers; 1 is the T-shaped piece that was simulated", _THESIS, ge=1, le=40)
    chamber_width: PositiveLength = parameter("2.5 mm", "chamber along x", _ASSUMED)
    chamber_length: PositiveLength = parameter("20 mm", "chamber along y", _ASSUMED)
    spacing: PositiveLength = parameter("2 mm", "solid between two chambers", _ASSUMED)
    border: PositiveLength = parameter("3 mm", "solid around the chambers", _ASSUMED)
    membrane: PositiveLength = parameter("0.2 mm", "thickness of the membrane", _THESIS)
    zone: PositiveLength = parameter("4 mm", "thickness of the zone with the chambers", _THESIS)
    base: PositiveLength = parameter("2 mm", "thickness of the base", _THESIS)
    inlet_diameter: PositiveLength = parameter("2 mm", "bore through the base under each chamber's middle", _THESIS)

    model: Literal["full", "half", "quarter", "plane"] = parameter(
        "full",
        "the whole, the half y ≥ 0, the quarter x, y ≥ 0 of a single segment, or the section across the chambers",
        _ASSUMED,
    )

    @property
    def section(self) -> PlaneSection | None:
        """A slice as thick as the chambers are long, in plane strain, where the bores are slots; or None in space."""
        return PlaneSection("plane-strain", self.chamber_length) if self.model == "plane" else None

    @property
    def default_size(self) -> float:
        """One element through the base, the walls and the border; four in the section, where they cost little."""
        return float(min(self.base, self.zone, self.spacing, self.border) / (4.0 if self.model == "plane" else 1.0))

    def check(self) -> None:
        """Raise InputError if the inlet does not fit under the chamber, or the membrane is no membrane."""
        room = min(self.chamber_width, self.chamber_length)
        if self.inlet_diameter >= room:
            value, expected = f"{self.inlet_diameter:g} mm", f"less than {room:g} mm"
            raise InputError(
                "the inlet is as wide as its chamber", key="inlet_diameter", value=value, expected=expected
            )
        if self.membrane > self.zone:
            value, expected = f"{self.membrane:g} mm", f"at most {self.zone:g} mm"
            raise InputError("the membrane is thicker than the zone", key="membrane", value=value, expected=expected)
        if self.model == "quarter" and self.segments != 1:
            expected = "a single segment, or the model 'half'"
            raise InputError("the quarter is one of a single segment", key="model", value="quarter", expected=expected)

    def views(self) -> list[View]:
        """Show the section across the chambers, one chamber larger, and the chambers from above."""
        whole = self.changed(model="full")
        (half, side, _), levels = whole._corners[1], self._levels
        areas = [
            (name, rectangle(-half, half, *levels[number : number + 2]))
            for number, name in enumerate(("base", "body", "membrane"))
        ]
        width, bore, length = 0.5 * self.chamber_width, 0.5 * self.inlet_diameter, 0.5 * self.chamber_length
        for x in self._middles():
            areas += [
                (AIR, rectangle(x - width, x + width, *levels[1:3])),
                (AIR, rectangle(x - bore, x + bore, *levels[:2])),
            ]
        x, last = self._middles()[0], self._middles()[-1]
        marks: list[Mark] = [
            Distance("chamber_width", (x - width, levels[3]), (x + width, levels[3]), 1),
            Distance("inlet_diameter", (x - bore, 0), (x + bore, 0), -1),
            Distance("border", (-half, 0), (x - width, 0), -2),
            *(
                Distance(name, (-half, levels[n]), (-half, levels[n + 1]), 1)
                for n, name in enumerate(("base", "zone", "membrane"))
            ),
        ]
        if self.segments > 1:
            marks.append(Distance("spacing", (x + width, levels[3]), (self._middles()[1] - width, levels[3]), 2))
        section = View(
            "section y = 0 across the chambers",
            areas,
            [Pointer("segments", (last, levels[3]), 90)],
            notes={"mount": (0, -0.1 * levels[3])},
        )
        right = half if self.segments == 1 else self._middles()[1] + width + 0.5 * self.spacing
        detail = View("the first chamber, larger", areas, marks, window=(-half, right, 0, levels[3]))
        above = [("body", rectangle(-half, half, -side, side))]
        for x in self._middles():
            above += [("base", rectangle(x - width, x + width, -length, length)), (AIR, circle(bore, centre=(x, 0.0)))]
        marks = [
            Distance("chamber_length", (half, -length), (half, length), -1),
            Distance("border", (half, length), (half, side), -1),
        ]
        return [section, detail, View("seen from above, without the membrane", above, marks)]

    def draw(self) -> Shape:
        """Draw three layers, the middle one less the chambers and the base less the inlets."""
        occ = cad.occ()
        dimension = 2 if self.model == "plane" else 3
        layers = self._faces() if self.model == "plane" else self._solids()
        markers = self._markers()
        stops = [occ.addPoint(*place) for place in markers.get("centreline", markers["tip"])]
        marked = [(1, occ.addLine(*pair)) for pair in itertools.pairwise(stops)] or [(0, stops[0])]
        owners = [name for name, entities in layers.items() for _ in entities]
        _, pieces = occ.fragment([entity for entities in layers.values() for entity in entities], marked)
        occ.synchronize()
        regions: dict[str, list[int]] = {name: [] for name in layers}
        for name, piece in zip(owners, pieces, strict=False):
            regions[name] += [tag for _, tag in piece]
        return Shape(
            regions=regions,
            surfaces=self._surfaces([tag for tags in regions.values() for tag in tags], dimension),
            markers={name: line[:, [0, 2]] if dimension == 2 else line for name, line in markers.items()},
            sizes=self._sizes(),
            dimension=dimension,
        )

    def _middles(self) -> list[float]:
        """Return the x of each chamber's middle; the block is centred on x = y = 0."""
        pitch = self.chamber_width + self.spacing
        return [(number - 0.5 * (self.segments - 1)) * pitch for number in range(self.segments)]

    @property
    def _levels(self) -> list[float]:
        """Heights of the layers' faces."""
        return [0.0, self.base, self.base + self.zone, self.base + self.zone + self.membrane]

    @property
    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner of what is drawn of the block."""
        half = self._middles()[-1] + 0.5 * self.chamber_width + self.border
        side = 0.5 * self.chamber_length + self.border
        low = np.array([0.0 if self.model == "quarter" else -half, -side if self.model == "full" else 0.0, 0.0])
        return low, np.array([half, side if self.model != "plane" else 0.0, self._levels[-1]])

    def _markers(self) -> dict[str, FloatArray]:
        x, top, end = self._middles()[self.segments // 2], self._levels[-1], 0.5 * self.chamber_length
        low, high = self._corners
        markers = {"base": np.array([[*high[:2], 0.0]]), "tip": np.array([[x, 0.0, top]])}
        if self.model == "plane":
            return markers
        starts = [-end, 0.0] if low[1] < 0.0 else [0.0]
        return {**markers, "centreline": np.array([[x, y, top] for y in (*starts, end)])}

    def _sizes(self) -> dict[str, float]:
        if self.model == "plane":
            return {"membrane": 0.5 * self.membrane}
        # Two elements across half a chamber bend with the sheet; it is far too thin for cubes.
        return {"membrane-face": min(self.default_size, 0.25 * self.chamber_width)}

    def _solids(self) -> dict[str, list[tuple[int, int]]]:
        occ, (low, high) = cad.occ(), self._corners
        extent = high - low

        def layer(number: int) -> tuple[int, int]:
            bottom, top = self._levels[number : number + 2]
            return 3, occ.addBox(low[0], low[1], bottom, extent[0], extent[1], top - bottom)

        base, body, membrane = (layer(number) for number in range(3))
        width, length = self.chamber_width, self.chamber_length
        chambers, inlets = [], []
        for x in self._middles():
            chambers.append((3, occ.addBox(x - width / 2, -length / 2, self.base, width, length, self.zone)))
            inlets.append((3, occ.addCylinder(x, 0, 0, 0, 0, self.base, 0.5 * self.inlet_diameter)))
        body, _ = occ.cut([body], chambers)
        base, _ = occ.cut([base], inlets)
        return {"base": base, "body": body, "membrane": [membrane]}

    def _faces(self) -> dict[str, list[tuple[int, int]]]:
        """Draw the section across the chambers, where their inlets are slots as wide as the bores."""
        low, high = self._corners

        def row(number: int, width: float) -> list[tuple[int, int]]:
            """Draw the rectangles of a layer that are left between gaps of this width under each chamber."""
            stops = [x + side * width / 2 for x in self._middles() for side in (-1, 1)] if width else []
            ends = [low[0], *stops, high[0]]
            bottom, top = self._levels[number : number + 2]
            boxes = zip(ends[::2], ends[1::2], strict=True)
            return [(2, cad.plane_face(polygon([(a, bottom), (b, bottom), (b, top), (a, top)]))) for a, b in boxes]

        return {"base": row(0, self.inlet_diameter), "body": row(1, self.chamber_width), "membrane": row(2, 0.0)}

    def _surfaces(self, tags: list[int], dimension: int) -> dict[str, list[int]]:
        faces, (low, high) = cad.boundary(tags, dimension), self._corners

        def plane(axis: str, place: float) -> list[int]:
            return cad.faces_in_plane(faces, axis, place, dimension)

        named = {"mount": plane("z", 0.0), "membrane-face": plane("z", self._levels[-1])}
        if dimension == 3:
            named |= {name: plane(axis, 0.0) for name, axis in CUTS[self.model].items()}
        cut = {face for tags in named.values() for face in tags}
        sides = [plane(axis, corner["xy".index(axis)]) for axis in "xyz"[: dimension - 1] for corner in (low, high)]
        named["outer"] = [face for side in sides for face in side if face not in cut]
        cavities = cad.skins([face for face in faces if face not in cut.union(named["outer"])], dimension)
        cavities.sort(key=lambda skin: min(cad.bounds(dimension - 1, face)[0][0] for face in skin))
        names = ["cavity"] if self.segments == 1 else [f"cavity-{number + 1}" for number in range(self.segments)]
        return {**named, **dict(zip(names, cavities, strict=True))}
