"""Every kind of cell: shape functions, faces, quadrature, and the bodies built of it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import vtk

from turgor.common.errors import InputError
from turgor.mesh.cells import CELLS, face_areas, face_cell, face_fluxes, jacobians
from turgor.mesh.faces import all_faces, boundary_faces, host_cells, outward_faces, rim_edges
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quadrilateral, quarter_ring, rectangle, shell_octant, tube_sector

VTK = {
    "line3": vtk.vtkQuadraticEdge,
    "tri6": vtk.vtkQuadraticTriangle,
    "quad9": vtk.vtkBiQuadraticQuad,
    "tet10": vtk.vtkQuadraticTetra,
    "hex27": vtk.vtkTriQuadraticHexahedron,
}


@pytest.fixture(params=CELLS)
def cell(request):
    return CELLS[request.param]


@pytest.fixture(params=[name for name, cell in CELLS.items() if cell.dimension > 1])
def body(request):
    return CELLS[request.param]


def inside(cell, n=9, seed=0):
    rng = np.random.default_rng(seed)
    return rng.dirichlet(np.ones(cell.dimension + 1), n)[:, 1:] if cell.simplex else rng.random((n, cell.dimension))


def bent(cell, amplitude=0.06, seed=1):
    """One cell with all nodes moved at random."""
    return cell.nodes + amplitude * np.random.default_rng(seed).uniform(-1, 1, cell.nodes.shape)


def test_nodes_stand_where_vtk_has_them(cell):
    place = VTK[cell.name]().GetParametricCoords()
    coordinates = np.array([place[k] for k in range(3 * cell.n_nodes)]).reshape(-1, 3)
    np.testing.assert_array_equal(cell.nodes, coordinates[:, : cell.dimension])


def test_shape_functions_are_nodal_and_reproduce_their_polynomials(cell):
    np.testing.assert_allclose(cell.shape(cell.nodes), np.eye(cell.n_nodes), atol=1e-14)
    degree = 2 if cell.simplex else 2 * cell.dimension
    powers = [p for p in itertools.product(range(3), repeat=cell.dimension) if sum(p) <= degree]
    points = inside(cell)
    for power in powers:
        field = np.prod(cell.nodes**power, axis=1)
        np.testing.assert_allclose(cell.shape(points) @ field, np.prod(points**power, axis=1), atol=1e-13)


def test_gradients_are_derivatives_of_the_shape_functions(cell):
    points, h = inside(cell), 1e-5
    for i in range(cell.dimension):
        step = h * np.eye(cell.dimension)[i]
        slope = (cell.shape(points + step) - cell.shape(points - step)) / (2 * h)
        np.testing.assert_allclose(cell.gradient(points)[:, :, i], slope, atol=1e-9)


@pytest.mark.parametrize(("name", "degree"), [("line3", 5), ("tri6", 2), ("quad9", 5), ("tet10", 2), ("hex27", 5)])
def test_quadrature_is_exact_to_its_degree(name, degree):
    cell = CELLS[name]
    for power in itertools.product(range(degree + 1), repeat=cell.dimension):
        if cell.simplex and sum(power) > degree:
            continue
        value = cell.weights @ np.prod(cell.points**power, axis=1)
        if cell.simplex and cell.dimension > 1:
            exact = math.prod(map(math.factorial, power)) / math.factorial(sum(power) + cell.dimension)
        else:
            exact = 1 / np.prod(np.array(power) + 1)
        assert value == pytest.approx(exact, rel=1e-12)


def test_face_triangles_have_a_rule_of_degree_four():
    rule = face_cell(np.zeros((1, 6))).rule
    for a, b in itertools.product(range(5), repeat=2):
        if a + b <= 4:
            exact = math.factorial(a) * math.factorial(b) / math.factorial(a + b + 2)
            assert rule.weights @ np.prod(rule.points ** [a, b], axis=1) == pytest.approx(exact, rel=1e-12)


def test_a_mirrored_cell_turns_the_other_way(body):
    nodes = bent(body)[None]
    mirrored = nodes[:, body.mirrored] * np.array([-1.0, *[1.0] * (body.dimension - 1)])
    assert (np.linalg.det(jacobians(nodes, body)) > 0).all()
    np.testing.assert_allclose(
        np.sort(np.linalg.det(jacobians(mirrored, body))), np.sort(np.linalg.det(jacobians(nodes, body))), atol=1e-13
    )


def test_divergence_theorem_holds_to_the_last_digit_on_a_bent_cell(body):
    points = bent(body)
    mesh = Mesh(points, np.arange(body.n_nodes)[None], surfaces={"skin": body.faces})
    assert mesh.cell_type == body.name
    assert mesh.dimension == body.dimension
    flux, area_vectors = face_fluxes(points[body.faces])
    assert flux.sum() / body.dimension == pytest.approx(mesh.volume(), rel=1e-12)
    np.testing.assert_allclose(area_vectors.sum(axis=0), 0.0, atol=1e-13)
    assert mesh.enclosed_volume("skin") == pytest.approx(-mesh.volume(), rel=1e-12)
    assert len(rim_edges(body.faces)) == 0
    assert len(rim_edges(body.faces[1:])) > 0


def test_faces_are_found_whichever_corner_comes_first_but_not_inside_out(body):
    cells = np.arange(body.n_nodes, dtype=np.int32)[None]
    face = face_cell(body.faces)
    corners = body.faces[:, : face.n_corners]
    found = outward_faces(cells, corners[::-1, ::-1])
    np.testing.assert_array_equal(np.sort(found, axis=1), np.sort(body.faces[::-1], axis=1))
    assert (host_cells(cells, found) == 0).all()
    assert (host_cells(cells, found[:, face.mirrored]) == -1).all()


BODIES = {
    "rectangle": (lambda n, kind: rectangle((2.0, 3.0), (2 * n, 3 * n), kind), 6.0, 10.0, "tri6 quad9"),
    "quadrilateral": (
        lambda n, kind: quadrilateral([(0, 0), (48, 44), (48, 60), (0, 44)], (n, n), kind),
        48 * 30.0,
        60 + math.hypot(48, 44) + math.hypot(48, 16),
        "tri6 quad9",
    ),
    "quarter ring": (
        lambda n, kind: quarter_ring(1.0, 1.5, n, kind),
        math.pi / 4 * 1.25,
        1 + math.pi / 2 * 2.5,
        "tri6 quad9",
    ),
    "box": (lambda n, kind: box((2.0, 3.0, 4.0), (n, 2 * n, n), kind), 24.0, 52.0, "tet10 hex27"),
    "tube": (
        lambda n, kind: tube_sector(1.0, 1.5, 0.5, n, kind),
        math.pi / 8 * 1.25,
        math.pi / 4 * 2.5 + math.pi / 2 * 1.25 + 0.5,
        "tet10 hex27",
    ),
    "shell": (
        lambda n, kind: shell_octant(1.0, 1.5, n, kind),
        math.pi / 6 * 2.375,
        math.pi / 2 * 3.25 + 3 * math.pi / 4 * 1.25,
        "tet10 hex27",
    ),
}


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for name, b in BODIES.items() for kind in b[3].split()])
def test_structured_bodies(name, kind):
    make, volume, area, _ = BODIES[name]
    mesh = make(2, kind)
    assert mesh.cell_type == kind
    assert mesh.volume() == pytest.approx(volume, rel=1e-4)
    assert sum(mesh.surface_area(side) for side in mesh.surfaces) == pytest.approx(area, rel=1e-4)
    skin = np.vstack(list(mesh.surfaces.values()))
    assert len(skin) == len(boundary_faces(mesh.cells)) == len(np.unique(np.sort(skin, axis=1), axis=0))
    assert len(rim_edges(skin)) == 0
    # every inner face is shared by exactly two cells, which look at it from opposite sides
    _, counts = np.unique(np.sort(all_faces(mesh.cells), axis=1), axis=0, return_counts=True)
    assert set(counts) == {1, 2}


def test_curved_hexahedra_converge_at_fourth_order():
    errors = [abs(shell_octant(1.0, 1.5, n, "hex27").volume() / (math.pi / 6 * 2.375) - 1) for n in (1, 2)]
    assert 3.8 < math.log2(errors[0] / errors[1]) < 5.0


def test_quarter_rings_enclose_their_quarter():
    mesh = quarter_ring(2.0, 3.0, 3)
    assert mesh.enclosed_volume("inner") == pytest.approx(math.pi, rel=1e-5)
    assert face_areas(mesh.points[mesh.surface("outer")]).sum() == pytest.approx(1.5 * math.pi, rel=1e-5)


def test_a_body_is_not_built_of_cells_of_another_dimension():
    with pytest.raises(InputError, match="expected tri6 or quad9"):
        rectangle((1.0, 1.0), (1, 1), "tet10")
    with pytest.raises(InputError, match="expected tet10 or hex27"):
        box((1.0, 1.0, 1.0), (1, 1, 1), "quad9")


def test_plane_cells_need_plane_points():
    mesh = rectangle((1.0, 1.0), (1, 1))
    with pytest.raises(InputError, match=r"points: .*shape \(n, 2\)"):
        Mesh(np.column_stack([mesh.points, mesh.points[:, 0]]), mesh.cells)
    with pytest.raises(InputError, match=r"cells: .*shape \(n, 6\) or shape \(n, 9\)"):
        Mesh(mesh.points, mesh.cells[:, :4])
