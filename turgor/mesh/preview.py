"""A template at a glance: its dimensioned drawing, and below it the mesh."""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib.image

from turgor.common.errors import InputError
from turgor.geometry.actuator import Actuator
from turgor.mesh.drawing import save_drawing
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.picture import check_png, save_picture


def save_preview(actuator: Actuator, path: str | Path) -> None:
    """Draw an actuator, mesh it (one half, where there is a plane of symmetry) and save both as one PNG file.

    No screen is needed.

    Raises
    ------
    InputError
        If the path does not end in .png, its folder does not exist or may not be written, the shape has no drawing, is
        too thin for its size to be meshed, or gmsh finds no valid mesh.
    MissingPackageError
        If gmsh, pyvista or a system library that they load is absent.
    """
    path = Path(path)
    check_png(path)
    if not path.parent.is_dir():
        raise InputError("there is no such folder", value=str(path.parent))
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "mesh.png"
        save_picture(_meshed(_opened(actuator)), image, window=(1430, 800))
        picture = matplotlib.image.imread(image)
    save_drawing(actuator, path, picture)


def _meshed(actuator: Actuator) -> Mesh:
    try:
        return generate(actuator)
    except InputError as error:
        if error.key != "size":
            raise
        # A preview has no size that one could change.
        raise InputError(
            f"the elements of a preview are as small as the thinnest part asks for, and {error.problem}",
            value=error.value,
            expected="a thicker part, or a case with a larger mesh.size and the command mesh",
        ) from error


def _opened(actuator: Actuator) -> Actuator:
    """Return the half of a whole actuator, which shows its cavities; one without a plane of symmetry stays."""
    fields = type(actuator).model_fields
    if "symmetric" in fields:
        return actuator.changed(symmetric=True)
    if "model" in fields and actuator.model_dump()["model"] == "full":
        return actuator.changed(model="half")
    return actuator
