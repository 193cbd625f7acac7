"""The capped tube: the plainest inflatable body, and the yardstick of the solver."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.blocks import Blocks, capped_tube
from turgor.geometry.drawing import AIR, Distance, View, circle, rectangle
from turgor.geometry.path import polygon
from turgor.geometry.section import CUTS, TURN, PlaneSection

_CASE_T = "case T of the solver's measurements"


class CappedTube(Actuator):
    """A straight round tube, closed by a solid cap at either end, along the z axis from the mount at z = 0.

    Surfaces ``mount`` (end face at z = 0), ``tip-face``, ``outer``, ``cavity``; of the half model ``symmetry`` (the cut
    y = 0), of the quarter ``symmetry-x`` and ``symmetry-y``, of the axisymmetric one ``axis``; region ``body``; markers
    ``base`` and ``tip`` (centres of the end faces) and ``centreline`` (along the outside at y = 0, x > 0, from mount to
    tip).
    """

    template: ClassVar[str] = "tube"

    inner_radius: PositiveLength = parameter("6.35 mm", "radius of the cavity", _CASE_T)
    wall: PositiveLength = parameter("3.5 mm", "thickness of the tube's wall", _CASE_T)
    length: PositiveLength = parameter("120 mm", "length, caps included", _CASE_T)
    cap: PositiveLength = parameter("17 mm", "thickness of either end cap", _CASE_T)

    model: Literal["full", "half", "quarter", "axisymmetric"] = parameter(
        "full", "the whole, the half y ≥ 0, the quarter x, y ≥ 0, or the section of radius and height", _CASE_T
    )

    @property
    def section(self) -> PlaneSection | None:
        """One half of the section through the axis, turned about it; None for a model in space."""
        return PlaneSection("axisymmetric") if self.model == "axisymmetric" else None

    @property
    def default_size(self) -> float:
        """One element through the thinner of wall and cap, three in the section, where they cost little."""
        return float(min(self.wall, self.cap) / (3.0 if self.model == "axisymmetric" else 1.0))

    def check(self) -> None:
        """Raise InputError if the caps leave no cavity between them."""
        if 2.0 * self.cap >= self.length:
            raise InputError(
                "the caps meet: no cavity is left between them",
                key="cap",
                value=f"{self.cap:g} mm",
                expected=f"less than half of the length, {self.length / 2:g} mm",
            )

    def views(self) -> list[View]:
        """Show the section along the axis and the one across it."""
        inner, outer, length = self.inner_radius, self.inner_radius + self.wall, self.length
        along = View(
            "section along the axis",
            [
                ("body", rectangle(0, length, -outer, outer)),
                (AIR, rectangle(self.cap, length - self.cap, -inner, inner)),
            ],
            [
                Distance("length", (0, -outer), (length, -outer), -3),
                Distance("cap", (0, -outer), (self.cap, -outer), -1),
            ],
            lines=[np.array([[-0.03 * length, 0.0], [1.03 * length, 0.0]])],
            notes={"cavity": (0.5 * length, 0.5 * inner), "mount": (-0.03 * length, 0.5 * outer)},
        )
        across = View(
            "section across the axis",
            [("body", circle(outer)), (AIR, circle(inner))],
            [Distance("inner_radius", (0, 0), (inner, 0)), Distance("wall", (0, inner), (0, outer))],
        )
        return [along, across]

    def draw(self) -> Shape:
        """Draw the section, or the outer cylinder less the inner one."""
        flat = self.model == "axisymmetric"
        ends = np.vstack([self._markers()["base"], self._markers()["tip"]])
        body = cad.with_points(self._face() if flat else self._solid(), ends, 2 if flat else 3)
        boundary = cad.boundary([body], 2 if flat else 3)
        lines = self._markers()
        return Shape(
            regions={"body": [body]},
            surfaces=cad.named_skin(boundary, "z", self.length, CUTS[self.model], 2 if flat else 3),
            markers={name: line[:, [0, 2]] if flat else line for name, line in lines.items()},
            dimension=2 if flat else 3,
        )

    def _markers(self) -> dict[str, FloatArray]:
        ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, self.length]])
        # OpenCASCADE's seam of the cylinder is the edge that carries the nodes of the centreline.
        seam = ends + np.array([self.inner_radius + self.wall, 0.0, 0.0])
        return {"base": ends[:1], "tip": ends[1:], "centreline": seam}

    def blocks(self) -> Blocks:
        """Return the caps' middles and the wall."""
        radii = (self.inner_radius, self.inner_radius + self.wall)
        return Blocks(capped_tube(radii, ("body", "body"), self.cap, self.length), self._markers())

    def _solid(self) -> int:
        outside, turn = self.inner_radius + self.wall, TURN[self.model]
        solid = cad.cylinder(0.0, self.length, outside, turn)
        air = cad.cylinder(self.cap, self.length - self.cap, self.inner_radius, turn)
        (hollow,), _ = cad.occ().cut([solid], [air])
        return int(hollow[1])

    def _face(self) -> int:
        inside, outside = self.inner_radius, self.inner_radius + self.wall
        low, high, end = self.cap, self.length - self.cap, self.length
        corners = [(0.0, 0.0), (outside, 0.0), (outside, end), (0.0, end)]
        corners += [(0.0, high), (inside, high), (inside, low), (0.0, low)]
        return cad.plane_face(polygon(corners))
