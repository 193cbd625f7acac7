"""Measured positions of markers: a table in a file with a header that names columns and units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.materials.columns import header_unit
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
        If the file cannot be read, a column or unit is missing, a cell is no number, or a marker is missing or twice
        at a pressure.
    """
    table = read_table(file, _is_header, _lacks)
    columns = _columns(table.header)
    factors = {name: _factor(table, place, name) for name, place in columns.items() if name != "marker"}
    numbers = {name: np.array(table.numbers(place)) * factors.get(name, 1.0) for name, place in columns.items()}
    for name, values in numbers.items():
        if not np.isfinite(values).all():
            row = table.rows[int(np.argmin(np.isfinite(values)))].number
            raise InputError("a cell is empty", file=file, key=f"row {row}, column '{table.header[columns[name]]}'")
    pressures = np.unique(numbers["pressure"])
    markers = numbers["marker"]
    count = int(markers.max())
    places = np.full((len(pressures), count, 3), math.nan)
    at = np.searchsorted(pressures, numbers["pressure"])
    for place, step, marker in zip(table.rows, at, markers, strict=True):
        if marker != int(marker) or marker < 1 or not np.isnan(places[step, int(marker) - 1, 0]):
            expected = "whole numbers from 1, each once at a pressure"
            raise InputError("this marker is not one more", file=file, key=f"row {place.number}", expected=expected)
        places[step, int(marker) - 1] = 0.0
    if np.isnan(places).any():
        step, marker, _ = np.argwhere(np.isnan(places))[0]
        problem = f"marker {marker + 1} is missing at {pressures[step] * 1000.0:.4g} kPa"
        raise InputError(problem, file=file, expected=f"{count} markers at each pressure")
    for axis, name in enumerate(_AXES):
        if name in numbers:
            places[at, markers.astype(int) - 1, axis] = numbers[name]
    return MeasuredPositions(pressures, places, np.array([name in numbers for name in _AXES]))


def _columns(cells: Sequence[str]) -> dict[str, int]:
    """Return the place of each column that is known by its name."""
    names = [header_unit(cell)[0].strip().lower() for cell in cells]
    return {name: names.index(name) for name in ("pressure", "marker", *_AXES) if name in names}


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
