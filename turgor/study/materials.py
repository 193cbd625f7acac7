"""Materials as a case file names them: from the library, by constants, or fitted to tests."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, ValidationInfo, model_validator

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.units import Compliance, Density, PositivePressure, to_internal
from turgor.materials import Hyperelastic, create, find_model
from turgor.materials.fit import fit, parse_strain_range
from turgor.materials.fit_result import FitReport
from turgor.materials.library import find
from turgor.materials.registry import is_model_file
from turgor.study.specimen import SpecimenCase, check_once
from turgor.study.validation import StrictModel, collected, invalid, under

log = logger("study")


def in_case_folder(value: object, info: ValidationInfo, kind: str = "CSV", key: str | None = None) -> Path:
    """Read a path relative to the case file's folder and make sure that the file, of some `kind`, is there."""
    if not isinstance(value, (str, Path)) or not str(value):
        raise invalid("this is not a file name", key=key, value=value, expected=f"the path of a {kind} file")
    folder = (info.context or {}).get("folder", Path())
    path: Path = folder / Path(value).expanduser()
    if not path.is_file():
        problem = "this is a folder" if path.is_dir() else "there is no such file"
        expected = f"a {kind} file, its path relative to the case file"
        raise invalid(problem, key=key, value=str(value), expected=expected)
    return path


def _test_file(value: object, info: ValidationInfo) -> Path:
    return in_case_folder(value, info)


def _as_list(value: object) -> object:
    return [value] if isinstance(value, (str, Path)) else value


def _known_model(name: str, info: ValidationInfo) -> str:
    if is_model_file(name):
        return str(in_case_folder(name, info, "YAML"))
    with collected():
        return name if name == ALL else find_model(name).name


def _written(model: str, files: Mapping[Path, str]) -> str:
    """Return the name of a model to write, of a file that of its copy."""
    return files.get(Path(model), model) if is_model_file(model) else model


def _model_files(models: Iterable[str]) -> tuple[Path, ...]:
    return tuple(Path(model) for model in models if is_model_file(model))


def _known_set(name: str) -> str:
    with collected():
        return find(name).name


def _strain_range(text: str) -> str:
    with collected():
        parse_strain_range(text)
    return text


ALL = "all"
"""Stands for every model where a fit may choose."""

ModelName = Annotated[str, AfterValidator(_known_model)]
StrainRange = Annotated[str, AfterValidator(_strain_range)]
DataFile = Annotated[Path, BeforeValidator(_test_file)]


class _Compressible(StrictModel):
    """How much a material changes its volume; left out, it is nearly incompressible."""

    bulk_modulus: PositivePressure | None = None
    D1: Compliance | None = Field(default=None, description="2 / bulk modulus, as Abaqus and ANSYS print it")
    poisson: float | None = Field(default=None, strict=True, description="Poisson's ratio at small strain")
    density: Density | None = None

    @model_validator(mode="after")
    def _one_volume_change(self) -> Self:
        given = [key for key in ("bulk_modulus", "D1", "poisson") if getattr(self, key) is not None]
        if len(given) > 1:
            raise invalid(
                "the compressibility is given twice", key=given[1], expected=f"only one of {', '.join(given)}"
            )
        return self

    def volume_change(self) -> dict[str, Any]:
        """Return the keyword arguments that say so to :func:`turgor.materials.create`."""
        return {"bulk_modulus": self.bulk_modulus, "D1": self.D1, "poisson": self.poisson, "density": self.density}


class ModelMaterial(_Compressible):
    """A model with its constants, each with its unit: ``{model: yeoh-1, constants: {C10: 0.05 MPa}}``.

    The name of a user's model is the path of its file.
    """

    model: ModelName
    constants: dict[str, str | float | int]
    convention: Literal["abaqus", "ogden"] | None = Field(default=None, description="how Ogden's constants are printed")

    def build(self) -> Hyperelastic:
        """Return the material; raise InputError if a constant is missing, unknown, without its unit or absurd."""
        kind = find_model(self.model)
        values: dict[str, object] = dict(self.constants)
        for constant in kind.constants():
            if constant.dimension != "number" and constant.name in values:
                key = f"constants.{constant.name}"
                values[constant.name] = to_internal(values[constant.name], constant.dimension, key=key)
        try:
            return create(kind, values, convention=self.convention, **self.volume_change())
        except InputError as error:
            is_constant = error.key and error.key not in type(self).model_fields
            raise under(error, "constants") if is_constant else error from error

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of a user's model."""
        return _model_files([self.model])

    def renamed(self, files: Mapping[Path, str]) -> dict[str, Any]:
        """Return the keys that name files, with the names of their copies."""
        return {"model": _written(self.model, files)}


class LibraryMaterial(StrictModel):
    """A published set of constants by its name in the library (``turgor materials`` lists them)."""

    library: Annotated[str, AfterValidator(_known_set)]
    density: Density | None = None

    def build(self) -> Hyperelastic:
        """Return the material; raise InputError if the library has none of that name."""
        entry = find(self.library)
        if entry.unusable:
            log.warning("%s: %s", entry.name, entry.unusable)
        return entry.build if self.density is None else dataclasses.replace(entry.build, density=self.density)

    @property
    def files(self) -> tuple[Path, ...]:
        """None."""
        return ()

    def renamed(self, files: Mapping[Path, str]) -> dict[str, Any]:
        """Return no keys, as none names a file."""
        del files
        return {}


class FittedMaterial(_Compressible):
    """The best of some models, fitted to tensile tests."""

    fit: Annotated[tuple[DataFile, ...], BeforeValidator(_as_list), Field(min_length=1)]
    models: Annotated[tuple[ModelName, ...], Field(min_length=1)] = (ALL,)
    strain_range: StrainRange | None = Field(
        default=None, pattern=r"^[^:]*:[^:]*$", description="strains from a to b, as 'a:b'"
    )
    error: Literal["absolute", "relative"] = Field(default="absolute", description="how a residual counts")
    weights: tuple[float, ...] | None = Field(default=None, description="one factor for each test")
    stability: Literal["prefer", "require", "ignore"] = Field(default="prefer", description="of the fits")
    specimen: SpecimenCase = Field(default=SpecimenCase(), description="what the files do not say")

    def fitted(self) -> FitReport:
        """Return the fit; raise InputError as :func:`turgor.materials.fit.fit` does, or if a file stands twice."""
        check_once(self.fit)
        return fit(
            [test for file in self.fit for test in self.specimen.read(file)],
            self.models,
            strain_range=self.strain_range,
            error=self.error,
            weights=self.weights,
            stability=self.stability,
        )

    def build(self, report: FitReport) -> Hyperelastic:
        """Return the recommended material of the fit with the density asked for here.

        So with the compressibility; where none is, with that of the tests if they tell it.
        """
        best, asked = report.best, self.volume_change()
        if report.measured_volume and all(asked[key] is None for key in ("bulk_modulus", "D1", "poisson")):
            asked["bulk_modulus"] = best.bulk_modulus
        return create(type(best), best.parameters, **asked)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of the tests and of the user's models."""
        return (*self.fit, *_model_files(self.models))

    def renamed(self, files: Mapping[Path, str]) -> dict[str, Any]:
        """Return the keys that name files, with the names of their copies."""
        tests = [files.get(path, str(path)) for path in self.fit]
        return {"fit": tests, "models": [_written(model, files) for model in self.models]}


_KINDS: dict[str, type[StrictModel]] = {"library": LibraryMaterial, "model": ModelMaterial, "fit": FittedMaterial}


def _source(value: object) -> str | None:
    """Return the tag of the kind of material; parenthesised, because the key paths of messages leave tags out."""
    for key, kind in _KINDS.items():
        if isinstance(value, kind) or (isinstance(value, dict) and key in value):
            return f"({key})"
    return None


MaterialChoice = Annotated[
    Annotated[LibraryMaterial, Tag("(library)")]
    | Annotated[ModelMaterial, Tag("(model)")]
    | Annotated[FittedMaterial, Tag("(fit)")],
    Discriminator(
        _source,
        custom_error_type="material",
        custom_error_message="this is not a material",
        custom_error_context={"expected": "one of the keys library, model and fit"},
    ),
]


def build_materials(
    choices: Mapping[str, LibraryMaterial | ModelMaterial | FittedMaterial],
) -> tuple[dict[str, Hyperelastic], FitReport | None]:
    """Return the material of each region, and the fit of the first that was fitted.

    Raises
    ------
    InputError
        With the key under ``materials``; an error in a data file names that file instead.
    """
    materials: dict[str, Hyperelastic] = {}
    first: FitReport | None = None
    for region, choice in choices.items():
        try:
            if isinstance(choice, FittedMaterial):
                found = choice.fitted()
                first = first or found
                for test in found.tests:
                    for text in test.warnings:
                        log.warning("%s: %s", test.file, text)
                materials[region] = choice.build(found)
            else:
                materials[region] = choice.build()
        except InputError as error:
            raise error if error.file else under(error, f"materials.{region}") from error
    return materials, first
