"""Rules that select faces and openings of an imported solid, whose tags mean nothing to a person."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from turgor.common.errors import InputError
from turgor.geometry.actuator import FloatArray
from turgor.geometry.space import Cylinder, Direction, Place, unit


class Part(Protocol):
    """What rules ask of a face, or of the rim of an opening."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner ``(3,)`` of the box around it."""
        ...

    @property
    def samples(self) -> FloatArray:
        """Points of it ``(k, 3)``: its vertices, and some between them."""
        ...

    @property
    def normals(self) -> FloatArray:
        """Unit normals ``(k, 3)`` out of the solid; of an opening, which looks both ways, in the sense of its rim."""
        ...

    @property
    def looks_both_ways(self) -> bool:
        """Whether the sense of the normals means nothing."""
        ...

    def distance(self, place: Place) -> float:
        """Return its distance in mm from a place."""
        ...


Some = TypeVar("Some", bound=Part)


class Selection(BaseModel):
    """Which faces, or which openings, are meant; of several rules all must hold.

    Parameters
    ----------
    within
        Two opposite corners of a box that holds all of it.
    inside
        A cylinder that holds its vertices and sample points.
    between
        Two places: all of it lies between the planes through them across the line that joins them.
    normal
        Direction, which need not have length one, of the outward normal of a flat face; of an opening either way.
    angle
        Largest angle in degrees between `normal` and the face's.
    any_of, none_of
        Other selections: what at least one of them selects, and what none does.
    nearest
        Of what the other rules leave, the one nearest to this point.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    within: tuple[Place, Place] | None = None
    inside: Cylinder | None = None
    between: tuple[Place, Place] | None = None
    normal: Direction | None = None
    angle: Annotated[float, Field(gt=0.0, lt=90.0)] = 5.0
    any_of: tuple[Selection, ...] = ()
    none_of: tuple[Selection, ...] = ()
    nearest: Place | None = None

    def pick(self, parts: Sequence[Some], key: str) -> list[Some]:
        """Return those of the `parts` that are meant.

        Raises
        ------
        InputError
            If there is no rule, or nothing follows them; `key` names the selection.
        """
        found = self._picked(parts, key)
        if not found:
            rules = self.model_dump(exclude_none=True, exclude_defaults=True)
            raise InputError("nothing follows these rules", key=key, value=rules)
        return found

    def _picked(self, parts: Sequence[Some], key: str) -> list[Some]:
        rules = (self.within, self.inside, self.between, self.normal, self.nearest)
        if not (any(rule is not None for rule in rules) or self.any_of or self.none_of):
            expected = ", ".join(name for name in type(self).model_fields if name != "angle")
            raise InputError("no rule says what is meant", key=key, expected=f"at least one of: {expected}")
        found = list(parts)
        for rule in (self._in_box, self._in_cylinder, self._in_slab, self._looks_along):
            found = [part for part in found if rule(part)]
        if self.any_of:
            wanted = [part for other in self.any_of for part in other._picked(found, key)]
            found = [part for part in found if any(part is one for one in wanted)]
        for other in self.none_of:
            refused = other._picked(found, key)
            found = [part for part in found if not any(part is one for one in refused)]
        if self.nearest is not None and found:
            place = self.nearest
            found = [min(found, key=lambda part: part.distance(place))]
        return found

    def _in_box(self, part: Part) -> bool:
        if self.within is None:
            return True
        low, high = part.bounds
        corners = np.array(self.within)
        slack = 1e-6 * max(1.0, float(np.abs(corners).max()))
        return bool((low > corners.min(axis=0) - slack).all() and (high < corners.max(axis=0) + slack).all())

    def _in_cylinder(self, part: Part) -> bool:
        return self.inside is None or bool(self.inside.contains(part.samples).all())

    def _in_slab(self, part: Part) -> bool:
        if self.between is None:
            return True
        start, end = np.array(self.between)
        axis = unit(tuple(end - start))
        height, width = (part.samples - start) @ axis, float((end - start) @ axis)
        slack = 1e-6 * max(1.0, float(np.abs(self.between).max()))
        return bool((height > -slack).all() and (height < width + slack).all())

    def _looks_along(self, part: Part) -> bool:
        if self.normal is None:
            return True
        cosine = part.normals @ unit(self.normal)
        if part.looks_both_ways:
            cosine = np.abs(cosine)
        return bool((cosine > math.cos(math.radians(self.angle))).all())
