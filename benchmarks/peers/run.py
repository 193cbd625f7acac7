"""The same tube in Turgor and in its peers: one table.

    .venv/bin/python benchmarks/peers/run.py [--sizes 5 3 2] [--peers turgor felupe …] [--repeat 5]

Run `sh benchmarks/peers/install.sh` once before. Every run is a process of its own in the peer's own environment; the
first small mesh warms it up before the clocks start. Each run's figures go to ``results/peers.jsonl`` beside this file,
and the table of their medians to standard output and ``results/peers.md``.
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
from case_t import TubeMesh
from with_turgor import tube_mesh

HERE = Path(__file__).parent
RESULTS = HERE / "results"
LONGEST_S = 1800
"""A peer that takes longer than this on one mesh has failed."""

ONCE_S = 120
"""A run that takes longer than this is not repeated."""


@dataclass(frozen=True)
class Peer:
    """A code: the environment under .peers that it lives in (none: that of this process), and how it is called."""

    title: str
    script: str
    environment: str | None = None
    ranks: int = 1
    arguments: tuple[str, ...] = ()
    program: str | None = None

    def missing(self) -> str | None:
        """Return why the peer cannot run, ``None`` if it can."""
        if self.program and shutil.which(self.program) is None:
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
    "turgor": Peer("Turgor", "with_turgor.py", arguments=("direct",)),
    "turgor-iterative": Peer("Turgor, iterative", "with_turgor.py", arguments=("iterative",)),
    "felupe": Peer("FElupe", "with_felupe.py", "felupe"),
    "ngsolve": Peer("NGSolve", "with_ngsolve.py", "ngsolve"),
    "dolfinx-p2p0": Peer("DOLFINx, P2–P0", "with_dolfinx.py", "dolfinx", ranks=2, arguments=("P2-P0",)),
    "dolfinx-p2p1": Peer("DOLFINx, P2–P1", "with_dolfinx.py", "dolfinx", ranks=2, arguments=("P2-P1",)),
    "calculix": Peer("CalculiX", "with_calculix.py", program="ccx"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=float, default=[5.0, 3.0, 2.0], help="edge lengths, mm")
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS))
    parser.add_argument("--repeat", type=int, default=5, help="runs of which the median is taken")
    asked = parser.parse_args()
    RESULTS.mkdir(exist_ok=True)
    sizes = sorted(asked.sizes, reverse=True)
    meshes = [export(size) for size in sizes]
    rows: dict[tuple[str, float], list[dict[str, object]]] = {}
    with (RESULTS / "peers.jsonl").open("w") as log:
        # Round after round, so that a disturbance of the machine meets all alike.
        for _ in range(asked.repeat):
            for size, mesh in zip(sizes, meshes, strict=True):
                for name in asked.peers:
                    runs = rows.setdefault((name, size), [])
                    if runs and ("failure" in runs[-1] or float(runs[-1]["wall_s"]) > ONCE_S):
                        continue
                    result = measured(PEERS[name], mesh, meshes[0])
                    runs.append(result)
                    log.write(json.dumps({"peer": name, "size_mm": size} | result) + "\n")
                    log.flush()
                    print(name, size, result.get("wall_s", result.get("failure")), file=sys.stderr)
    text = table(asked.peers, sizes, meshes, rows)
    (RESULTS / "peers.md").write_text(text)
    print(text)


def export(size: float) -> Path:
    """Mesh case T and write it as plain arrays."""
    path = RESULTS / f"case-t-{size:g}mm.npz"
    tube_mesh(size).save(path)
    return path


def measured(peer: Peer, mesh: Path, warm_up: Path) -> dict[str, object]:
    """Run a peer once on two threads or ranks and return what it printed, or its ``failure``."""
    if reason := peer.missing():
        return {"failure": reason}
    threads = str(2 // peer.ranks)
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, threads)
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
    "tetrahedra",
    "unknowns",
    "runs",
    "wall, s",
    "CPU, s",
    "peak memory, MB",
    "iterations",
    "factorisations",
    "tip, mm",
    "off Turgor's",
    "wall ∝ nᵏ, k",
)


def table(
    names: list[str],
    sizes: list[float],
    meshes: list[Path],
    rows: dict[tuple[str, float], list[dict[str, object]]],
) -> str:
    """Return the Markdown table of medians."""
    counts = [len(TubeMesh.load(mesh).cells) for mesh in meshes]
    lines = ["| " + " | ".join(HEAD) + " |", "|---|---" + "|--:" * (len(HEAD) - 2) + "|"]
    for name in names:
        walls: list[tuple[int, float]] = []
        for size, count in zip(sizes, counts, strict=True):
            runs = rows[name, size]
            title = PEERS[name].title
            if failed := [str(run["failure"]) for run in runs if "failure" in run]:
                cells = [title, failed[0].replace("|", "/"), f"{count:,}", *[""] * (len(HEAD) - 3)]
            else:
                walls.append((count, median(runs, "wall_s")))
                exponent = f"{growth(walls):.2f}" if size == sizes[-1] and len(walls) > 1 else ""
                cells = [title, *figures(runs, count), off(runs, rows.get(("turgor", size), [])), exponent]
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
        f"{np.linalg.norm(last['tip']):.5f}",
    ]


def median(runs: list[dict[str, object]], key: str) -> float:
    return statistics.median(float(run[key]) for run in runs)


def off(runs: list[dict[str, object]], ours: list[dict[str, object]]) -> str:
    """Return by how much more or less the tip moves than Turgor's on the same mesh, in percent of that."""
    if not ours or "failure" in ours[-1]:
        return ""
    tip, reference = (float(np.linalg.norm(run[-1]["tip"])) for run in (runs, ours))
    return f"{100 * (tip / reference - 1):+.2g} %"


def growth(walls: list[tuple[int, float]]) -> float:
    """Return k of wall time ∝ (number of tetrahedra)ᵏ, by least squares of the logarithms."""
    return float(np.polyfit(*np.log(walls).T, 1)[0])


if __name__ == "__main__":
    main()
