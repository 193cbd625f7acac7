"""Does the automatic choice of how linear problems are solved cost what the cheaper of both ways costs?

    .venv/bin/python benchmarks/linear_choice.py [--cases 0 1 …] [--repeat 1]

Walks the loads of actuators of several shapes and mesh sizes by factorisation, by iteration and as is chosen by itself,
each in a process of its own, and prints a table: seconds of wall time of the walk alone, the inner iterations that each
tangent took and those that factorising is expected to be worth. Threads are those of OMP_NUM_THREADS and
NUMBA_NUM_THREADS.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from typing import Any

from apart import answer
from iterations import EXAMPLES, actuator

import turgor as tg
from turgor.solver import path
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.iterative import Iterative
from turgor.solver.newton import NewtonOptions
from turgor.solver.stiffness import StiffnessSolver
from turgor.solver.worth import affordable_iterations

WAYS = ("direct", "iterative", "auto")
HEXAHEDRA = ("mesh.cells=hexahedra", "mesh.per_circle=8")
CASES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("tube", ("mesh.size=3.8 mm",)),
    ("tube", ()),
    ("tube", ("mesh.size=2 mm",)),
    ("tube", ("mesh.size=4.5 mm", *HEXAHEDRA)),
    ("tube", ("mesh.size=3 mm", *HEXAHEDRA)),
    ("demo", ("mesh.size=2.8 mm",)),
    ("demo", ()),
    ("demo", ("mesh.size=1.7 mm",)),
    ("demo", ("mesh.size=1.4 mm",)),
    ("reinforced-tube", ("mesh.size=3.5 mm",)),
    ("reinforced-tube", ("mesh.size=2.8 mm",)),
    ("reinforced-tube", ()),
    ("pneunet", ("mesh.size=2 mm", "contact=null")),
    ("bellows-quarter", ("mesh.size=1.5 mm",)),
    ("membrane", ("mesh.size=5 mm",)),
)
HEAD = """\
| case | cells | unknowns | direct, s | iterative, s | auto, s | inner a tangent | worth | ended with |
|---|--:|--:|--:|--:|--:|--:|--:|---|"""


def worker(number: int, way: str) -> None:
    """Walk one case's loads in this process and print one line of JSON."""
    name, changes = CASES[number]
    small = ("mesh.size=6 mm", *(HEXAHEDRA if "mesh.cells=hexahedra" in changes else ()))
    for other in ("direct", "iterative"):
        walk("tube", small, other)
    print(json.dumps(walk(name, changes, way)))


def walk(name: str, changes: tuple[str, ...], way: str) -> dict[str, Any]:
    """Return what walking an example's loads, with some of its keys changed, cost, and what was counted."""
    case = tg.load_case(EXAMPLES / f"{name}.yaml", changes)
    system = actuator(case)
    made: list[StiffnessSolver] = []

    def make(*arguments: Any) -> StiffnessSolver:
        made.append(make_stiffness_solver(*arguments))
        return made[0]

    path.make_stiffness_solver = make
    options = path.PathOptions(newton=NewtonOptions(linear=way))  # type: ignore[arg-type]
    begun = time.perf_counter()
    found = path.solve_path(system, case.fractions(), options=options)
    spent = time.perf_counter() - begun
    (solver,) = made
    counted = sum(solver.iterations) / solver.tangents if isinstance(solver, Iterative) else None
    return {
        "cells": system.mesh.n_cells,
        "unknowns": system.n_dofs,
        "wall_s": spent,
        "inner": counted,
        "worth": affordable_iterations(system),
        "name": solver.name,
        "reached": found[-1].fraction,
    }


def row(number: int, runs: dict[str, list[dict[str, Any]]]) -> str:
    """Return the line of a case."""
    name, changes = CASES[number]
    last = {way: runs[way][-1] for way in WAYS}
    assert len({run["reached"] for run in last.values()}) == 1
    seconds = (f"{statistics.median(run['wall_s'] for run in runs[way]):.2f}" for way in WAYS)
    auto = last["auto"]
    title = ", ".join((name, *(change.partition("=")[2] for change in changes)))
    figures = (f"{last['iterative']['inner']:.1f}", f"{auto['worth']:.1f}", auto["name"])
    return f"| {title} | {auto['cells']} | {auto['unknowns']} | {' | '.join((*seconds, *figures))} |"


def main() -> None:
    """Run all and print."""
    if sys.argv[1:2] == ["--worker"]:
        worker(int(sys.argv[2]), sys.argv[3])
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, nargs="+", default=range(len(CASES)), help="numbers of rows")
    parser.add_argument("--repeat", type=int, default=1, help="runs of which the median is taken")
    asked = parser.parse_args()
    print(HEAD)
    for number in asked.cases:
        runs: dict[str, list[dict[str, Any]]] = {way: [] for way in WAYS}
        # Way after way, so that a disturbance of the machine meets all alike.
        for _ in range(asked.repeat):
            for way in WAYS:
                runs[way].append(answer(__file__, number, way))
        print(row(number, runs), flush=True)


if __name__ == "__main__":
    main()
