"""CalculiX: C3D10 in displacements, automatic increments, SPOOLES on two threads (Debian's `calculix-ccx`).

For the tube alone. CalculiX has no mixed tetrahedron, and this build no other solver. One step fails; of the first
increments 0.05, 0.1, 0.25, 0.5 and 1 of the load its automatic control needs fewest iterations with 0.5 (42, 52, 50, 38
and 54). Convergence follows its own rule, largest residual over average force, set to `TOLERANCE` instead of 5e-3.
Reading the deck is in the times.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from case import TOLERANCE, Case
from measure import Solved, run

FIRST = 0.5
"""First increment, part of the load."""

FACES = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
"""CalculiX's numbering of a tetrahedron's faces."""


def solve(case: Case) -> Solved:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "tube.inp").write_text(deck(case))
        done = subprocess.run(["ccx", "tube"], cwd=folder, capture_output=True, text=True, check=False)
        text = done.stdout
        if done.returncode or "Job finished" not in text:
            tail = " ".join(text.split()[-40:])
            raise SystemExit(f"ccx failed: {tail}")
        tip = tip_displacement(Path(folder, "tube.dat").read_text())
    iterations = len(re.findall(r"^ iteration +\d+", text, re.MULTILINE))
    increments = len(re.findall(r"^ increment +\d+", text, re.MULTILINE))
    return Solved(
        tip=tip,
        work=0.0,
        unknowns=int(np.isnan(case.given).sum()),
        iterations=iterations,
        factorisations=iterations,
        settings=f"P2 displacement; {increments} increments; SPOOLES",
        version=re.search(
            r"Version ([\d.]+)", subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
        )[1],
    )


def deck(case: Case) -> str:
    """Return the input deck."""
    host, face = case.hosts(FACES)
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i},{x:.15g},{y:.15g},{z:.15g}" for i, (x, y, z) in enumerate(case.points.tolist(), start=1)]
    lines += ["*ELEMENT, TYPE=C3D10, ELSET=BODY"]
    lines += [f"{i}," + ",".join(map(str, nodes)) for i, nodes in enumerate((case.cells + 1).tolist(), start=1)]
    lines += ["*NSET, NSET=MOUNT", *(f"{node + 1}," for node in np.unique(case.surfaces["mount"]).tolist())]
    lines += ["*NSET, NSET=TIP", f"{case.tip + 1},"]
    lines += ["*BOUNDARY", "MOUNT,1,3"]
    lines += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", f"{case.mu / 2:.15g},{2 / case.bulk:.15g}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER"]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC, SOLVER=SPOOLES", f"{FIRST},1.,1e-4"]
    lines += ["*CONTROLS, PARAMETERS=FIELD", f"{TOLERANCE},1e-2"]
    lines += [
        "*DLOAD",
        *(f"{e + 1},P{f + 1},{case.pressure}" for e, f in zip(host.tolist(), face.tolist(), strict=True)),
    ]
    lines += ["*NODE PRINT, NSET=TIP, FREQUENCY=1000", "U", "*END STEP", ""]
    return "\n".join(lines)


def tip_displacement(text: str) -> tuple[float, float, float]:
    """Return the last displacement printed."""
    rows = [line.split() for line in text.splitlines() if re.match(r" +\d+ +[-\d.E+]+ ", line)]
    x, y, z = (float(value) for value in rows[-1][1:])
    return x, y, z


if __name__ == "__main__":
    if shutil.which("ccx") is None:
        sys.exit("ccx is not on the path")
    threads = os.environ.get("OMP_NUM_THREADS", "2")
    os.environ |= {"CCX_NPROC_EQUATION_SOLVER": threads, "CCX_NPROC_STIFFNESS": threads, "CCX_NPROC_RESULTS": threads}
    # Each run is a process of its own: nothing stays warm.
    run(solve, warm_up=lambda _: None)
