"""An actuator from a STEP file: bodies by the names in the file, cavities by topology, the rest by rules."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from turgor.common.errors import InputError
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape
from turgor.geometry.imported.selection import Selection
from turgor.geometry.space import Place


class StepFile(Actuator):
    """A solid, or an assembly whose bodies touch, from a STEP file; lengths become mm whatever the file's unit.

    Regions carry the names of the bodies in the file (``body`` if there is one without a name); bodies that touch share
    the nodes between them. Every closed pocket is a ``cavity`` (``cavity-1``, … from the largest to the smallest if
    there are several). What `mount`, `tip_face` and `surfaces` select takes its name; the rest of the outside is
    ``outer``. Markers ``base`` and ``tip``: a vertex of the mount and of the tip face.
    """

    template: ClassVar[str] = "step"

    file: str = Field(description="path of the .step or .stp file")
    mount: Selection = Field(description="where the actuator is held")
    tip_face: Selection | None = Field(default=None, description="the end whose motion is of interest")
    tip: Place | None = Field(default=None, description="the tip is the vertex of tip_face nearest to this point")
    surfaces: dict[str, Selection] = Field(default_factory=dict, description="further names of parts of the outside")

    def check(self) -> None:
        """Raise InputError if there is no such file, or a tip without a tip face."""
        path = Path(self.file)
        if path.suffix.lower() not in (".step", ".stp"):
            raise InputError("this is not a STEP file", key="file", value=self.file, expected="a .step or .stp file")
        if not path.is_file():
            raise InputError("there is no such file", key="file", value=self.file)
        if self.tip is not None and self.tip_face is None:
            raise InputError("a tip needs a tip_face to lie on", key="tip")
        taken = sorted({"mount", "tip-face", "outer"} & set(self.surfaces))
        if taken:
            raise InputError("this name is taken", key=f"surfaces.{taken[0]}")

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
        outside, *cavities = cad.skins(cad.boundary([tag for tags in regions.values() for tag in tags]))
        rules = {"mount": self.mount, **({"tip-face": self.tip_face} if self.tip_face else {}), **self.surfaces}
        surfaces: dict[str, list[int]] = {}
        for name, rule in rules.items():
            picked = rule.pick(outside, name)
            twice = [other for other, faces in surfaces.items() if set(faces) & set(picked)]
            if twice:
                raise InputError(f"a face of it belongs to '{twice[0]}' already", key=name)
            surfaces[name] = picked
        named = {face for faces in surfaces.values() for face in faces}
        numbered = len(cavities) > 1
        pockets = {f"cavity-{number}" if numbered else "cavity": skin for number, skin in enumerate(cavities, start=1)}
        if set(pockets) & set(surfaces):
            raise InputError("a closed pocket has this name", key=f"surfaces.{min(set(pockets) & set(surfaces))}")
        rest = [face for face in outside if face not in named]
        markers = {"base": _vertex(surfaces["mount"], None)}
        if "tip-face" in surfaces:
            markers["tip"] = _vertex(surfaces["tip-face"], self.tip)
        return Shape(regions, {**surfaces, **({"outer": rest} if rest else {}), **pockets}, markers)

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
        names = _unique([_plain(gmsh.model.getEntityName(*shape)) for shape in shapes])
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


def _plain(label: str) -> str:
    """Turn the path of an assembly's part into a region's name."""
    name = re.sub(r"[^a-z0-9]+", "-", label.rsplit("/", 1)[-1].lower()).strip("-")
    # What CAD kernels write for a part that nobody named.
    return "body" if not name or re.fullmatch(r"open-cascade-step-translator.*|solid|shape|part", name) else name


def _unique(names: list[str]) -> list[str]:
    return [
        name if names.count(name) == 1 else f"{name}-{names[: number + 1].count(name)}"
        for number, name in enumerate(names)
    ]


def _vertex(faces: list[int], near: Any) -> FloatArray:
    """Return as a marker ``(1, 3)`` the vertex of the faces nearest to a point, or to their common centre."""
    gmsh = cad.kernel()
    vertices = gmsh.model.getBoundary([(2, face) for face in faces], combined=False, oriented=False, recursive=True)
    points = np.array([gmsh.model.getValue(0, tag, []) for tag in sorted({tag for _, tag in vertices})])
    centre = np.array(near if near is not None else gmsh.model.occ.getCenterOfMass(2, faces[0]))
    return np.atleast_2d(points[np.argmin(np.linalg.norm(points - centre, axis=1))])
