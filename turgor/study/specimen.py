"""What a tensile test's file does not say, as a case file or the command line says it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from turgor.common.errors import InputError
from turgor.common.units import PositiveArea, PositiveLength, PositivePressure
from turgor.materials.measurement import MaterialTest, Specimen
from turgor.materials.testdata import read_tests as read_file
from turgor.study.validation import StrictModel, explain, invalid


class SpecimenCase(StrictModel):
    """Kind of test, source of the strain and dimensions of the specimen, and corrections of the strain."""

    mode: Literal["uniaxial", "equibiaxial", "planar", "simple-shear", "volumetric"] | None = None
    strain_source: Literal["extensometer", "video", "crosshead", "unknown"] | None = None
    gauge_length: PositiveLength | None = Field(default=None, description="the length that strain was reckoned with")
    effective_gauge_length: PositiveLength | None = Field(
        default=None, description="the length that really stretched: strain is corrected to it"
    )
    area: PositiveArea | None = Field(default=None, description="cross-section, for files with forces")
    known_modulus: PositivePressure | None = Field(
        default=None, description="nominal stress at 100 % strain: strain is scaled so that the test meets it"
    )
    remove_toe: bool = Field(default=False, strict=True, description="count strain from where the toe ends")

    @model_validator(mode="after")
    def _corrected_once(self) -> Self:
        if self.effective_gauge_length is not None and self.gauge_length is None:
            raise invalid("the correction needs the gauge length that was used", key="gauge_length")
        if self.effective_gauge_length is not None and self.known_modulus is not None:
            raise invalid(
                "the strain is corrected twice", expected="only one of effective_gauge_length and known_modulus"
            )
        return self

    def read(self, path: str | Path) -> list[MaterialTest]:
        """Return the tests of one file, corrected; raise InputError naming the file."""
        said = Specimen(
            mode=self.mode, strain_source=self.strain_source, gauge_length=self.gauge_length, area=self.area
        )
        return [self._corrected(test) for test in read_file(path, said)]

    def _corrected(self, test: MaterialTest) -> MaterialTest:
        if self.remove_toe:
            test = test.with_toe_removed()
        if self.effective_gauge_length is not None and self.gauge_length is not None:
            test = test.with_gauge_length(self.gauge_length, self.effective_gauge_length)
        return test if self.known_modulus is None else test.with_known_modulus(self.known_modulus)


def check_once(files: Sequence[str | Path]) -> None:
    """Refuse a file of tests that stands twice: it would count double, and make the intervals narrower than they are.

    Raises
    ------
    InputError
        Naming the file.
    """
    places = [Path(file).resolve() for file in files]
    for number, place in enumerate(places):
        if place in places[:number]:
            expected = "each file once (its weight makes it count more)"
            raise InputError("this file of tests is given twice", file=files[number], expected=expected)


def read_tests(data: str | Path | Sequence[str | Path], **specimen: Any) -> list[MaterialTest]:
    """Return the tests of one or several files, for :func:`turgor.fit`.

    Parameters
    ----------
    data
        The files.
    specimen
        What they do not say, quantities as text with units: `mode`, `strain_source`, `gauge_length`, `area`; and how
        the strain is corrected: `effective_gauge_length`, `known_modulus`, `remove_toe`. ``None`` says nothing.

    Raises
    ------
    InputError
        If a file cannot be read or is given twice, or an argument is wrong.
    """
    said = {key: value for key, value in specimen.items() if value is not None}
    try:
        case = SpecimenCase.model_validate(said)
    except ValidationError as error:
        raise explain(error, said, SpecimenCase) from None
    files = [data] if isinstance(data, (str, Path)) else list(data)
    check_once(files)
    return [test for file in files for test in case.read(file)]
