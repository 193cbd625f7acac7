"""Tables in text files as testing machines write them: separators, decimal commas, metadata, units in the header."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from turgor.common.errors import InputError

DELIMITERS = (";", "\t", ",")

_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
EXPECTED_HEADER = (
    "a row such as 'Engineering Strain;Engineering Stress (MPa)' above the numbers, its cells separated by ';', ',' "
    "or a tab"
)
_MISSING = {"", "nan", "na", "n/a", "-", "--", "null", "none", "#n/a", "inf", "+inf", "-inf", "infinity"}


@dataclass(frozen=True)
class Row:
    """One row of cells and its number in the file, counted from one."""

    number: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """A header, the rows under it, and what stood above it.

    ``metadata`` holds the two first cells of each row above the header, ``comments`` the lines that begin with ``#``.
    """

    file: Path
    header: tuple[str, ...]
    rows: tuple[Row, ...]
    metadata: dict[str, str]
    comments: tuple[str, ...]
    delimiter: str
    decimal_comma: bool

    def text(self, column: int) -> list[str]:
        """Return the cells of one column, stripped; empty where a row is short."""
        return [row.cells[column].strip() if column < len(row.cells) else "" for row in self.rows]

    def numbers(self, column: int) -> list[float]:
        """Return one column as numbers, NaN where a cell is empty or says that the value is missing.

        Raises
        ------
        InputError
            If a cell holds something else than a number.
        """
        return [self._number(cell, row.number, column) for cell, row in zip(self.text(column), self.rows, strict=True)]

    def _number(self, cell: str, row: int, column: int) -> float:
        if cell.lower() in _MISSING:
            return math.nan
        if not _NUMBER.fullmatch(cell):
            raise InputError(
                "this cell is not a number",
                file=self.file,
                key=f"row {row}, column '{self.header[column]}'",
                value=cell,
                expected="a number such as 0.25 (or an empty cell where the value is missing)",
            )
        return float(cell.replace(",", "."))


def read_lines(path: str | Path) -> list[str]:
    """Return the lines of a text file, whatever its encoding.

    Raises
    ------
    InputError
        If there is no such file, it is empty, cannot be read or is not text.
    """
    file = Path(path)
    expected = "a CSV file with a header that names the columns and their units"
    if not file.exists():
        raise InputError("there is no such file", file=file, expected=expected)
    if not file.is_file():
        raise InputError("this is not a file", file=file, expected=expected)
    try:
        content = file.read_bytes()
    except OSError as error:
        raise InputError(f"the file cannot be read ({error.strerror})", file=file, expected=expected) from error
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif b"\x00" in content or content.startswith((b"PK\x03\x04", b"%PDF")):
        raise InputError("this is not a text file", file=file, expected=expected + " (save a spreadsheet as CSV)")
    else:
        encoding = "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if not text.strip():
        raise InputError("the file is empty", file=file, expected=expected)
    return text.splitlines()


def read_table(
    path: str | Path, is_header: Callable[[Sequence[str]], bool], lacks: Callable[[Sequence[str]], str | None]
) -> Table:
    """Read the table whose header row `is_header` recognises.

    Parameters
    ----------
    path
        The file.
    is_header
        Says of a row of stripped cells whether it is the header.
    lacks
        Says what a row that looks like a header lacks; ``None`` for any other row.

    Raises
    ------
    InputError
        If the file cannot be read, no header is recognised, no rows stand under it, a row has more cells than the
        header, or what its commas and points mean is open.
    """
    file = Path(path)
    lines = read_lines(file)
    comments = tuple(line.lstrip("# ").rstrip() for line in lines if line.lstrip().startswith("#"))
    numbered = [(n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    for delimiter in DELIMITERS:
        rows = [Row(n, _split(line, delimiter)) for n, line in numbered]
        position = next((i for i, row in enumerate(rows) if is_header(row.cells)), None)
        if position is not None:
            return _below(file, rows, position, comments, delimiter)
    for delimiter in DELIMITERS:
        for n, line in numbered:
            lacking = lacks(_split(line, delimiter))
            if lacking:
                raise InputError(lacking, file=file, key=f"row {n}", value=line.strip(), expected=EXPECTED_HEADER)
    raise InputError(
        "no header with a strain and a stress (or a displacement and a force) was found",
        file=file,
        key=f"row {numbered[0][0]}" if numbered else None,
        value=numbered[0][1].strip() if numbered else None,
        expected=EXPECTED_HEADER,
    )


def _split(line: str, delimiter: str) -> tuple[str, ...]:
    try:
        cells = next(csv.reader([line], delimiter=delimiter))
    except csv.Error:
        cells = line.split(delimiter)
    return tuple(cell.strip() for cell in cells)


def _below(file: Path, rows: list[Row], position: int, comments: tuple[str, ...], delimiter: str) -> Table:
    header = rows[position].cells
    body = [row for row in rows[position + 1 :] if any(row.cells)]
    _refuse_surplus(file, header, body)
    if body and _is_unit_row(body[0].cells, header):
        header = tuple(
            f"{name} {unit}" if unit.startswith(("(", "[")) else f"{name} ({unit})" if unit else name
            for name, unit in zip(header, (*body[0].cells, *[""] * len(header)), strict=False)
        )
        body = body[1:]
    if not body:
        raise InputError("there are no rows under the header", file=file, key=f"row {rows[position].number}")
    cells = [cell for row in body for cell in row.cells]
    comma = any("," in cell for cell in cells if _NUMBER.fullmatch(cell))
    point = any("." in cell for cell in cells if _NUMBER.fullmatch(cell))
    if comma and point:
        raise InputError(
            "decimal commas and decimal points are mixed",
            file=file,
            expected="one of the two (and no separators of thousands)",
        )
    if comma and delimiter != ",":
        _refuse_thousands(file, header, body)
    metadata = {row.cells[0]: row.cells[1] for row in rows[:position] if len(row.cells) > 1 and row.cells[0]}
    return Table(file, header, tuple(body), metadata, comments, delimiter, comma)


def _refuse_surplus(file: Path, header: Sequence[str], body: Sequence[Row]) -> None:
    """Refuse a row with a cell beyond the header: its numbers would be read under the wrong names."""
    for row in body:
        if any(row.cells[len(header) :]):
            raise InputError(
                "this row has more cells than the header",
                file=file,
                key=f"row {row.number}",
                value=f"{len(row.cells)} cells under {len(header)}",
                expected="as many cells as the header (a decimal comma needs ';' or a tab between cells)",
            )


def _refuse_thousands(file: Path, header: Sequence[str], body: Sequence[Row]) -> None:
    """Refuse commas that may separate thousands as well as decimals.

    One comma that cannot stand behind thousands, as in 0,125 or 1,5, shows that all of the file are decimal.
    """
    places = [(row, i, cell) for row in body for i, cell in enumerate(row.cells) if "," in cell]
    places = [(row, i, cell) for row, i, cell in places if _NUMBER.fullmatch(cell)]
    if all(_THOUSANDS.fullmatch(cell) for _, _, cell in places):
        row, i, cell = places[0]
        raise InputError(
            "this comma may separate thousands or decimals, and so may every other in the file",
            file=file,
            key=f"row {row.number}, column '{header[i]}'",
            value=cell,
            expected=f"{cell.replace(',', '')} or {cell.replace(',', '.')}",
        )


def _is_unit_row(cells: Sequence[str], header: Sequence[str]) -> bool:
    """Say whether the row under the header holds units: short texts, no number, one for most columns."""
    filled = [cell for cell in cells if cell]
    return (
        len(filled) >= max(1, len([name for name in header if name]) // 2)
        and not any(_NUMBER.fullmatch(cell) or cell.lower() in _MISSING for cell in filled)
        and all(len(cell) <= 12 for cell in filled)
        and any(
            re.fullmatch(r"[\[(]?(N|kN|mN|mm|m|cm|s|sec|%|k?Pa|MPa|psi|mm/mm|N/mm.?2|1|-)[\])]?", c) for c in filled
        )
    )
