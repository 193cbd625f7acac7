"""NGSolve: P2–P0, pressures condensed, Newton in one load step, sparse Cholesky under the task manager.

Its best settings of those tried. The elements are Turgor's (in hexahedra and quadrilaterals Q2–P1disc) and, there,
Q2–P0 (third argument); static condensation (`condense=True`) removes the pressure from the global system, which is
positive definite then, so that NGSolve's own parallel Cholesky factorises it; P2–P1 needs an indefinite solver, and the
wheel's only one, UMFPACK, is unsymmetric and serial. NGSolve differentiates the compiled potential energy; integration
takes the points of Turgor, four a tetrahedron, three a triangle, and `Update` keeps the ordering (together 9.0 → 5.7 s
of processor time at 5.7 k tetrahedra). Two threads.
"""

from __future__ import annotations

import itertools
import sys

import netgen.meshing
import ngsolve as ng
import numpy as np
from case import NODES, Case
from measure import Newton, Solved, run

CELL_NODES = {3: [0, 1, 2, 3, 4, 6, 7, 5, 8, 9], 2: [0, 1, 2, 4, 5, 3]}
"""Netgen's order of the nodes: edges 01 02 03 12 13 23 of a tetrahedron, of a triangle each opposite to its corner."""

FACE_NODES = {3: CELL_NODES[2], 2: [0, 1, 2]}


CORNER_SHAPES = {
    number: np.prod(np.where(nodes[: 2 ** nodes.shape[1]] == 1, nodes[:, None], 1 - nodes[:, None]), axis=2)
    for number, nodes in NODES.items()
}
"""The multilinear shape functions of the corners of a hexahedron or quadrilateral at all its nodes."""


def gauss(dimension: int) -> ng.IntegrationRule:
    """Return three Gauss points each way."""
    points, weights = np.polynomial.legendre.leggauss(3)
    places = itertools.product((1 + points) / 2, repeat=dimension)
    return ng.IntegrationRule(
        list(places), [float(np.prod(w)) for w in itertools.product(weights / 2, repeat=dimension)]
    )


NEAR, FAR = (5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20
RULES = {
    ng.ET.TET: ng.IntegrationRule(
        [(FAR, NEAR, NEAR), (NEAR, FAR, NEAR), (NEAR, NEAR, FAR), (NEAR, NEAR, NEAR)], [1 / 24] * 4
    ),
    ng.ET.HEX: gauss(3),
    ng.ET.QUAD: gauss(2),
    ng.ET.TRIG: ng.IntegrationRule([(1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)], [1 / 6] * 3),
}
"""The rules of degree 2, which Turgor and FElupe use; NGSolve's own choice takes more points."""


def solve(case: Case) -> Solved:
    element = sys.argv[3]
    mesh = curved_mesh(case)
    axes = "xyz"[: case.dimension]
    held = {
        f"dirichlet{axis}": "|".join(name for name, value in case.held.items() if not np.isnan(value[i]))
        for i, axis in enumerate(axes)
    }
    constant = ng.L2(mesh, order=0)
    pressures = constant ** (1 + case.dimension) if element == "Q2-P1disc" else constant
    space = ng.VectorH1(mesh, order=2, **held) * pressures
    form = potential(case, space)
    solution, given = ng.GridFunction(space), ng.GridFunction(space)
    for name, value in case.held.items():
        for i in np.flatnonzero(np.nan_to_num(value)):
            given.components[0].components[i].Set(value[i], definedon=mesh.Boundaries(name))
    solver = Solver(case, form, space, solution, given)
    solver.run()
    return Solved(
        tip=tuple(solution.components[0](mesh(*case.points[case.tip]))),
        work=float(ng.InnerProduct(solver.residual, given.vec)),
        unknowns=int(np.sum(list(solver.coupling))),
        iterations=solver.newton.iterations,
        factorisations=solver.newton.iterations,
        settings=f"{element.replace('-', '–')} mixed, condensed; 1 step; sparsecholesky",
        version=ng.__version__,
    )


def curved_mesh(case: Case) -> ng.Mesh:
    """Return the mesh with its middle nodes; Netgen wants the corners numbered first."""
    if case.is_of_rows:
        return mesh_of_rows(case)
    d = case.dimension
    corner = np.zeros(len(case.points), dtype=bool)
    corner[case.cells[:, : d + 1]] = True
    order = np.argsort(~corner, kind="stable")
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    mesh = netgen.meshing.Mesh(dim=d)
    mesh.AddPoints(np.pad(case.points[order], ((0, 0), (0, 3 - d))))
    if d == 2:
        mesh.Add(netgen.meshing.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
    for number, (name, faces) in enumerate(case.surfaces.items(), start=1):
        if d == 3:
            mesh.Add(netgen.meshing.FaceDescriptor(surfnr=number, domin=1, domout=0, bc=number))
        mesh.SetBCName(number - 1, name)
        mesh.AddElements(dim=d - 1, index=number, data=np.ascontiguousarray(place[faces[:, FACE_NODES[d]]]), base=0)
    mesh.AddElements(dim=d, index=1, data=np.ascontiguousarray(place[case.cells[:, CELL_NODES[d]]]), base=0)
    return ng.Mesh(mesh)


def mesh_of_rows(case: Case) -> ng.Mesh:
    """Return the mesh of the corners, deformed so that all 27 (or nine) nodes of each cell are in their places.

    Netgen has no such cell, and NGSolve none of its curved ones in spaces.
    """
    d, count = case.dimension, case.cells.shape[1]
    corners = np.unique(case.cells[:, : 2**d])
    mesh = netgen.meshing.Mesh(dim=d)
    mesh.AddPoints(np.pad(case.points[corners], ((0, 0), (0, 3 - d))))
    if d == 2:
        mesh.Add(netgen.meshing.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
    for number, (name, faces) in enumerate(case.surfaces.items(), start=1):
        if d == 3:
            mesh.Add(netgen.meshing.FaceDescriptor(surfnr=number, domin=1, domout=0, bc=number))
        mesh.SetBCName(number - 1, name)
        sides = np.searchsorted(corners, faces[:, : 2 ** (d - 1)]).astype(np.int32)
        mesh.AddElements(dim=d - 1, index=number, data=sides, base=0)
    mesh.AddElements(dim=d, index=1, data=np.searchsorted(corners, case.cells[:, : 2**d]).astype(np.int32), base=0)
    mesh = ng.Mesh(mesh)
    space = ng.H1(mesh, order=2)
    elements = list(space.Elements())
    # Bubbles of second order are the same from whichever end, so that one matrix serves all cells.
    first = space.GetFE(ng.ElementId(ng.VOL, 0))
    shapes = np.array([first.CalcShape(*place) for place in NODES[count]])
    dofs = np.array([element.dofs for element in elements])
    straight = np.einsum("an,mni->mai", CORNER_SHAPES[count], case.points[case.cells[:, : 2**d]])
    deformation = ng.GridFunction(ng.VectorH1(mesh, order=2))
    coefficients = np.linalg.solve(shapes, case.points[case.cells] - straight)
    for i, component in enumerate(deformation.components):
        component.vec.FV().NumPy()[dofs] = coefficients[:, :, i]
    mesh.SetDeformation(deformation)
    return mesh


def pressure(case: Case, p: ng.CoefficientFunction, mesh: ng.Mesh) -> ng.CoefficientFunction:
    """Return the pressure: constant in a cell, or linear in the coordinates, as in Turgor."""
    if not p.dims:
        return p
    volumes = ng.Integrate(ng.CF(1), mesh, element_wise=True).NumPy()
    value = p[0]
    for i, along in enumerate((ng.x, ng.y, ng.z)[: case.dimension], start=1):
        middle = ng.GridFunction(ng.L2(mesh, order=0))
        middle.vec.FV().NumPy()[:] = ng.Integrate(along, mesh, element_wise=True).NumPy() / volumes
        value += p[i] * (along - middle)
    return value


def potential(case: Case, space: ng.FESpace) -> ng.BilinearForm:
    """Return Π(u, p) = ∫ μ/2 (Ī₁ − 3) + p (J − 1) − p²/2K dV − P · volume of the cavity."""
    (u, p), _ = space.TnT()
    p = pressure(case, p, space.mesh)
    F = deformation(case, u)
    J = ng.Det(F)
    form = ng.BilinearForm(space, symmetric=True, condense=True)
    energy = case.mu / 2 * (J ** (-2 / 3) * ng.InnerProduct(F, F) - 3) + p * (J - 1) - p**2 / (2 * case.bulk)
    form += ng.Variation((depth(case) * energy).Compile() * ng.dx(intrules=RULES))
    if case.has_cavity:
        if case.dimension == 3:
            x, gradient = ng.CF((ng.x, ng.y, ng.z)) + u, ng.Id(3) + ng.Grad(u).Trace()
        else:
            # Netgen takes the edges of a plane mesh for straight ones; where they are, the cells know.
            place = ng.GridFunction(ng.VectorH1(space.mesh, order=2))
            place.Set(ng.CF((ng.x, ng.y)))
            x, gradient = place + u, ng.Grad(place).Trace() + ng.Grad(u).Trace()
        area = ng.Cof(gradient) * ng.specialcf.normal(case.dimension)
        flux = np.pi * x[0] ** 2 * area[0] if case.is_axisymmetric else ng.InnerProduct(x, area) / 3
        rules = {"intrules": {ng.ET.QUAD: gauss(2)}} if case.is_of_rows and case.dimension == 3 else {}
        form += ng.Variation(case.pressure * flux * ng.ds("cavity", **rules))
    return form


def deformation(case: Case, u: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """Return F, ``(3, 3)``."""
    F = ng.Id(case.dimension) + ng.Grad(u)
    if case.dimension == 3:
        return F
    hoop = 1 + u[0] / ng.x if case.is_axisymmetric else 1
    return ng.CF((F[0, 0], F[0, 1], 0, F[1, 0], F[1, 1], 0, 0, 0, hoop), dims=(3, 3))


def depth(case: Case) -> ng.CoefficientFunction:
    """Return what an area of the section is multiplied by to give a volume; 1 in space."""
    return 2 * np.pi * ng.x if case.is_axisymmetric else ng.CF(1)


class Solver:
    """Newton's method with the condensation spelt out, so that iterations and tolerance are the benchmark's."""

    def __init__(
        self,
        case: Case,
        form: ng.BilinearForm,
        space: ng.FESpace,
        solution: ng.GridFunction,
        given: ng.GridFunction,
    ) -> None:
        self.form, self.solution, self.given = form, solution, given
        self.coupling = space.FreeDofs(coupling=True)
        free = np.fromiter(space.FreeDofs(), dtype=bool)
        self.displacement = np.arange(space.ndof) < space.components[0].ndof
        self.balance = free & self.displacement
        cells = ng.Integrate(depth(case), space.mesh, element_wise=True).NumPy()
        self.scale_of_volume = float(np.linalg.norm(cells))
        self.residual, self.step = solution.vec.CreateVector(), solution.vec.CreateVector()
        self.inverse = None
        self.newton = Newton(case)

    def arrived(self) -> bool:
        self.form.Apply(self.solution.vec, self.residual)
        values = self.residual.FV().NumPy()
        parts = (values[part] for part in (self.balance, self.displacement, ~self.displacement))
        imbalance, forces, gap = (float(np.linalg.norm(part)) for part in parts)
        return self.newton.arrived(imbalance, forces, gap / self.scale_of_volume)

    def run(self) -> None:
        form, residual, step = self.form, self.residual, self.step
        while not self.arrived():
            form.AssembleLinearization(self.solution.vec)
            if self.inverse is None:
                self.inverse = form.mat.Inverse(self.coupling, inverse="sparsecholesky")
            else:
                self.inverse.Update()  # keeps ordering and symbolic factorisation
            residual.data += form.harmonic_extension_trans * residual
            if self.newton.iterations == 0:
                residual.data += form.mat * self.given.vec
            step.data = self.inverse * residual
            if self.newton.iterations == 0:
                step.data -= self.given.vec
            step.data += form.harmonic_extension * step
            step.data += form.inner_solve * residual
            self.solution.vec.data -= step


if __name__ == "__main__":
    ng.SetNumThreads(2)
    with ng.TaskManager():
        run(solve)
