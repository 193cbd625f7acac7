"""Where the time of the demo goes: once with nothing compiled, once with everything compiled.

    .venv/bin/python benchmarks/profile_demo.py

Prints one table in Markdown (seconds of wall time), the one in docs/performance.md.
"""

from __future__ import annotations

import functools
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CASE = Path(__file__).parents[1] / "examples" / "demo.yaml"
ROWS = {
    "import": "starting Python, importing",
    "fit": "reading the test, fitting",
    "mesh": "drawing and meshing",
    "system": "setting up the system",
    "assemble": "forces and stiffness",
    "factorise": "factorisation",
    "solve": "triangular solves",
    "rest of load": "rest of the load path (stress, storing, predictor)",
    "report": "pictures and report",
    "total": "total",
}


def measure_here() -> dict[str, float]:
    """Run the demo in this process and return the seconds of each part."""
    begun = time.perf_counter()
    from turgor.fem.system import System
    from turgor.solver.linear import Pardiso, SuperLU
    from turgor.study.case import load_case
    from turgor.study.progress import Silent
    from turgor.study.run import run

    spent = {"import": time.perf_counter() - begun}

    def timed(owner: type, name: str, row: str) -> None:
        inner = getattr(owner, name)

        @functools.wraps(inner)
        def wrapper(*args: object, **kwargs: object) -> object:
            start = time.perf_counter()
            try:
                return inner(*args, **kwargs)
            finally:
                spent[row] = spent.get(row, 0.0) + time.perf_counter() - start

        setattr(owner, name, wrapper)

    for owner in (Pardiso, SuperLU):
        timed(owner, "factorise", "factorise")
        timed(owner, "solve", "solve")
    for name in ("forces", "stiffness", "advanced", "worst_jacobian", "consistent"):
        timed(System, name, "assemble")

    class Clock(Silent):
        now, since = "", 0.0

        def stage(self, name: str) -> None:
            moment = time.perf_counter()
            if self.now:
                spent[self.now] = moment - self.since
            self.now, self.since = name, moment

    clock = Clock()
    with tempfile.TemporaryDirectory() as folder:
        run(load_case(CASE), Path(folder) / "demo", progress=clock)
        clock.stage("")
    inside = sum(spent.get(name, 0.0) for name in ("assemble", "factorise", "solve"))
    spent["rest of load"] = spent.pop("load") - inside
    spent["total"] = time.perf_counter() - begun
    return spent


def measure_apart(cache: str) -> dict[str, float]:
    """Run :func:`measure_here` in a fresh process with its compiled kernels in the folder `cache`."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    run = [sys.executable, __file__, "--here"]
    return json.loads(subprocess.run(run, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    if "--here" in sys.argv:
        print(json.dumps(measure_here()))
        return
    with tempfile.TemporaryDirectory() as cache:
        cold, warm = measure_apart(cache), measure_apart(cache)
    print("| part of the demo | first run, compiling | later runs |\n|---|---|---|")
    for key, text in ROWS.items():
        print(f"| {text} | {cold.get(key, 0.0):.2f} | {warm.get(key, 0.0):.2f} |")


if __name__ == "__main__":
    main()
