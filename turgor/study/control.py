"""What is prescribed along a run: the loads, the enclosed volume, an amount of air, or the length of the path."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from turgor.common.errors import InputError
from turgor.common.units import PositivePressure, to_internal
from turgor.solver.control import ATMOSPHERE
from turgor.study.validation import StrictModel, collected

_PERCENT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*%\s*")


A_VOLUME = "a volume with its unit, such as '5 ml', or per cent of that at rest, such as '250 %'"


def volume_of(text: str, rest: float, key: str) -> float:
    """Return a volume in mm³ given with its unit, or in per cent of the volume at rest.

    Raises
    ------
    InputError
        If it is neither, or not positive.
    """
    if not isinstance(text, str):
        raise InputError("a unit is missing", key=key, value=text, expected=A_VOLUME)
    share = _PERCENT.fullmatch(text)
    try:
        value = rest * float(share[1]) / 100.0 if share else to_internal(text, "volume", key=key)
    except InputError as error:
        raise InputError(error.problem, key=key, value=text, expected=A_VOLUME) from None
    if not value > 0.0:
        raise InputError("the volume must be greater than 0", key=key, value=text, expected=A_VOLUME)
    return value


def volume_text(text: str) -> str:
    """Return the text of a volume if it is one; raise InputError if it is not."""
    volume_of(text, 1.0, "volume")
    return text


def _readable(text: str) -> str:
    with collected():
        return volume_text(text)


VolumeText = Annotated[str, BeforeValidator(_readable)]


class PressureControl(StrictModel):
    """The loads are given, in proportion or along their programmes."""

    type: Literal["pressure"]
    at_limit: Literal["stop", "post-snap"] = Field(
        default="stop", description="at a limit pressure end there, or go on from the state that the actuator snaps to"
    )


class VolumeControl(StrictModel):
    """The enclosed volume grows to a target; the loads are what they must be, in proportion to each other."""

    type: Literal["volume"]
    target: VolumeText = Field(description="volume with unit, or per cent of that at rest")
    cavity: str | None = Field(default=None, description="left out, all cavities under pressure together")


class AirControl(StrictModel):
    """Air is pumped into a closed cavity, at constant temperature: (p + p₀) V grows to a target."""

    type: Literal["air"]
    target: VolumeText = Field(
        description="volume of the air at the pressure of the surroundings, or per cent of that in the cavity at rest"
    )
    cavity: str | None = Field(default=None, description="needed where several cavities are under pressure")
    surroundings: PositivePressure = Field(
        default=f"{ATMOSPHERE} MPa", validate_default=True, description="pressure of the surroundings"
    )


class ArcLengthControl(StrictModel):
    """The path is followed by its length in the plane of volume and load, through limits of both, to a volume."""

    type: Literal["arc-length"]
    target: VolumeText = Field(description="volume with unit, or per cent of that at rest")
    cavity: str | None = Field(default=None, description="left out, all cavities under pressure together")


ControlCase = Annotated[
    PressureControl | VolumeControl | AirControl | ArcLengthControl,
    Field(discriminator="type"),
]
