"""Turgor: P2–P0, mixed Newton in one load step, on two threads; `direct` or `iterative` (third argument).

`direct` condenses the mean pressures and factorises with PARDISO, its default at these sizes; `iterative` keeps them as
unknowns of a Krylov method, and does not tell whether the state is stable, as the peers do not.
"""

from __future__ import annotations

import sys

import numpy as np
from case_t import BULK, MU, PRESSURE, TOLERANCE, TubeMesh
from measure import Solved, run

import turgor
from turgor.fem.loads import Pressure
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.materials.registry import create
from turgor.mesh import Mesh
from turgor.solver.linear import solver_in_use
from turgor.solver.newton import NewtonOptions
from turgor.solver.path import PathOptions, solve_path


def tube_mesh(size: float) -> TubeMesh:
    """Mesh case T with Turgor's mesher at an element size in mm."""
    mesh = turgor.CappedTube().mesh(size=f"{size} mm")
    tip = int(mesh.markers["tip"][0])
    return TubeMesh(mesh.points, mesh.cells, mesh.surfaces["mount"], mesh.surfaces["cavity"], tip)


def body_of(tube: TubeMesh) -> Mesh:
    """Return the tube as a mesh of Turgor's."""
    return Mesh(
        points=tube.points,
        cells=tube.cells,
        regions={"body": np.arange(len(tube.cells), dtype=np.int32)},
        surfaces={"mount": tube.mount, "cavity": tube.cavity},
        markers={},
        curves={},
    )


def solve(tube: TubeMesh) -> Solved:
    mesh = body_of(tube)
    rubber = create("neo-hookean", {"C10": f"{MU / 2} MPa"}, bulk_modulus=f"{BULK} MPa")
    system = System(mesh, {"body": rubber}, [Clamped("mount")], [Pressure("cavity", PRESSURE)])
    way = sys.argv[3]
    options = PathOptions(newton=NewtonOptions(tolerance=TOLERANCE, linear=way))
    (end,) = solve_path(system, [1.0], options=options)
    return Solved(
        tip=tuple(end.state.u[tube.tip].tolist()),
        unknowns=system.n_dofs,
        iterations=end.iterations,
        factorisations=end.factorisations,
        settings=f"P2–P0 mixed; 1 step; {solver_in_use().name if way == 'direct' else 'GMRES, multigrid'}",
        version=turgor.__version__,
    )


if __name__ == "__main__":
    run(solve)
