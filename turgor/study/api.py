"""The Python story: fit a rubber, draw an actuator, mesh it, inflate it, look at the path."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from turgor.common.errors import InputError
from turgor.common.units import to_internal
from turgor.fem.loads import Pressure
from turgor.fem.system import System
from turgor.geometry import pneunet, tube
from turgor.geometry.actuator import Actuator
from turgor.materials import Hyperelastic
from turgor.mesh import Mesh
from turgor.mesh.generate import generate
from turgor.solver.newton import Equilibrium
from turgor.solver.path import PathOptions, output_fractions, solve_path
from turgor.study.boundary import read_loads, read_supports
from turgor.study.build import every_region
from turgor.study.path import Path
from turgor.study.states import Recorder


class _Meshed(Actuator):
    """What the Python story adds to a template: the way to its mesh."""

    def mesh(self, size: str | None = None) -> Mesh:
        """Mesh the actuator with elements of `size` (text with a unit; left out, the template's own default).

        Raises
        ------
        InputError
            If the size is no positive length, or gmsh finds no valid mesh.
        """
        return generate(self, None if size is None else to_internal(size, "length", key="size"))


class CappedTube(tube.CappedTube, _Meshed):
    """The capped tube; ``CappedTube(length="90 mm").mesh(size="3 mm")``, `turgor templates tube` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class PneuNet(pneunet.PneuNet, _Meshed):
    """The PneuNet finger; ``PneuNet(chambers=8, wall="1.5 mm")``, `turgor templates pneunet` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class Model:
    """A meshed actuator with its materials, supports and loads, ready to be inflated; it does not change.

    Parameters
    ----------
    mesh
        The actuator.
    supports
        What holds it, each as in a case file: ``{"type": "clamped", "surface": "mount"}``. Left out, the surface
        ``mount`` is clamped and the surface ``symmetry``, if there is one, slides.
    loads
        What acts on it besides the pressure, each as in a case file: ``{"type": "gravity"}``.
    contact
        Contact of the actuator with itself.
    materials
        One for each region by its name; regions without one are made of the material of ``body``.

    Raises
    ------
    InputError
        If a region, surface or cavity is unknown, a region has no material, or `contact` is asked for, which this
        version does not have.
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        supports: Sequence[Mapping[str, Any]] | None = None,
        loads: Sequence[Mapping[str, Any]] = (),
        contact: bool = False,
        **materials: Hyperelastic,
    ) -> None:
        if contact:
            raise InputError(
                "contact is not part of this version: the walls may pass through each other",
                key="contact",
                value=True,
                expected="contact=False",
            )
        self.mesh = mesh
        self.materials = every_region(materials, mesh)
        self.supports = read_supports(_default_supports(mesh) if supports is None else supports)
        self.loads = read_loads(loads)

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
        others = [load.build() for load in self.loads]
        system = System(self.mesh, self.materials, [held.build() for held in self.supports], [*pressures, *others])
        recorder = Recorder(system)
        path = Path(self.mesh, system.n_dofs, self._description())

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
            "supports": [held.model_dump(mode="json", exclude_none=True) for held in self.supports],
            "loads": [load.model_dump(mode="json", exclude_none=True) for load in self.loads],
        }


def _default_supports(mesh: Mesh) -> list[dict[str, str]]:
    symmetry = [{"type": "sliding", "surface": "symmetry"}] if "symmetry" in mesh.surfaces else []
    return [{"type": "clamped", "surface": "mount"}, *symmetry]


def _cavities(mesh: Mesh) -> list[str]:
    names = [name for name in mesh.surfaces if name == "cavity" or name.startswith("cavity-")]
    if not names:
        raise InputError("the mesh has no cavity to inflate", key="cavity", expected="a surface called 'cavity'")
    return names
