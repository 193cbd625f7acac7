"""The actuator templates of the Python story: what the geometry draws, with the way to its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from turgor.common.units import to_internal
from turgor.geometry import bellows, fibre_tube, honeycomb, membrane, pneunet, reinforced_tube, tube
from turgor.geometry.actuator import Actuator
from turgor.geometry.catalogue import actuator
from turgor.geometry.imported import step, stl
from turgor.mesh import Mesh
from turgor.mesh.generate import generate
from turgor.mesh.preview import save_preview
from turgor.study.reading import override


class _Meshed(Actuator):
    """What the Python story adds to a template: the way to its mesh."""

    def mesh(
        self,
        size: str | None = None,
        *,
        sizes: Mapping[str, str] | None = None,
        per_circle: int | None = None,
        cells: str | None = None,
        layers: int | None = None,
    ) -> Mesh:
        """Mesh the actuator.

        Parameters
        ----------
        size
            Edge length of the elements, text with a unit; left out, the template's own default.
        sizes
            Smaller edge lengths by the name of a region or surface.
        per_circle
            Elements along a full circle, in tetrahedra about; left out, the template's own default.
        cells
            ``hexahedra`` or, of a section, ``quadrilaterals``, where the shape is made of blocks; left out, tetrahedra
            or triangles.
        layers
            Elements through the walls, at least, behind all but 5 % of the skin; left out, walls do not count.

        Raises
        ------
        InputError
            If a size is no positive length or names nothing, or gmsh finds no valid mesh.
        """
        local = {name: to_internal(text, "length", key=f"sizes.{name}") for name, text in (sizes or {}).items()}
        whole = None if size is None else to_internal(size, "length", key="size")
        return generate(self, whole, sizes=local, per_circle=per_circle, cells=cells, layers=layers)


def preview(name: str, path: str | Path, changes: Sequence[str] = ()) -> None:
    """Save a picture of a template: its drawing with every dimension, and its mesh.

    Parameters
    ----------
    name
        Of the template.
    path
        Ends in .png.
    changes
        Assignments ``parameter=value``, as ``wall=2 mm``.

    Raises
    ------
    InputError
        If there is no such template, a parameter is wrong or the path cannot hold a PNG file.
    """
    parameters: dict[str, Any] = {}
    for change in changes:
        override(parameters, change)
    save_preview(actuator(name, **parameters), path)


class Bellows(bellows.Bellows, _Meshed):
    """The bellows; ``Bellows(convolutions=3, wall="1.23 mm")``, `turgor templates bellows` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class CappedTube(tube.CappedTube, _Meshed):
    """The capped tube; ``CappedTube(length="90 mm").mesh(size="3 mm")``, `turgor templates tube` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class FibreTube(fibre_tube.FibreTube, _Meshed):
    """The fibre tube; ``FibreTube(tilt="51 deg")``, `turgor templates fibre-tube` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class Honeycomb(honeycomb.Honeycomb, _Meshed):
    """The honeycomb network; ``Honeycomb(columns=3, rows=3)``, `turgor templates honeycomb` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class Membrane(membrane.Membrane, _Meshed):
    """The membrane actuator; ``Membrane(segments=1)``, `turgor templates membrane` lists the parameters.

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


class ReinforcedTube(reinforced_tube.ReinforcedTube, _Meshed):
    """The reinforced tube; ``ReinforcedTube(rings=20)``, `turgor templates reinforced-tube` lists the parameters.

    Raises
    ------
    InputError
        On construction, if a parameter is unknown, has a wrong unit, is out of bounds or contradicts another.
    """


class StepFile(step.StepFile, _Meshed):
    """A solid or an assembly from a STEP file; ``StepFile(file="gripper.step", mount={"normal": (0, 0, -1)})``.

    Raises
    ------
    InputError
        On construction, if there is no such file or a rule is not well formed; on meshing, if a rule selects no face.
    """


class StlFile(stl.StlFile, _Meshed):
    """A body from an STL file; ``StlFile(file="finger.stl", unit="mm", mount={"normal": (0, 0, -1)})``.

    Raises
    ------
    InputError
        On construction, if there is no such file or a rule is not well formed; on meshing, if the surface is broken or
        a rule selects no face.
    """
