"""From a case to the system that the solver takes, with every name and size checked on the way."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from turgor.common.errors import InputError
from turgor.common.units import from_internal, to_text
from turgor.fem.section import section_of
from turgor.fem.system import System
from turgor.materials import Hyperelastic
from turgor.materials.assessment import warnings_in_use
from turgor.mesh import Mesh
from turgor.solver.control import ATMOSPHERE
from turgor.study.boundary import GravityCase, PressureCase, TractionCase
from turgor.study.case import Case, Draft
from turgor.study.setup import unknown

STIFFEST_SOLID = 5.5e5
"""Shear modulus of diamond, rounded up, MPa."""

MOST_PRESSURE_PER_MODULUS = 100.0
"""Pressure over shear modulus beyond which no actuator of any shape is an equilibrium worth asking for."""

LEAST_PRESSURE_PER_MODULUS = 1e-6
"""Pressure over the shear modulus of the softest material below which no actuator moves visibly."""

USUAL_DENSITY = (1e-11, 2.3e-8)
"""From the lightest foam to osmium, t/mm³."""

MOST_ELEMENTS_PER_WALL = 20
"""Beyond it the mesh is not a fine one but a slip of the unit, and would fill the memory of any machine."""


LEAST_STRETCH = 1.05
"""A part that is expected to stretch less is not examined: an insert so much stiffer than the body hardly strains."""


def check_sizes(case: Case, materials: Mapping[str, Hyperelastic]) -> None:
    """Refuse a load or a stiffness that no actuator can have, before anything expensive is done.

    Raises
    ------
    InputError
        Saying which value, against what it was held, and what is possible.
    """
    for region, material in materials.items():
        if material.shear_modulus > STIFFEST_SOLID:
            raise InputError(
                f"a shear modulus of {material.shear_modulus:.3g} MPa is more than diamond's",
                key=f"materials.{region}",
                expected="constants in the unit that they are printed with",
            )
        if material.density is None and any(isinstance(load, GravityCase) for load in case.loads):
            raise InputError(
                "gravity needs the density of every material",
                key=f"materials.{region}.density",
                expected="a density with its unit, such as '1070 kg/m^3'",
            )
    sizes = {"size": case.mesh.size, **{f"sizes.{name}": size for name, size in case.mesh.sizes.items()}}
    given = {key: size for key, size in sizes.items() if size is not None}
    coarsest = case.geometry.default_size if given else 0.0
    for key, size in given.items():
        if size < coarsest / MOST_ELEMENTS_PER_WALL:
            raise InputError(
                f"this is more than {MOST_ELEMENTS_PER_WALL} elements through the thinnest wall",
                key=f"mesh.{key}",
                value=to_text(size, "length"),
                expected=f"about {coarsest:g} mm, and not below {coarsest / MOST_ELEMENTS_PER_WALL:g} mm",
            )
    stiffest = max(material.shear_modulus for material in materials.values())
    for number, load in enumerate(case.loads):
        programmed = isinstance(load, PressureCase) and load.programme is not None
        key = f"loads.{number}.{'programme' if programmed else 'value'}"
        if isinstance(load, PressureCase):
            check_pressures(load.pressures, stiffest, key)
        elif isinstance(load, TractionCase):
            _check_size(load.value, stiffest, key)


def check_pressures(pressures: Collection[float], stiffest: float, key: str) -> None:
    """Refuse pressures in MPa that no cavity can have; `stiffest` is the shear modulus of the stiffest material, MPa.

    Raises
    ------
    InputError
        Naming the key and the pressure.
    """
    if min(pressures, default=0.0) < -ATMOSPHERE:
        raise InputError(
            "a vacuum cannot be deeper than the pressure of the atmosphere",
            key=key,
            value=to_text(min(pressures), "pressure"),
            expected=f"at least {-ATMOSPHERE} MPa",
        )
    _check_size(max(pressures, key=abs, default=0.0), stiffest, key)


def _check_size(value: float, stiffest: float, key: str) -> None:
    if abs(value) > MOST_PRESSURE_PER_MODULUS * stiffest:
        raise InputError(
            f"this is {abs(value) / stiffest:.3g} times the shear modulus of the stiffest material "
            f"({stiffest:.3g} MPa), and no actuator of it can hold that",
            key=key,
            value=to_text(value, "pressure"),
            expected=f"at most {MOST_PRESSURE_PER_MODULUS:g} times the modulus; check both units",
        )


def doubts(case: Case, materials: Mapping[str, Hyperelastic]) -> list[str]:
    """Say what is to be known of materials and loads before a run: slips of a unit, and where no trust is due.

    The softest material is examined up to the case's largest stretch; a stiffer one, which strains less, up to a strain
    that is smaller in the ratio of the shear moduli.
    """
    softest = min(material.shear_modulus for material in materials.values())
    found = list(_doubtful_pressures(case, softest))
    for region, material in materials.items():
        found += [f"materials.{region}{text}" for text in _doubtful_sizes(material)]
        stretch = 1.0 + (case.largest_stretch - 1.0) * softest / material.shear_modulus
        if stretch >= LEAST_STRETCH:
            found += [f"materials.{region}: {text}" for text in warnings_in_use(material, stretch)]
    return found


def _doubtful_pressures(case: Case, softest: float) -> Iterator[str]:
    """Say where a pressure is so small beside the `softest` shear modulus, MPa, that it is likely to be another one."""
    for number, load in enumerate(case.loads):
        largest = max(map(abs, load.pressures), default=0.0) if isinstance(load, PressureCase) else 0.0
        if 0.0 < largest < LEAST_PRESSURE_PER_MODULUS * softest:
            yield (
                f"loads.{number}: a pressure of {from_internal(largest, 'pressure', 'Pa'):.3g} Pa moves nothing: it is "
                f"{largest / softest:.2g} times the shear modulus of the softest material; check both units "
                "(mPa is a thousandth of a Pa)"
            )


def _doubtful_sizes(material: Hyperelastic) -> Iterator[str]:
    """Say which constants that every material has are not those of a solid, each with its key."""
    if material.poisson_ratio < 0.0:
        yield (
            f": a bulk modulus of {material.bulk_modulus:.3g} MPa beside a shear modulus of "
            f"{material.shear_modulus:.3g} MPa makes Poisson's ratio {material.poisson_ratio:.3g}, and no elastomer "
            "has a negative one; check both units"
        )
    low, high = USUAL_DENSITY
    if material.density is not None and not low <= material.density <= high:
        kind = "lighter than foams" if material.density < low else "heavier than any element"
        yield f".density: {from_internal(material.density, 'density', 'kg/m^3'):.3g} kg/m³ is {kind}; check the unit"


def every_region(materials: Mapping[str, Hyperelastic], mesh: Mesh) -> dict[str, Hyperelastic]:
    """Return a material for each region of the mesh: its own, or that of ``body`` where it has none.

    Raises
    ------
    InputError
        If a material is given for a region that the mesh does not have, or a region has none and neither has ``body``.
    """
    for fault in _faults_of_regions(materials, mesh):
        raise fault
    return {region: materials.get(region) or materials["body"] for region in mesh.regions}


def check_names(case: Case, mesh: Mesh) -> None:
    """Refuse a region, surface, cavity or curve that the mesh does not have.

    Raises
    ------
    InputError
        With the key and the names that there are.
    """
    for fault in faults_of_names(case, mesh):
        raise fault


def faults_of_names(case: Draft, mesh: Mesh) -> Iterator[InputError]:
    """Yield an error for every region, surface, cavity and curve that the mesh does not have."""
    if case.materials:
        yield from _faults_of_regions(case.materials, mesh)
    yield from case.faults(mesh)


def system_of(case: Case, mesh: Mesh, materials: Mapping[str, Hyperelastic]) -> System:
    """Return the system of a case on its mesh; raise InputError as `every_region`, `check_names` or System do."""
    return case.system(mesh, every_region(materials, mesh), section=section_of(case.geometry.section))


def _faults_of_regions(names: Collection[str], mesh: Mesh) -> Iterator[InputError]:
    others = set(mesh.regions) - set(names)
    for name in names:
        if name == "body" and others:
            continue  # it stands for the regions that are not named, whether or not one is called so
        yield from unknown(name, mesh.regions, f"materials.{name}", "region")
    for region in mesh.regions:
        if region not in names and "body" not in names:
            yield InputError(f"no material is given for the region '{region}'", key=f"materials.{region}")
