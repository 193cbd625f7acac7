"""FEBio: P2–P0 (`three-field-solid`) in displacements, full Newton, MKL PARDISO, symmetric, on two threads.

    .venv/bin/python benchmarks/peers/with_febio.py MESH.npz MESH.npz STEPS

For the tube, whole and a quarter: FEBio has no plane and no axisymmetric elements. The model is what ``turgor export``
writes. The pressures of the cells follow from the displacements, so that long steps fail and are cut; of 4, 5, 6,
8 and 10 steps five need fewest iterations (40, 31, 39, 33 and 41 on the mesh of 3 mm). Reading the model is in the
times.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
from case import TOLERANCE, Case
from measure import Solved, run
from with_turgor import mesh_of, rubber_of

from turgor.fem.loads import Pressure
from turgor.study.export.febio import Stepping, feb_model
from turgor.study.export.problem import Held, Problem


def solve(case: Case, steps: int) -> Solved:
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "tube.feb").write_text("\n".join(feb_model(problem_of(case), stepping(steps))))
        command = ["febio4", "-i", "tube.feb", "-silent"]
        subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        log = Path(folder, "tube.log").read_text()
    if "N O R M A L   T E R M I N A T I O N" not in log:
        raise SystemExit("febio4 failed: " + " ".join(log.split()[-40:]))
    x, y, z = re.findall(rf"^{case.tip + 1} (\S+) (\S+) (\S+)$", log, re.MULTILINE)[-1]
    return Solved(
        tip=(float(x), float(y), float(z)),
        work=0.0,
        unknowns=said(log, "Nr of equations"),
        iterations=said(log, "Total number of equilibrium iterations"),
        factorisations=said(log, "Total number of stiffness reformations"),
        settings=f"P2–P0 displacement; {steps} steps; full Newton; PARDISO",
        version=re.search(r"version (\d[\d.]*)", log)[1],
    )


def stepping(steps: int) -> Stepping:
    """Return the steps, and when one has converged.

    A step begins with the residual of its part of the load, to which FEBio compares; so the residual that is asked for
    is `TOLERANCE` of the whole load, as elsewhere.
    """
    return Stepping(1.0 / steps, force_tolerance=TOLERANCE * steps)


def problem_of(case: Case) -> Problem:
    """Return the case in terms that every program has."""
    held = [
        Held(name, axis, float(value))
        for name, values in case.held.items()
        for axis, value in enumerate(values)
        if not np.isnan(value)
    ]
    return Problem(
        name="tube",
        mesh=mesh_of(case),
        materials={"body": rubber_of(case)},
        held=tuple(held),
        pressures=(Pressure("cavity", case.pressure),),
        tractions=(),
        weight=None,
        fractions=(1.0,),
    )


def said(log: str, what: str) -> int:
    """Return the last number that the log gives for this."""
    return int(re.findall(rf"{what} \.* : (\d+)", log)[-1])


if __name__ == "__main__":
    if shutil.which("febio4") is None:
        sys.exit("febio4 is not on the path")
    # Each run is a process of its own: nothing stays warm.
    run(partial(solve, steps=int(sys.argv[3])), warm_up=lambda _: None)
