"""The same case in Turgor and in its peers: one table.

    .venv/bin/python benchmarks/peers/run.py [--case tube|tube-hexahedra|punch|…] [--sizes 5 3 2]
        [--peers turgor felupe …] [--repeat 5]

Run `sh benchmarks/peers/install.sh` once before. Every run is a process of its own in the peer's own environment; the
first small mesh warms it up before the clocks start. Each run's figures go to ``results/CASE.jsonl`` beside this file,
and the table of their medians to standard output and ``results/CASE.md``.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from case import Case
from cases import CASES

HERE = Path(__file__).parent
RESULTS = HERE / "results"
LONGEST_S = 1800
"""A peer that takes longer than this on one mesh has failed."""

PATH = os.pathsep.join([os.environ["PATH"], str(HERE / ".peers" / "febio" / "bin")])
"""Where the programs are: what `install.sh` builds stands behind what is there already."""

ONCE_S = 120
"""A run that takes longer than this is not repeated."""


SIMPLICES = ("tube", "tube-quarter", "tube-section", "punch", "bellows")
"""The cases of tetrahedra and triangles."""

IN_ROWS = ("tube-hexahedra", "tube-quarter-hexahedra", "tube-section-quads", "punch-quads")
"""Those of hexahedra and quadrilaterals."""

IN_SPACE = ("tube", "tube-quarter", "tube-hexahedra", "tube-quarter-hexahedra")


@dataclass(frozen=True)
class Peer:
    """A code: the environment under .peers that it lives in (none: that of this process), its call, its cases."""

    title: str
    script: str
    environment: str | None = None
    ranks: int = 1
    arguments: tuple[str, ...] = ()
    program: str | None = None
    cases: tuple[str, ...] = SIMPLICES

    def missing(self) -> str | None:
        """Return why the peer cannot run, ``None`` if it can."""
        if self.program and shutil.which(self.program, path=PATH) is None:
            return f"`{self.program}` is not on the path"
        if self.environment and not self.python.exists():
            return f"not installed: `sh benchmarks/peers/install.sh {self.environment}`"
        return None

    @property
    def python(self) -> Path:
        return HERE / ".peers" / self.environment / "bin" / "python" if self.environment else Path(sys.executable)

    def command(self, mesh: Path, warm_up: Path) -> list[str]:
        launcher = [str(self.python.with_name("mpiexec")), "-n", str(self.ranks)] if self.ranks > 1 else []
        return [*launcher, str(self.python), str(HERE / self.script), str(mesh), str(warm_up), *self.arguments]


PEERS = {
    "turgor": Peer("Turgor", "with_turgor.py", arguments=("auto",), cases=tuple(CASES)),
    "turgor-direct": Peer("Turgor, factorised", "with_turgor.py", arguments=("direct",), cases=IN_SPACE),
    "felupe": Peer("FElupe", "with_felupe.py", "felupe", arguments=("mixed",), cases=(*SIMPLICES, *IN_ROWS)),
    "felupe-p2": Peer("FElupe, P2", "with_felupe.py", "felupe", arguments=("displacement",), cases=("punch",)),
    "ngsolve": Peer("NGSolve", "with_ngsolve.py", "ngsolve", arguments=("P2-P0",)),
    "ngsolve-q2p0": Peer("NGSolve, Q2–P0", "with_ngsolve.py", "ngsolve", arguments=("Q2-P0",), cases=IN_ROWS),
    "ngsolve-q2p1": Peer("NGSolve, Q2–P1disc", "with_ngsolve.py", "ngsolve", arguments=("Q2-P1disc",), cases=IN_ROWS),
    "dolfinx-p2p0": Peer("DOLFINx, P2–P0", "with_dolfinx.py", "dolfinx", ranks=2, arguments=("P2-P0",)),
    "dolfinx-p2p1": Peer("DOLFINx, P2–P1", "with_dolfinx.py", "dolfinx", ranks=2, arguments=("P2-P1",)),
    "dolfinx-q2p0": Peer("DOLFINx, Q2–P0", "with_dolfinx.py", "dolfinx", ranks=2, arguments=("Q2-P0",), cases=IN_ROWS),
    "dolfinx-q2p1": Peer(
        "DOLFINx, Q2–P1disc",
        "with_dolfinx.py",
        "dolfinx",
        ranks=2,
        arguments=("Q2-P1disc",),
        cases=IN_ROWS,
    ),
    "dolfinx-q2p1-space": Peer(
        "DOLFINx, Q2–P1space",
        "with_dolfinx.py",
        "dolfinx",
        ranks=2,
        arguments=("Q2-P1space",),
        cases=IN_ROWS,
    ),
    "calculix": Peer("CalculiX", "with_calculix.py", program="ccx", cases=("tube",)),
    "febio": Peer("FEBio", "with_febio.py", arguments=("5",), program="febio4", cases=("tube", "tube-quarter")),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", choices=CASES, default="tube")
    parser.add_argument("--sizes", nargs="+", type=float, help="edge lengths, mm")
    parser.add_argument("--peers", nargs="+", choices=PEERS, help="those of them that can solve the case")
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the median is taken")
    asked = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    peers = [name for name in asked.peers or PEERS if asked.case in PEERS[name].cases]
    sizes = sorted(asked.sizes or CASES[asked.case].sizes, reverse=True)
    meshes = [export(asked.case, size) for size in sizes]
    rows: dict[tuple[str, float], list[dict[str, object]]] = {}
    with (RESULTS / f"{asked.case}.jsonl").open("w") as log:
        # Round after round, so that a disturbance of the machine meets all alike.
        for _ in range(asked.repeat):
            for size, mesh in zip(sizes, meshes, strict=True):
                for name in peers:
                    runs = rows.setdefault((name, size), [])
                    if runs and ("failure" in runs[-1] or float(runs[-1]["wall_s"]) > ONCE_S):
                        continue
                    result = measured(PEERS[name], mesh, meshes[0])
                    runs.append(result)
                    log.write(json.dumps({"peer": name, "size_mm": size} | result) + "\n")
                    log.flush()
                    print(name, size, result.get("wall_s", result.get("failure")), file=sys.stderr)
    text = table(peers, sizes, meshes, rows)
    (RESULTS / f"{asked.case}.md").write_text(text)
    print(text)


def export(name: str, size: float) -> Path:
    """Mesh a case and write it as plain arrays."""
    path = RESULTS / f"{name}-{size:g}mm.npz"
    CASES[name].make(size).save(path)
    return path


def measured(peer: Peer, mesh: Path, warm_up: Path) -> dict[str, object]:
    """Run a peer once on two threads or ranks and return what it printed, or its ``failure``."""
    if reason := peer.missing():
        return {"failure": reason}
    threads = str(2 // peer.ranks)
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    environment = os.environ | {"PATH": PATH} | dict.fromkeys(names, threads)
    try:
        done = subprocess.run(
            peer.command(mesh, warm_up), env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
    except subprocess.TimeoutExpired:
        return {"failure": f"no result in {LONGEST_S} s"}
    if done.returncode:
        return {"failure": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


HEAD = (
    "code",
    "settings",
    "cells",
    "unknowns",
    "runs",
    "wall, s",
    "CPU, s",
    "peak memory, MB",
    "iterations",
    "factorisations",
    "wall ∝ nᵏ, k",
)


def table(
    names: list[str],
    sizes: list[float],
    meshes: list[Path],
    rows: dict[tuple[str, float], list[dict[str, object]]],
) -> str:
    """Return the Markdown table of medians."""
    cases = [Case.load(mesh) for mesh in meshes]
    compared = {"tip": ("tip, mm", 1.0)}
    if travel := cases[0].travel:
        compared["work"] = ("force, N", 1.0 / travel)
    head = [*HEAD, *(title for first, _ in compared.values() for title in (first, "off Turgor's"))]
    lines = ["| " + " | ".join(head) + " |", "|---|---" + "|--:" * (len(head) - 2) + "|"]
    for name in names:
        walls: list[tuple[int, float]] = []
        for size, case in zip(sizes, cases, strict=True):
            count, runs, ours = len(case.cells), rows[name, size], rows.get(("turgor", size), [])
            title = PEERS[name].title
            if failed := [str(run["failure"]) for run in runs if "failure" in run]:
                cells = [title, failed[0].replace("|", "/"), f"{count:,}", *[""] * (len(head) - 3)]
            else:
                walls.append((count, median(runs, "wall_s")))
                exponent = f"{growth(walls):.2f}" if size == sizes[-1] and len(walls) > 1 else ""
                cells = [title, *figures(runs, count), exponent]
                for key, (_, unit) in compared.items():
                    cells += [f"{unit * amount(runs[-1], key):.6g}", off(runs, ours, key)]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def figures(runs: list[dict[str, object]], count: int) -> list[str]:
    last = runs[-1]
    return [
        f"{last['settings']} ({last['version']})",
        f"{count:,}",
        f"{last['unknowns']:,}",
        str(len(runs)),
        f"{median(runs, 'wall_s'):.2f}",
        f"{median(runs, 'cpu_s'):.2f}",
        f"{median(runs, 'peak_memory_MB'):.0f}",
        str(last["iterations"]),
        str(last["factorisations"]),
    ]


def amount(run: dict[str, object], key: str) -> float:
    """Return the size of what a code says: a number or a displacement."""
    return float(np.linalg.norm(run[key]))


def median(runs: list[dict[str, object]], key: str) -> float:
    return statistics.median(float(run[key]) for run in runs)


def off(runs: list[dict[str, object]], ours: list[dict[str, object]], key: str) -> str:
    """Return by how much a result is larger or smaller than Turgor's on the same mesh, in percent of that."""
    if not ours or "failure" in ours[-1]:
        return ""
    return f"{100 * (amount(runs[-1], key) / amount(ours[-1], key) - 1):+.2g} %"


def growth(walls: list[tuple[int, float]]) -> float:
    """Return k of wall time ∝ (number of cells)ᵏ, by least squares of the logarithms."""
    return float(np.polyfit(*np.log(walls).T, 1)[0])


if __name__ == "__main__":
    main()
