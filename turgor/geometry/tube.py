"""The capped tube: the plainest inflatable body, and the yardstick of the solver."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, Shape, parameter


class CappedTube(Actuator):
    """A straight round tube, closed by a solid cap at either end, along the z axis from the mount at z = 0.

    Surfaces ``mount`` (end face at z = 0), ``tip-face``, ``outer``, ``cavity``; region ``body``; markers ``base`` and
    ``tip`` (centres of the end faces) and ``centreline`` (along the outside at y = 0, x > 0, from mount to tip).
    """

    template: ClassVar[str] = "tube"

    inner_radius: PositiveLength = parameter("6.35 mm", "radius of the cavity", "case T of the solver's measurements")
    wall: PositiveLength = parameter("3.5 mm", "thickness of the tube's wall", "case T of the solver's measurements")
    length: PositiveLength = parameter("120 mm", "length, caps included", "case T of the solver's measurements")
    cap: PositiveLength = parameter("17 mm", "thickness of either end cap", "case T of the solver's measurements")

    @property
    def default_size(self) -> float:
        """One element through the thinner of wall and cap."""
        return float(min(self.wall, self.cap))

    def check(self) -> None:
        """Raise InputError if the caps leave no cavity between them."""
        if 2.0 * self.cap >= self.length:
            raise InputError(
                "the caps meet: no cavity is left between them",
                key="cap",
                value=f"{self.cap:g} mm",
                expected=f"less than half of the length, {self.length / 2:g} mm",
            )

    def draw(self) -> Shape:
        """Draw the outer cylinder less the inner one."""
        occ = cad.occ()
        outer = self.inner_radius + self.wall
        solid = occ.addCylinder(0, 0, 0, 0, 0, self.length, outer)
        air = occ.addCylinder(0, 0, self.cap, 0, 0, self.length - 2 * self.cap, self.inner_radius)
        (hollow,), _ = occ.cut([(3, solid)], [(3, air)])
        ends = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, self.length]])
        body = cad.with_points(hollow[1], ends)
        # OpenCASCADE's seam of the cylinder is the edge that carries the nodes of the centreline.
        seam = ends + np.array([outer, 0.0, 0.0])
        return Shape(
            regions={"body": [body]},
            surfaces=cad.named_skin(cad.boundary([body]), "z", self.length),
            markers={"base": ends[:1], "tip": ends[1:], "centreline": seam},
        )
