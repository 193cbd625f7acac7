"""DOLFINx: P2–P0 or P2–P1 (third argument), Newton in one load step, MUMPS in symmetric mode on two MPI ranks.

Its best settings of those tried. P2–P0 is Turgor's element, its pressures left in the system, for DOLFINx does not
condense them; the Taylor–Hood pair P2–P1 of its demos has a quarter of the pressures, but couples them. MUMPS
factorises L D Lᵀ (`pc_type cholesky`; LU needs 30 % more memory), orders with METIS and analyses the pattern once, on
two ranks with one thread each, as both codes are made parallel by MPI. Forms are compiled with `-O3 -march=native` and
integrated with four points, as by Turgor; UFL's own estimate takes many more.
"""

from __future__ import annotations

from mpi4py import MPI  # isort: skip  (must be first, so that DOLFINx finds this wheel's MPI)

import sys

import basix.ufl
import dolfinx
import numpy as np
import ufl
from case_t import BULK, MOST_ITERATIONS, MU, PRESSURE, TOLERANCE, VOLUME_TOLERANCE, TubeMesh
from dolfinx import fem
from dolfinx.fem import petsc
from measure import Solved, run
from petsc4py import PETSc

TET10 = [0, 1, 2, 3, 9, 8, 5, 7, 6, 4]
"""Basix's order of the nodes: edges 23 13 12 03 02 01."""

OPPOSITE = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Basix's numbering of the faces: each opposite to its corner."""

COMPILED = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
PRESSURES = {"P2-P0": ("DG", 0), "P2-P1": ("Lagrange", 1)}
MUMPS = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_7": 5,
    "mat_mumps_icntl_14": 40,
}
"""Symmetric factorisation, METIS, 40 % more memory than MUMPS expects to need when it pivots."""

comm = MPI.COMM_WORLD


def solve(tube: TubeMesh) -> Solved:
    mesh, cavity = curved_mesh(tube)
    name = sys.argv[3]
    family, degree = PRESSURES[name]
    pressures = basix.ufl.element(family, "tetrahedron", degree)
    space = fem.functionspace(mesh, basix.ufl.mixed_element([quadratic(), pressures]))
    solution = fem.Function(space)
    force, tangent = forms(solution, mesh, cavity)
    displacement, (to_mixed,) = space.sub(0).collapse()
    to_mixed = np.asarray(to_mixed)
    mount = fem.locate_dofs_geometrical((space.sub(0), displacement), lambda x: np.isclose(x[2], 0.0))
    clamp = fem.dirichletbc(fem.Function(displacement), mount, space.sub(0))
    newton = Newton(solution, force, tangent, clamp, to_mixed, size_of_volume(mesh, pressures))
    newton.run()
    return Solved(
        tip=tip_displacement(solution, displacement, to_mixed, tube.points[tube.tip]),
        unknowns=space.dofmap.index_map.size_global * space.dofmap.index_map_bs,
        iterations=newton.iterations,
        factorisations=newton.iterations,
        settings=f"{name.replace('-', '–')} mixed; 1 step; MUMPS L D Lᵀ, {comm.size} ranks",
        version=dolfinx.__version__,
    )


def curved_mesh(tube: TubeMesh) -> tuple[dolfinx.mesh.Mesh, np.ndarray]:
    """Return the distributed mesh and this rank's cavity faces as pairs of cell and face."""
    first = comm.rank == 0
    cells = tube.cells[:, TET10].astype(np.int64) if first else np.empty((0, 10), np.int64)
    points = tube.points if first else np.empty((0, 3))
    mesh = dolfinx.mesh.create_mesh(comm, cells, quadratic(), points)
    host, face = tube.host_faces(OPPOSITE)
    owned = np.asarray(mesh.topology.original_cell_index)[: mesh.topology.index_map(3).size_local]
    here = np.full(len(tube.cells), -1, dtype=np.int32)
    here[owned] = np.arange(len(owned))
    mine = here[host] >= 0
    return mesh, np.column_stack([here[host[mine]], face[mine]]).astype(np.int32)


def forms(solution: fem.Function, mesh: dolfinx.mesh.Mesh, cavity: np.ndarray) -> tuple[fem.Form, fem.Form]:
    """Return ∂Π and ∂²Π of Π(u, p) = ∫ μ/2 (Ī₁ − 3) + p (J − 1) − p²/2K dV − P · volume of the cavity."""
    u, p = ufl.split(solution)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2})
    ds = ufl.Measure("ds", mesh, subdomain_data=[(1, cavity.ravel())], metadata={"quadrature_degree": 4})
    F = ufl.Identity(3) + ufl.grad(u)
    J = ufl.det(F)
    energy = MU / 2 * (J ** (-2 / 3) * ufl.inner(F, F) - 3) + p * (J - 1) - p**2 / (2 * BULK)
    x = ufl.SpatialCoordinate(mesh) + u
    volume = -ufl.dot(x, ufl.cofac(F) * ufl.FacetNormal(mesh)) / 3 * ds(1)
    first = ufl.derivative(energy * dx - PRESSURE * volume, solution)
    second = ufl.derivative(first, solution)
    return tuple(fem.form(form, jit_options=COMPILED) for form in (first, second))


def quadratic() -> basix.ufl._ElementBase:
    return basix.ufl.element("Lagrange", "tetrahedron", 2, shape=(3,))


def size_of_volume(mesh: dolfinx.mesh.Mesh, pressures: basix.ufl._ElementBase) -> float:
    """Return the norm of ∫ q dV over all test pressures q: what the volume's residual is small against."""
    test = ufl.TestFunction(fem.functionspace(mesh, pressures))
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": 2})
    vector = petsc.assemble_vector(fem.form(test * dx, jit_options=COMPILED))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return float(vector.norm())


class Newton:
    """Newton's method spelt out, so that iterations and tolerance are the benchmark's."""

    def __init__(
        self,
        solution: fem.Function,
        force: fem.Form,
        tangent: fem.Form,
        clamp: fem.DirichletBC,
        displacements: np.ndarray,
        size: float,
    ) -> None:
        self.solution, self.force, self.tangent, self.clamp, self.size = solution, force, tangent, clamp, size
        self.matrix = petsc.create_matrix(tangent)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.residual = petsc.create_vector(solution.function_space)
        self.step = self.residual.duplicate()
        owned = solution.function_space.dofmap.index_map.size_local * solution.function_space.dofmap.index_map_bs
        is_displacement = np.zeros(owned, dtype=bool)
        is_displacement[displacements[displacements < owned]] = True
        self.is_displacement = is_displacement
        self.solver = PETSc.KSP().create(comm)
        options = PETSc.Options()
        for key, value in MUMPS.items():
            options[key] = value
        self.solver.setFromOptions()
        self.solver.setOperators(self.matrix)
        self.iterations = 0

    def norms(self) -> tuple[float, float]:
        """Assemble the residual; return the norms of its displacement part and of its pressure part."""
        with self.residual.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.residual, self.force)
        self.residual.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        self.all_forces = self._norm(self.is_displacement)
        petsc.set_bc(self.residual, [self.clamp], alpha=0.0)
        return self._norm(self.is_displacement), self._norm(~self.is_displacement)

    def run(self) -> None:
        imbalance, gap = self.norms()
        load = self.all_forces  # at rest the pressure's are the only forces
        while not (imbalance <= TOLERANCE * load and gap <= VOLUME_TOLERANCE * self.size):
            if self.iterations == MOST_ITERATIONS or not np.isfinite(imbalance):
                raise SystemExit(f"no equilibrium in {self.iterations} iterations, imbalance {imbalance / load:.2g}")
            self.matrix.zeroEntries()
            petsc.assemble_matrix(self.matrix, self.tangent, bcs=[self.clamp])
            self.matrix.assemble()
            self.solver.solve(self.residual, self.step)
            self.solution.x.petsc_vec.axpy(-1.0, self.step)
            self.solution.x.scatter_forward()
            self.iterations += 1
            imbalance, gap = self.norms()

    def _norm(self, part: np.ndarray) -> float:
        return float(np.sqrt(comm.allreduce(float(np.sum(self.residual.array_r[part] ** 2)))))


def tip_displacement(
    solution: fem.Function, displacement: fem.FunctionSpace, to_mixed: np.ndarray, tip: np.ndarray
) -> tuple[float, float, float]:
    """Return the displacement of the node at `tip` on every rank."""
    distance = np.linalg.norm(displacement.tabulate_dof_coordinates() - tip, axis=1)
    node = int(np.argmin(distance))
    found = (float(distance[node]), tuple(solution.x.array[to_mixed[3 * node : 3 * node + 3]].tolist()))
    return min(comm.allgather(found))[1]


if __name__ == "__main__":
    run(solve, comm)
