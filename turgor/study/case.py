"""The case file: one study of one actuator, checked and with its units resolved.

A case is read from YAML, changed by ``--set`` assignments, validated in one place, and written back as the
resolved ``case.yaml`` of a run's folder, which gives the same run again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import yaml
from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    model_validator,
)

from turgor.common.errors import InputError
from turgor.common.names import Name
from turgor.common.units import PositiveLength, to_internal
from turgor.fem.system import System
from turgor.geometry.imported.mesh_file import MeshFile
from turgor.geometry.space import Space
from turgor.mesh.inp import files_of
from turgor.solver.choice import LinearPath
from turgor.solver.newton import NewtonOptions
from turgor.solver.path import PathOptions, output_fractions
from turgor.study.boundary import DisplacementCase, GravityCase, Load, PressureCase, Support
from turgor.study.control import ArcLengthControl, ControlCase, PressureControl
from turgor.study.course import Course, LoadCourse, course_by
from turgor.study.geometry import Geometry
from turgor.study.materials import MaterialChoice
from turgor.study.measures import MeasureChoice
from turgor.study.reading import override, read_mapping
from turgor.study.setup import Setup
from turgor.study.validation import StrictModel, collected, explain, invalid


class MeshCase(StrictModel):
    """How finely the actuator is cut into elements."""

    size: PositiveLength | None = Field(default=None, description="edge length; left out, the template's own default")
    sizes: dict[str, PositiveLength] = Field(default={}, description="region or surface: smaller edge length there")
    per_circle: int | None = Field(
        default=None, strict=True, ge=0, le=1000, description="elements along a full circle, in tetrahedra about"
    )
    cells: Literal["tetrahedra", "hexahedra", "triangles", "quadrilaterals"] | None = Field(
        default=None, description="left out, tetrahedra or triangles; the others where the shape is made of blocks"
    )
    layers: int | None = Field(
        default=None, strict=True, ge=1, le=20, description="elements through walls, at least, behind 95 % of the skin"
    )


class RegionCase(StrictModel):
    """Elements that become a region of their own because of where they lie."""

    where: Space = Field(description="the part of space")
    at_least: int = Field(
        default=4, strict=True, ge=1, le=4, description="corners of an element that lie in it, of its four"
    )


def _with_unit(value: object) -> object:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        raise invalid("a unit is missing", value=value, expected="a pressure, a time or a volume, such as '12 psi'")
    return value


QuantityText = Annotated[str, BeforeValidator(_with_unit)]
"""Text with a unit of which the rest of the case says what it measures."""

Count = Annotated[int, Field(strict=True, ge=1)]
Part = Annotated[float, Field(strict=True, gt=0.0, le=1.0)]


class SolverCase(StrictModel):
    """Where on the way to the full load a state is kept, and how accurate it is."""

    steps: Count | None = Field(default=None, le=10_000, description="states at equal steps of the load")
    outputs: tuple[QuantityText, ...] | None = Field(
        default=None, min_length=1, description="or states at these pressures, times or volumes"
    )
    # Not a Part: of two bounds of one kind pydantic keeps the type's.
    tolerance: Annotated[float, Field(strict=True, gt=0.0, le=1e-3)] = Field(
        default=1e-7, description="residual relative to the largest of the forces in it"
    )
    max_iterations: Count = Field(default=25, le=1000, description="tangents that may be factorised for one state")
    largest_step: Part = Field(default=1.0, description="longest step, as part of the load")
    smallest_step: Part = Field(default=1e-3, description="shortest step tried before giving up")
    linear: LinearPath = Field(default="auto", description="whether linear problems are factorised or iterated on")

    def options(self, *, post_snap: bool = False) -> PathOptions:
        """Return the options of the load path."""
        newton = NewtonOptions(self.tolerance, self.max_iterations, self.linear)
        return PathOptions(newton, self.largest_step, self.smallest_step, post_snap)

    @model_validator(mode="after")
    def _agrees_with_itself(self) -> Self:
        if self.steps is not None and self.outputs is not None:
            raise invalid("both steps and outputs are given", expected="only one of the two")
        if self.smallest_step > self.largest_step:
            raise invalid("this is more than the largest step", key="smallest_step", value=self.smallest_step)
        return self


class Draft(Setup):
    """A case that may still lack materials, supports and loads: enough to be meshed. What it says must be right."""

    name: Name = Field(default="case", description="the run's name and default folder; left out, the file's name")
    geometry: Geometry
    materials: dict[str, MaterialChoice] = Field(default={}, description="region of the actuator: its material")
    regions: dict[Name, RegionCase] = Field(default={}, description="further regions by parts of space")
    mesh: MeshCase = MeshCase()
    supports: tuple[Support, ...] = ()
    loads: tuple[Load, ...] = ()
    largest_stretch: float = Field(
        default=2.0, strict=True, gt=1.0, description="up to which the softest material is examined before the run"
    )
    control: ControlCase = Field(
        default=PressureControl(type="pressure"), description="what is prescribed; left out, the loads"
    )
    solver: SolverCase = SolverCase()
    measures: tuple[MeasureChoice, ...] | None = Field(
        default=None, description="left out, the usual ones that the actuator's names allow"
    )

    @model_validator(mode="after")
    def _cavities_and_outputs_agree(self) -> Self:
        cavities = [load.cavity for load in self.pressures]
        if len(set(cavities)) < len(cavities):
            raise invalid("a cavity is given two pressures", key="loads", expected="one pressure for each cavity")
        for number, load in enumerate(self.loads):
            if isinstance(load, PressureCase):
                self._check_pressure(load, f"loads.{number}")
        if isinstance(self.control, PressureControl):
            if self.loads:
                self.fractions()
        elif any(isinstance(support, DisplacementCase) for support in self.supports):
            raise invalid("the supports move with the load, which is not given", key="control", expected=BY_LOADS)
        elif self.contact is not None and any(body.move is not None for body in self.contact.bodies):
            raise invalid("a rigid body moves with the load, which is not given", key="control", expected=BY_LOADS)
        elif self.contact is not None and self.contact.rubs:
            raise invalid("friction follows the path of the loads, not a volume", key="control", expected=BY_LOADS)
        return self

    @model_validator(mode="after")
    def _a_mesh_file_has_its_size(self) -> Self:
        given = [key for key in MeshCase.model_fields if getattr(self.mesh, key) not in (None, {})]
        if isinstance(self.geometry, MeshFile) and given:
            problem = "the mesh comes from a file, whose elements have their size"
            raise invalid(problem, key=f"mesh.{given[0]}", expected="no mesh keys")
        return self

    def _check_pressure(self, load: PressureCase, key: str) -> None:
        by_load, given = isinstance(self.control, PressureControl), load.value is not None
        if load.programme is not None and not by_load:
            raise invalid("a programme follows time, not a volume", key=f"{key}.programme", expected=BY_LOADS)
        if load.programme is None and not given and (by_load or isinstance(self.control, ArcLengthControl)):
            raise invalid("no pressure is given", key=key, expected="value, or programme with times and pressures")
        if not by_load and not given and self._grows_beside(load):
            problem = "no pressure is given, and other loads grow in proportion to it"
            raise invalid(problem, key=key, expected="value: the pressure that belongs to theirs")
        if given and load.value == 0.0 and not by_load:
            raise invalid("the pressure cannot be zero where it is what it must be", key=f"{key}.value")

    def _grows_beside(self, load: PressureCase) -> bool:
        """Whether another load grows whose size is given: weight does not, and pressures may all be left open."""
        others = (other for other in self.loads if other is not load and not isinstance(other, GravityCase))
        return any(not isinstance(other, PressureCase) or other.value is not None for other in others)

    @property
    def pressures(self) -> tuple[PressureCase, ...]:
        """The loads that are pressures of a cavity."""
        return tuple(load for load in self.loads if isinstance(load, PressureCase))

    @property
    def full_pressure(self) -> float:
        """The pressure of largest size at the full load, MPa; 0 without any."""
        return max((load.full for load in self.pressures), key=abs, default=0.0)

    def fractions(self) -> tuple[float, ...]:
        """Return the fractions of the load, in (0, 1] and ascending, at which states are asked for."""
        if self.solver.outputs is None:
            return tuple(output_fractions(self.solver.steps or DEFAULT_STEPS))
        key = "solver.outputs"
        if self.duration is not None:
            what, target, expected = "time", self.duration, "times in order, the last that of the longest programme"
        else:
            what, target = "pressure", self.full_pressure
            expected = "pressures in order from 0 to the load's, the last equal to it"
        if target == 0.0:
            raise invalid("the outputs are pressures, and no load is one", key=key, expected="solver.steps instead")
        values = []
        for number, text in enumerate(self.solver.outputs):
            with collected(f"{key}.{number}"):
                values.append(to_internal(text, what))
        # Units are converted with rounding: 50 mbar of 5 kPa are the whole.
        fractions = tuple(1.0 if abs(value / target - 1.0) <= SAME else value / target for value in values)
        ascending = all(low < high for low, high in zip((0.0, *fractions), fractions, strict=False))
        if not ascending or fractions[-1] != 1.0:
            end = "the load's" if what == "pressure" else "the end of the programmes"
            raise invalid(f"these {what}s do not lead from 0 to {end}", key=key, expected=expected)
        return fractions

    @property
    def data_files(self) -> list[Path]:
        """The files that the case names, each once: tests and models of materials, measured motion and shapes."""
        of_materials = [path for choice in self.materials.values() for path in choice.files]
        data = self.model_dump(mode="json", exclude_none=True, include={"geometry", "regions"})
        measured = [path for choice in self.measures or () for path in choice.files]
        return list(dict.fromkeys([*of_materials, *measured, *(Path(shape["file"]) for shape in _with_file(data))]))

    @property
    def files_read(self) -> list[Path]:
        """The data files and what they include: what nothing may be written over."""
        return [file for path in self.data_files for file in (files_of(path) if path.suffix == ".inp" else [path])]


class Case(Draft):
    """One study of one actuator: what it is made of, how it is held and loaded, and what is to be known of it.

    Made from a file by :func:`load_case`. Quantities are kept in internal units and written back with them.
    """

    materials: dict[str, MaterialChoice] = Field(min_length=1, description="region of the actuator: its material")
    supports: tuple[Support, ...] = Field(min_length=1)
    loads: tuple[Load, ...] = Field(min_length=1)

    def course(self, system: System) -> Course:
        """Return the course of the run: which states are asked for, and how the solver gets there.

        Raises
        ------
        InputError
            If the control does not fit the system or the outputs do not lead to its target.
        """
        steps = self.solver.steps or DEFAULT_STEPS
        if isinstance(self.control, PressureControl):
            options = self.solver.options(post_snap=self.control.at_limit == "post-snap")
            return LoadCourse(system, self.fractions(), options, self.duration)
        if self.solver.outputs is not None and isinstance(self.control, ArcLengthControl):
            expected = "solver.steps: the states lie one over so many of the way apart"
            raise InputError("a path by its length has no outputs", key="solver.outputs", expected=expected)
        return course_by(self.control, system, self.solver.outputs, steps, self.solver.options())

    def to_yaml(self, files: Mapping[Path, str] | None = None) -> str:
        """Return the resolved case as YAML that :func:`load_case` reads back to the same case.

        Parameters
        ----------
        files
            Data file → the path to write for it, relative to the folder the YAML will lie in.
        """
        data = self.model_dump(mode="json", exclude_none=True)
        for shape in _with_file([data["geometry"], data.get("regions", {})]):
            shape["file"] = (files or {}).get(Path(shape["file"]), shape["file"])
        for region, material in self.materials.items():
            data["materials"][region] |= material.renamed(files or {})
        if self.measures is not None:
            data["measures"] = [choice.plain(files) for choice in self.measures]
        data = {key: data[key] for key in _FIRST} | {key: part for key, part in data.items() if part not in ([], {})}
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)


def _with_file(data: Any) -> Iterator[dict[str, Any]]:
    """Find the mappings that name a file, at any depth."""
    if isinstance(data, dict) and isinstance(data.get("file"), str):
        yield data
    for part in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _with_file(part)


DEFAULT_STEPS = 10
SAME = 1e-9
"""Part of the full load by which an output may be off it through the conversion of units."""
BY_LOADS = "control by the loads (control.type: pressure)"
_FIRST = ("name", "geometry", "materials", "mesh")
"""What a reader of the resolved case looks for first."""


Kind = TypeVar("Kind", bound=Draft)


def load_case(path: str | Path, changes: Sequence[str] = ()) -> Case:
    """Read a case file.

    Parameters
    ----------
    path
        The YAML file; paths inside it are relative to its folder.
    changes
        Assignments ``key.path=value`` that replace what the file says (the command line's ``--set``).

    Raises
    ------
    InputError
        If the file or a change is not well formed; names the file (or ``--set``), the key and the value.
    """
    return _load(Case, path, changes)


def load_draft(path: str | Path, changes: Sequence[str] = ()) -> Draft:
    """Read a case file that may still lack materials, supports and loads; otherwise as :func:`load_case`."""
    return _load(Draft, path, changes)


def _load(kind: type[Kind], path: str | Path, changes: Sequence[str]) -> Kind:
    path = Path(path)
    data = read_mapping(path)
    data.setdefault("name", _name_from(path))
    for change in changes:
        override(data, change)
    try:
        return kind.model_validate(data, context={"folder": path.parent})
    except ValidationError as error:
        found = explain(error, data, kind)
    except InputError as error:
        found = error
    raise found.read_from(path, changes)


def _name_from(path: Path) -> str:
    kept = "".join(character if character.isalnum() and character.isascii() else "-" for character in path.stem)
    return kept.strip("-") or "case"
