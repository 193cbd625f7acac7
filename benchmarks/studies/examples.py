"""Case files of `examples/`, changed or not, run by the command that a user would type: what several studies share."""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).parents[2] / "examples"


@dataclass(frozen=True)
class Row:
    """A row of a table: an example, what `turgor run --set` changes in it, and at which pressures, kPa, it is read."""

    name: str
    example: str
    changes: tuple[str, ...] = ()
    pressures: tuple[float, ...] = ()
    paper: str = "–"


@dataclass(frozen=True)
class Ran:
    """What a run left: its summary, its history, and the seconds of the whole command, meshing and report included.

    A run that was refused has no summary and no history; `said` is the last line that it told.
    """

    summary: Mapping[str, Any]
    history: Sequence[Mapping[str, str]]
    wall: float
    said: str

    @property
    def counts(self) -> str:
        """Elements, unknowns, states, factorisations and iterations, as cells of a Markdown row."""
        if not self.summary:
            return " | | | |"
        mesh, solver = self.summary["mesh"], self.summary["solver"]
        work = f"{solver['factorisations']} | {solver['iterations']}"
        return f"{mesh['elements']} | {mesh['dofs']} | {solver['steps']} | {work}"

    @property
    def ended(self) -> str:
        """Why it ended."""
        return str(self.summary.get("reason", self.said))

    def at(self, pressure: float, key: str = "max_displacement_mm") -> float | None:
        """Return a value of the history at a pressure in kPa, if the run came so far."""
        reached = (row for row in self.history if abs(float(row["pressure_kPa"]) - pressure) <= 1e-6 * abs(pressure))
        return next((float(row[key]) for row in reached), None)


def run_example(name: str, changes: Sequence[str] = (), threads: int = 1) -> Ran:
    """Run an example of that name as `turgor run` does."""
    limits = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), str(threads))
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "turgor", "run", str(EXAMPLES / f"{name}.yaml"), "--out", folder, "--json"]
        for change in changes:
            command += ["--set", change]
        begun = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | limits, check=False)
        wall = time.perf_counter() - begun
        table = Path(folder) / "history.csv"
        history = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines())) if table.exists() else []
    said = (done.stderr.strip().splitlines() or [""])[-1]
    return Ran(json.loads(done.stdout) if done.stdout else {}, history, wall, said)


def asked_for(description: str | None, rows: Sequence[Row], threads: int = 1) -> tuple[list[Row], int]:
    """Read from the command line which rows to run, and on how many threads."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of: " + "; ".join(row.name for row in rows))
    parser.add_argument("--threads", type=int, default=threads)
    options = parser.parse_args()
    unknown = set(options.names) - {row.name for row in rows}
    if unknown:
        parser.error(f"there is no {', '.join(sorted(unknown))}")
    return [row for row in rows if not options.names or row.name in options.names], options.threads


def print_displacements(rows: Sequence[Row], threads: int) -> dict[str, Ran]:
    """Run rows one after the other; print of each the largest displacement at its pressures, and what it took."""
    print("| | paper, mm | ours, mm | elements | unknowns | states | factorisations | iterations | wall, s | ended |")
    print("|---|---|---|--:|--:|--:|--:|--:|--:|---|")
    ran: dict[str, Ran] = {}
    for row in rows:
        found = ran[row.name] = run_example(row.example, row.changes, threads)
        ours = " / ".join("–" if value is None else f"{value:.4g}" for value in map(found.at, row.pressures))
        print(f"| {row.name} | {row.paper} | {ours} | {found.counts} | {found.wall:.0f} | {found.ended} |", flush=True)
    return ran
