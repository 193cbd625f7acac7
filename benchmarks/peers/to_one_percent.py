"""How coarse a mesh may be for the tip of case T to be within 1 % of where it converges to, and how long that takes.

    .venv/bin/python benchmarks/peers/to_one_percent.py [--cases tube tube-quarter …] [--peers turgor …] [--repeat 5]
    .venv/bin/python benchmarks/peers/to_one_percent.py --converged

Every code climbs a ladder of meshes, coarse to fine, with each kind of cell, until two in a row are within 1 %: the
first of them counts, for a coarser one may hit by luck. Only that one is run again for the median of the times. The
table of these goes to standard output and ``results/to-one-percent.md``, every rung to the ``.jsonl`` beside it.
`--converged` prints what `CONVERGED` rests on.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from case import TOLERANCE, Case
from cases import tube_section
from run import PEERS, RESULTS, amount, export, measured, median
from with_turgor import system_of

from turgor.solver.newton import NewtonOptions
from turgor.solver.path import PathOptions, solve_path

CONVERGED = 1.3764
"""Displacement of the tip in mm, to 1e-4: between what the section's quadrilaterals and triangles tend to."""

WITHIN = 0.01

LADDERS = {
    "tube": (6.0, 5.0, 4.0, 3.5, 3.0, 2.5, 2.0, 1.75, 1.5),
    "tube-quarter": (6.0, 5.0, 4.0, 3.5, 3.0, 2.5, 2.0, 1.75, 1.5, 1.25),
    "tube-hexahedra": (40.0, 20.0, 14.0, 10.0, 8.0, 7.0, 5.0),
    "tube-quarter-hexahedra": (40.0, 20.0, 14.0, 10.0, 8.0, 7.0, 5.0, 3.5, 1.75),
    "tube-section": (20.0, 14.0, 10.0, 7.0, 5.0, 3.5, 2.5, 1.75, 1.25, 0.8),
    "tube-section-quads": (20.0, 14.0, 10.0, 7.0, 5.0, 3.5, 2.5, 1.75, 1.25, 0.8),
}
"""Case → element sizes in mm."""

SECTION = (1.6, 0.8, 0.4, 0.2, 0.1)
"""Element sizes in mm of the section, each half of the one before."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", nargs="+", choices=LADDERS, default=list(LADDERS))
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=[name for name in PEERS if name != "calculix"])
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the median is taken")
    parser.add_argument("--converged", action="store_true", help="print the displacements of ever finer sections")
    asked = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    if asked.converged:
        show_convergence()
        return
    chosen = [(case, name) for case in asked.cases for name in asked.peers if case in PEERS[name].cases]
    with (RESULTS / "to-one-percent.jsonl").open("w") as log:
        first = {}
        for case, name in chosen:
            rungs = climb(case, name)
            for size, run in rungs:
                log.write(json.dumps({"case": case, "peer": name, "size_mm": size} | run) + "\n")
            log.flush()
            first[case, name] = arrival(rungs)
    repeated = {key: [rung[1]] if rung else [] for key, rung in first.items()}
    # Round after round, so that a disturbance of the machine meets all alike.
    for _ in range(asked.repeat - 1):
        for (case, name), rung in first.items():
            if rung:
                repeated[case, name].append(measured(PEERS[name], mesh(case, rung[0]), mesh(case, LADDERS[case][0])))
    lines = [row(case, name, rung, repeated[case, name]) for (case, name), rung in first.items()]
    head = (
        "code",
        "settings",
        "case",
        "size, mm",
        "cells",
        "unknowns",
        "tip, mm",
        "error",
        "runs",
        "wall, s",
        "CPU, s",
    )
    text = "\n".join(["| " + " | ".join(head) + " |", "|---|---|---" + "|--:" * (len(head) - 3) + "|", *lines]) + "\n"
    (RESULTS / "to-one-percent.md").write_text(text)
    print(text)


def mesh(case: str, size: float) -> Path:
    """Return the stored mesh of a rung; it is made once."""
    path = RESULTS / f"{case}-{size:g}mm.npz"
    return path if path in MADE else MADE.setdefault(export(case, size), path)


MADE: dict[Path, Path] = {}


def climb(case: str, name: str) -> list[tuple[float, dict[str, object]]]:
    """Run a peer on ever finer meshes until two in a row are within 1 %, or one fails: sizes and what was printed."""
    rungs: list[tuple[float, dict[str, object]]] = []
    for size in LADDERS[case]:
        run = measured(PEERS[name], mesh(case, size), mesh(case, LADDERS[case][0]))
        rungs.append((size, run))
        found = run.get("failure") or f"{amount(run, 'tip'):.5f} mm, {error(run):+.2%}, {run['wall_s']:.3f} s"
        print(case, name, size, found, file=sys.stderr)
        if "failure" in run or (len(rungs) > 1 and all(abs(error(run)) <= WITHIN for _, run in rungs[-2:])):
            break
    return rungs


def error(run: dict[str, object]) -> float:
    return amount(run, "tip") / CONVERGED - 1.0


def arrival(rungs: list[tuple[float, dict[str, object]]]) -> tuple[float, dict[str, object]] | None:
    """Return the first of the two rungs that are within 1 %, or None where a ladder ends before."""
    last = rungs[-2:]
    if len(last) == 2 and all("failure" not in run and abs(error(run)) <= WITHIN for _, run in last):
        return last[0]
    return None


def row(case: str, name: str, rung: tuple[float, dict[str, object]] | None, runs: list[dict[str, object]]) -> str:
    title = PEERS[name].title
    if rung is None:
        return f"| {title} | not on this ladder | {case} |" + " |" * 8
    (size, run), cells = rung, len(Case.load(mesh(case, rung[0])).cells)
    figures = [
        title,
        f"{run['settings']} ({run['version']})",
        case,
        f"{size:g}",
        f"{cells:,}",
        f"{run['unknowns']:,}",
        f"{amount(run, 'tip'):.5f}",
        f"{100 * error(run):+.2f} %",
        str(len(runs)),
        f"{median(runs, 'wall_s'):.3f}",
        f"{median(runs, 'cpu_s'):.3f}",
    ]
    return "| " + " | ".join(figures) + " |"


def show_convergence() -> None:
    """Print the section's tip on ever finer meshes and, by Aitken's formula, what the last three tend to."""
    for cells in ("quadrilaterals", "triangles"):
        tips: list[float] = []
        for size in SECTION:
            case = tube_section(size, cells)
            (end,) = solve_path(system_of(case), [1.0], options=PathOptions(newton=NewtonOptions(tolerance=TOLERANCE)))
            tips.append(float(np.linalg.norm(end.state.u[case.tip])))
            print(f"{cells}, {size:g} mm: {len(case.cells):,} cells, tip {tips[-1]:.6f} mm", flush=True)
        a, b, c = tips[-3:]
        limit = c - (c - b) ** 2 / (c - 2 * b + a)
        print(f"{cells}: tend to {limit:.5f} mm, with order {np.log2((a - b) / (b - c)):.2f}")


if __name__ == "__main__":
    main()
