"""Factorisations on the way to the loads of several actuators, and the iterations made with them.

    .venv/bin/python benchmarks/iterations.py [--kept-from 0] [--contact]

Prints the rows of the table in docs/theory/formulation.md: the factorisations and the iterations of each state, those
of attempts that failed on the way left out. With `--contact`, the iterations of the boxes in docs/theory/contact.md,
each one factorisation. With PYTHONPATH at the checkout of another commit it counts that one's.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import turgor as tg
from turgor.fem.contact.spec import SelfContact
from turgor.fem.loads import Force, Pressure
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.materials.models.neo_hookean import NeoHookean
from turgor.materials.volumetric import Quadratic
from turgor.mesh.structured import rectangle
from turgor.solver import tangent
from turgor.solver.path import output_fractions, solve_path
from turgor.study.build import system_of
from turgor.study.materials import build_materials

EXAMPLES = Path(__file__).parents[1] / "examples"
SHORT = ['geometry.length="70 mm"', 'geometry.cap="8 mm"', 'geometry.fibre_length="60 mm"']
CASES: dict[str, tuple[str, list[str], list[float]]] = {
    "honeycomb, 1 mm elements": ("honeycomb", ['mesh.size="1 mm"'], [0.25, 0.5, 0.75, 1.0]),
    "reinforced tube, 6 mm": ("reinforced-tube", ['mesh.size="6 mm"'], [0.22, 0.44, 0.66, 0.88, 1.0]),
    "fibre tube of 70 mm, 51°": ("fibre-tube", SHORT, [0.25, 0.5, 0.75, 1.0]),
    "PneuNet, eight chambers, 4 mm": ("pneunet", ['mesh.size="4 mm"', "contact=null"], [0.2, 0.4, 0.6, 0.8, 1.0]),
    "bellows": ("bellows", [], [0.25, 0.5, 0.75, 1.0]),
    "capped tube (case T)": ("tube", [], [1.0]),
}


def counts(system: System, fractions: list[float]) -> str:
    """Return the factorisations of every state behind rest and, in brackets, its iterations."""
    states = (found for found in solve_path(system, fractions) if found.fraction > 0.0)
    return ", ".join(f"{found.factorisations} ({found.iterations})" for found in states)


def strip(strength: float) -> System:
    """Return a cantilever of 100 × 1 mm in plane strain under a force of `strength` EI/L² across its end."""
    length, thickness, depth, modulus = 100.0, 1.0, 2.0, 0.1
    rubber = NeoHookean(C10=modulus / 2, volumetric=Quadratic(1e4 * modulus))
    bending = rubber.young_modulus / (1.0 - rubber.poisson_ratio**2) * depth * thickness**3 / 12.0
    mesh = rectangle((length, thickness), (40, 1), "quad9")
    load = Force("x1", (0.0, strength * bending / length**2, 0.0))
    return System(mesh, {"body": rubber}, [Clamped("x0")], [load], section=PlaneStrain(depth))


def actuator(case: tg.Case) -> System:
    """Mesh a case and return its system."""
    materials, _ = build_materials(case.materials)
    return system_of(case, tg.mesh_case(case), materials)


def chambers(pressure: float, method: str | None) -> System:
    """Return two boxes 1 mm apart under `pressure`, MPa: halves of them, as in tests/analytic/test_contact.py."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from contact_bodies import half_chamber, merged, shifted_mesh

    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    mesh = merged(left=one, right=shifted_mesh(one, 13.0))
    supports = [Clamped("left-z0"), Clamped("right-z0"), Sliding("left-y0"), Sliding("right-y0")]
    loads = [Pressure("left-cavity", pressure), Pressure("right-cavity", pressure)]
    rubber = NeoHookean(C10=0.05, volumetric=Quadratic(100.0))
    return System(mesh, {"body": rubber}, supports, loads, contact=[SelfContact(method=method)] if method else [])


def print_boxes() -> None:
    """Print a row a pressure: iterations without contact, by penalty and by barrier, in 1, 4 and 10 steps."""
    tangent.KEPT_FROM = sys.maxsize
    print("| pressure, steps | without contact | penalty | overlap | barrier | gap |\n|---|---|---|---|---|---|")
    for pressure in (20, 30, 40):
        counted, last = [], {}
        for method in (None, "penalty", "barrier"):
            system = chambers(1e-3 * pressure, method)
            ends = [solve_path(system, output_fractions(steps)) for steps in (1, 4, 10)]
            counted.append(" / ".join(str(sum(found.iterations for found in path)) for path in ends))
            last[method] = system.touches(ends[-1][-1].state)
        (touch,), (near,) = last["penalty"], last["barrier"]
        overlap = f"{touch.overlap:.3f} mm, {100 * touch.overlap_per_wall:.2f} % of the wall"
        row = (f"{pressure} kPa, 1 / 4 / 10", counted[0], counted[1], overlap, counted[2], f"{near.gap:.3f} mm")
        print(f"| {' | '.join(row)} |", flush=True)


def main() -> None:
    """Print one row a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--kept-from", type=int, default=tangent.KEPT_FROM, help="unknowns in space from which tangents serve again"
    )
    parser.add_argument("--contact", action="store_true", help="count those of two boxes that touch")
    asked = parser.parse_args()
    if asked.contact:
        print_boxes()
        return
    tangent.KEPT_FROM = asked.kept_from
    print("| case | factorisations (iterations) |\n|---|---|")
    ends = [counts(strip(strength), [1.0]) for strength in (1.0, 5.0, 10.0)]
    print(f"| elastica, end force 1, 5, 10 EI/L², in one step | {', '.join(ends)} |")
    for title, (name, changes, fractions) in CASES.items():
        case = tg.load_case(EXAMPLES / f"{name}.yaml", changes)
        print(f"| {title} | {counts(actuator(case), fractions)} |", flush=True)


if __name__ == "__main__":
    main()
