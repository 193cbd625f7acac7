"""An actuator from an STL file: shells become bodies and cavities, facets are meshed anew."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import ClassVar

from pydantic import Field

from turgor.geometry import cad
from turgor.geometry.actuator import Shape
from turgor.geometry.imported.names import plain, unique
from turgor.geometry.imported.patches import draw_patches
from turgor.geometry.imported.solid import ImportedSolid
from turgor.geometry.imported.surface import StlUnit, Surface, read_surface


class StlFile(ImportedSolid):
    """A body, or several apart from each other, from an STL file: a closed surface of flat facets.

    Small faults are repaired with a word in the log, others refused (:mod:`turgor.geometry.imported.surface`). A shell
    inside another is a cavity of it, a shell inside a cavity is another body. Regions carry the names of the solids in
    the file (``body`` if there is one without a name; ``body-1``, … from the largest to the smallest). The faces that
    rules select are patches of facets that meet at less than `feature_angle`.

    The facets are meshed anew; the middles of the elements' edges lie on them.
    """

    template: ClassVar[str] = "stl"
    suffixes: ClassVar[tuple[str, ...]] = (".stl",)
    # Facets have no curvature; elements as small as the corners between them would cost much and give nothing.
    per_circle: ClassVar[int] = 0

    unit: StlUnit = Field(description="unit of the file's numbers, which STL does not say")
    feature_angle: float = Field(
        default=40.0, gt=0.0, lt=180.0, description="degrees by which facets turn at an edge between faces"
    )

    @functools.cached_property
    def surface(self) -> Surface:
        """The repaired surface."""
        return read_surface(self.file, self.unit)

    @functools.cached_property
    def default_size(self) -> float:
        """Mean thickness of the walls: twice the volume over the area of the skin."""
        volume, area = self.surface.extent
        return 2.0 * volume / area

    def draw(self) -> Shape:
        """Divide the shells into patches, make volumes of them and name what the rules select."""
        bodies = self.surface.bodies
        patches = draw_patches(self.surface, math.radians(self.feature_angle))
        draw = cad.kernel().model.geo
        names = unique([plain(self.surface.shells[body[0]].name) for body in bodies])
        regions, faces = {}, []
        for name, body in zip(names, bodies, strict=True):
            tags = [tag for shell in body for patch in patches[shell] for tag in patch.tags]
            regions[name] = [int(draw.addVolume([draw.addSurfaceLoop(tags)]))]
            faces += patches[body[0]]
            faces += [
                replace(patch, corners=patch.corners[:, [0, 2, 1]]) for shell in body[1:] for patch in patches[shell]
            ]
        draw.synchronize()
        return self._named(regions, faces, faceted=self.surface.extent)
