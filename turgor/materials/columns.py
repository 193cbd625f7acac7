"""What a column of a test file holds, from its header: quantity, measure (engineering or true) and unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from turgor.common.errors import InputError
from turgor.common.units import INTERNAL_UNITS, to_internal

PLAIN = {"strain", "lateral strain", "shear", "volumetric strain"}
"""Quantities without dimension, which may stand without unit or in percent."""

DEFORMATIONS = {"strain", "stretch", "shear", "displacement", "volume ratio", "volumetric strain"}
LOADS = {"stress", "shear stress", "force", "pressure"}

DIMENSIONS: dict[str, str] = {
    "stress": "pressure",
    "shear stress": "pressure",
    "pressure": "pressure",
    "force": "force",
    "displacement": "length",
    "time": "time",
}

_WORDS: tuple[tuple[str, str], ...] = (
    ("mode", r"test|mode|test mode|loading|loading mode|test type|type of test"),
    ("specimen", r"specimen|sample|specimen no|sample no|probe|specimen id|sample id|specimen number"),
    ("time", r".*\btime\b.*|zeit|t"),
    ("cycle", r".*\bcycles?\b.*"),
    ("shear stress", r".*\bshear stress\b.*|tau"),
    ("shear", r".*\bshear strain\b.*|amount of shear|gamma"),
    ("lateral stretch", r".*\b(lateral|transverse|width|thickness) stretch\b.*"),
    ("lateral strain", r".*\b(lateral|transverse|width|thickness) strain\b.*"),
    ("volume ratio", r"j|.*\bvolume ratio\b.*|relative volume"),
    ("volumetric strain", r".*\b(volumetric|volume) strain\b.*"),
    ("stretch", r".*\b(stretch|stretch ratio|extension ratio|lambda|λ)\b.*"),
    ("strain", r".*\b(strain|dehnung)\b.*|e|eps|epsilon|ε"),
    ("pressure", r".*\b(pressure|druck)\b.*"),
    ("stress", r".*\b(stress|spannung)\b.*|s|sigma|σ|p11|pk1"),
    ("force", r".*\b(force|load|kraft)\b.*|f"),
    ("displacement", r".*\b(displacement|extension|elongation|crosshead|position|stroke|weg|travel)\b.*|d|u"),
)

_TRUE = re.compile(r"\b(true|cauchy|hencky|logarithmic|log)\b")
_NOMINAL = re.compile(r"\b(engineering|eng|nominal|technical|pk1|p11|piola)\b")
_ABOUT = re.compile(
    r"\b(rate|energy|error|deviation|dev|std|stdev|sd|uncertainty|variance|fehler|abweichung|standardabweichung)\b"
)
"""Words that make something else of a stress or strain: its rate, its scatter, its energy."""
_BRACKETS = re.compile(r"[\[({<]\s*([^\[\](){}<>]*(?:\([^()]*\))?[^\[\](){}<>]*)\s*[\])}>]\s*$")
_UNIT_SUFFIX = re.compile(
    r"(?:\s*/\s*|\s+in\s+|\s*,\s*|[\s_]+)"
    r"(k?Pa|MPa|GPa|psi|ksi|kgf/cm\^?2|N/mm\^?2|mN|kN|N|lbf|gf|kgf|mm/mm|mm|cm|m|inch|in|percent|%|s|sec|min)\s*$"
)
_SPELLINGS = {
    "n/mm2": "N/mm^2", "n/mm²": "N/mm^2", "kgf/cm2": "kgf/cm^2", "n/m2": "N/m^2", "gf": "gram_force",
    "kgf": "kilogram_force", "kgf/cm^2": "kilogram_force/cm^2", "lbf": "pound_force", "sec": "s", "mpa": "MPa",
    "kpa": "kPa", "pa": "Pa", "gpa": "GPa", "psi": "psi", "n": "N", "kn": "kN",
}  # fmt: skip
_PERCENT = {"%", "percent", "pct"}
_ONE = {"", "-", "1", "mm/mm", "m/m", "in/in", "-/-", "–"}


@dataclass(frozen=True)
class Column:
    """One understood column: its place, label, quantity, ``"true"``/``"engineering"``/``""``, and unit as printed."""

    index: int
    label: str
    quantity: str
    measure: str
    unit: str | None

    def scale(self, file: str) -> float:
        """Return the factor to internal units (1 for pure numbers, 0.01 for percent).

        Raises
        ------
        InputError
            If the unit is missing or not one of the quantity.
        """
        if self.quantity in PLAIN or self.quantity in ("stretch", "lateral stretch", "volume ratio"):
            return self._plain_scale(file)
        dimension = DIMENSIONS[self.quantity]
        key = f"column '{self.label}'"
        if self.unit is None or self.unit in _ONE:
            expected = f"the unit in the header, such as '{self.label} ({INTERNAL_UNITS[dimension]})'"
            raise InputError("the unit is missing", file=file, key=key, expected=expected)
        text = f"1 {_SPELLINGS.get(self.unit.lower(), self.unit)}"
        try:
            return to_internal(text, dimension, key=key)
        except InputError as error:
            expected = (
                f"a unit of {dimension}, such as '{self.label.split('(')[0].strip()} ({INTERNAL_UNITS[dimension]})'"
            )
            problem = f"'{self.unit}' is not a unit of {self.quantity}"
            raise InputError(problem, file=file, key=key, expected=expected) from error

    def _plain_scale(self, file: str) -> float:
        unit = (self.unit or "").lower()
        if unit in _ONE:
            return 1.0
        if unit in _PERCENT:
            return 0.01
        raise InputError(
            f"'{self.unit}' is not a unit of {self.quantity}",
            file=file,
            key=f"column '{self.label}'",
            expected="no unit, mm/mm or %",
        )


def understand(header: Sequence[str]) -> list[Column]:
    """Return the columns whose quantity is known from their `header`, in order."""
    columns = []
    for index, label in enumerate(header):
        name, unit = header_unit(label)
        words = re.sub(r"[\s_\-.:]+", " ", name).strip().lower()
        quantity = next((q for q, pattern in _WORDS if re.fullmatch(pattern, words)), None)
        if quantity is None or _ABOUT.search(words):
            continue
        measure = "true" if _TRUE.search(words) else "engineering" if _NOMINAL.search(words) else ""
        columns.append(Column(index, label.strip(), quantity, measure, unit))
    return columns


def is_header(cells: Sequence[str]) -> bool:
    """Say whether a row names a deformation and a load: the header of a test."""
    quantities = {column.quantity for column in understand(cells)}
    return bool(quantities & DEFORMATIONS and quantities & LOADS)


def lacks(cells: Sequence[str]) -> str | None:
    """Say what a row lacks that names a deformation or a load, but not both; ``None`` for any other row."""
    columns = understand(cells)
    quantities = {column.quantity for column in columns}
    if len(cells) < 2 or not quantities & (DEFORMATIONS | LOADS):
        return None
    names = ", ".join(f"'{column.label}'" for column in columns)
    if quantities & DEFORMATIONS:
        return f"there is no column of stress or force (understood: {names})"
    return f"there is no column of strain, stretch or displacement (understood: {names})"


def find(columns: Sequence[Column], quantity: str, measure: str | None = None) -> Column | None:
    """Return the first column of a quantity (and measure), or ``None``.

    Raises
    ------
    InputError
        If another column has the same quantity and the same measure.
    """
    found = matching(columns, quantity, measure)
    if not found:
        return None
    alike = [column for column in found if column.measure == found[0].measure]
    refuse_twins([(column.index, column.label) for column in alike], quantity)
    return found[0]


def matching(columns: Sequence[Column], quantity: str, measure: str | None = None) -> list[Column]:
    """Return all columns of a quantity (and measure)."""
    return [column for column in columns if column.quantity == quantity and measure in (None, column.measure)]


def refuse_twins(alike: Sequence[tuple[int, str]], what: str, file: Path | None = None) -> None:
    """Refuse more than one of the columns, given by place and label, that are understood `alike`.

    Raises
    ------
    InputError
        Naming the first two; nothing says which of them is meant.
    """
    if len(alike) > 1:
        (i, first), (j, second) = alike[:2]
        raise InputError(
            f"two columns hold the {what}",
            file=file,
            key=f"columns {i + 1} and {j + 1}",
            value=f"'{first}' and '{second}'",
            expected="one of the two (remove or rename the other)",
        )


def plain_names(header: Sequence[str]) -> list[str]:
    """Return the names of a header's cells without their units, in small letters."""
    return [header_unit(label)[0].strip().lower() for label in header]


def header_unit(label: str) -> tuple[str, str | None]:
    """Split a header into its name and its unit, ``None`` if it has none."""
    match = _BRACKETS.search(label) or _UNIT_SUFFIX.search(label)
    if match is None:
        return label, None
    return label[: match.start()], match.group(1).strip()
