"""Measured positions of markers: a table in a file with a header that names columns and units."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.materials.columns import header_unit, plain_names, refuse_twins
from turgor.materials.tabular import Table, read_table

FloatArray = npt.NDArray[np.float64]

SAME_PRESSURE = 1e-3
"""A state is held against the row of the table whose pressure differs by no more than this part of the largest."""

_EXPECTED = "a header such as 'pressure (bar), marker, x (mm), y (mm), z (mm)'"
_AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class MeasuredPositions:
    """Where markers were at some pressures.

    Parameters
    ----------
    pressures
        Shape ``(p,)``, MPa, ascending.
    places
        Shape ``(p, markers, 3)``, mm; zero along what was not measured.
    measured
        Which of x, y and z were measured, ``(3,)``.
    """

    pressures: FloatArray
    places: FloatArray
    measured: npt.NDArray[np.bool_]

    def at(self, pressure: float) -> FloatArray | None:
        """Return the places ``(markers, 3)`` at a pressure in MPa; ``None`` where it was not measured at that one."""
        nearest = int(np.argmin(np.abs(self.pressures - pressure)))
        close = SAME_PRESSURE * float(np.abs(self.pressures).max())
        return self.places[nearest] if abs(self.pressures[nearest] - pressure) <= close else None


def read_positions(file: Path) -> MeasuredPositions:
    """Read a table of measured positions: one row for each marker at each pressure.

    Its columns are the ``pressure``, the number of the ``marker`` from 1, and ``x``, ``y`` and ``z`` or some of them,
    with their units in the header, in the coordinates of the model.

    Raises
    ------
    InputError
        If the file cannot be read, a column or unit is missing, two columns have one name, a cell is no number, a
        marker is none of the numbers from 1 to that of the rows, or one is missing or twice at a pressure.
    """
    table = read_table(file, _is_header, _lacks)
    columns = _columns(table.header)
    for name in columns:
        refuse_twins([(i, table.header[i]) for i, n in enumerate(plain_names(table.header)) if n == name], name, file)
    factors = {name: _factor(table, place, name) for name, place in columns.items() if name != "marker"}
    numbers = {name: np.array(table.numbers(place)) * factors.get(name, 1.0) for name, place in columns.items()}
    for name, values in numbers.items():
        if not np.isfinite(values).all():
            row = table.rows[int(np.argmin(np.isfinite(values)))].number
            raise InputError("a cell is empty", file=file, key=f"row {row}, column '{table.header[columns[name]]}'")
    pressures = np.unique(numbers["pressure"])
    markers = numbers["marker"]
    _check_markers(table, columns["marker"], markers)
    at = np.searchsorted(pressures, numbers["pressure"])
    _check_complete(table, at, markers, pressures)
    places = np.zeros((len(pressures), int(markers.max()), 3))
    for axis, name in enumerate(_AXES):
        if name in numbers:
            places[at, markers.astype(int) - 1, axis] = numbers[name]
    return MeasuredPositions(pressures, places, np.array([name in numbers for name in _AXES]))


def _columns(cells: Sequence[str]) -> dict[str, int]:
    """Return the place of each column that is known by its name."""
    names = plain_names(cells)
    return {name: names.index(name) for name in ("pressure", "marker", *_AXES) if name in names}


def _check_markers(table: Table, place: int, markers: FloatArray) -> None:
    """Refuse what is no marker's number: places are kept for as many markers as the largest of them says."""
    wrong = (markers != np.floor(markers)) | (markers < 1) | (markers > len(markers))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            "this is not the number of a marker",
            file=table.file,
            key=f"row {table.rows[row].number}, column '{table.header[place]}'",
            value=table.text(place)[row],
            expected=f"a whole number from 1 to that of the rows, {len(markers)}",
        )


def _check_complete(table: Table, at: npt.NDArray[np.intp], markers: FloatArray, pressures: FloatArray) -> None:
    """Refuse a marker that stands twice at a pressure or not at all; `at` is the row's place among the pressures."""
    count, seen = int(markers.max()), set()
    for row, pair in zip(table.rows, zip(at.tolist(), markers.tolist(), strict=True), strict=True):
        if pair in seen:
            expected = "whole numbers from 1, each once at a pressure"
            raise InputError("this marker is not one more", file=table.file, key=f"row {row.number}", expected=expected)
        seen.add(pair)
    every = itertools.product(range(len(pressures)), range(1, count + 1))
    missing = next((pair for pair in every if pair not in seen), None)
    if missing:
        problem = f"marker {missing[1]} is missing at {pressures[missing[0]] * 1000.0:.4g} kPa"
        raise InputError(problem, file=table.file, expected=f"{count} markers at each pressure")


def _is_header(cells: Sequence[str]) -> bool:
    found = _columns(cells)
    return "pressure" in found and "marker" in found and any(axis in found for axis in _AXES)


def _lacks(cells: Sequence[str]) -> str | None:
    """Say what a header lacks: it names a pressure or a marker but not both, or no coordinate."""
    found = _columns(cells)
    if not found:
        return None
    missing = [name for name in ("pressure", "marker") if name not in found] or ["x, y or z"]
    return f"there is no column '{missing[0]}'; {_EXPECTED} is needed"


def _factor(table: Table, place: int, name: str) -> float:
    """Return what the numbers of a column are multiplied by to be MPa or mm."""
    label = table.header[place]
    _, unit = header_unit(label)
    key, dimension = f"column '{label}'", "pressure" if name == "pressure" else "length"
    if unit is None:
        raise InputError("the unit is missing", file=table.file, key=key, expected=_EXPECTED)
    try:
        return to_internal(f"1 {unit}", dimension, key=key)
    except InputError as error:
        raise error.at(file=table.file) from error
