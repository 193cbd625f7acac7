"""A hollow rubber ball, an octant of it, as a case on a mesh."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from turgor.materials.compressible import free_response
from turgor.materials.registry import create
from turgor.mesh.structured import box, shell_octant
from turgor.solver.path import solve_path
from turgor.study.build import system_of
from turgor.study.case import Case
from turgor.study.materials import build_materials

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


@pytest.fixture
def swollen(ball, octant):
    """Return where the marker of the ball goes in Turgor, mm."""
    case, states = ball(), []
    solve_path(system_of(case, octant, build_materials(case.materials)[0]), [1.0], on_equilibrium=states.append)
    expected = states[-1].state.u[octant.marker("tip")[0]]
    assert expected[2] > 0.2
    return expected


def _bar(length, cells):
    """Return a bar along z of 1 mm², the corner opposite to the origin as its marker, and that corner."""
    bar = box((1.0, 1.0, length), (1, 1, cells))
    corner = int(bar.points.sum(axis=1).argmax())
    return dataclasses.replace(bar, markers={"tip": [corner]}), corner


CONSTANTS = {
    "neo-hookean": {"C10": 0.05},
    "mooney-rivlin-2": {"C10": 0.04, "C01": 0.01},
    "mooney-rivlin-5": {"C10": 0.04, "C01": 0.01, "C20": 0.002, "C11": 0.003, "C02": 0.001},
    "mooney-rivlin-9": dict.fromkeys(("C20", "C11", "C02", "C30", "C21", "C12", "C03"), 1e-3)
    | {"C10": 0.04, "C01": 0.01},
    "yeoh-2": {"C10": 0.05, "C20": 0.01},
    "yeoh-3": {"C10": 0.05, "C20": 0.01, "C30": 0.003},
    "ogden-1": {"mu1": 0.1, "alpha1": 3.0},
    "ogden-3": {"mu1": 0.05, "alpha1": 1.3, "mu2": 0.03, "alpha2": 4.0, "mu3": 0.02, "alpha3": -2.0},
    "arruda-boyce": {"mu": 0.1, "lambda_m": 2.0},
    "gent": {"mu": 0.1, "Jm": 10.0},
    "hencky": {"mu": 0.1},
}


@pytest.fixture
def stretched(ball, model):
    """Return a bar pulled to 1.5 times its length along x, its mesh and material, its corner and how that moves, mm."""
    case = ball(
        supports=[{"type": "sliding", "surface": name} for name in ("x0", "y0", "z0")]
        + [{"type": "displacement", "surface": "x1", "x": "0.5 mm"}],
        loads=[{"type": "traction", "surface": "x1", "value": "1e-9 MPa", "direction": [1, 0, 0]}],
        solver={"steps": 1},
    )
    material = create(model, CONSTANTS[model], poisson=0.45)
    lateral, _ = free_response(material, "uniaxial", np.array([1.5]))
    bar, corner = _bar(1.0, 1)
    return case, bar, material, corner, [0.5, lateral[0] - 1, lateral[0] - 1]


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
