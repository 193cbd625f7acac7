"""The Python story: a meshed actuator with its materials becomes a model, and the model is inflated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.units import to_internal
from turgor.fem.loads import Pressure
from turgor.fem.section import check_section, section_of
from turgor.fem.system import System
from turgor.geometry.section import PlaneSection
from turgor.materials import Hyperelastic
from turgor.mesh import Mesh
from turgor.results.measures import Choice, available, check
from turgor.results.stored import Body
from turgor.solver.newton import Equilibrium
from turgor.solver.path import PathOptions, output_fractions
from turgor.study.boundary import UNKNOWN, GravityCase, PressureCase
from turgor.study.build import check_pressures, every_region
from turgor.study.control import VolumeControl, volume_text
from turgor.study.course import LoadCourse, QuantityCourse, course_by
from turgor.study.path import Path
from turgor.study.setup import Setup, cavities_of
from turgor.study.states import Recorder

log = logger("study")


class Model:
    """A meshed actuator with its materials, supports and loads, ready to be inflated; it does not change.

    Parameters
    ----------
    mesh
        The actuator.
    supports
        What holds it, each as in a case file: ``{"type": "clamped", "surface": "mount"}``. Left out, the surface
        ``mount`` is clamped and the surfaces ``symmetry…``, if there are any, slide.
    loads
        What acts on it besides the pressure, each as in a case file: ``{"type": "gravity"}``.
    contact
        ``True`` for contact of the actuator with itself; or what may touch what, as in a case file:
        ``{"bodies": [{"type": "plane", "point": …, "normal": …}]}``.
    section
        What a plane mesh stands for: the ``section`` of the shape that it was made of.
    measures
        What is to be known of each state, each as in a case file; left out, the usual ones that the mesh has the names
        for.
    fibres, sheets, fibre_families
        What runs through the body or lies on it, each as in a case file.
    materials
        One for each region by its name; regions without one are made of the material of ``body``.

    Raises
    ------
    InputError
        If a region, surface, cavity or curve is unknown, a region has no material or something else in its place, or a
        measure is impossible.
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        supports: Sequence[Mapping[str, Any]] | None = None,
        loads: Sequence[Mapping[str, Any]] = (),
        contact: bool | Mapping[str, Any] = False,
        section: PlaneSection | None = None,
        measures: Sequence[str | Mapping[str, Any]] | None = None,
        fibres: Sequence[Mapping[str, Any]] = (),
        sheets: Sequence[Mapping[str, Any]] = (),
        fibre_families: Sequence[Mapping[str, Any]] = (),
        **materials: Hyperelastic,
    ) -> None:
        self.mesh = mesh
        self.materials = every_region(materials, mesh)
        _check_materials(materials)
        self.setup = Setup.read(
            supports=_default_supports(mesh) if supports is None else supports,
            loads=loads,
            contact=contact,
            fibres=fibres,
            sheets=sheets,
            fibre_families=fibre_families,
        )
        self.setup.check(mesh)
        check_section(mesh, section_of(section))
        contact_labels = tuple(self.setup.contact.labels) if self.setup.contact else ()
        self.body = Body(mesh, section, contact_labels, self.setup.held)
        self.measures = available(self.body) if measures is None else tuple(map(Choice.read, measures))
        check(self.measures, self.body)

    def inflate(
        self,
        pressure: str,
        *,
        steps: int = 10,
        cavity: str | None = None,
        post_snap: bool = False,
        options: PathOptions | None = None,
        on_step: Callable[[Path], None] | None = None,
    ) -> Path:
        """Raise the pressure from zero and return the equilibria on the way.

        Parameters
        ----------
        pressure
            Target with its unit, such as ``"50 kPa"``.
        steps
            Number of states at equal steps of the pressure; the solver takes more or less steps between as it needs.
        cavity
            Which cavity; left out, all of them.
        post_snap
            Whether to go on behind a limit pressure, from the state that the actuator snaps to.
        options
            Tolerance and bounds of the solver's steps.
        on_step
            Called with the path so far whenever a state is reached.

        Raises
        ------
        InputError
            If the pressure or the cavity is wrong, or the actuator is not held.
        SolverError
            If no equilibrium is found before the target; its facts tell how far it came, and `on_step` has been given
            the states until then.
        """
        _check_steps(steps)
        value = to_internal(pressure, "pressure", key="pressure")
        self._check_pressures([value], "pressure")
        system = self._system([Pressure(name, value) for name in _cavities(self.mesh, cavity)])
        how = options or PathOptions()
        how = replace(how, post_snap=post_snap or how.post_snap)
        return self._walked(LoadCourse(system, output_fractions(steps), how), on_step)

    def inflate_to(
        self,
        volume: str,
        *,
        steps: int = 10,
        cavity: str | None = None,
        options: PathOptions | None = None,
        on_step: Callable[[Path], None] | None = None,
    ) -> Path:
        """Let the enclosed volume grow and return the equilibria on the way, through limits of the pressure.

        Parameters
        ----------
        volume
            Target with its unit, or in per cent of the volume at rest, such as ``"250 %"``.
        steps
            Number of states at equal steps of the volume.
        cavity
            Which cavity; left out, all of them together, at the same pressure.
        options, on_step
            As for :meth:`inflate`.

        Raises
        ------
        InputError, SolverError
            As :meth:`inflate` does.
        """
        _check_steps(steps)
        if any(not isinstance(load, GravityCase) for load in self.setup.loads):
            problem = "the loads would grow in no known proportion to the pressure"
            raise InputError(problem, key="loads", expected="weight alone, or a case with control and both values")
        system = self._system([Pressure(name, UNKNOWN) for name in _cavities(self.mesh, cavity)])
        control = VolumeControl(type="volume", target=volume_text(volume))
        return self._walked(course_by(control, system, None, steps, options or PathOptions()), on_step)

    def play(
        self,
        programmes: Mapping[str, Mapping[str, Sequence[str]]],
        *,
        steps: int = 10,
        options: PathOptions | None = None,
        on_step: Callable[[Path], None] | None = None,
    ) -> Path:
        """Let each pressure follow its programme over time and return the equilibria at equal steps of time.

        Parameters
        ----------
        programmes
            Cavity → its programme as in a case file: ``{"time": ["0 s", "1 s"], "pressure": ["0 kPa", "20 kPa"]}``.
        steps
            Number of states at equal steps of time.
        options, on_step
            As for :meth:`inflate`.

        Raises
        ------
        InputError, SolverError
            As :meth:`inflate` does.
        """
        _check_steps(steps)
        if not programmes:
            raise InputError("no cavity has a programme", key="programmes", expected="cavity → times and pressures")
        loads = [{"type": "pressure", "cavity": name, "programme": dict(table)} for name, table in programmes.items()]
        setup = Setup.read(supports=_default_supports(self.mesh), loads=loads)
        duration = setup.duration
        for load in setup.loads:
            if isinstance(load, PressureCase):
                self._check_pressures(load.pressures, f"programmes.{load.cavity}")
        pressures = [load.build(duration) for load in setup.loads if isinstance(load, PressureCase)]
        course = LoadCourse(self._system(pressures), output_fractions(steps), options or PathOptions(), duration)
        return self._walked(course, on_step)

    def _check_pressures(self, pressures: Sequence[float], key: str) -> None:
        check_pressures(pressures, max(material.shear_modulus for material in self.materials.values()), key)

    def _system(self, pressures: Sequence[Pressure]) -> System:
        return self.setup.system(self.mesh, self.materials, pressures, self.body.mechanics)

    def _walked(self, course: LoadCourse | QuantityCourse, on_step: Callable[[Path], None] | None) -> Path:
        system = course.system
        recorder = Recorder(system, course=course)
        path = Path(self.body, system.n_dofs, self._description(), self.measures)

        def keep(equilibrium: Equilibrium) -> None:
            nonlocal path
            path = path.longer(recorder.record(equilibrium))
            if on_step is not None:
                on_step(path)

        course.walk(None, keep, None)
        for text in path.warnings:
            log.warning(text)
        return path

    def _description(self) -> dict[str, Any]:
        return {
            "materials": {
                region: {"model": rubber.name, "constants": rubber.parameters, "bulk_modulus_MPa": rubber.bulk_modulus}
                for region, rubber in self.materials.items()
            },
            **self.setup.model_dump(mode="json", exclude_none=True),
        }


def _check_materials(materials: Mapping[str, object]) -> None:
    """Refuse what is no material: a name or a report of fits would be asked for its stiffness much later."""
    for region, material in materials.items():
        if not isinstance(material, Hyperelastic):
            raise InputError(
                "this is not a material",
                key=region,
                value=material if isinstance(material, str) else type(material).__name__,
                expected="one of material('neo-hookean', {'C10': '0.05 MPa'}), find_material(NAME).build, fit(…).best",
            )


def _check_steps(steps: int) -> None:
    if not (isinstance(steps, int) and steps >= 1):
        raise InputError("the number of steps must be at least 1", key="steps", value=steps, expected="10")


def _default_supports(mesh: Mesh) -> list[dict[str, str]]:
    sliding = [{"type": "sliding", "surface": name} for name in mesh.symmetry_planes]
    return [{"type": "clamped", "surface": "mount"}, *sliding]


def _cavities(mesh: Mesh, chosen: str | None) -> list[str]:
    names = cavities_of(mesh)
    if chosen is not None:
        if not isinstance(chosen, str):
            expected = f"one of {', '.join(names)}, or none for all"
            raise InputError("this is no name", key="cavity", value=chosen, expected=expected)
        return [chosen]
    if not names:
        raise InputError("the mesh has no cavity to inflate", key="cavity", expected="a surface called 'cavity'")
    return names
