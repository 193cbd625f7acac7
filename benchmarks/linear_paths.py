"""The factorisation and the iterative path beside each other on case T, from coarse to fine.

    .venv/bin/python benchmarks/linear_paths.py [--sizes 4 3 2 1.35] [--ratio 1000] [--most-direct 300000]

Prints a table of both paths, how their times grow with the number of tetrahedra, and where they cross. Each run has
a process of its own and is warmed up on a coarse mesh; its clocks start with the mesh in memory and stop at the
displacement in memory. Threads are those of OMP_NUM_THREADS and NUMBA_NUM_THREADS.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from apart import answer

from turgor.solver import iterative
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.newton import NewtonOptions, find_equilibrium

sys.path.insert(0, str(Path(__file__).parent / "peers"))
from case import Case
from cases import tube
from measure import cpu_s, peak_memory_MB
from with_turgor import system_of

PATHS = ("direct", "iterative")
WARM_UP = 6.0
HEAD = """\
| tetrahedra | unknowns | path | wall, s | CPU, s | peak memory, MB | kB an unknown | tangents | inner | largest, mm |
|--:|--:|---|--:|--:|--:|--:|--:|---|--:|"""


def saved(size: float, folder: Path) -> Path:
    """Mesh the tube at an element size in mm and store it."""
    path = folder / f"{size}.npz"
    tube(size).save(path)
    return path


def solve(case: Case, path: str, ratio: float) -> dict[str, object]:
    """Bring case T to its pressure in one step; return what was counted and where the furthest node went."""
    system = system_of(replace(case, bulk=ratio * case.mu))
    solver = make_stiffness_solver(system, path)
    end = find_equilibrium(system, solver, system.reference_state(), 1.0, NewtonOptions())
    return {
        "tetrahedra": len(case.cells),
        "unknowns": system.n_dofs,
        "newton": end.factorisations,
        "inner": getattr(solver, "iterations", []),
        "largest_mm": float(np.linalg.norm(end.state.u, axis=1).max()),
    }


def worker(path: str, ratio: float, augmentation: float, warm_up: Path, mesh: Path) -> None:
    """Run one path on one mesh and print one line of JSON."""
    iterative.AUGMENTATION = augmentation
    solve(Case.load(warm_up), path, ratio)
    case = Case.load(mesh)

    wall, cpu = time.perf_counter(), cpu_s()
    found = solve(case, path, ratio)
    wall, cpu = time.perf_counter() - wall, cpu_s() - cpu
    print(json.dumps(found | {"wall": wall, "cpu": cpu, "memory": peak_memory_MB()}))


def measured(path: str, asked: argparse.Namespace, warm_up: Path, mesh: Path) -> dict[str, object]:
    """Return what a worker printed."""
    return answer(__file__, path, asked.ratio, asked.augmentation, warm_up, mesh)


def row(path: str, run: dict[str, object]) -> str:
    inner = run["inner"]
    assert isinstance(inner, list)
    counts = f"{sum(inner)} ({', '.join(map(str, inner))})" if inner else "–"
    per_unknown = float(str(run["memory"])) * 2**20 / 1e3 / int(str(run["unknowns"]))
    return (
        f"| {run['tetrahedra']:,} | {run['unknowns']:,} | {path} | {run['wall']:.2f} | {run['cpu']:.2f} "
        f"| {run['memory']:.0f} | {per_unknown:.1f} | {run['newton']} | {counts} | {run['largest_mm']:.6f} |"
    ).replace(",", " ", 2)


def exponent(runs: list[dict[str, object]], key: str) -> float:
    """Return the slope of a straight line through the logarithms of a time over those of the tetrahedra."""
    sizes, times = (np.log([float(str(run[name])) for run in runs]) for name in ("tetrahedra", key))
    return float(np.polyfit(sizes, times, 1)[0])


def crossing(direct: list[dict[str, object]], iterative: list[dict[str, object]], key: str) -> str:
    """Say from how many unknowns on the iterative path takes less of a time, between the sizes that were run."""
    pairs = list(zip(direct, iterative, strict=False))
    gain = [np.log(float(str(a[key])) / float(str(b[key]))) for a, b in pairs]
    unknowns = np.log([float(str(a["unknowns"])) for a, _ in pairs])
    for k, (low, high) in enumerate(itertools.pairwise(gain)):
        if low <= 0.0 < high:
            at = np.exp(unknowns[k] - low * (unknowns[k + 1] - unknowns[k]) / (high - low))
            return f"about {at:,.0f} unknowns"
    return f"below {np.exp(unknowns[0]):,.0f} unknowns" if gain[0] > 0.0 else "not reached"


def main() -> None:
    """Mesh, run and print."""
    if sys.argv[1:2] == ["--worker"]:
        path, ratio, augmentation, warm_up, mesh = sys.argv[2:]
        worker(path, float(ratio), float(augmentation), Path(warm_up), Path(mesh))
        return
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=float, nargs="+", default=[4.0, 3.0, 2.0, 1.35], help="element sizes, mm")
    parser.add_argument("--ratio", type=float, default=1000.0, help="bulk over shear modulus")
    parser.add_argument("--augmentation", type=float, default=iterative.AUGMENTATION, help="shear moduli kept in A")
    parser.add_argument("--most-direct", type=int, default=300_000, help="unknowns up to which it is factorised too")
    asked = parser.parse_args()
    runs: dict[str, list[dict[str, object]]] = {path: [] for path in PATHS}
    print(HEAD)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        warm_up = saved(WARM_UP, folder)
        for size in sorted(asked.sizes, reverse=True):
            mesh = saved(size, folder)
            runs["iterative"].append(measured("iterative", asked, warm_up, mesh))
            if int(str(runs["iterative"][-1]["unknowns"])) <= asked.most_direct:
                runs["direct"].append(measured("direct", asked, warm_up, mesh))
                print(row("direct", runs["direct"][-1]))
            print(row("iterative", runs["iterative"][-1]), flush=True)
    for key in ("wall", "cpu") if runs["direct"] else ():
        print(f"\n{key}: crossing {crossing(runs['direct'], runs['iterative'], key)}")
        for path in PATHS:
            if len(runs[path]) > 1:
                last = runs[path][-2:]
                print(
                    f"  {path}: exponent {exponent(runs[path], key):.2f} over all, {exponent(last, key):.2f} at the end"
                )


if __name__ == "__main__":
    main()
