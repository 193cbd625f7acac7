"""Tables of time against pressure, written out in a case file or in a CSV file of their own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

from pydantic import Field, GetJsonSchemaHandler, ValidationInfo, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from turgor.common.errors import InputError
from turgor.common.units import INTERNAL_UNITS, Pressure, Time, to_internal, to_text
from turgor.fem.programme import Programme
from turgor.materials.columns import header_unit, plain_names, refuse_twins
from turgor.materials.tabular import EXPECTED_HEADER, Table, read_table
from turgor.study.materials import in_case_folder
from turgor.study.validation import StrictModel, invalid


class ProgrammeCase(StrictModel):
    """Pressures at given times, straight lines between them."""

    time: tuple[Time, ...] = Field(min_length=2)
    pressure: tuple[Pressure, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _is_a_programme(self) -> Self:
        if len(self.time) != len(self.pressure):
            found = f"{len(self.time)} times, {len(self.pressure)} pressures"
            raise invalid("not as many pressures as times", value=found, expected="one pressure for each time")
        if self.time[0] != 0.0 or self.pressure[0] != 0.0:
            start = f"{to_text(self.time[0], 'time')}, {to_text(self.pressure[0], 'pressure')}"
            raise invalid("a programme starts from rest", value=start, expected="0 s and a pressure of 0 first")
        for number, (earlier, later) in enumerate(itertools.pairwise(self.time), start=1):
            if not later > earlier:
                raise invalid("times must ascend", key=f"time.{number}", value=to_text(later, "time"))
        return self

    @property
    def duration(self) -> float:
        """The last time, s."""
        return float(self.time[-1])

    @property
    def peak(self) -> float:
        """The pressure of largest size, MPa."""
        return float(max(self.pressure, key=abs))

    def over(self, duration: float) -> Programme:
        """Return the factors of the peak over the part of a `duration` in s; at its end a pressure is held."""
        times, pressures = [*self.time], [*self.pressure]
        if times[-1] < duration:
            times, pressures = [*times, duration], [*pressures, pressures[-1]]
        peak = self.peak or 1.0
        return Programme(tuple(t / duration for t in times), tuple(p / peak for p in pressures))

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        written = handler(core)
        file = {"type": "string", "description": "CSV file with times and pressures, relative to the case file"}
        column = {"type": "string", "description": "header of the pressures; left out, the cavity's name or 'pressure'"}
        from_file = {
            "type": "object",
            "properties": {"file": file, "column": column},
            "required": ["file"],
            "additionalProperties": False,
        }
        return {"anyOf": [written, from_file]}


def written_out(value: object, cavity: object, info: ValidationInfo) -> object:
    """Return ``{file: …, column: …}`` as the times and pressures that the file holds; anything else passes."""
    if not (isinstance(value, dict) and "file" in value):
        return value
    others = set(value) - {"file", "column"}
    if others:
        raise invalid("this does not go with a file", key=f"programme.{min(others)}", expected="only file and column")
    path = in_case_folder(value["file"], info, key="programme.file")
    wanted = [str(value["column"])] if "column" in value else [str(cavity), "pressure"]
    try:
        return _read(path, wanted)
    except InputError as error:
        raise ValueError(error.problem) from error


def _read(path: Path, wanted: Sequence[str]) -> dict[str, Any]:
    def lacking(cells: Sequence[str]) -> str | None:
        names = plain_names(cells)
        if "time" not in names:
            return "there is no column 'time'" if _is_any(names, wanted) else None
        return None if _is_any(names, wanted) else f"there is no column {' or '.join(repr(name) for name in wanted)}"

    def fits(cells: Sequence[str]) -> bool:
        return "time" in plain_names(cells) and _is_any(plain_names(cells), wanted)

    try:
        table = read_table(path, fits, lacking)
    except InputError as error:
        header = f"a header such as 'time (s),{wanted[0]} (kPa)' above the numbers"
        expected = header if error.expected in (None, EXPECTED_HEADER) else error.expected
        problem = error.problem if "strain" not in error.problem else "no header with a time and a pressure was found"
        raise InputError(problem, file=error.file, key=error.key, value=error.value, expected=expected) from None
    names = plain_names(table.header)
    pressure = next(name.lower() for name in wanted if name.lower() in names)
    for known in ("time", pressure):
        refuse_twins([(i, table.header[i]) for i, name in enumerate(names) if name == known], known, path)
    return {
        "time": _column(table, names.index("time"), "time"),
        "pressure": _column(table, names.index(pressure), "pressure"),
    }


def _is_any(names: Sequence[str], wanted: Sequence[str]) -> bool:
    return any(name.lower() in names for name in wanted)


def _column(table: Table, index: int, dimension: str) -> list[str]:
    label = table.header[index]
    unit = header_unit(label)[1]
    key = f"column '{label}'"
    if not unit:
        expected = f"the unit in the header, such as '{label} ({INTERNAL_UNITS[dimension]})'"
        raise InputError("the unit is missing", file=table.file, key=key, expected=expected)
    numbers = table.numbers(index)
    if any(math.isnan(number) for number in numbers):
        raise InputError("a number is missing", file=table.file, key=key, expected="one in every row")
    try:
        return [to_text(to_internal(f"{number!r} {unit}", dimension), dimension) for number in numbers]
    except InputError as error:
        raise InputError(error.problem, file=table.file, key=key, value=error.value, expected=error.expected) from None
