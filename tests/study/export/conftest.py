"""A hollow rubber ball, an octant of it, as a case on a mesh."""

from __future__ import annotations

import dataclasses

import pytest

from turgor.mesh.structured import shell_octant
from turgor.study.case import Case

BALL = {
    "name": "ball",
    "geometry": {"template": "tube"},
    "materials": {"body": {"model": "neo-hookean", "constants": {"C10": "0.05 MPa"}, "poisson": 0.4}},
    "supports": [{"type": "sliding", "surface": name} for name in ("x0", "y0", "z0")],
    "loads": [{"type": "pressure", "value": "25 kPa"}],
    "solver": {"steps": 2},
}


@pytest.fixture(scope="session")
def octant():
    """The mesh, its inside called ``cavity``, with a marker on the outside."""
    shell = shell_octant(4.0, 6.0, 2)
    surfaces = {name: faces for name, faces in shell.surfaces.items() if name != "inner"}
    top = int(shell.points[:, 2].argmax())
    return dataclasses.replace(shell, surfaces={**surfaces, "cavity": shell.surface("inner")}, markers={"tip": [top]})


@pytest.fixture
def ball():
    """Return the case with some of its keys changed."""
    return lambda **changes: Case.model_validate({**BALL, **changes})
