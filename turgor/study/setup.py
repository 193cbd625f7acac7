"""What holds a body, acts on it, touches it and reinforces it: the part that cases and the Python story share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

from pydantic import Field, ValidationError

from turgor.common.errors import InputError
from turgor.fem import loads as fem_loads
from turgor.fem.section import Section
from turgor.fem.system import Reinforcement, System
from turgor.materials import Hyperelastic
from turgor.mesh import Mesh
from turgor.study.boundary import GravityCase, Load, PressureCase, Support
from turgor.study.contact import ContactChoice
from turgor.study.reinforcement import FibreCase, FibreFamilyCase, SheetCase
from turgor.study.rest import check_rest
from turgor.study.validation import StrictModel, explain, suggestion


class Setup(StrictModel):
    """The supports, loads, contact and reinforcements of a body."""

    supports: tuple[Support, ...] = Field(min_length=1)
    loads: tuple[Load, ...] = ()
    contact: ContactChoice = Field(default=None, description="left out, nothing touches anything")
    fibres: tuple[FibreCase, ...] = ()
    sheets: tuple[SheetCase, ...] = ()
    fibre_families: tuple[FibreFamilyCase, ...] = ()

    @classmethod
    def read(cls, **parts: Any) -> Self:
        """Return the setup of parts given as in a case file; raise InputError as a case file does."""
        data = {key: _plain(part) for key, part in parts.items()}
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise explain(error, data, cls) from None

    def check(self, mesh: Mesh) -> None:
        """Refuse a surface, cavity, region or curve that the mesh does not have.

        Raises
        ------
        InputError
            With the key and the names that there are.
        """
        for fault in self.faults(mesh):
            raise fault

    def faults(self, mesh: Mesh) -> Iterator[InputError]:
        """Yield an error for every surface, cavity, region and curve that the mesh does not have."""
        for number, support in enumerate(self.supports):
            yield from unknown(support.surface, mesh.surfaces, f"supports.{number}.surface", "surface")
        yield from self._faults_of_loads(mesh)
        yield from self._faults_of_contact(mesh)
        yield from self._faults_of_reinforcements(mesh)

    def system(
        self,
        mesh: Mesh,
        materials: Mapping[str, Hyperelastic],
        pressures: Sequence[fem_loads.Pressure] = (),
        section: Section | None = None,
    ) -> System:
        """Return the system on a mesh with a material for each region, and with `pressures` before the other loads.

        A plane mesh needs a `section`.

        Raises
        ------
        InputError
            As :meth:`check`, :class:`System` and :func:`turgor.study.rest.check_rest` do.
        """
        self.check(mesh)
        system = System(
            mesh,
            materials,
            supports=[support.build() for support in self.supports],
            loads=[*pressures, *(self._load(load, mesh) for load in self.loads)],
            reinforcements=self._reinforcements(mesh),
            section=section,
            contact=self.contact.build() if self.contact else [],
        )
        if self.contact:
            check_rest(self.contact, system)
        return system

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the surfaces that supports hold."""
        return tuple(dict.fromkeys(support.surface for support in self.supports))

    @property
    def duration(self) -> float | None:
        """The time that the load fraction runs over, s, where loads follow programmes: the longest of them."""
        programmes = [load.programme for load in self.loads if isinstance(load, PressureCase)]
        return max((programme.duration for programme in programmes if programme is not None), default=None)

    def _load(self, load: Load, mesh: Mesh) -> fem_loads.Load:
        if isinstance(load, PressureCase):
            return load.build(self.duration)
        return load.build(mesh.dimension) if isinstance(load, GravityCase) else load.build()

    def _reinforcements(self, mesh: Mesh) -> list[Reinforcement]:
        threads = [fibre for choice in self.fibres for fibre in choice.build(mesh)]
        sheets = [sheet.build() for sheet in self.sheets]
        return [*threads, *sheets, *(family.build() for family in self.fibre_families)]

    def _faults_of_loads(self, mesh: Mesh) -> Iterator[InputError]:
        cavities = cavities_of(mesh)
        for number, load in enumerate(self.loads):
            if isinstance(load, PressureCase) and not cavities:
                yield InputError(
                    "no air can be kept in this shape: it has no closed cavity",
                    key=f"loads.{number}.cavity",
                    value=load.cavity,
                    expected="a closed pocket, or caps in the geometry for the openings of one",
                )
            elif isinstance(load, PressureCase):
                yield from unknown(load.cavity, cavities, f"loads.{number}.cavity", "cavity")
            elif not isinstance(load, GravityCase):
                yield from unknown(load.surface, mesh.surfaces, f"loads.{number}.surface", "surface")

    def _faults_of_contact(self, mesh: Mesh) -> Iterator[InputError]:
        if self.contact is None:
            return
        for number, names in enumerate(self.contact.pairs):
            for side, name in enumerate(names):
                yield from unknown(name, mesh.surfaces, f"contact.pairs.{number}.{side}", "surface")
        for number, body in enumerate(self.contact.bodies):
            if body.surface is not None:
                yield from unknown(body.surface, mesh.surfaces, f"contact.bodies.{number}.surface", "surface")

    def _faults_of_reinforcements(self, mesh: Mesh) -> Iterator[InputError]:
        for key in ("fibres", "sheets", "fibre_families"):
            if getattr(self, key) and mesh.dimension != 3:
                yield InputError("a plane section cannot have these", key=key, expected="a body in space")
        for number, fibre in enumerate(self.fibres):
            key = f"fibres.{number}.curve"
            if not mesh.curves:
                yield InputError("the actuator has no curves for fibres to run along", key=key, expected="no fibres")
            elif fibre.curve is not None:
                yield from unknown(fibre.curve, mesh.curves, key, "curve")
        for number, sheet in enumerate(self.sheets):
            if sheet.surface is not None:
                yield from unknown(sheet.surface, mesh.surfaces, f"sheets.{number}.surface", "surface")
            for side, region in enumerate(sheet.between or ()):
                yield from unknown(region, mesh.regions, f"sheets.{number}.between.{side}", "region")
        for number, family in enumerate(self.fibre_families):
            yield from unknown(family.region, mesh.regions, f"fibre_families.{number}.region", "region")


def cavities_of(mesh: Mesh) -> list[str]:
    """Return the names of the surfaces that are cavities."""
    return [name for name in mesh.surfaces if name == "cavity" or name.startswith("cavity-")]


def unknown(name: str, known: Iterable[str], key: str, kind: str) -> Iterator[InputError]:
    """Yield an error if a name is not among the `known` ones of its `kind`."""
    if name not in known:
        yield InputError(f"the actuator has no such {kind}", key=key, value=name, expected=suggestion(name, known))


def _plain(part: Any) -> Any:
    """Return lists and mappings as YAML would give them."""
    if isinstance(part, Mapping):
        return {key: _plain(value) for key, value in part.items()}
    return [_plain(item) for item in part] if isinstance(part, (list, tuple)) else part
