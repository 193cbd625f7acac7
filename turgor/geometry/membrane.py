"""The segmented membrane actuator: a thin sheet over a row of long chambers, each with its own inlet from below."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, Shape, parameter

_THESIS = "San Martin Lopez, Flexible TPU pneumatic actuator simulation, section 2.2"
_ASSUMED = "assumed"


class Membrane(Actuator):
    """A block on the plane z = 0: base, zone with the chambers, membrane; chambers along y, side by side along x.

    A chamber with its inlet is a T: the pressure acts on its walls and on the inlet, which opens in the plane z = 0.

    Regions ``base``, ``body`` (the zone) and ``membrane``; surfaces ``mount`` (the bottom), ``membrane-face`` (the
    top), ``outer`` (the sides) and ``cavity``, or ``cavity-1``, ``cavity-2``, … along x if there are several; markers
    ``tip`` (on the middle of the membrane over the middle chamber), ``centreline`` (from end to end of that chamber)
    and ``base`` (corner of the bottom).
    """

    template: ClassVar[str] = "membrane"

    segments: int = parameter(7, "number of chambers; 1 is the T-shaped piece that was simulated", _THESIS, ge=1, le=40)
    chamber_width: PositiveLength = parameter("2.5 mm", "chamber along x", "assumed, from the measured deflection")
    chamber_length: PositiveLength = parameter("20 mm", "chamber along y", _ASSUMED)
    spacing: PositiveLength = parameter("2 mm", "solid between two chambers", _ASSUMED)
    border: PositiveLength = parameter("3 mm", "solid around the chambers", _ASSUMED)
    membrane: PositiveLength = parameter("0.2 mm", "thickness of the membrane", _THESIS)
    zone: PositiveLength = parameter("4 mm", "thickness of the zone with the chambers", _THESIS)
    base: PositiveLength = parameter("2 mm", "thickness of the base", _THESIS)
    inlet_diameter: PositiveLength = parameter("2 mm", "bore through the base under each chamber's middle", _THESIS)

    @property
    def default_size(self) -> float:
        """One element through the base, the walls and the border."""
        return float(min(self.base, self.zone, self.spacing, self.border))

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

    @property
    def _pitch(self) -> float:
        return float(self.chamber_width + self.spacing)

    def _middles(self) -> list[float]:
        """Return the x of each chamber's middle; the block is centred on x = y = 0."""
        return [(number - 0.5 * (self.segments - 1)) * self._pitch for number in range(self.segments)]

    def draw(self) -> Shape:
        """Draw three layers, the middle one less the chambers and the base less the inlets."""
        occ = cad.occ()
        half = 0.5 * (self.segments * self._pitch - self.spacing) + self.border
        side = 0.5 * self.chamber_length + self.border
        levels = np.cumsum([0.0, self.base, self.zone, self.membrane]).tolist()

        def layer(number: int) -> tuple[int, int]:
            low, high = levels[number : number + 2]
            return 3, occ.addBox(-half, -side, low, 2 * half, 2 * side, high - low)

        base, body, membrane = (layer(number) for number in range(3))
        width, length = self.chamber_width, self.chamber_length
        chambers, inlets = [], []
        for x in self._middles():
            chambers.append((3, occ.addBox(x - width / 2, -length / 2, self.base, width, length, self.zone)))
            inlets.append((3, occ.addCylinder(x, 0, 0, 0, 0, self.base, 0.5 * self.inlet_diameter)))
        (body,), _ = occ.cut([body], chambers)
        (base,), _ = occ.cut([base], inlets)
        x = self._middles()[self.segments // 2]
        line = np.array([[x, -length / 2, levels[-1]], [x, length / 2, levels[-1]]])
        middle = np.array([[x, 0.0, levels[-1]]])
        start, centre, end = (occ.addPoint(*place) for place in (line[0], middle[0], line[1]))
        lines = [(1, occ.addLine(start, centre)), (1, occ.addLine(centre, end))]
        _, pieces = occ.fragment([base, body, membrane], lines)
        occ.synchronize()
        regions = {
            name: [tag for _, tag in piece]
            for name, piece in zip(("base", "body", "membrane"), pieces[:3], strict=True)
        }
        return Shape(
            regions=regions,
            surfaces=self._surfaces(cad.boundary([tag for tags in regions.values() for tag in tags]), levels[-1]),
            markers={"base": np.array([[-half, -side, 0.0]]), "tip": middle, "centreline": line},
            # Two elements across half a chamber bend with the sheet; it is far too thin for cubes.
            sizes={"membrane-face": min(self.default_size, 0.25 * self.chamber_width)},
        )

    def _surfaces(self, faces: list[int], top: float) -> dict[str, list[int]]:
        mount, membrane = (cad.faces_in_plane(faces, "z", z) for z in (0.0, top))
        outer, *cavities = cad.skins([face for face in faces if face not in mount + membrane])
        cavities.sort(key=lambda skin: min(cad.bounds(2, face)[0][0] for face in skin))
        names = ["cavity"] if self.segments == 1 else [f"cavity-{number + 1}" for number in range(self.segments)]
        named = {"mount": mount, "membrane-face": membrane, "outer": outer}
        return {**named, **dict(zip(names, cavities, strict=True))}
