"""FElupe: `SolidBodyNearlyIncompressible` on quadratic simplices, Newton in one load step, PARDISO (pypardiso).

Its best settings of those tried (third argument `mixed`). The nearly incompressible body keeps a mean pressure for each
cell and condenses it, the same discretisation as Turgor's; its three-field form would solve a larger, indefinite
matrix. The linear solver is pypardiso instead of SciPy's SuperLU, as FElupe's documentation advises, in symmetric mode,
which halves the work of its default. Assembly has `parallel=True` and two threads. FElupe has no boundary region for
quadratic simplices; `CavityFaces` is one, built as FElupe's own regions are. In hexahedra and quadrilaterals the body
is Q2–P0, one mean pressure to a cell being all it has. `displacement` takes its plain `SolidBody`, to show what locking
does to a punch; it finds no way in ten steps, so it takes 20.
"""

from __future__ import annotations

import sys

import felupe as fem
import numpy as np
import pypardiso
import scipy.sparse as sp
from case import OPPOSITE, Case
from measure import Newton, Solved, run

EVEN_PERMUTATIONS = {
    3: np.array([[1, 3, 2, 0], [0, 2, 3, 1], [1, 0, 3, 2], [0, 1, 2, 3]]),
    2: np.array([[1, 2, 0], [2, 0, 1], [0, 1, 2]]),
}
"""For the face opposite to each corner an order of the corners with those of the face first."""

EDGES = {3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], 2: [(0, 1), (1, 2), (2, 0)]}


class QuadraticTriangle(fem.QuadraticTriangle):
    """FElupe's, whose ∂h₅/∂s = 4 (1 − r − 2 s) is 4 (1 − 2 r − s) in 11.3.0."""

    def gradient(self, rs: np.ndarray) -> np.ndarray:
        r, s = rs
        gradient = super().gradient(rs)
        missing = 4 * (1 - r - 2 * s) - gradient[5, 1]
        gradient[[0, 2, 5], 1] += np.multiply([-0.5, -0.5, 1.0], missing)
        return gradient


ELEMENTS = {3: fem.QuadraticTetra(), 2: QuadraticTriangle()}
RULES = {3: fem.TetrahedronQuadrature(order=2), 2: fem.TriangleQuadrature(order=2)}
CELL_TYPES = {3: "tetra10", 2: "triangle6"}
OF_ROWS = {
    3: ("hexahedron27", fem.RegionTriQuadraticHexahedron, fem.RegionTriQuadraticHexahedronBoundary),
    2: ("quad9", fem.RegionBiQuadraticQuad, fem.RegionBiQuadraticQuadBoundary),
}
FACE_RULES = {3: fem.TriangleQuadrature(order=5), 2: fem.GaussLegendre(order=2, dim=1)}
FIELDS = {"space": fem.Field, "plane-strain": fem.FieldPlaneStrain, "axisymmetric": fem.FieldAxisymmetric}


def solve(case: Case) -> Solved:
    mixed = sys.argv[3] == "mixed"
    # FElupe's axis of revolution is the first one, and the radius the second.
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]]) if case.is_axisymmetric else np.eye(case.dimension)
    field, solid, pressures = bodies(case, case.points @ turn, mixed)
    given = (np.nan_to_num(case.given) @ turn).ravel()
    held = (np.isfinite(case.given) @ np.abs(turn)).ravel() > 0.0
    fixed, free = np.flatnonzero(held), np.flatnonzero(~held)
    pardiso = pypardiso.PyPardisoSolver(mtype=-2)
    steps = 1 if mixed else 20
    iterations = 0
    for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
        newton = Newton(case)
        while True:
            force = total("vector", solid, pressures, field).toarray().ravel()
            if newton.arrived(float(np.linalg.norm(force[free])), float(np.linalg.norm(force))):
                break
            system = fem.solve.partition(field, total("matrix", solid, pressures), free, fixed, force)
            field += fem.solve.solve(
                *system, ext0=part * given[fixed], solver=lambda A, b: pardiso.solve(sp.triu(A, format="csr"), b)
            )
        iterations += newton.iterations
    pardiso.free_memory(everything=True)
    order = "Q2" if case.is_of_rows else "P2"
    counted = "1 step" if steps == 1 else f"{steps} steps"
    return Solved(
        tip=tuple((turn @ field[0].values[case.tip]).tolist()),
        work=float(force @ given),
        unknowns=len(free),
        iterations=iterations,
        factorisations=iterations,
        settings=f"{order}{'–P0 mixed, condensed' if mixed else ' displacement'}; {counted}; MKL PARDISO",
        version=fem.__version__,
    )


def bodies(
    case: Case, points: np.ndarray, mixed: bool
) -> tuple[fem.FieldContainer, fem.SolidBody | fem.SolidBodyNearlyIncompressible, list[fem.SolidBodyPressure]]:
    """Return the displacement, the solid and what presses on it; `points` are in FElupe's axes."""
    d = case.dimension
    if case.is_of_rows:
        name, whole, boundary = OF_ROWS[d]
        region = whole(fem.Mesh(points, case.cells, name))
    else:
        region = fem.Region(fem.Mesh(points, case.cells, CELL_TYPES[d]), ELEMENTS[d], RULES[d])
    field = fem.FieldContainer([FIELDS[case.kind](region, dim=d)])
    if mixed:
        solid = fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=case.mu, parallel=True), field, bulk=case.bulk)
    else:
        solid = fem.SolidBody(fem.NeoHooke(mu=case.mu, bulk=case.bulk, parallel=True), field)
    if not case.has_cavity:
        return field, solid, []
    if case.is_of_rows:
        cavity = boundary(region.mesh, mask=np.unique(case.surfaces["cavity"]))
        if d == 2:
            cavity.normals = np.concatenate([cavity.normals, np.zeros_like(cavity.normals[:1])])
    else:
        cavity = CavityFaces(case, points)
    faces = fem.FieldContainer([FIELDS[case.kind](cavity, dim=d)])
    return field, solid, [fem.SolidBodyPressure(faces, pressure=case.pressure)]


def total(
    quantity: str,
    solid: fem.SolidBody | fem.SolidBodyNearlyIncompressible,
    pressures: list[fem.SolidBodyPressure],
    *at: fem.FieldContainer,
) -> sp.sparray | sp.spmatrix:
    """Return the ``vector`` or the ``matrix`` of the solid less those of the pressures."""
    whole = getattr(solid.assemble, quantity)(*at, parallel=True)
    for pressure in pressures:
        whole = whole - getattr(pressure.assemble, quantity)(*at, parallel=True)
    return whole


class CavityFaces(fem.Region):
    """The faces of the cavity as faces of the cells behind them, with the normals out of the solid."""

    def __init__(self, case: Case, points: np.ndarray) -> None:
        d = case.dimension
        host, face = case.hosts(OPPOSITE[d])
        corners = EVEN_PERMUTATIONS[d][face]
        middle = np.zeros((d + 1, d + 1), dtype=int)
        for place, (a, b) in enumerate(EDGES[d], start=d + 1):
            middle[a, b] = middle[b, a] = place
        order = np.concatenate([corners, *(middle[corners[:, a], corners[:, b]][:, None] for a, b in EDGES[d])], axis=1)
        cells = np.take_along_axis(case.cells[host], order, axis=1)
        rule = FACE_RULES[d]
        places = rule.points if d == 3 else (rule.points + 1) / 2
        weights = rule.weights if d == 3 else rule.weights / 2
        on_face = fem.quadrature.Scheme(np.pad(places, ((0, 0), (0, 1))), weights)
        super().__init__(fem.Mesh(points, cells, CELL_TYPES[d]), ELEMENTS[d], on_face)
        # The corners 0 1 2 of a positive tetrahedron turn about the normal into it; a positive triangle is on the left.
        if d == 3:
            area = -np.cross(self.dXdr[:, 0], self.dXdr[:, 1], axis=0)
        else:
            along = self.dXdr[:, 0]
            area = np.stack([along[1], -along[0], np.zeros_like(along[0])])
        area = area * weights[:, None]
        self.dV = np.linalg.norm(area, axis=0)
        self.normals = area / self.dV


if __name__ == "__main__":
    run(solve)
