"""Quantities with units at the border, plain floats inside.

Inside Turgor every number is in millimetre, newton, megapascal, tonne, second and radian. At a border
(case files, the command line, CSV headers, constructors) a quantity is text such as ``"12 psi"`` or a
pint quantity; a bare number where a unit is needed is an error.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from turgor.common.errors import InputError

if TYPE_CHECKING:
    import pint

INTERNAL_UNITS: dict[str, str] = {
    "length": "mm",
    "area": "mm^2",
    "volume": "mm^3",
    "pressure": "MPa",
    "compliance": "1/MPa",
    "force": "N",
    "stiffness": "N/mm",
    "bending stiffness": "N mm^2",
    "stiffness per area": "N/mm^3",
    "density": "t/mm^3",
    "acceleration": "mm/s^2",
    "time": "s",
    "angle": "rad",
}
"""The unit in which each dimension is kept inside."""

USUAL_UNITS: dict[str, tuple[str, ...]] = {"pressure": ("kPa", "psi", "bar"), "angle": ("deg",)}
"""What else people write some dimensions in."""

_LONG = 10
"""Digits that nobody writes: a number that needs so many is the same to a reader in every unit."""

EXAMPLES: dict[str, str] = {
    "length": "3 mm",
    "area": "18 mm^2",
    "volume": "5 ml",
    "pressure": "12 psi",
    "compliance": "30 1/MPa",
    "force": "1.5 N",
    "stiffness": "0.5 N/mm",
    "bending stiffness": "20 N mm^2",
    "stiffness per area": "0.01 N/mm^3",
    "density": "1070 kg/m^3",
    "acceleration": "9.81 m/s^2",
    "time": "2 s",
    "angle": "51 deg",
}
"""A well-formed value of each dimension, quoted in messages and in the JSON Schema."""


@functools.cache
def registry() -> pint.UnitRegistry[Any]:
    """Return the one unit registry (built when first used: pint takes a while to load)."""
    import pint

    units: pint.UnitRegistry[Any] = pint.UnitRegistry(cache_folder=None)
    return units


@functools.lru_cache(maxsize=1000)
def _unit(text: str) -> pint.Unit:
    # A study reads the same few units again and again, each of which takes pint half a millisecond.
    return registry().parse_units(text)


def to_internal(value: object, dimension: str, *, key: str | None = None) -> float:
    """Convert a quantity to the internal unit of its `dimension`.

    Parameters
    ----------
    value
        Text with a unit (``"12 psi"``) or a pint quantity.
    dimension
        A key of :data:`INTERNAL_UNITS`.
    key
        Name of the value, for the message.

    Raises
    ------
    InputError
        If the unit is missing, unknown or of another dimension, or the number is not finite.
    """
    expected = f"a {dimension} with its unit, such as '{EXAMPLES[dimension]}'"
    units = registry()
    if isinstance(value, units.Quantity):
        quantity = value
    elif isinstance(value, str):
        quantity = _parse(value, expected, key)
    else:
        problem = "a unit is missing" if isinstance(value, (int, float)) else "this is not a quantity"
        raise InputError(problem, key=key, value=value, expected=expected)
    target = INTERNAL_UNITS[dimension]
    if quantity.dimensionless and dimension != "angle":
        raise InputError("a unit is missing", key=key, value=value, expected=expected)
    if dimension == "angle" and quantity.unitless:
        raise InputError("a unit is missing", key=key, value=value, expected=expected)
    if not quantity.check(_unit(target).dimensionality):
        raise InputError(f"{_unit_text(value)} is not a unit of {dimension}", key=key, value=value, expected=expected)
    number = float(quantity.to(_unit(target)).magnitude)
    if not math.isfinite(number):
        raise InputError("the number is not finite", key=key, value=value, expected=expected)
    return number


def from_internal(number: float, dimension: str, unit: str | None = None) -> float:
    """Convert `number` from the internal unit of its `dimension` to `unit`."""
    if unit is None:
        return number
    return float(registry().Quantity(number, INTERNAL_UNITS[dimension]).to(unit).magnitude)


def to_text(number: float, dimension: str) -> str:
    """Write an internal `number` as text with its unit; reading it back returns the same number.

    Of the usual units it takes the one in which that is shortest: 12 psi, not 0.08273708751802035 MPa.
    """
    short = f"{number:.15g}"
    shortest, unit = (short if float(short) == number else repr(number)), INTERNAL_UNITS[dimension]
    for other in USUAL_UNITS.get(dimension, ()):
        text = f"{from_internal(number, dimension, other):.15g}"
        if len(text) < min(len(shortest), _LONG) and to_internal(f"{text} {other}", dimension) == number:
            shortest, unit = text, other
    return f"{shortest} {unit}"


_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf))\s*(?P<unit>(?:1\s*/\s*)?[^\d\s.+-].{0,40})?\s*"
)


def _parse(text: str, expected: str, key: str | None) -> pint.Quantity[Any]:
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError("this is not a quantity", key=key, value=text, expected=expected)
    if match["unit"] is None:
        raise InputError("a unit is missing", key=key, value=text, expected=expected)
    try:
        unit = _unit(match["unit"].strip())
    except Exception as error:  # pint's parser lets several kinds of exception through
        raise InputError("this is not a quantity with a known unit", key=key, value=text, expected=expected) from error
    return registry().Quantity(float(match["number"]), unit)


def _unit_text(value: object) -> str:
    """Return the unit of a quantity in quotes, of a text as it stands there."""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    return f"'{match['unit'].strip()}'" if match else f"'{getattr(value, 'units', value):~P}'"


def quantity_type(dimension: str, minimum: float | None = None, exclusive: bool = False) -> Any:
    """Make a pydantic field type that reads text with a unit and holds an internal float.

    With `minimum`, smaller values are refused (`exclusive`: equal ones too). The field is written back as
    text with its internal unit, and its JSON Schema is a string. A default is given as text too, with
    ``validate_default=True``: the schema shows it as it is, and an editor writes it into a case.
    """

    def read(value: object) -> float:
        number = to_internal(value, dimension)
        if minimum is not None and (number < minimum or (exclusive and number == minimum)):
            bound = "greater than" if exclusive else "at least"
            raise InputError(
                f"the {dimension} must be {bound} {minimum:g} {INTERNAL_UNITS[dimension]}",
                value=value,
            )
        return number

    return Annotated[
        float,
        BeforeValidator(_as_value_error(read)),
        PlainSerializer(functools.partial(to_text, dimension=dimension), return_type=str),
        WithJsonSchema({"type": "string", "description": f"{dimension} with unit", "examples": [EXAMPLES[dimension]]}),
    ]


def _as_value_error(read: Callable[[object], float]) -> Callable[[object], float]:
    # pydantic collects ValueErrors with the place where each occurred, which is what the message needs.
    @functools.wraps(read)
    def wrapped(value: object) -> float:
        try:
            return read(value)
        except InputError as error:
            raise ValueError(str(error)) from error

    return wrapped


Length = quantity_type("length")
PositiveLength = quantity_type("length", 0.0, exclusive=True)
NonNegativeLength = quantity_type("length", 0.0)
PositiveArea = quantity_type("area", 0.0, exclusive=True)
Pressure = quantity_type("pressure")
PositivePressure = quantity_type("pressure", 0.0, exclusive=True)
Force = quantity_type("force")
Stiffness = quantity_type("stiffness", 0.0, exclusive=True)
BendingStiffness = quantity_type("bending stiffness", 0.0, exclusive=True)
Foundation = quantity_type("stiffness per area", 0.0, exclusive=True)
Density = quantity_type("density", 0.0, exclusive=True)
Acceleration = quantity_type("acceleration")
Compliance = quantity_type("compliance", 0.0, exclusive=True)
Angle = quantity_type("angle")
Time = quantity_type("time", 0.0)
