"""A case as an input deck for CalculiX, in the keywords that it shares with Abaqus.

Each state that the case asks for is the end of a step, so that it is hit exactly and stored. A pressure follows the
wall (``NLGEOM``), a dead traction becomes nodal forces. Tetrahedra are C3D10: CalculiX has no mixed ones, and they
lock where the volume hardly changes; in Abaqus C3D10H takes their place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from turgor.common.errors import InputError
from turgor.fem.loads import add_nodal_forces
from turgor.materials import Hyperelastic
from turgor.materials.models.arruda_boyce import ArrudaBoyce
from turgor.materials.models.ogden import OgdenModel
from turgor.materials.models.polynomial import PolynomialModel
from turgor.mesh.decks import element_faces, inp_lines, inp_number, label
from turgor.study.export.problem import Problem

PROGRAM = "CalculiX"

_POWERS = [(i, total - i) for total in (1, 2, 3) for i in range(total, -1, -1)]
"""Order of the constants Cij of a polynomial."""
_PER_LINE = 8
_NO_TERM = 1e20
"""D2 and D3 of a volume change that costs (J − 1)²/D1 alone: CalculiX takes a zero for a value that is left out."""
_FIRST_STEP, _SHORTEST_STEP = 0.25, 1e-5
_RESIDUAL = 1e-5
"""Largest residual over the mean force; with CalculiX's own half a percent displacements can be wrong by as much."""


def inp_model(problem: Problem) -> Iterator[str]:
    """Yield the lines of the deck; raise InputError for a material that CalculiX does not have."""
    mesh = problem.mesh
    yield f"** {problem.name}, written by Turgor. Units: mm, N, MPa, t, s."
    yield "** The tetrahedra lock where a material is nearly incompressible; in Abaqus write C3D10H for C3D10."
    yield from inp_lines(mesh)
    for name, material in problem.materials.items():
        yield f"*MATERIAL, NAME={label(name)}"
        yield from _material(material, f"materials.{name}")
        if material.density is not None:
            yield from ("*DENSITY", inp_number(material.density))
        yield f"*SOLID SECTION, ELSET={label(name)}, MATERIAL={label(name)}"
    yield "*BOUNDARY"
    yield from (f"{label(held.surface)}, {held.axis + 1}, {held.axis + 1}" for held in problem.held)
    faces = {load.cavity: _faces(problem, load.cavity) for load in problem.pressures}
    forces = _nodal_forces(problem)
    watched = [label(name) for name in problem.points_of_interest]
    if problem.weight is not None:
        yield "** Weight before anything else."
        yield from _step([*_weight(problem)], watched)
    for fraction in problem.fractions:
        yield f"** {100.0 * fraction:.6g} % of the load."
        loads = [*_moved(problem, fraction), *_pressed(problem, faces, fraction), *_pulled(forces, fraction)]
        yield from _step(loads, watched)


def _material(material: Hyperelastic, key: str) -> Iterator[str]:
    """Yield the block: W = Σ C_ij (Ī₁ − 3)^i (Ī₂ − 3)^j + (J − 1)²/D1 with D1 = 2/K, and Ogden's μ as ours."""
    D1 = 2.0 / material.bulk_modulus
    if material.volumetric.name != "quadratic":
        problem = f"{PROGRAM} has no {material.volumetric.name} law of the volume change"
        raise InputError(problem, key=key, value=material.name, expected="K/2 (J − 1)²")
    if isinstance(material, PolynomialModel):
        order = max(i + j for i, j in material.powers)
        constants = [getattr(material, f"C{i}{j}", 0.0) for i, j in _POWERS if i + j <= order]
        yield f"*HYPERELASTIC, POLYNOMIAL, N={order}"
    elif isinstance(material, OgdenModel):
        order, constants = material.terms, list(material.parameters.values())
        yield f"*HYPERELASTIC, OGDEN, N={order}"
    elif isinstance(material, ArrudaBoyce):
        order, constants = 1, [material.mu, material.lambda_m]
        yield "** Here the volume change costs (J² − 1)/(2 D1) − ln J/D1, as (J − 1)²/D1 to second order."
        yield "*HYPERELASTIC, ARRUDA-BOYCE"
    else:
        expected = "a polynomial (neo-Hookean, Mooney-Rivlin, Yeoh), Ogden's or Arruda and Boyce's model"
        raise InputError(f"{PROGRAM} has no such material", key=key, value=material.name, expected=expected)
    constants += [D1, *[_NO_TERM] * (order - 1)]
    for start in range(0, len(constants), _PER_LINE):
        yield ", ".join(map(inp_number, constants[start : start + _PER_LINE]))


def _step(loads: list[str], watched: list[str]) -> Iterator[str]:
    yield "*STEP, NLGEOM, INC=1000"
    yield "*STATIC"
    yield f"{_FIRST_STEP}, 1., {_SHORTEST_STEP}, 1."
    yield from ("*CONTROLS, PARAMETERS=FIELD", f"{_RESIDUAL}, 0.01")
    yield from loads
    yield from ("*NODE FILE, FREQUENCY=1000", "U", "*EL FILE, FREQUENCY=1000", "S, E")
    for nodes in watched:
        yield from (f"*NODE PRINT, NSET={nodes}, FREQUENCY=1000", "U")
    yield "*END STEP"


def _weight(problem: Problem) -> Iterator[str]:
    assert problem.weight is not None
    size = float(np.linalg.norm(problem.weight))
    numbers = ", ".join(map(inp_number, [size, *(component / size for component in problem.weight)]))
    yield "*DLOAD"
    yield from (f"{label(name)}, GRAV, {numbers}" for name in problem.materials)


def _moved(problem: Problem, fraction: float) -> Iterator[str]:
    moved = [held for held in problem.held if held.value]
    if moved:
        yield "*BOUNDARY"
        for held in moved:
            axis = held.axis + 1
            yield f"{label(held.surface)}, {axis}, {axis}, {inp_number(fraction * held.value)}"


def _faces(problem: Problem, cavity: str) -> list[int]:
    """Return the numbers, from 1, of the faces that elements turn to a cavity."""
    _, sides = element_faces(problem.mesh, problem.mesh.surface(cavity))
    return [int(side) + 1 for side in np.unique(sides)]


def _pressed(problem: Problem, faces: Mapping[str, list[int]], fraction: float) -> Iterator[str]:
    if problem.pressures:
        yield "*DLOAD"
        for load in problem.pressures:
            for side in faces[load.cavity]:
                yield f"{label(load.cavity)}_S{side}, P{side}, {inp_number(fraction * load.value)}"


def _nodal_forces(problem: Problem) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the consistent nodal forces ``(n_points, 3)`` of the tractions at the full load, N."""
    forces = np.zeros_like(problem.mesh.points)
    for load in problem.tractions:
        add_nodal_forces(load, problem.mesh, None, (), forces)
    return forces


def _pulled(forces: np.ndarray[tuple[int, int], np.dtype[np.float64]], fraction: float) -> Iterator[str]:
    nodes, axes = np.nonzero(forces)
    if len(nodes):
        yield "*CLOAD"
        values = (fraction * forces[nodes, axes]).tolist()
        for node, axis, value in zip(nodes.tolist(), axes.tolist(), values, strict=True):
            yield f"{node + 1}, {axis + 1}, {inp_number(value)}"
