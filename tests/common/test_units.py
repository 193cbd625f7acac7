"""Quantities with units at the border, plain floats inside."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from turgor.common.errors import InputError
from turgor.common.units import (
    EXAMPLES,
    INTERNAL_UNITS,
    Angle,
    PositiveLength,
    from_internal,
    quantity_type,
    registry,
    to_internal,
    to_text,
)


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("12 psi", "pressure", 0.0827370875),
        ("0.3bar", "pressure", 0.03),
        ("50 kPa", "pressure", 0.05),
        ("-1e1 kPa", "pressure", -0.01),
        ("1 in", "length", 25.4),
        (".5 cm", "length", 5.0),
        ("5 ml", "volume", 5000.0),
        ("1070 kg/m^3", "density", 1.07e-9),
        ("9.81 m/s^2", "acceleration", 9810.0),
        ("1.5 N", "force", 1.5),
        ("180 deg", "angle", math.pi),
        ("3 rad", "angle", 3.0),
        ("0.5 1/kPa", "compliance", 500.0),
        ("0.5 kPa^-1", "compliance", 500.0),
    ],
)
def test_text_becomes_the_internal_number(text: str, dimension: str, value: float) -> None:
    assert to_internal(text, dimension) == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("dimension", INTERNAL_UNITS)
def test_the_example_of_every_dimension_is_well_formed(dimension: str) -> None:
    assert math.isfinite(to_internal(EXAMPLES[dimension], dimension))


@pytest.mark.parametrize("dimension", INTERNAL_UNITS)
@given(number=st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12))
def test_what_is_written_is_read_back_to_the_last_bit(dimension: str, number: float) -> None:
    assert to_internal(to_text(number, dimension), dimension) == number


@pytest.mark.parametrize(
    ("text", "dimension"),
    [
        ("12 psi", "pressure"),
        ("50 kPa", "pressure"),
        ("51 deg", "angle"),
        ("3 mm", "length"),
        ("1.2542 MPa", "pressure"),
    ],
)
def test_what_people_write_is_written_as_they_do(text: str, dimension: str) -> None:
    assert to_text(to_internal(text, dimension), dimension) == text


def test_a_pint_quantity_is_taken() -> None:
    assert to_internal(registry().Quantity(2.0, "cm"), "length") == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("value", "dimension", "words"),
    [
        (3, "length", "a unit is missing"),
        (3.0, "length", "a unit is missing"),
        ("3", "length", "a unit is missing"),
        ("3", "angle", "a unit is missing"),
        ("3 kPa", "length", "'kPa' is not a unit of length"),
        ("3 mm", "pressure", "'mm' is not a unit of pressure"),
        ("3 furlongz", "length", "known unit"),
        ("nan mm", "length", "not finite"),
        ("inf mm", "length", "not finite"),
        ("1e999 mm", "length", "not finite"),
        ("mm", "length", "not a quantity"),
        ("", "length", "not a quantity"),
        ("1 + 2 mm", "length", "quantity"),
        ("__import__('os') mm", "length", "not a quantity"),
        ("2 mm; 3", "length", "known unit"),
        (None, "length", "not a quantity"),
        ([1], "length", "not a quantity"),
        ("9" * 400 + " mm", "length", "not finite"),
    ],
)
def test_what_is_no_quantity_is_refused(value: object, dimension: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        to_internal(value, dimension, key="geometry.wall")
    assert "geometry.wall" in str(refused.value)
    assert EXAMPLES[dimension] in str(refused.value)


def test_from_internal() -> None:
    assert from_internal(0.03, "pressure", "kPa") == pytest.approx(30.0)
    assert from_internal(0.03, "pressure") == 0.03


class Wall(BaseModel):
    thickness: PositiveLength
    turn: Angle = 0.0
    layer: quantity_type("length", 1.0) = 2.0  # type: ignore[valid-type]


def test_a_field_reads_and_writes_text() -> None:
    wall = Wall(thickness="0.1 in", turn="90 deg", layer="1 mm")
    assert wall.thickness == pytest.approx(2.54)
    assert Wall(**wall.model_dump(mode="json")) == wall
    assert Wall.model_json_schema()["properties"]["thickness"]["type"] == "string"


@pytest.mark.parametrize(
    ("values", "words"),
    [({"thickness": "0 mm"}, "greater than 0 mm"), ({"thickness": "1 mm", "layer": "0.9 mm"}, "at least 1 mm")],
)
def test_a_field_keeps_its_bound(values: dict[str, str], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Wall(**values)
