"""An actuator from a STEP file: bodies by the names in the file, cavities by topology, the rest by rules."""

from __future__ import annotations

import functools
from typing import ClassVar

from turgor.common.errors import InputError
from turgor.geometry import cad
from turgor.geometry.actuator import Shape
from turgor.geometry.imported.names import plain, unique
from turgor.geometry.imported.parts import CadFace
from turgor.geometry.imported.solid import ImportedSolid


class StepFile(ImportedSolid):
    """A solid, or an assembly whose bodies touch, from a STEP file; lengths become mm whatever the file's unit.

    Regions carry the names of the bodies in the file (``body`` if there is one without a name); bodies that touch share
    the nodes between them. Cavities, caps and the names of surfaces are those of every imported solid.
    """

    template: ClassVar[str] = "step"
    suffixes: ClassVar[tuple[str, ...]] = (".step", ".stp")

    @functools.cached_property
    def default_size(self) -> float:
        """Mean thickness of the walls: twice the volume over the area of the skin."""
        with cad.session("size"):
            tags = [tag for pieces in self._import().values() for tag in pieces]
            volume = sum(cad.occ().getMass(3, tag) for tag in tags)
            area = sum(cad.occ().getMass(2, face) for face in cad.boundary(tags))
        return float(2.0 * volume / area)

    def draw(self) -> Shape:
        """Import the bodies, make their interfaces common and name what the rules select."""
        regions = self._import()
        skin = cad.boundary([tag for tags in regions.values() for tag in tags])
        return self._named(regions, [CadFace(face) for face in skin])

    def _import(self) -> dict[str, list[int]]:
        """Draw the bodies of the file, cut at their common faces: region name → tags of volumes."""
        gmsh = cad.kernel()
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        try:
            shapes = [shape for shape in gmsh.model.occ.importShapes(self.file) if shape[0] == 3]
        except Exception as error:  # gmsh raises bare Exceptions that carry its own text
            raise InputError(f"the STEP file cannot be read: {error}", file=self.file) from error
        if not shapes:
            raise InputError("the STEP file holds no solid", file=self.file)
        gmsh.model.occ.synchronize()
        names = unique([plain(gmsh.model.getEntityName(*shape)) for shape in shapes])
        pieces = [shapes]
        if len(shapes) > 1:
            _, pieces = gmsh.model.occ.fragment(shapes[:1], shapes[1:])
            gmsh.model.occ.synchronize()
        regions = {name: [tag for _, tag in piece] for name, piece in zip(names, pieces, strict=True)}
        owners: dict[int, str] = {}
        for name, tags in regions.items():
            for tag in tags:
                if tag in owners:
                    raise InputError(f"the bodies '{owners[tag]}' and '{name}' overlap", file=self.file)
                owners[tag] = name
        return regions
