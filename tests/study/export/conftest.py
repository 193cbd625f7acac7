"""A hollow rubber ball, an octant of it, as a case on a mesh."""

from __future__ import annotations

import dataclasses

import pytest

from turgor.mesh.structured import box, shell_octant
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


def _bar(length, cells):
    """Return a bar along z of 1 mm², the corner opposite to the origin as its marker, and that corner."""
    bar = box((1.0, 1.0, length), (1, 1, cells))
    corner = int(bar.points.sum(axis=1).argmax())
    return dataclasses.replace(bar, markers={"tip": [corner]}), corner


@pytest.fixture
def stretched(ball):
    """Return a bar pulled to 1.5 times its length along x, its mesh and the corner that moves."""
    case = ball(
        supports=[{"type": "sliding", "surface": name} for name in ("x0", "y0", "z0")]
        + [{"type": "displacement", "surface": "x1", "x": "0.5 mm"}],
        loads=[{"type": "traction", "surface": "x1", "value": "1e-9 MPa", "direction": [1, 0, 0]}],
        solver={"steps": 1},
    )
    return case, *_bar(1.0, 1)


@pytest.fixture
def hanging(ball):
    """Return a bar under its weight and a force, its mesh, its end and how far that moves along z, mm."""
    case = ball(
        materials={
            "body": {
                "model": "neo-hookean", "constants": {"C10": "0.05 MPa"}, "poisson": 0.2, "density": "1e-8 t/mm^3"
            }
        },
        supports=[{"type": "sliding", "surface": name} for name in ("x0", "y0", "z0")],
        loads=[
            {"type": "gravity", "direction": [0, 0, 1], "acceleration": "1000 mm/s^2"},
            {"type": "force", "surface": "z1", "value": "1e-4 N", "direction": [0, 0, 1]},
        ],
        solver={"steps": 1},
    )  # fmt: skip
    # Small strains: u = (F L + ρ g L² / 2) / E with E = 2 μ (1 + ν) = 0.24 MPa on 1 mm².
    return case, *_bar(10.0, 4), (1e-4 * 10 + 1e-8 * 1000 * 50) / 0.24
