"""A case as a model for FEBio, in version 4.0 of its file format (FEBio User Manual 4, chapter 3).

Time runs over the load: one unit for the weight, if there is any, and one for the other loads, whose fractions are
must-points, so that each state that the case asks for is hit exactly and stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from turgor.common.errors import InputError
from turgor.materials import Hyperelastic
from turgor.materials.models.gent import Gent
from turgor.materials.models.hencky import Hencky
from turgor.materials.models.ogden import OgdenModel
from turgor.materials.models.polynomial import PolynomialModel
from turgor.mesh.decks import feb_mesh_lines
from turgor.study.export.problem import Problem

PROGRAM = "FEBio"

_AXES = "xyz"
_RETRIES = 10
_RULE = "TET10G4"
"""The four integration points of Turgor's tetrahedra; FEBio's own choice is eight."""
_LOAD, _MUST_POINTS = 1, 2
_WATER = 1e-9
"""Density in t/mm³ where the case gives none: without weight nothing depends on it, and FEBio wants one."""


@dataclass(frozen=True)
class Stepping:
    """How FEBio goes to the load.

    ``longest`` is the largest part of the load in a step, ``force_tolerance`` the norm of the residual over that at a
    step's beginning at which the step has converged; without it FEBio's own criteria hold, of displacements and energy.
    """

    longest: float = 0.1
    force_tolerance: float | None = None


def feb_model(problem: Problem, stepping: Stepping = Stepping()) -> Iterator[str]:
    """Yield the lines of the model; raise InputError for a material that FEBio does not have."""
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f"<!-- {problem.name.replace('--', '- -')}, written by Turgor. Units: mm, N, MPa, t, s. -->"
    yield '<febio_spec version="4.0">'
    yield '<Module type="solid"/>'
    yield from _control(problem, stepping)
    yield "<Material>"
    for number, (name, material) in enumerate(problem.materials.items(), start=1):
        yield from _material(material, number, name)
    yield "</Material>"
    yield from feb_mesh_lines(problem.mesh)
    yield "<MeshDomains>"
    for name, material in problem.materials.items():
        # One constant pressure an element, as in Turgor; the other materials of FEBio are not split that way.
        kind = "elastic-solid" if isinstance(material, Hencky) else "three-field-solid"
        yield f'<SolidDomain name={quoteattr(name)} mat={quoteattr(name)} type="{kind}" elem_type="{_RULE}"/>'
    yield "</MeshDomains>"
    yield "<Boundary>"
    yield from _boundary(problem)
    yield "</Boundary>"
    yield "<Loads>"
    yield from _loads(problem)
    yield "</Loads>"
    yield from _load_data(problem, stepping.longest)
    yield '<Output><plotfile type="febio"><var type="displacement"/><var type="stress"/></plotfile>'
    watched = [str(nodes[0] + 1) for nodes in problem.points_of_interest.values()]
    if watched:
        yield f'<logfile><node_data data="ux;uy;uz">{",".join(watched)}</node_data></logfile>'
    yield "</Output>"
    yield "</febio_spec>"


def _begin(problem: Problem) -> float:
    """Return the time at which the loads begin."""
    return 0.0 if problem.weight is None else 1.0


def _control(problem: Problem, stepping: Stepping) -> Iterator[str]:
    steps, longest = round((_begin(problem) + 1.0) / stepping.longest), stepping.longest
    yield "<Control>"
    yield "<analysis>STATIC</analysis>"
    yield f"<time_steps>{steps}</time_steps><step_size>{longest!r}</step_size>"
    yield "<plot_level>PLOT_MUST_POINTS</plot_level>"
    yield f'<time_stepper type="default"><max_retries>{_RETRIES}</max_retries><opt_iter>15</opt_iter>'
    yield f'<dtmin>1e-5</dtmin><dtmax lc="{_MUST_POINTS}">{longest!r}</dtmax></time_stepper>'
    yield '<solver type="solid"><symmetric_stiffness>symmetric</symmetric_stiffness><max_refs>25</max_refs>'
    if stepping.force_tolerance is not None:
        # FEBio compares squares of norms.
        yield f"<dtol>0</dtol><etol>0</etol><rtol>{stepping.force_tolerance**2!r}</rtol>"
    # Full Newton: the matrix is made anew in every iteration.
    yield '<qn_method type="BFGS"><max_ups>0</max_ups></qn_method></solver>'
    yield "</Control>"


def _material(material: Hyperelastic, number: int, name: str) -> Iterator[str]:
    """Yield a material.

    FEBio's Ogden has W = Σ c/m² (Σ λ̄^m − 3), so c = 2 μ in our (Abaqus's) convention. Its Yeoh takes Σ cᵢ (Ī₁ −
    3)^(i−1) for ∂W/∂Ī₁, so cᵢ = i Cᵢ₀, though its energy has W = Σ cᵢ (Ī₁ − 3)^i (FEBio 4.11, FEYeoh.cpp). Of the laws
    of the volume change number 2 is K/2 (J − 1)². Its Arruda and Boyce differs from the published series: every term
    but the first counts its power twice.
    """
    if material.volumetric.name != "quadratic":
        problem = f"this law of the volume change is not written for {PROGRAM}"
        raise InputError(problem, key=f"materials.{name}", value=material.volumetric.name, expected="quadratic")
    kind, constants = _kind_and_constants(material, f"materials.{name}")
    if not isinstance(material, Hencky):
        constants |= {"k": material.bulk_modulus, "pressure_model": 2}
    else:
        yield "<!-- Here the volume change costs K/2 (ln J)², as K/2 (J − 1)² to second order. -->"
    constants = {"density": _WATER if material.density is None else material.density, **constants}
    yield f'<material id="{number}" name={quoteattr(name)} type="{kind}">'
    yield from (f"<{key}>{value!r}</{key}>" for key, value in constants.items())
    yield "</material>"


def _kind_and_constants(material: Hyperelastic, key: str) -> tuple[str, dict[str, float]]:
    given = material.parameters
    if isinstance(material, PolynomialModel) and set(material.powers) <= {(1, 0), (0, 1)}:
        return "Mooney-Rivlin", {"c1": given["C10"], "c2": given.get("C01", 0.0)}
    if isinstance(material, PolynomialModel) and all(j == 0 for _, j in material.powers):
        return "Yeoh", {f"c{i}": i * given[f"C{i}0"] for i, _ in material.powers}
    if isinstance(material, OgdenModel):
        return "Ogden", {
            name: value
            for i in range(1, material.terms + 1)
            for name, value in ((f"c{i}", 2.0 * given[f"mu{i}"]), (f"m{i}", given[f"alpha{i}"]))
        }
    if isinstance(material, Gent):
        return "Gent", {"G": material.mu, "Jm": material.Jm}
    if isinstance(material, Hencky):
        mu, nu = material.mu, material.poisson_ratio
        return "isotropic Hencky", {"E": 2.0 * mu * (1.0 + nu), "v": nu}
    expected = "neo-Hookean, Mooney-Rivlin of two constants, Yeoh, Ogden, Gent or Hencky"
    raise InputError(f"{PROGRAM} has no such material", key=key, value=material.name, expected=expected)


def _boundary(problem: Problem) -> Iterator[str]:
    for number, held in enumerate(problem.held, start=1):
        name, axis = f"{held.surface}-{_AXES[held.axis]}-{number}", _AXES[held.axis]
        nodes = quoteattr(held.surface)
        if held.value:
            yield f'<bc name={quoteattr(name)} type="prescribed displacement" node_set={nodes}>'
            yield f'<dof>{axis}</dof><value lc="{_LOAD}">{held.value!r}</value><relative>0</relative></bc>'
        else:
            yield f'<bc name={quoteattr(name)} type="zero displacement" node_set={nodes}>'
            yield f"<{axis}_dof>1</{axis}_dof></bc>"


def _loads(problem: Problem) -> Iterator[str]:
    for load in problem.pressures:
        surface = quoteattr(load.cavity)
        yield f'<surface_load name={surface} type="pressure" surface={surface}>'
        yield f'<pressure lc="{_LOAD}">{load.value!r}</pressure>'
        yield "<symmetric_stiffness>1</symmetric_stiffness><linear>0</linear></surface_load>"
    for number, traction in enumerate(problem.tractions, start=1):
        surface, name = quoteattr(traction.surface), quoteattr(f"{traction.surface}-{number}")
        yield f'<surface_load name={name} type="traction" surface={surface}>'
        # Linear: the force of the reference area.
        yield f'<scale lc="{_LOAD}">1</scale><traction>{_joined(traction.vector)}</traction><linear>1</linear>'
        yield "</surface_load>"
    if problem.weight is not None:
        # FEBio subtracts the body force: what it calls by that name is the acceleration of the frame.
        against = _joined(-component for component in problem.weight)
        yield f'<body_load name="weight" type="body force"><force>{against}</force></body_load>'


def _load_data(problem: Problem, longest_step: float) -> Iterator[str]:
    begin = _begin(problem)
    yield "<LoadData>"
    loaded = [(0.0, 0.0), (begin, 0.0), (begin + 1.0, 1.0)] if begin else [(0.0, 0.0), (1.0, 1.0)]
    yield from _curve(_LOAD, "LINEAR", loaded)
    times = [0.0, *([begin] if begin else []), *(begin + fraction for fraction in problem.fractions)]
    yield from _curve(_MUST_POINTS, "STEP", [(time, longest_step) for time in times])
    yield "</LoadData>"


def _curve(number: int, kind: str, points: Iterable[tuple[float, float]]) -> Iterator[str]:
    yield f'<load_controller id="{number}" type="loadcurve"><interpolate>{kind}</interpolate>'
    yield "<extend>CONSTANT</extend><points>"
    yield from (f"<pt>{time!r},{value!r}</pt>" for time, value in points)
    yield "</points></load_controller>"


def _joined(values: Iterable[float]) -> str:
    return ",".join(repr(value) for value in values)
