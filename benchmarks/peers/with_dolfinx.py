"""DOLFINx: Newton in one load step, MUMPS in symmetric mode on two MPI ranks.

Its best settings of those tried, with P2–P0, P2–P1, Q2–P0, Q2–P1disc or Q2–P1space (third argument). P2–P0 is Turgor's
element, its pressures left in the system, for DOLFINx does not condense them; the Taylor–Hood pair P2–P1 of its demos
has a quarter of the pressures, but couples them. MUMPS factorises L D Lᵀ (`pc_type cholesky`; LU needs 30 % more
memory), orders with METIS and analyses the pattern once, on two ranks with one thread each, as both codes are made
parallel by MPI. Forms are compiled with `-O3 -march=native` and integrated with the points of Turgor (four a
tetrahedron, three a triangle); UFL's own estimate takes many more.
"""

from __future__ import annotations

from mpi4py import MPI  # isort: skip  (must be first, so that DOLFINx finds this wheel's MPI)

import sys

import basix.ufl
import dolfinx
import measure
import numpy as np
import ufl
from case import HEX27, OPPOSITE, Case
from dolfinx import fem
from dolfinx.fem import petsc
from measure import Solved, run
from petsc4py import PETSc

CELL_NODES = {10: [0, 1, 2, 3, 9, 8, 5, 7, 6, 4], 6: [0, 1, 2, 4, 5, 3], 9: [0, 1, 3, 2, 4, 7, 5, 6, 8]}
"""Basix's order of the nodes: edges 23 13 12 03 02 01 of a tetrahedron, 12 02 01 of a triangle; of a quadrilateral the
corners row by row."""

LAGRANGE = basix.ElementFamily.P, basix.CellType.hexahedron, 2, basix.LagrangeVariant.equispaced
CELL_NODES[27] = [int(np.argmin(np.abs(HEX27 - place).sum(axis=1))) for place in basix.create_element(*LAGRANGE).points]
FACES = {
    27: np.array(CELL_NODES[27])[np.array(basix.topology(basix.CellType.hexahedron)[2])],
    9: np.array(CELL_NODES[9])[np.array(basix.topology(basix.CellType.quadrilateral)[1])],
}

CELLS = {10: "tetrahedron", 6: "triangle", 9: "quadrilateral", 27: "hexahedron"}
DEGREES = {10: 2, 6: 2, 9: 5, 27: 5}
"""Of the integration rule: four, three, nine and 27 points."""

COMPILED = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
PRESSURES = {
    "P2-P0": ("DG", 0),
    "P2-P1": ("Lagrange", 1),
    "Q2-P0": ("DG", 0),
    "Q2-P1disc": ("DPC", 1),
    "Q2-P1space": ("DG", 0),
}
"""The last two are linear in the coordinates of the reference cell, and in those of space, as in Turgor."""

MUMPS = {
    "ksp_type": "preonly",
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_7": 5,
    "mat_mumps_icntl_14": 40,
}
"""Symmetric factorisation, METIS, 40 % more memory than MUMPS expects to need when it pivots."""

comm = MPI.COMM_WORLD


def solve(case: Case) -> Solved:
    mesh, cavity = curved_mesh(case)
    name = sys.argv[3]
    family, degree = PRESSURES[name]
    shape = (1 + case.dimension,) if name == "Q2-P1space" else None
    pressures = basix.ufl.element(family, cell_of(case), degree, shape=shape)
    space = fem.functionspace(mesh, basix.ufl.mixed_element([quadratic(case), pressures]))
    solution = fem.Function(space)
    force, tangent = forms(case, solution, mesh, cavity)
    displacement, (to_mixed,) = space.sub(0).collapse()
    to_mixed, nodes = np.asarray(to_mixed), nodes_of(mesh, displacement)
    given = case.given[nodes].ravel()
    support = held(space, displacement, to_mixed, given)
    size = size_of_volume(case, mesh, pressures)
    newton = Newton(solution, force, tangent, support, to_mixed, size, measure.Newton(case))
    newton.run()
    return Solved(
        tip=tip_displacement(solution, to_mixed, nodes == case.tip),
        work=newton.work(to_mixed, np.nan_to_num(given)),
        unknowns=space.dofmap.index_map.size_global * space.dofmap.index_map_bs,
        iterations=newton.progress.iterations,
        factorisations=newton.progress.iterations,
        settings=f"{name.replace('-', '–')} mixed; 1 step; MUMPS L D Lᵀ, {comm.size} ranks",
        version=dolfinx.__version__,
    )


def curved_mesh(case: Case) -> tuple[dolfinx.mesh.Mesh, np.ndarray]:
    """Return the distributed mesh and this rank's cavity faces as pairs of cell and face."""
    first, order = comm.rank == 0, CELL_NODES[case.cells.shape[1]]
    cells = case.cells[:, order].astype(np.int64) if first else np.empty((0, len(order)), np.int64)
    points = case.points if first else np.empty((0, case.dimension))
    mesh = dolfinx.mesh.create_mesh(comm, cells, quadratic(case), points)
    if not case.has_cavity:
        return mesh, np.empty((0, 2), np.int32)
    host, face = case.hosts(FACES.get(case.cells.shape[1], OPPOSITE[case.dimension]))
    owned = np.asarray(mesh.topology.original_cell_index)[: mesh.topology.index_map(case.dimension).size_local]
    here = np.full(len(case.cells), -1, dtype=np.int32)
    here[owned] = np.arange(len(owned))
    mine = here[host] >= 0
    return mesh, np.column_stack([here[host[mine]], face[mine]]).astype(np.int32)


def nodes_of(mesh: dolfinx.mesh.Mesh, displacement: fem.FunctionSpace) -> np.ndarray:
    """Return the node of the case at each node of this rank's displacements: both are quadratic on the same cells."""
    dofs = displacement.dofmap
    nodes = np.empty(dofs.index_map.size_local + dofs.index_map.num_ghosts, dtype=np.int64)
    nodes[dofs.list] = np.asarray(mesh.geometry.input_global_indices)[mesh.geometry.dofmaps[0]]
    return nodes


def held(
    space: fem.FunctionSpace, displacement: fem.FunctionSpace, to_mixed: np.ndarray, given: np.ndarray
) -> fem.DirichletBC:
    """Return the support: displacements `given` on this rank, NaN where they are free."""
    value = fem.Function(displacement)
    value.x.array[:] = np.nan_to_num(given)
    fixed = np.flatnonzero(np.isfinite(given)).astype(np.int32)
    fixed = fixed[np.argsort(to_mixed[fixed])]
    return fem.dirichletbc(value, [to_mixed[fixed].astype(np.int32), fixed], space.sub(0))


def forms(case: Case, solution: fem.Function, mesh: dolfinx.mesh.Mesh, cavity: np.ndarray) -> tuple[fem.Form, fem.Form]:
    """Return ∂Π and ∂²Π of Π(u, p) = ∫ μ/2 (Ī₁ − 3) + p (J − 1) − p²/2K dV − P · volume of the cavity."""
    u, p = ufl.split(solution)
    p = field_of(p, mesh)
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": DEGREES[case.cells.shape[1]]})
    in_plane = ufl.Identity(case.dimension) + ufl.grad(u)
    F = deformation(case, mesh, in_plane, u)
    J = ufl.det(F)
    energy = case.mu / 2 * (J ** (-2 / 3) * ufl.inner(F, F) - 3) + p * (J - 1) - p**2 / (2 * case.bulk)
    potential = depth(case, mesh) * energy * dx
    if case.has_cavity:
        # Exact: what is integrated is of this degree along the faces.
        degree = 5 if case.is_axisymmetric or case.is_of_rows else 4
        ds = ufl.Measure("ds", mesh, subdomain_data=[(1, cavity.ravel())], metadata={"quadrature_degree": degree})
        x, area = ufl.SpatialCoordinate(mesh) + u, ufl.cofac(in_plane) * ufl.FacetNormal(mesh)
        flux = ufl.pi * x[0] ** 2 * area[0] if case.is_axisymmetric else ufl.dot(x, area) / 3
        potential += case.pressure * flux * ds(1)
    first = ufl.derivative(potential, solution)
    second = ufl.derivative(first, solution)
    return tuple(fem.form(form, jit_options=COMPILED) for form in (first, second))


def deformation(
    case: Case, mesh: dolfinx.mesh.Mesh, F: ufl.core.expr.Expr, u: ufl.core.expr.Expr
) -> ufl.core.expr.Expr:
    """Return the deformation gradient ``(3, 3)`` from that of the section."""
    if case.dimension == 3:
        return F
    hoop = 1 + u[0] / ufl.SpatialCoordinate(mesh)[0] if case.is_axisymmetric else 1
    return ufl.as_matrix([[F[0, 0], F[0, 1], 0], [F[1, 0], F[1, 1], 0], [0, 0, hoop]])


def depth(case: Case, mesh: dolfinx.mesh.Mesh) -> ufl.core.expr.Expr | int:
    """Return what an area of the section is multiplied by to give a volume; 1 in space."""
    return 2 * ufl.pi * ufl.SpatialCoordinate(mesh)[0] if case.is_axisymmetric else 1


def cell_of(case: Case) -> str:
    return CELLS[case.cells.shape[1]]


def quadratic(case: Case) -> basix.ufl._ElementBase:
    return basix.ufl.element("Lagrange", cell_of(case), 2, shape=(case.dimension,))


def field_of(p: ufl.core.expr.Expr, mesh: dolfinx.mesh.Mesh) -> ufl.core.expr.Expr:
    """Return the pressure of its unknowns: constants of a cell stand for 1, x, y (and z) about its middle."""
    if not p.ufl_shape:
        return p
    d = mesh.geometry.dim
    middle = fem.Function(fem.functionspace(mesh, ("DG", 0, (d,))))
    middle.interpolate(lambda x: x[:d])
    local = ufl.SpatialCoordinate(mesh) - middle
    return p[0] + sum(p[i + 1] * local[i] for i in range(d))


def size_of_volume(case: Case, mesh: dolfinx.mesh.Mesh, pressures: basix.ufl._ElementBase) -> float:
    """Return the norm of ∫ q dV over all test pressures q: what the volume's residual is small against."""
    test = ufl.TestFunction(fem.functionspace(mesh, pressures))
    dx = ufl.Measure("dx", mesh, metadata={"quadrature_degree": DEGREES[case.cells.shape[1]]})
    vector = petsc.assemble_vector(fem.form(depth(case, mesh) * field_of(test, mesh) * dx, jit_options=COMPILED))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return float(vector.norm())


class Newton:
    """Newton's method spelt out, so that iterations and tolerance are the benchmark's."""

    def __init__(
        self,
        solution: fem.Function,
        force: fem.Form,
        tangent: fem.Form,
        support: fem.DirichletBC,
        displacements: np.ndarray,
        size: float,
        progress: measure.Newton,
    ) -> None:
        self.solution, self.force, self.tangent, self.support, self.size = solution, force, tangent, support, size
        self.progress = progress
        self.matrix = petsc.create_matrix(tangent)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.residual = petsc.create_vector(solution.function_space)
        self.step = self.residual.duplicate()
        self.owned = solution.function_space.dofmap.index_map.size_local * solution.function_space.dofmap.index_map_bs
        is_displacement = np.zeros(self.owned, dtype=bool)
        is_displacement[displacements[displacements < self.owned]] = True
        self.is_displacement = is_displacement
        self.solver = PETSc.KSP().create(comm)
        options = PETSc.Options()
        for key, value in MUMPS.items():
            options[key] = value
        self.solver.setFromOptions()
        self.solver.setOperators(self.matrix)

    def assemble(self, lifted_from: PETSc.Vec | None = None) -> None:
        with self.residual.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(self.residual, self.force)
        if lifted_from is not None:
            petsc.apply_lifting(self.residual, [self.tangent], bcs=[[self.support]], x0=[lifted_from], alpha=-1.0)
        self.residual.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def arrived(self) -> bool:
        """Assemble the residual with zeros where displacements are held, and say whether it is small enough."""
        self.assemble()
        forces = self._norm(self.is_displacement)
        petsc.set_bc(self.residual, [self.support], alpha=0.0)
        return self.progress.arrived(
            self._norm(self.is_displacement), forces, self._norm(~self.is_displacement) / self.size
        )

    def run(self) -> None:
        while not self.arrived():
            self.matrix.zeroEntries()
            petsc.assemble_matrix(self.matrix, self.tangent, bcs=[self.support])
            self.matrix.assemble()
            if self.progress.iterations == 0:
                self.lift()
            self.solver.solve(self.residual, self.step)
            self.solution.x.petsc_vec.axpy(-1.0, self.step)
            self.solution.x.scatter_forward()

    def lift(self) -> None:
        """Let the step from rest bring the displacements to the given ones."""
        here = self.solution.x.petsc_vec
        self.assemble(lifted_from=here)
        petsc.set_bc(self.residual, [self.support], x0=here, alpha=-1.0)

    def work(self, to_mixed: np.ndarray, given: np.ndarray) -> float:
        """Return the work of the last forces along the `given` displacements."""
        self.assemble()
        here = to_mixed < self.owned
        return comm.allreduce(float(self.residual.array_r[to_mixed[here]] @ given[here]))

    def _norm(self, part: np.ndarray) -> float:
        return float(np.sqrt(comm.allreduce(float(np.sum(self.residual.array_r[part] ** 2)))))


def tip_displacement(solution: fem.Function, to_mixed: np.ndarray, at_tip: np.ndarray) -> tuple[float, ...]:
    """Return the displacement at the one node of any rank that is the tip."""
    dofs = to_mixed.reshape(len(at_tip), -1)[at_tip].ravel()
    found = comm.allgather(tuple(solution.x.array[dofs].tolist()))
    return next(tip for tip in found if tip)


if __name__ == "__main__":
    run(solve, comm)
