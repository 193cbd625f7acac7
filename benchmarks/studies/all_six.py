"""The six published actuators, each as its case file stands: whether they reach their loads, and what that takes.

    .venv/bin/python benchmarks/studies/all_six.py [--threads 2] [NAME…]

Prints one Markdown row per actuator; wall time is that of the whole command, meshing and report included.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
SIX = ("bellows", "membrane", "pneunet", "honeycomb", "reinforced-tube", "fibre-tube")
HEADER = """| example | elements | unknowns | states | iterations | wall, s | ended |
|---|--:|--:|--:|--:|--:|---|"""


def row(name: str, threads: int) -> tuple[str, float]:
    """Run an example and return its row and the seconds that it took."""
    limits = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), str(threads))
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "turgor", "run", str(EXAMPLES / f"{name}.yaml"), "--out", folder, "--json"]
        begun = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | limits, check=False)
        wall = time.perf_counter() - begun
    if not done.stdout:
        return f"| {name} | | | | | {wall:.0f} | {done.stderr.strip().splitlines()[-1]} |", wall
    summary = json.loads(done.stdout)
    mesh, solver = summary["mesh"], summary["solver"]
    counts = f"{mesh['elements']} | {mesh['dofs']} | {solver['steps']} | {solver['iterations']}"
    return f"| {name} | {counts} | {wall:.0f} | {summary['reason']} |", wall


def main() -> None:
    """Run the examples that are asked for, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of: " + ", ".join(SIX))
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    print(HEADER)
    total = 0.0
    for name in options.names or SIX:
        line, wall = row(name, options.threads)
        total += wall
        print(line, flush=True)
    print(f"\n{total:.0f} s in all, {options.threads} threads")


if __name__ == "__main__":
    main()
