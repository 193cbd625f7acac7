"""Supports and loads as a case file names them."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, model_validator

from turgor.common.units import Acceleration, Force, Foundation, Length, Pressure
from turgor.fem.loads import Force as SurfaceForce
from turgor.fem.loads import Gravity, Traction
from turgor.fem.loads import Pressure as CavityPressure
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding
from turgor.study.programme import ProgrammeCase, written_out
from turgor.study.validation import StrictModel, invalid

UNKNOWN = 0.01
"""What counts as the full pressure, MPa, where the pressure is what it must be: only a scale."""

Vector = tuple[float, float, float]


def _not_zero(vector: Vector) -> Vector:
    if not math.hypot(*vector) > 0.0:
        raise invalid("this direction has length 0", value=vector, expected="three numbers that are not all 0")
    return vector


Direction = Annotated[Vector, AfterValidator(_not_zero)]
"""Three numbers without unit; only their direction counts."""


class ClampedCase(StrictModel):
    """A surface that does not move."""

    type: Literal["clamped"]
    surface: str

    def build(self) -> Clamped:
        """Return the support."""
        return Clamped(self.surface)


class SlidingCase(StrictModel):
    """A flat surface that keeps its plane without friction."""

    type: Literal["sliding"]
    surface: str

    def build(self) -> Sliding:
        """Return the support."""
        return Sliding(self.surface)


class DisplacementCase(StrictModel):
    """A surface moved by a given amount along the axes that are named; free along the others."""

    type: Literal["displacement"]
    surface: str
    x: Length | None = None
    y: Length | None = None
    z: Length | None = None

    @model_validator(mode="after")
    def _moves_somewhere(self) -> Self:
        if self.x is None and self.y is None and self.z is None:
            raise invalid("the surface is not moved along any axis", expected="at least one of x, y and z")
        return self

    def build(self) -> Prescribed:
        """Return the support."""
        return Prescribed(self.surface, displacement=(self.x, self.y, self.z))


class ElasticCase(StrictModel):
    """A surface held by springs, in every direction or along its normal only."""

    type: Literal["elastic"]
    surface: str
    stiffness: Foundation = Field(description="force per volume swept: pressure per displacement")
    normal_only: bool = False

    def build(self) -> ElasticSupport:
        """Return the support."""
        return ElasticSupport(self.surface, stiffness=self.stiffness, normal_only=self.normal_only)


class PressureCase(StrictModel):
    """Air pressure above the atmosphere's in a closed cavity: a full value, or a programme over time."""

    type: Literal["pressure"]
    cavity: str = "cavity"
    value: Pressure | None = Field(default=None, description="the pressure at the full load, in proportion before")
    programme: ProgrammeCase | None = Field(default=None, description="or pressures at given times")

    @model_validator(mode="before")
    @classmethod
    def _programme_written_out(cls, data: object, info: ValidationInfo) -> object:
        if not isinstance(data, dict) or "programme" not in data:
            return data
        return {**data, "programme": written_out(data["programme"], data.get("cavity", "cavity"), info)}

    @model_validator(mode="after")
    def _value_or_programme(self) -> Self:
        if self.value is not None and self.programme is not None:
            raise invalid("both value and programme are given", expected="only one of the two")
        return self

    @property
    def pressures(self) -> tuple[float, ...]:
        """The pressures given, MPa; empty where the pressure is what it must be."""
        if self.programme is not None:
            return self.programme.pressure
        return () if self.value is None else (self.value,)

    @property
    def full(self) -> float:
        """The pressure of largest size that is given, MPa; 0 without any."""
        return max(self.pressures, key=abs, default=0.0)

    def build(self, duration: float | None = None) -> CavityPressure:
        """Return the load; `duration` in s is what the load fraction runs over where there are programmes."""
        if self.programme is not None and duration:
            return CavityPressure(self.cavity, self.programme.peak, self.programme.over(duration))
        return CavityPressure(self.cavity, UNKNOWN if self.value is None else self.value)


class GravityCase(StrictModel):
    """Weight of every region that has a density."""

    type: Literal["gravity"]
    acceleration: Acceleration = Field(default="9.80665 m/s^2", validate_default=True)
    direction: Direction | None = Field(default=None, description="left out, down: −z, in a plane model −y")

    def build(self, dimension: int = 3) -> Gravity:
        """Return the load on a model of 3 or 2 dimensions."""
        down = (0.0, 0.0, -1.0) if dimension == 3 else (0.0, -1.0, 0.0)
        return Gravity(_along(self.direction or down, self.acceleration))


class TractionCase(StrictModel):
    """A dead load per reference area on a surface."""

    type: Literal["traction"]
    surface: str
    value: Pressure
    direction: Direction

    def build(self) -> Traction:
        """Return the load."""
        return Traction(self.surface, _along(self.direction, self.value))


class ForceCase(StrictModel):
    """A dead force in all, spread evenly over a surface."""

    type: Literal["force"]
    surface: str
    value: Force
    direction: Direction

    def build(self) -> SurfaceForce:
        """Return the load."""
        return SurfaceForce(self.surface, _along(self.direction, self.value))


Support = Annotated[ClampedCase | SlidingCase | DisplacementCase | ElasticCase, Field(discriminator="type")]
Load = Annotated[PressureCase | GravityCase | TractionCase | ForceCase, Field(discriminator="type")]


def _along(direction: Vector, size: float) -> Vector:
    scale = size / math.hypot(*direction)
    return (direction[0] * scale, direction[1] * scale, direction[2] * scale)
