"""What every actuator template is: parameters with units and bounds, and a drawing with names."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self, get_args

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from turgor.common.errors import InputError
from turgor.common.findings import what_fits, what_is_missing
from turgor.common.units import NonNegativeLength, PositiveLength
from turgor.geometry.blocks import Blocks
from turgor.geometry.drawing import View
from turgor.geometry.section import PlaneSection

FloatArray = npt.NDArray[np.float64]

SMALLEST, LARGEST = 1e-3, 1e5
"""Lengths in mm between which the CAD kernel's tolerance of 1e-7 mm resolves a shape."""


@dataclass(frozen=True)
class Shape:
    """The names of what a template drew into the current gmsh model.

    Parameters
    ----------
    regions
        Name → tags of volumes, or of faces if the shape is a section.
    surfaces
        Name → tags of faces on the outside of the solid, or of edges of the section.
    markers
        Name → points ``(k, 3)``, of a section ``(k, 2)``, of a polyline on the drawing's vertices and edges; the nodes
        on it, in order from its first point to its last, become the marker (one point: the node there).
    curves
        Name → points ``(j, 3)`` of a curve embedded in the solid without shaping the mesh (a fibre).
    sizes
        Name of a region or surface → element size in mm there, where it is smaller than elsewhere at the default size.
    dimension
        3, or 2 for a section drawn in the plane y = 0, whose coordinates are (x, z): a slice along y, or one half of
        the section through a body of revolution around z.
    caps
        Name → tags of edges of the rim of an opening in a cavity, which is closed for the air but not for the mesh.
    faceted
        Volume in mm³ and area in mm² of a body of flat facets, which the CAD kernel does not know.
    """

    regions: Mapping[str, Sequence[int]]
    surfaces: Mapping[str, Sequence[int]]
    markers: Mapping[str, FloatArray] = field(default_factory=dict)
    curves: Mapping[str, FloatArray] = field(default_factory=dict)
    sizes: Mapping[str, float] = field(default_factory=dict)
    dimension: int = 3
    caps: Mapping[str, Sequence[int]] = field(default_factory=dict)
    faceted: tuple[float, float] | None = None


@dataclass(frozen=True)
class Parameter:
    """One parameter of a template, as text for tables.

    ``default`` carries its unit, ``bounds`` says what is accepted, ``source`` where the default comes from.
    """

    name: str
    default: str
    bounds: str
    meaning: str
    source: str


class Actuator(BaseModel, ABC):
    """A parametric actuator: quantities in, a drawing with names out; it does not change after construction.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, lies outside its bounds or contradicts another.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    template: ClassVar[str]
    """The name by which case files and commands call the template."""

    def __init__(self, **parameters: Any) -> None:
        try:
            super().__init__(**parameters)
        except ValidationError as error:
            raise _input_error(error, type(self)) from None
        self._check_scale()
        self._check_angles()
        self.check()

    @classmethod
    def parameters(cls) -> list[Parameter]:
        """Return the parameters with default, bounds, meaning and source, in the order of declaration."""
        schema = cls.model_json_schema()["properties"]
        return [_describe(name, field, schema[name]) for name, field in cls.model_fields.items()]

    def changed(self, **parameters: Any) -> Self:
        """Return a copy with some `parameters` changed; raise InputError as the constructor does."""
        return type(self)(**{**self.model_dump(), **parameters})

    def _check_scale(self) -> None:
        for name, info in type(self).model_fields.items():
            size = getattr(self, name)
            is_length = any(get_args(kind)[1] in info.metadata for kind, _ in _QUANTITY_BOUNDS)
            if is_length and size != 0.0 and not SMALLEST <= size <= LARGEST:
                expected = f"{SMALLEST:g} mm to {LARGEST:g} mm"
                raise InputError("no actuator has this size", key=name, value=f"{size:g} mm", expected=expected)

    def _check_angles(self) -> None:
        for name, info in type(self).model_fields.items():
            extra = info.json_schema_extra
            degrees: Any = extra.get("degrees") if isinstance(extra, dict) else None
            if degrees and not math.radians(degrees[0]) <= getattr(self, name) <= math.radians(degrees[1]):
                value = f"{math.degrees(getattr(self, name)):g} deg"
                raise InputError("no actuator has this angle", key=name, value=value, expected=_range(degrees))

    @property
    def per_circle(self) -> int:
        """Elements along a full circle by default: longer ones would bulge through a thin wall when they are curved."""
        return 12

    @property
    def section(self) -> PlaneSection | None:
        """What the drawing stands for if it is plane; None for a body in space."""
        return None

    def blocks(self) -> Blocks | None:
        """Return the section in blocks, for meshes in rows; None if the shape is not made of them."""
        return None

    def views(self) -> Sequence[View]:
        """Return the views of the dimensioned drawing; a shape that comes from a file has none."""
        return ()

    def shown(self) -> dict[str, str]:
        """Return every parameter's value as short text: lengths in mm, angles in degrees, without their units."""
        values: dict[str, str] = {}
        for name, text in self.model_dump(mode="json").items():
            value = getattr(self, name)
            angle = isinstance(text, str) and text.endswith((" rad", " deg"))
            values[name] = (
                f"{math.degrees(value):g}°" if angle else f"{value:g}" if isinstance(value, float) else str(value)
            )
        return values

    @property
    @abstractmethod
    def default_size(self) -> float:
        """Element size in mm with which the shape is meshed if nothing else is asked for."""

    @abstractmethod
    def check(self) -> None:
        """Raise InputError naming a parameter that contradicts the others."""

    @abstractmethod
    def draw(self) -> Shape:
        """Add the solid to the current gmsh model and return the names of its parts."""


def parameter(
    default: Any,
    meaning: str,
    source: str,
    *,
    ge: int | None = None,
    le: int | None = None,
    degrees: tuple[float, float] | None = None,
) -> Any:
    """Declare a template's parameter.

    Parameters
    ----------
    default
        Text with a unit where the type is a quantity.
    meaning
        What it measures, and between what.
    source
        Where the default comes from.
    ge, le
        Bounds of a whole number.
    degrees
        Bounds of an angle, both included.
    """
    extra: dict[str, Any] = {"source": source, **({"degrees": list(degrees)} if degrees else {})}
    return Field(default=default, description=meaning, json_schema_extra=extra, ge=ge, le=le)


_LIMITS = {
    "minimum": "at least",
    "maximum": "at most",
    "exclusiveMinimum": "greater than",
    "exclusiveMaximum": "less than",
}
_QUANTITY_BOUNDS = ((PositiveLength, "greater than 0 mm"), (NonNegativeLength, "at least 0 mm"))


def _describe(name: str, info: FieldInfo, schema: Mapping[str, Any]) -> Parameter:
    limits = [f"{word} {schema[key]}" for key, word in _LIMITS.items() if key in schema]
    limits += [text for kind, text in _QUANTITY_BOUNDS if get_args(kind)[1] in info.metadata]
    if "degrees" in schema:
        limits.append(_range(schema["degrees"]))
    if "enum" in schema:
        limits.append("one of: " + ", ".join(schema["enum"]))
    return Parameter(
        name=name,
        default={True: "yes", False: "no"}[info.default] if schema["type"] == "boolean" else str(info.default),
        bounds=", ".join(limits),
        meaning=info.description or "",
        source=str(schema["source"]),
    )


def _range(degrees: Sequence[float]) -> str:
    low, high = degrees
    return f"{low:g} to {high:g} deg"


def _input_error(error: ValidationError, kind: type[Actuator]) -> InputError:
    """Make one message of pydantic's list: the first problem in full, the others by name."""
    first, *others = error.errors(include_url=False)
    key = ".".join(str(part) for part in first["loc"]) or None
    also = f" (also wrong: {', '.join(str(other['loc'][0]) for other in others if other['loc'])})" if others else ""
    if first["type"] == "extra_forbidden":
        expected = "one of: " + ", ".join(kind.model_fields)
        return InputError(f"'{kind.template}' has no such parameter{also}", key=key, expected=expected)
    if first["type"] == "missing":
        return InputError(f"this key is missing{also}", key=key, expected=what_is_missing(kind, first["loc"]))
    cause = first.get("ctx", {}).get("error")
    if first["type"] == "value_error" and cause is not None:
        return InputError(f"{cause}{also}", key=key)
    return InputError(f"this value does not fit{also}", key=key, value=first["input"], expected=what_fits(first))
