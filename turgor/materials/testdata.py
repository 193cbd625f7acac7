"""Reading of test files as laboratories have them: columns, units, modes, engineering or true, specimens."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.materials.cleaning import Curve, clean, numbered
from turgor.materials.columns import Column, find, header_unit, is_header, lacks, matching, understand
from turgor.materials.kinematics import Array
from turgor.materials.measurement import CROSSHEAD_WARNING, MINIMUM_POINTS, MODES, TOE_LIMIT, MaterialTest, Specimen
from turgor.materials.tabular import Table, read_table

LARGEST_BARE_STRAIN = 25.0
"""A strain above it without unit is taken for percent and refused."""

WIDENING = 0.05
"""Lateral strain over strain beyond which a specimen is said to widen; what is measured of one that hardly contracts
scatters about zero."""

PAIR_TOLERANCE = 0.02
"""Largest relative difference between a true value and the one that follows from the engineering columns."""


def read_tests(path: str | Path, specimen: Specimen | None = None) -> tuple[MaterialTest, ...]:
    """Read the tests of one file, one for each mode and specimen that its columns name.

    Parameters
    ----------
    path
        A text file with a header that names columns and units; see ``docs/theory/materials.md``.
    specimen
        What the file does not say.

    Raises
    ------
    InputError
        Naming file, row or column, and what would be right.
    """
    table = read_table(path, is_header, lacks)
    known = specimen or Specimen()
    columns = understand(table.header)
    try:
        return tuple(
            _Reading(table, columns, known, word, name, rows).test() for word, name, rows in _groups(table, columns)
        )
    except InputError as error:
        raise error.at(file=table.file) from error


def _groups(table: Table, columns: Sequence[Column]) -> list[tuple[str, str, list[int]]]:
    """Split the rows by the word for their mode and by specimen, in the order in which these appear."""
    mode_column, specimen_column = find(columns, "mode"), find(columns, "specimen")
    modes = table.text(mode_column.index) if mode_column else [""] * len(table.rows)
    names = table.text(specimen_column.index) if specimen_column else [""] * len(table.rows)
    groups: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(modes, names, strict=True)):
        groups.setdefault(key, []).append(i)
    return [(word, name, rows) for (word, name), rows in groups.items()]


_MODE_WORDS = {
    "uniaxial": r"uni.?axial.*|tension|tensile.*|compression|compressive.*|ut|uc|st",
    "equibiaxial": r".*bi.?axial.*|et|bt|eb|inflation|bulge.*",
    "planar": r"planar.*|pure.?shear|ps|pt",
    "simple-shear": r"simple.?shear|shear|ss",
    "volumetric": r"volum.*|hydrostatic.*|vol",
}
_COMPRESSION = r"compression|compressive.*|uc"


def _mode_of_word(word: str, file: str) -> str | None:
    if not word:
        return None
    for mode, pattern in _MODE_WORDS.items():
        if re.fullmatch(pattern, word.strip().lower()):
            return mode
    raise InputError("unknown kind of test", file=file, value=word, expected="one of " + ", ".join(MODES))


class _Reading:
    """One mode and specimen of a table on its way to a :class:`MaterialTest`."""

    def __init__(
        self, table: Table, columns: Sequence[Column], known: Specimen, word: str, name: str, chosen: list[int]
    ) -> None:
        self.table, self.columns, self.known = table, columns, known
        self.name, self.chosen = name, np.array(chosen)
        self.file = str(table.file)
        self.used: list[str] = []
        self.assumed: list[str] = []
        self.warnings: list[str] = []
        self.word = word
        self.mode = self._mode()

    def test(self) -> MaterialTest:
        deformation = self._deformation()
        stress = self._stress(deformation)
        lateral = self._lateral()
        rows = np.array([self.table.rows[i].number for i in self.chosen])
        self._check_deformation(deformation, rows)
        self._check_compression(deformation, stress, rows)
        curve, dropped, changed = clean(Curve(rows, deformation, stress, lateral))
        self._check_lateral(curve)
        if len(curve) < MINIMUM_POINTS:
            gone = "; ".join(f"{len(part.rows)} dropped ({part.reason})" for part in dropped)
            raise InputError(
                f"only {len(curve)} usable points are left of {len(rows)}" + (f": {gone}" if gone else ""),
                file=self.file,
                key=self.name or None,
                expected=f"at least {MINIMUM_POINTS} rows with a strain and a stress",
            )
        if not np.ptp(curve.deformation) > 0:
            raise InputError(
                "the strain is the same in all usable rows",
                file=self.file,
                key=f"column '{self.used[0]}'",
                value=float(curve.deformation[0]),
                expected="a strain that grows with the load",
            )
        shift = 0.0 if self.mode == "simple-shear" else 1.0
        source = self._strain_source()
        test = MaterialTest(
            mode=self.mode,
            stretch=curve.deformation + shift,
            stress=curve.stress,
            lateral=curve.lateral,
            name=self.name,
            file=self.file,
            strain_source=source,
            rows_read=len(rows),
            dropped=dropped,
            columns=tuple(self.used),
            assumed=tuple(self.assumed),
            warnings=(*self.warnings, *changed, *_missing_lateral(curve)),
        )
        if abs(test.toe) <= TOE_LIMIT:
            return test
        warning = (
            f"the first part of the curve meets zero stress at a strain of {test.toe:.2%}, not at rest (slack, or a "
            f"preload that was set to zero); the strain can be counted from there"
        )
        return replace(test, warnings=(*test.warnings, warning))

    def _mode(self) -> str:
        written = _mode_of_word(self.word, self.file)
        if written and self.known.mode and self.known.mode != written:
            raise InputError(
                f"the file says that this test is '{self.word}'",
                file=self.file,
                key="mode",
                value=self.known.mode,
                expected=f"'{written}', or no mode beside that of the file",
            )
        return self.known.mode or written or self._mode_of_columns()

    def _mode_of_columns(self) -> str:
        quantities = {column.quantity for column in self.columns}
        if quantities & {"volume ratio", "volumetric strain"}:
            return "volumetric"
        if "shear" in quantities:
            return "simple-shear"
        self.assumed.append("the test is uniaxial (the file does not say)")
        return "uniaxial"

    def _values(self, column: Column) -> Array:
        if column.label not in self.used:
            self.used.append(column.label)
        values: Array = np.array(self.table.numbers(column.index))[self.chosen]
        return values * column.scale(self.file)

    def _deformation(self) -> Array:
        """Engineering strain, the amount of shear, or J − 1."""
        if self.mode == "volumetric":
            return self._first({"volume ratio": lambda x: x - 1.0, "volumetric strain": lambda x: x})
        if self.mode == "simple-shear" and (column := find(self.columns, "shear") or find(self.columns, "strain")):
            return self._bare_checked(column)
        if column := find(self.columns, "stretch"):
            return self._values(column) - 1.0
        engineering = find(self.columns, "strain", "engineering") or find(self.columns, "strain", "")
        true = find(self.columns, "strain", "true")
        if engineering:
            if not engineering.measure:
                self.assumed.append(f"'{engineering.label}' is engineering strain")
            strain = self._bare_checked(engineering)
            if true:
                self._check_pair(true, np.log1p(np.maximum(strain, -0.999)), "strain")
            return strain
        if true:
            return np.expm1(self._bare_checked(true))
        return self._strain_from_displacement()

    def _first(self, readings: dict[str, Callable[[Array], Array]]) -> Array:
        for quantity, turn in readings.items():
            if column := find(self.columns, quantity):
                return turn(self._values(column))
        raise InputError(
            f"a column for this kind of test ({self.mode}) is missing",
            file=self.file,
            expected=" or ".join(f"'{quantity}'" for quantity in readings),
        )

    def _bare_checked(self, column: Column) -> Array:
        strain = self._values(column)
        if column.unit is None and np.nanmax(np.abs(strain), initial=0.0) > LARGEST_BARE_STRAIN:
            raise InputError(
                "this strain has no unit and looks like percent",
                file=self.file,
                key=f"column '{column.label}'",
                value=float(np.nanmax(np.abs(strain))),
                expected=f"'{column.label} (%)' or '{column.label} (mm/mm)' in the header",
            )
        return strain

    def _strain_from_displacement(self) -> Array:
        column = find(self.columns, "displacement")
        if column is None:
            raise InputError("there is no column of strain, stretch or displacement", file=self.file)
        length = self.known.gauge_length or self._metadata(r"gau?ge length|specimen length|length|l0", "length")
        if length is None:
            raise InputError(
                "the gauge length is not known, so that the displacement cannot become a strain",
                file=self.file,
                key=f"column '{column.label}'",
                expected="a row 'Gauge length (mm);33' above the header, or the gauge length as an option",
            )
        self.assumed.append(f"strain = displacement / gauge length of {length:g} mm")
        return self._values(column) / length

    def _stress(self, deformation: Array) -> Array:
        """Nominal stress in MPa."""
        if self.mode == "volumetric":
            return self._first({"pressure": lambda x: -x, "stress": lambda x: x})
        if self.mode == "simple-shear" and (column := find(self.columns, "shear stress")):
            return self._values(column)
        engineering = find(self.columns, "stress", "engineering")
        true = find(self.columns, "stress", "true")
        bare = None if engineering else find(self.columns, "stress", "")
        if bare is not None:
            strain_is_true = matching(self.columns, "strain", "true") and not matching(
                self.columns, "strain", "engineering"
            )
            if strain_is_true and true is None:
                true = bare
                self.assumed.append(f"'{bare.label}' is true stress, as the strain beside it is true")
            else:
                engineering = bare
                self.assumed.append(f"'{bare.label}' is engineering (nominal) stress")
        if engineering:
            stress = self._values(engineering)
            if true:
                self._check_pair(true, stress * self._area_ratio(deformation), "stress")
            return stress
        if true:
            # Incompressible: the area shrinks by 1/λ, so that P = σ/λ in every mode of tension.
            if self.mode != "simple-shear":
                self.assumed.append("the volume is constant (true stress turned into nominal)")
            return self._values(true) / self._area_ratio(deformation)
        return self._stress_from_force()

    def _area_ratio(self, deformation: Array) -> Array:
        """How often the loaded area goes into the undeformed one: λ, and one in simple shear, whose plane stays."""
        return np.ones_like(deformation) if self.mode == "simple-shear" else 1.0 + deformation

    def _stress_from_force(self) -> Array:
        column = find(self.columns, "force")
        if column is None:
            raise InputError("there is no column of stress or force", file=self.file)
        area = self.known.area or self._metadata(r".*(cross.?section|area).*", "area")
        if area is None:
            width = self._metadata(r"(specimen |sample )?width", "length")
            thickness = self._metadata(r"(specimen |sample )?thickness", "length")
            area = width * thickness if width and thickness else None
        if area is None:
            raise InputError(
                "the cross-section is not known, so that the force cannot become a stress",
                file=self.file,
                key=f"column '{column.label}'",
                expected="rows 'Width (mm);6' and 'Thickness (mm);3' above the header, or the area as an option",
            )
        self.assumed.append(f"nominal stress = force / undeformed cross-section of {area:g} mm²")
        return self._values(column) / area

    def _lateral(self) -> Array | None:
        if column := find(self.columns, "lateral stretch"):
            return self._values(column)
        if column := find(self.columns, "lateral strain"):
            strain = self._values(column)
            return np.exp(strain) if column.measure == "true" else 1.0 + strain
        return None

    def _metadata(self, pattern: str, dimension: str) -> float | None:
        """Find a dimension of the specimen above the header: 'Width (mm);6' or 'Width;6 mm'."""
        for key, value in self.table.metadata.items():
            name, unit = header_unit(key)
            if re.fullmatch(pattern, re.sub(r"[\s_:]+", " ", name).strip().lower()):
                text = value.replace(",", ".").strip()
                return to_internal(f"{text} {unit}" if unit else text, dimension, key=f"{self.file}: {key}")
        return None

    def _check_deformation(self, deformation: Array, rows: NDArray[np.int64]) -> None:
        if self.mode != "simple-shear":
            self._check_possible(deformation, rows, "strain", "engineering strain above -1, compression negative")

    def _check_possible(self, strain: Array, rows: NDArray[np.int64], quantity: str, expected: str) -> None:
        if np.any(strain <= -1.0):
            worst = int(np.nanargmin(strain))
            raise InputError(
                f"a {quantity} of -100 % or less is impossible",
                file=self.file,
                key=f"row {rows[worst]}",
                value=float(strain[worst]),
                expected=expected,
            )

    def _check_compression(self, deformation: Array, stress: Array, rows: Array) -> None:
        """Refuse a compression whose numbers are those of a tension; noise about zero has a right to be positive."""
        if not re.fullmatch(_COMPRESSION, self.word.lower()):
            return
        for quantity, values in (("strain", deformation), ("stress", stress)):
            if np.nanmax(values, initial=0.0) > -np.nanmin(values, initial=0.0):
                worst = int(np.nanargmax(values))
                raise InputError(
                    f"the {quantity} of this '{self.word}' is positive",
                    file=self.file,
                    key=f"row {rows[worst]}",
                    value=float(values[worst]),
                    expected="negative strains and stresses (or 'uniaxial' as the kind of test, if it is a tension)",
                )

    def _check_lateral(self, curve: Curve) -> None:
        """Refuse lateral strains that are impossible, and those that say that a specimen widens as it is stretched."""
        if curve.lateral is None or not np.any(np.isfinite(curve.lateral)):
            return
        strain = curve.lateral - 1.0
        self._check_possible(
            strain, curve.rows, "lateral strain", "lateral strains above -1, lateral stretches above 0"
        )
        widening = strain * curve.deformation
        if np.nansum(widening) > WIDENING * np.sum(curve.deformation**2):
            worst = int(np.nanargmax(widening))
            raise InputError(
                "the specimen widens as it is stretched",
                file=self.file,
                key=f"row {curve.rows[worst]}",
                value=float(f"{strain[worst]:.6g}"),
                expected="contraction as a negative lateral strain, or a lateral stretch below 1",
            )

    def _check_pair(self, true: Column, expected: Array, quantity: str) -> None:
        """Refuse true values that contradict the engineering ones."""
        difference = np.abs(self._values(true) - expected)
        allowed = PAIR_TOLERANCE * np.nanmax(np.abs(expected), initial=0.0)
        if np.any(difference > allowed):
            worst = int(np.nanargmax(difference))
            raise InputError(
                f"the columns of true and engineering {quantity} contradict each other",
                file=self.file,
                key=f"row {self.table.rows[self.chosen[worst]].number}, column '{true.label}'",
                value=float(self._values(true)[worst]),
                expected=f"{expected[worst]:.6g}, which follows from the engineering columns "
                "(remove the column that is wrong)",
            )

    def _strain_source(self) -> str:
        source = self.known.strain_source or self._stated_source()
        if source is None:
            if matching(self.columns, "displacement") and not matching(self.columns, "strain"):
                source = "crosshead"
                self.assumed.append("the displacement is the crosshead's (the file does not say)")
            else:
                source = "unknown"
                self.assumed.append("the source of the strain is not stated (extensometer, video or crosshead)")
        if source == "crosshead":
            self.warnings.append(CROSSHEAD_WARNING)
        return source

    def _stated_source(self) -> str | None:
        text = " ".join(
            [*(f"{k} {v}" for k, v in self.table.metadata.items()), *self.table.comments, *self.used]
        ).lower()
        patterns = {
            "crosshead": r"cross.?head|traverse|strain measurement global",
            "video": r"video|optical|camera|\bdic\b|image correlation",
            "extensometer": r"extensometer|extensometric",
        }
        return next((source for source, pattern in patterns.items() if re.search(pattern, text)), None)


def _missing_lateral(curve: Curve) -> list[str]:
    """Say in which rows the lateral strain is missing, if it is in some."""
    if curve.lateral is None or np.all(known := np.isfinite(curve.lateral)):
        return []
    return [f"the lateral strain is missing in {numbered(curve.rows[~known].tolist())}: the stress alone counts there"]
