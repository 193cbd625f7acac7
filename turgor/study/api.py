"""The Python story: a meshed actuator with its materials becomes a model, and the model is inflated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.fem.loads import Pressure
from turgor.fem.section import check_section, section_of
from turgor.geometry.section import PlaneSection
from turgor.materials import Hyperelastic
from turgor.mesh import Mesh
from turgor.results.measures import Choice, available, check
from turgor.results.stored import Body
from turgor.solver.newton import Equilibrium
from turgor.solver.path import PathOptions, output_fractions, solve_path
from turgor.study.build import every_region
from turgor.study.path import Path
from turgor.study.setup import Setup, cavities_of
from turgor.study.states import Recorder


class Model:
    """A meshed actuator with its materials, supports and loads, ready to be inflated; it does not change.

    Parameters
    ----------
    mesh
        The actuator.
    supports
        What holds it, each as in a case file: ``{"type": "clamped", "surface": "mount"}``. Left out, the surface
        ``mount`` is clamped and the surfaces ``symmetry`` or ``symmetry-…``, if there are any, slide.
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
        If a region, surface, cavity or curve is unknown, a region has no material, or a measure is impossible.
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
        self.body = Body(mesh, section, tuple(self.setup.contact.labels) if self.setup.contact else ())
        self.measures = available(self.body) if measures is None else tuple(map(Choice.read, measures))
        check(self.measures, self.body)

    def inflate(
        self,
        pressure: str,
        *,
        steps: int = 10,
        cavity: str | None = None,
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
        if not (isinstance(steps, int) and steps >= 1):
            raise InputError("the number of steps must be at least 1", key="steps", value=steps, expected="10")
        value = to_internal(pressure, "pressure", key="pressure")
        cavities = [cavity] if cavity else _cavities(self.mesh)
        pressures = [Pressure(name, value) for name in cavities]
        system = self.setup.system(self.mesh, self.materials, pressures, self.body.mechanics)
        recorder = Recorder(system)
        path = Path(self.body, system.n_dofs, self._description(), self.measures)

        def keep(equilibrium: Equilibrium) -> None:
            nonlocal path
            path = path.longer(recorder.record(equilibrium))
            if on_step is not None:
                on_step(path)

        solve_path(system, output_fractions(steps), options=options, on_equilibrium=keep)
        return path

    def _description(self) -> dict[str, Any]:
        return {
            "materials": {
                region: {"model": rubber.name, "constants": rubber.parameters, "bulk_modulus_MPa": rubber.bulk_modulus}
                for region, rubber in self.materials.items()
            },
            **self.setup.model_dump(mode="json", exclude_none=True),
        }


def _default_supports(mesh: Mesh) -> list[dict[str, str]]:
    planes = [name for name in mesh.surfaces if name == "symmetry" or name.startswith("symmetry-")]
    return [{"type": "clamped", "surface": "mount"}, *({"type": "sliding", "surface": name} for name in planes)]


def _cavities(mesh: Mesh) -> list[str]:
    names = cavities_of(mesh)
    if not names:
        raise InputError("the mesh has no cavity to inflate", key="cavity", expected="a surface called 'cavity'")
    return names
