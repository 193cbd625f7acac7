"""FElupe: `SolidBodyNearlyIncompressible` on quadratic tetrahedra, Newton in one load step, PARDISO (pypardiso).

Its best settings of those tried. The nearly incompressible body keeps a mean pressure for each cell and condenses it,
the same discretisation as Turgor's; its three-field form would solve a larger, indefinite matrix. The linear solver is
pypardiso instead of SciPy's SuperLU, as FElupe's documentation advises, in symmetric mode, which halves the work of its
default. Assembly has `parallel=True` and two threads. FElupe has no boundary region for tetrahedra; `CavityFaces` is
one, built as FElupe's own regions are.
"""

from __future__ import annotations

import felupe as fem
import numpy as np
import pypardiso
import scipy.sparse as sp
from case_t import BULK, MOST_ITERATIONS, MU, PRESSURE, TOLERANCE, TubeMesh
from measure import Solved, run

EVEN_PERMUTATIONS = np.array([[1, 3, 2, 0], [0, 2, 3, 1], [1, 0, 3, 2], [0, 1, 2, 3]])
"""For the face opposite to each corner of a tetrahedron an order of the corners with those of the face first."""

EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]


def solve(tube: TubeMesh) -> Solved:
    mesh = fem.Mesh(tube.points, tube.cells, "tetra10")
    field = fem.FieldContainer([fem.Field(fem.RegionQuadraticTetra(mesh), dim=3)])
    solid = fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=MU, parallel=True), field, bulk=BULK)
    faces = fem.FieldContainer([fem.Field(CavityFaces(tube), dim=3)])
    pressure = fem.SolidBodyPressure(faces, pressure=PRESSURE)
    held = np.zeros(len(tube.points), dtype=bool)
    held[tube.clamped] = True
    clamp = {"mount": fem.Boundary(field[0], mask=held)}
    fixed, free = fem.dof.partition(field, clamp)
    load = float(np.linalg.norm(pressure.assemble.vector(field).toarray()))
    pardiso = pypardiso.PyPardisoSolver(mtype=-2)
    iterations = 0
    while True:
        force = solid.assemble.vector(field, parallel=True) - pressure.assemble.vector(field, parallel=True)
        force = force.toarray().ravel()
        imbalance = float(np.linalg.norm(force[free])) / load
        if imbalance <= TOLERANCE:
            break
        if iterations == MOST_ITERATIONS or not np.isfinite(imbalance):
            raise SystemExit(f"no equilibrium in {iterations} iterations, imbalance {imbalance:.2g}")
        stiffness = solid.assemble.matrix(parallel=True) - pressure.assemble.matrix(parallel=True)
        system = fem.solve.partition(field, stiffness, free, fixed, force)
        field += fem.solve.solve(*system, solver=lambda A, b: pardiso.solve(sp.triu(A, format="csr"), b))
        iterations += 1
    pardiso.free_memory(everything=True)
    return Solved(
        tip=tuple(field[0].values[tube.tip].tolist()),
        unknowns=len(free),
        iterations=iterations,
        factorisations=iterations,
        settings="P2–P0 mixed, condensed; 1 step; MKL PARDISO",
        version=fem.__version__,
    )


class CavityFaces(fem.Region):
    """The faces of the cavity as faces of the tetrahedra behind them, with the normals out of the solid."""

    def __init__(self, tube: TubeMesh) -> None:
        opposite = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
        host, face = tube.host_faces(opposite)
        corners = EVEN_PERMUTATIONS[face]
        middle = np.zeros((4, 4), dtype=int)
        for place, (a, b) in enumerate(EDGES, start=4):
            middle[a, b] = middle[b, a] = place
        order = np.concatenate([corners, *(middle[corners[:, a], corners[:, b]][:, None] for a, b in EDGES)], axis=1)
        cells = np.take_along_axis(tube.cells[host], order, axis=1)
        triangle = fem.TriangleQuadrature(order=5)
        on_face = fem.quadrature.Scheme(np.pad(triangle.points, ((0, 0), (0, 1))), triangle.weights)
        super().__init__(fem.Mesh(tube.points, cells, "tetra10"), fem.QuadraticTetra(), on_face)
        # The corners 0 1 2 of a positive tetrahedron turn about the normal into it.
        area = -np.cross(self.dXdr[:, 0], self.dXdr[:, 1], axis=0) * triangle.weights[:, None]
        self.dV = np.linalg.norm(area, axis=0)
        self.normals = area / self.dV


if __name__ == "__main__":
    run(solve)
