"""NGSolve: P2–P0, pressures condensed, Newton in one load step, sparse Cholesky under the task manager.

Its best settings of those tried. The element is Turgor's; static condensation (`condense=True`) removes its pressure
from the global system, which is positive definite then, so that NGSolve's own parallel Cholesky factorises it; P2–P1
needs an indefinite solver, and the wheel's only one, UMFPACK, is unsymmetric and serial. NGSolve differentiates the
compiled potential energy; integration takes four points a cell, as in Turgor, and `Update` keeps the ordering
(together 9.0 → 5.7 s of processor time at 5.7 k tetrahedra). Two threads.
"""

from __future__ import annotations

import netgen.meshing
import ngsolve as ng
import numpy as np
from case_t import BULK, MOST_ITERATIONS, MU, PRESSURE, TOLERANCE, VOLUME_TOLERANCE, TubeMesh
from measure import Solved, run

TET10 = [0, 1, 2, 3, 4, 6, 7, 5, 8, 9]
"""Netgen's order of the nodes: edges 01 02 03 12 13 23."""

TRI6 = [0, 1, 2, 4, 5, 3]
"""Netgen's order of the nodes: each middle node opposite to its corner."""

NEAR, FAR = (5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20
FOUR_POINTS = ng.IntegrationRule(
    [(FAR, NEAR, NEAR), (NEAR, FAR, NEAR), (NEAR, NEAR, FAR), (NEAR, NEAR, NEAR)], [1 / 24] * 4
)
"""The rule of degree 2, which Turgor and FElupe use; NGSolve's own choice takes more points."""


def solve(tube: TubeMesh) -> Solved:
    mesh = curved_mesh(tube)
    space = ng.VectorH1(mesh, order=2, dirichlet="mount") * ng.L2(mesh, order=0)
    form = potential(space)
    solution = ng.GridFunction(space)
    newton = Newton(form, space, solution)
    newton.run()
    tip = solution.components[0](mesh(*tube.points[tube.tip]))
    return Solved(
        tip=tuple(tip),
        unknowns=int(np.sum(list(newton.coupling))),
        iterations=newton.iterations,
        factorisations=newton.iterations,
        settings="P2–P0 mixed, condensed; 1 step; sparsecholesky",
        version=ng.__version__,
    )


def curved_mesh(tube: TubeMesh) -> ng.Mesh:
    """Return the mesh with its middle nodes; Netgen wants the corners numbered first."""
    corner = np.zeros(len(tube.points), dtype=bool)
    corner[tube.cells[:, :4]] = True
    order = np.argsort(~corner, kind="stable")
    place = np.empty(len(order), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    mesh = netgen.meshing.Mesh(dim=3)
    mesh.AddPoints(tube.points[order])
    for number, (name, faces) in enumerate({"cavity": tube.cavity, "mount": tube.mount}.items(), start=1):
        mesh.Add(netgen.meshing.FaceDescriptor(surfnr=number, domin=1, domout=0, bc=number))
        mesh.SetBCName(number - 1, name)
        mesh.AddElements(dim=2, index=number, data=np.ascontiguousarray(place[faces[:, TRI6]]), base=0)
    mesh.AddElements(dim=3, index=1, data=np.ascontiguousarray(place[tube.cells[:, TET10]]), base=0)
    return ng.Mesh(mesh)


def potential(space: ng.FESpace) -> ng.BilinearForm:
    """Return Π(u, p) = ∫ μ/2 (Ī₁ − 3) + p (J − 1) − p²/2K dV − P · volume of the cavity."""
    (u, p), _ = space.TnT()
    F = ng.Id(3) + ng.Grad(u)
    J = ng.Det(F)
    form = ng.BilinearForm(space, symmetric=True, condense=True)
    energy = MU / 2 * (J ** (-2 / 3) * ng.InnerProduct(F, F) - 3) + p * (J - 1) - p**2 / (2 * BULK)
    form += ng.Variation(energy.Compile() * ng.dx(intrules={ng.ET.TET: FOUR_POINTS}))
    on_face = ng.Id(3) + ng.Grad(u).Trace()
    area = ng.Cof(on_face) * ng.specialcf.normal(3)
    form += ng.Variation(PRESSURE / 3 * ng.InnerProduct(ng.CF((ng.x, ng.y, ng.z)) + u, area) * ng.ds("cavity"))
    return form


class Newton:
    """Newton's method with the condensation spelt out, so that iterations and tolerance are the benchmark's."""

    def __init__(self, form: ng.BilinearForm, space: ng.FESpace, solution: ng.GridFunction) -> None:
        self.form, self.solution = form, solution
        self.coupling = space.FreeDofs(coupling=True)
        free = np.fromiter(space.FreeDofs(), dtype=bool)
        displacement = np.arange(space.ndof) < space.components[0].ndof
        self.balance, self.volume = free & displacement, ~displacement
        cells = ng.Integrate(ng.CF(1), space.mesh, element_wise=True).NumPy()
        self.scale_of_volume = float(np.linalg.norm(cells))
        self.residual, self.step = solution.vec.CreateVector(), solution.vec.CreateVector()
        self.evaluate()
        # At rest the pressure's are the only forces.
        self.load = float(np.linalg.norm(self.residual.FV().NumPy()[displacement]))
        self.inverse = None
        self.iterations = 0

    def evaluate(self) -> np.ndarray:
        self.form.Apply(self.solution.vec, self.residual)
        return self.residual.FV().NumPy()

    def run(self) -> None:
        form, residual, step = self.form, self.residual, self.step
        while True:
            values = self.evaluate()
            imbalance = float(np.linalg.norm(values[self.balance])) / self.load
            gap = float(np.linalg.norm(values[self.volume])) / self.scale_of_volume
            if imbalance <= TOLERANCE and gap <= VOLUME_TOLERANCE:
                return
            if self.iterations == MOST_ITERATIONS or not np.isfinite(imbalance):
                raise SystemExit(f"no equilibrium in {self.iterations} iterations, imbalance {imbalance:.2g}")
            form.AssembleLinearization(self.solution.vec)
            if self.inverse is None:
                self.inverse = form.mat.Inverse(self.coupling, inverse="sparsecholesky")
            else:
                self.inverse.Update()  # keeps ordering and symbolic factorisation
            residual.data += form.harmonic_extension_trans * residual
            step.data = self.inverse * residual
            step.data += form.harmonic_extension * step
            step.data += form.inner_solve * residual
            self.solution.vec.data -= step
            self.iterations += 1


if __name__ == "__main__":
    ng.SetNumThreads(2)
    with ng.TaskManager():
        run(solve)
