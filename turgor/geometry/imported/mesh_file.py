"""An actuator from a mesh that another program made."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, NoReturn

from pydantic import Field, WithJsonSchema

from turgor.common.errors import InputError
from turgor.common.units import PositiveLength
from turgor.geometry.actuator import Actuator
from turgor.geometry.space import Place, Space

_Place = Annotated[Space, WithJsonSchema({"type": "object", "description": "box, ball, cylinder, half_space, …"})]
"""A part of space holds others, which the schema of a case file, written in one piece, cannot follow."""

SUFFIXES = (".msh", ".inp", ".vtu")


class MeshFile(Actuator):
    """A mesh of tetrahedra or hexahedra from a .msh, .inp or .vtu file, with the names of its sets.

    Sets of cells are regions, sets of faces (or of nodes that hold whole faces) surfaces, other sets of nodes markers;
    names are in small letters with hyphens. Every closed pocket is a ``cavity``.
    """

    template: ClassVar[str] = "mesh"

    file: str = Field(description="path of the .msh, .inp or .vtu file")
    unit: PositiveLength = Field(default="1 mm", description="length that the number 1 in the file stands for")
    surfaces: dict[str, _Place] = Field(
        default_factory=dict, description="further names: the faces of the skin whose nodes lie in a part of space"
    )
    base: Place | None = Field(default=None, description="the node nearest to this place is the marker of this name")
    tip: Place | None = Field(default=None, description="the node nearest to this place is the marker of this name")

    def check(self) -> None:
        """Raise InputError if there is no such file."""
        if Path(self.file).suffix not in SUFFIXES:
            raise InputError(
                "this is not a mesh file", key="file", value=self.file, expected=f"one of {', '.join(SUFFIXES)}"
            )
        if not Path(self.file).is_file():
            raise InputError("there is no such file", key="file", value=self.file)

    @property
    def default_size(self) -> NoReturn:
        """Raise InputError: the mesh has its size."""
        raise InputError("the mesh comes from a file, whose elements have their size", key="mesh")

    def draw(self) -> NoReturn:
        """Raise InputError: there is nothing to draw."""
        raise InputError("the mesh comes from a file and is not drawn", key="mesh")
