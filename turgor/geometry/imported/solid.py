"""What solids from files have in common: names that rules give to the skin, cavities, and caps over openings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from turgor.common.errors import InputError
from turgor.common.names import Name
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape
from turgor.geometry.imported.parts import CadFace, Patch, rims
from turgor.geometry.imported.selection import Selection
from turgor.geometry.space import Place

Face = CadFace | Patch


class ImportedSolid(Actuator):
    """A solid, or several, from a file.

    Every closed pocket, and every open one whose openings `caps` close, is a ``cavity`` (``cavity-1``, … from the
    largest to the smallest if there are several). What `mount`, `tip_face` and `surfaces` select of the outside takes
    its name; the rest is ``outer``. Markers ``base`` and ``tip``: a vertex of the mount and of the tip face.
    """

    suffixes: ClassVar[tuple[str, ...]]
    """How the file's name may end."""

    file: str = Field(description="path of the file")
    mount: Selection = Field(description="where the actuator is held")
    tip_face: Selection | None = Field(default=None, description="the end whose motion is of interest")
    tip: Place | None = Field(default=None, description="the tip is the vertex of tip_face nearest to this point")
    surfaces: dict[Name, Selection] = Field(default_factory=dict, description="further names of parts of the outside")
    caps: dict[Name, Selection] = Field(
        default_factory=dict, description="openings that air does not leave by: name of the cap, rules for the rim"
    )

    def check(self) -> None:
        """Raise InputError if there is no such file, a name is taken, or a tip has no tip face."""
        path = Path(self.file)
        if path.suffix.lower() not in self.suffixes:
            kind, expected = self.template.upper(), " or ".join(self.suffixes)
            raise InputError(f"this is not a {kind} file", key="file", value=self.file, expected=f"a {expected} file")
        if not path.is_file():
            raise InputError("there is no such file", key="file", value=self.file)
        if self.tip is not None and self.tip_face is None:
            raise InputError("a tip needs a tip_face to lie on", key="tip")
        taken = sorted({"mount", "tip-face", "outer"} & set(self.surfaces))
        if taken:
            raise InputError("this name is taken", key=f"surfaces.{taken[0]}")

    def _named(self, regions: Mapping[str, Sequence[int]], faces: Sequence[Face], **more: Any) -> Shape:
        """Return the shape of the drawn regions, whose skin the `faces` are."""
        caps = self._openings(faces)
        outside, pockets = self._skins(regions, caps)
        surfaces = self._selected([face for face in faces if face.tags[0] in outside])
        pockets.sort(key=cad.extent, reverse=True)
        numbered = len(pockets) > 1
        cavities = {f"cavity-{number}" if numbered else "cavity": skin for number, skin in enumerate(pockets, start=1)}
        if set(cavities) & set(surfaces):
            raise InputError("a closed pocket has this name", key=f"surfaces.{min(set(cavities) & set(surfaces))}")
        tags = {name: [tag for face in picked for tag in face.tags] for name, picked in surfaces.items()}
        named = {tag for own in tags.values() for tag in own}
        rest = [tag for tag in outside if tag not in named]
        markers = self._markers(surfaces)
        return Shape(regions, {**tags, **({"outer": rest} if rest else {}), **cavities}, markers, caps=caps, **more)

    def _openings(self, faces: Sequence[Face]) -> dict[str, list[int]]:
        """Return the edges of the rim that each cap closes."""
        candidates = rims(faces) if self.caps else []
        caps: dict[str, list[int]] = {}
        for name, rule in self.caps.items():
            picked = rule.pick(candidates, f"caps.{name}")
            if len(picked) > 1:
                problem = f"these rules select {len(picked)} closed rims"
                raise InputError(problem, key=f"caps.{name}", expected="one, for example by 'nearest'")
            caps[name] = sorted(picked[0].edges)
        return caps

    def _skins(
        self, regions: Mapping[str, Sequence[int]], caps: Mapping[str, Sequence[int]]
    ) -> tuple[list[int], list[list[int]]]:
        """Return the faces on the outside, and those of each cavity, where caps close their openings."""
        closed = {edge for edges in caps.values() for edge in edges}
        outside, pockets = [], []
        for volumes in _clusters(regions):
            skin, *inner = cad.skins(cad.boundary(volumes), walls=closed)
            outside += skin
            pockets += inner
        for name, edges in caps.items():
            if sum(_touches(skin, edges) for skin in (outside, *pockets)) < 2:
                raise InputError(
                    "closing this opening encloses no cavity: the air has another way out",
                    key=f"caps.{name}",
                    expected="a cap for every opening of the cavity",
                )
        return outside, pockets

    def _selected(self, outside: Sequence[Face]) -> dict[str, list[Face]]:
        rules = {"mount": self.mount, **({"tip-face": self.tip_face} if self.tip_face else {}), **self.surfaces}
        surfaces: dict[str, list[Face]] = {}
        for name, rule in rules.items():
            key = f"surfaces.{name}" if name in self.surfaces else name.replace("-", "_")
            picked = rule.pick(outside, key)
            twice = [other for other, faces in surfaces.items() if any(face in faces for face in picked)]
            if twice:
                raise InputError(f"a face of it belongs to '{twice[0]}' already", key=key)
            surfaces[name] = picked
        return surfaces

    def _markers(self, surfaces: Mapping[str, Sequence[Face]]) -> dict[str, FloatArray]:
        markers = {}
        for name, surface, near in (("base", "mount", None), ("tip", "tip-face", self.tip)):
            if surface not in surfaces:
                continue
            place = np.array(near) if near is not None else surfaces[surface][0].samples.mean(axis=0)
            vertices = cad.vertices([tag for face in surfaces[surface] for tag in face.tags])
            if len(vertices):  # a patch of facets may be smooth all around
                markers[name] = vertices[[np.argmin(np.linalg.norm(vertices - place, axis=1))]]
        return markers


def _clusters(regions: Mapping[str, Sequence[int]]) -> list[list[int]]:
    """Group the volumes of all regions into those that hang together by their faces."""
    left = [tag for tags in regions.values() for tag in tags]
    faces = {tag: cad.sides(3, tag) for tag in left}
    clusters = []
    while left:
        cluster = [left.pop(0)]
        while joined := [tag for tag in left if any(faces[tag] & faces[other] for other in cluster)]:
            cluster += joined
            left = [tag for tag in left if tag not in joined]
        clusters.append(cluster)
    return clusters


def _touches(skin: Sequence[int], edges: Sequence[int]) -> bool:
    return any(cad.sides(2, face) & set(edges) for face in skin)
