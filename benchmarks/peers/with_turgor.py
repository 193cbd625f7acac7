"""Turgor: mixed Newton in one load step, on two threads; `auto`, `direct` or `iterative` (third argument).

The element is P2–P0, of quadrilaterals and hexahedra Q2–P1disc. `direct` condenses the pressures and factorises with
PARDISO; `iterative`, for bodies in space, keeps them as unknowns of a Krylov method; `auto`, its default, takes what is
expected to cost less. All tell whether the state is stable, which the peers do not.
"""

from __future__ import annotations

import sys
from functools import partial

import numpy as np
from case import TOLERANCE, Case
from measure import Solved, run

import turgor
from turgor.common.blas import dense_products_on_one_thread
from turgor.fem.loads import Pressure
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Prescribed
from turgor.fem.system import System
from turgor.materials import Hyperelastic
from turgor.materials.registry import create
from turgor.mesh import Mesh
from turgor.solver.newton import NewtonOptions
from turgor.solver.path import PathOptions, solve_path

ELEMENTS = {10: "P2–P0", 6: "P2–P0", 9: "Q2–P1disc", 27: "Q2–P1disc"}
SECTIONS = {"space": None, "plane-strain": PlaneStrain(), "axisymmetric": Axisymmetric()}


def system_of(case: Case) -> System:
    """Return the case as a model of Turgor's."""
    supports = [
        Prescribed(name, tuple(None if np.isnan(u) else float(u) for u in value)) for name, value in case.held.items()
    ]
    loads = [Pressure("cavity", case.pressure)] if case.has_cavity else []
    return System(mesh_of(case), {"body": rubber_of(case)}, supports, loads, section=SECTIONS[case.kind])


def mesh_of(case: Case) -> Mesh:
    return Mesh(case.points, case.cells, surfaces=case.surfaces, markers={"tip": np.array([case.tip])})


def rubber_of(case: Case) -> Hyperelastic:
    return create("neo-hookean", {"C10": f"{case.mu / 2} MPa"}, bulk_modulus=f"{case.bulk} MPa")


@dense_products_on_one_thread()
def solve(case: Case, way: str) -> Solved:
    # The forces are asked for after the path, which has OpenBLAS on one thread only as long as it lasts: its threads
    # would spin from the warm-up into the run that is measured.
    system = system_of(case)
    options = PathOptions(newton=NewtonOptions(tolerance=TOLERANCE, linear=way))
    (end,) = solve_path(system, [1.0], options=options)
    return Solved(
        tip=tuple(end.state.u[case.tip].tolist()),
        work=float(np.vdot(system.forces(end.state)[0], np.nan_to_num(case.given))),
        unknowns=system.n_dofs,
        iterations=end.iterations,
        factorisations=end.factorisations,
        settings=f"{ELEMENTS[case.cells.shape[1]]} mixed; 1 step; linear problems {way}",
        version=turgor.__version__,
    )


def warm_up(case: Case) -> None:
    """Solve in both ways: on a finer mesh `auto` may choose another one than on this."""
    for way in ("direct", "iterative"):
        solve(case, way)


if __name__ == "__main__":
    run(partial(solve, way=sys.argv[3]), warm_up=warm_up)
