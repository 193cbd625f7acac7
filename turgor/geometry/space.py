"""Parts of space that rules speak of: boxes, balls, cylinders, half-spaces, bodies from STL files, and combinations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from turgor.common.errors import InputError
from turgor.common.units import Length, PositiveLength
from turgor.geometry.imported.surface import StlUnit, read_surface

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

Place = tuple[Length, Length, Length]
Direction = tuple[float, float, float]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


class Ball(_Part):
    """All space nearer to `centre` than `radius`."""

    centre: Place
    radius: PositiveLength

    def contains(self, points: FloatArray) -> BoolArray:
        """Say of each of the `points` ``(n, 3)`` whether it lies inside."""
        inside: BoolArray = np.linalg.norm(points - np.array(self.centre), axis=1) <= self.radius
        return inside


class Cylinder(_Part):
    """All space nearer than `radius` to the axis through `point` along `direction`."""

    point: Place
    direction: Direction
    radius: PositiveLength

    def contains(self, points: FloatArray) -> BoolArray:
        """Say of each of the `points` ``(n, 3)`` whether it lies inside."""
        axis = unit(self.direction)
        offsets = points - np.array(self.point)
        away = offsets - np.outer(offsets @ axis, axis)
        inside: BoolArray = np.linalg.norm(away, axis=1) <= self.radius
        return inside


class HalfSpace(_Part):
    """All space on the side of the plane through `point` to which `normal` points."""

    point: Place
    normal: Direction

    def contains(self, points: FloatArray) -> BoolArray:
        """Say of each of the `points` ``(n, 3)`` whether it lies inside."""
        inside: BoolArray = (points - np.array(self.point)) @ unit(self.normal) >= 0.0
        return inside


class NearBody(_Part):
    """All space inside the body of an STL file, or nearer to it than `distance` (a negative one: that deep inside).

    Parameters
    ----------
    file
        Its path; in a case file relative to that.
    unit
        Of the numbers in the file.
    distance
        From the body's surface.
    """

    file: str
    unit: StlUnit
    distance: Length = Field(default="0 mm", validate_default=True)

    @field_validator("file")
    @classmethod
    def _is_there(cls, file: str, info: ValidationInfo) -> str:
        path: Path = (info.context or {}).get("folder", Path()) / Path(file).expanduser()
        if not path.is_file():
            raise ValueError("there is no such file") from InputError("there is no such file", value=str(path))
        return str(path)

    def contains(self, points: FloatArray) -> BoolArray:
        """Say of each of the `points` ``(n, 3)`` whether it lies inside; raise InputError if the file is no body."""
        distance, _, _ = read_surface(self.file, self.unit).solid.distance(points)
        inside: BoolArray = distance <= self.distance
        return inside


class Space(_Part):
    """A part of space; of several keys all must hold.

    Parameters
    ----------
    box
        Two opposite corners.
    ball, cylinder, half_space, stl
        As these say.
    all_of, any_of, none_of
        Other parts of space: in all of them, in at least one, in none.

    Raises
    ------
    InputError
        On use, if no key says which part is meant.
    """

    box: tuple[Place, Place] | None = None
    ball: Ball | None = None
    cylinder: Cylinder | None = None
    half_space: HalfSpace | None = None
    stl: NearBody | None = None
    all_of: tuple[Space, ...] = Field(default=())
    any_of: tuple[Space, ...] = Field(default=())
    none_of: tuple[Space, ...] = Field(default=())

    def contains(self, points: FloatArray) -> BoolArray:
        """Say of each of the `points` ``(n, 3)`` whether it lies inside, faces included."""
        simple = (self.ball, self.cylinder, self.half_space, self.stl)
        tests = [part.contains(points) for part in simple if part is not None]
        if self.box is not None:
            corners = np.array(self.box)
            tests.append(((points >= corners.min(axis=0)) & (points <= corners.max(axis=0))).all(axis=1))
        tests += [part.contains(points) for part in self.all_of]
        if self.any_of:
            tests.append(np.any([part.contains(points) for part in self.any_of], axis=0))
        tests += [~part.contains(points) for part in self.none_of]
        if not tests:
            expected = ", ".join(type(self).model_fields)
            raise InputError("no rule says which part of space is meant", expected=f"one of: {expected}")
        inside: BoolArray = np.all(tests, axis=0)
        return inside


def unit(direction: Direction) -> Any:
    """Return `direction` with length one; raise InputError if it has no length."""
    vector = np.array(direction)
    length = float(np.linalg.norm(vector))
    if not (np.isfinite(length) and length > 0.0):
        raise InputError("a direction has no length", value=direction, expected="three numbers, not all zero")
    return vector / length
