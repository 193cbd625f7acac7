"""What a case asks for in terms that every finite-element program has; what they lack is refused by its name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from turgor.common.errors import InputError
from turgor.fem.constraints import compile_constraints
from turgor.fem.loads import Force, Gravity, Pressure, Traction
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding
from turgor.materials import Hyperelastic
from turgor.mesh import Mesh
from turgor.mesh.tet10 import IntArray
from turgor.study.boundary import PressureCase
from turgor.study.build import every_region, system_of
from turgor.study.case import Case
from turgor.study.control import PressureControl

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Held:
    """One component of displacement given on a whole surface: `axis` 0 to 2, `value` in mm at the full load."""

    surface: str
    axis: int
    value: float


@dataclass(frozen=True, eq=False)
class Problem:
    """A case on its mesh.

    Attributes
    ----------
    held
        Components of displacement that are given.
    pressures
        Cavity → pressure in MPa at the full load; it follows the wall.
    tractions
        Surface and dead force per reference area in MPa at the full load.
    weight
        Acceleration in mm/s², there in full before any other load begins; None without gravity.
    fractions
        Parts of the full load at which a state is asked for, ascending, the last 1.
    """

    name: str
    mesh: Mesh
    materials: Mapping[str, Hyperelastic]
    held: tuple[Held, ...]
    pressures: tuple[Pressure, ...]
    tractions: tuple[Traction, ...]
    weight: Vector | None
    fractions: tuple[float, ...]

    @property
    def points_of_interest(self) -> dict[str, IntArray]:
        """The markers of one node that no surface shares its name with: their displacements are printed."""
        markers = self.mesh.markers.items()
        return {name: nodes for name, nodes in markers if len(nodes) == 1 and name not in self.mesh.surfaces}


def problem_of(case: Case, mesh: Mesh, materials: Mapping[str, Hyperelastic], program: str) -> Problem:
    """Return the case in terms that every program has.

    Parameters
    ----------
    case, mesh, materials
        The case, its mesh, and the materials that it names.
    program
        Where it goes, for the messages.

    Raises
    ------
    InputError
        Naming the key of the case that other programs cannot take, or as a run of the case does.
    """
    for key in ("contact", "fibres", "sheets", "fibre_families"):
        if getattr(case, key):
            raise InputError(f"this is not written for {program}", key=key, expected=f"a case without {key}")
    if not isinstance(case.control, PressureControl):
        raise InputError(
            f"this is not written for {program}", key="control.type", value=case.control.type, expected="pressure"
        )
    for number, load in enumerate(case.loads):
        if isinstance(load, PressureCase) and load.programme is not None:
            raise InputError(f"this is not written for {program}", key=f"loads.{number}.programme", expected="a value")
    if mesh.cell_type != "tet10":
        raise InputError(
            f"a mesh of these cells is not written for {program}", value=mesh.cell_type, expected="tetrahedra in space"
        )
    materials = every_region(materials, mesh)
    held = tuple(part for number in range(len(case.supports)) for part in _held(case, number, mesh, program))
    # What a run would refuse (a body that is not held, an open cavity) is refused here in the same words.
    system_of(case, mesh, materials)
    built = [load.build() for load in case.loads]
    weights = [np.array(load.acceleration) for load in built if isinstance(load, Gravity)]
    return Problem(
        name=case.name,
        mesh=mesh,
        materials=materials,
        held=held,
        pressures=tuple(load for load in built if isinstance(load, Pressure)),
        tractions=tuple(_as_traction(load, mesh) for load in built if isinstance(load, (Traction, Force))),
        weight=_vector(np.sum(weights, axis=0)) if weights else None,
        fractions=case.fractions(),
    )


def _held(case: Case, number: int, mesh: Mesh, program: str) -> list[Held]:
    support = case.supports[number].build()
    key = f"supports.{number}"
    if isinstance(support, ElasticSupport):
        raise InputError(f"a bed of springs is not written for {program}", key=key, expected="another support")
    if isinstance(support, Clamped):
        return [Held(support.surface, axis, 0.0) for axis in range(3)]
    if isinstance(support, Prescribed):
        return [Held(support.surface, a, value) for a, value in enumerate(support.displacement) if value is not None]
    return [Held(support.surface, _axis_across(support, mesh, key, program), 0.0)]


def _axis_across(support: Sliding, mesh: Mesh, key: str, program: str) -> int:
    """Return the axis across which a sliding surface is flat."""
    given = compile_constraints(mesh, [support])
    fixed = given.fixed[mesh.surface_nodes(support.surface)]
    if len(given.frame_nodes) or (fixed != fixed[0]).any() or fixed[0].sum() != 1:
        problem = f"a sliding surface that is not flat across x, y or z is not written for {program}"
        raise InputError(problem, key=f"{key}.surface", value=support.surface)
    return int(np.argmax(fixed[0]))


def _as_traction(load: Traction | Force, mesh: Mesh) -> Traction:
    if isinstance(load, Traction):
        return load
    return Traction(load.surface, _vector(np.array(load.vector) / mesh.surface_area(load.surface)))


def _vector(values: object) -> Vector:
    x, y, z = np.asarray(values, dtype=float).tolist()
    return x, y, z
