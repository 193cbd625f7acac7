"""Signed distance of bodies of triangles: against boxes and spheres in closed form, and from files."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from samples import neo_hookean
from scipy.spatial import ConvexHull

from turgor.common.errors import InputError
from turgor.fem.contact.spec import RigidContact
from turgor.fem.rigid import Box
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.geometry.imported.triangles import TriangleBody
from turgor.mesh.structured import box
from turgor.solver.path import solve_path


def hull(points):
    """Triangles of a convex hull, anticlockwise from outside."""
    found = ConvexHull(points)
    triangles = found.simplices.copy()
    a, b, c = (points[triangles[:, i]] for i in range(3))
    inward = np.einsum("ki,ki->k", np.cross(b - a, c - a), found.equations[:, :3]) < 0
    triangles[inward] = triangles[inward][:, [0, 2, 1]]
    return points, triangles


CUBE = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 1.0)])


def l_shape():
    """A prism over an L, with a re-entrant edge: corners and triangles."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    flat = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    n = len(outline)
    points = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 1.0)])
    sides = [t for i in range(n) for j in [(i + 1) % n] for t in ((i, j, j + n), (i, j + n, i + n))]
    return points, np.array([(a, c, b) for a, b, c in flat] + [(a + n, b + n, c + n) for a, b, c in flat] + sides)


def test_inside_of_a_cube_is_that_of_a_box():
    body, exact = TriangleBody(*hull(CUBE)), Box((0.0, 0.0, 0.0), (2.0, 3.0, 1.0))
    x = np.random.default_rng(0).uniform([0, 0, 0], [2, 3, 1], (500, 3))
    distance, normal, curvature = body.distance(x)
    expected, expected_normal, _ = exact.distance(x)
    np.testing.assert_allclose(distance, expected, atol=1e-12)
    np.testing.assert_allclose(normal, expected_normal, atol=1e-12)
    assert not curvature.any()


def test_distance_outside_a_cube_and_its_derivatives():
    body = TriangleBody(*hull(CUBE))
    x = np.random.default_rng(1).uniform(-2.0, 5.0, (500, 3))
    out = np.maximum(np.maximum(-x, x - [2.0, 3.0, 1.0]), 0.0)
    outside = out.any(axis=1)
    distance, _, _ = body.distance(x)
    np.testing.assert_allclose(distance[outside], np.linalg.norm(out[outside], axis=1), atol=1e-12)
    assert (distance[~outside] < 0).all()
    check_derivatives(body, x)


def check_derivatives(body, x):
    _, normal, curvature = body.distance(x)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        (more, more_normal, _), (less, less_normal, _) = (body.distance(x + h) for h in (step, -step))
        smooth = np.abs(more_normal - less_normal).max(axis=1) < 1e-3
        assert smooth.mean() > 0.9
        np.testing.assert_allclose(normal[smooth, axis], ((more - less) / 2e-6)[smooth], atol=1e-7)
        slope = (more_normal - less_normal) / 2e-6
        np.testing.assert_allclose(curvature[smooth][:, :, axis], slope[smooth], atol=1e-5)
    assert np.abs(curvature).max() > 0.1


def test_re_entrant_edge():
    body = TriangleBody(*l_shape())
    x = np.random.default_rng(2).uniform(-0.5, 2.5, (800, 3))
    distance, _, _ = body.distance(x)
    low = (x[:, 2] > 0) & (x[:, 2] < 1)
    inside = low & (x[:, :2] > 0).all(axis=1) & (x[:, :2] < 2).all(axis=1) & (x[:, :2] < 1).any(axis=1)
    assert np.array_equal(distance < 0, inside)
    assert inside.sum() > 50
    check_derivatives(body, x)


def test_many_triangles_make_a_sphere():
    rng = np.random.default_rng(3)
    points = rng.standard_normal((2000, 3))
    body = TriangleBody(*hull(points / np.linalg.norm(points, axis=1, keepdims=True)))
    x = rng.uniform(-2.0, 2.0, (500, 3))
    distance, _, _ = body.distance(x)
    np.testing.assert_allclose(distance, np.linalg.norm(x, axis=1) - 1.0, atol=0.02)


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
def test_a_file_presses_as_the_same_box_does(tmp_path, kind):
    lower, upper = (-0.5, -0.5, 0.95), (1.5, 1.5, 1.6)
    corners = np.array([[x, y, z] for x in (-0.5, 1.5) for y in (-0.5, 1.5) for z in (0.95, 1.6)])
    points, triangles = hull(corners)
    meshio.write(tmp_path / "plate.stl", meshio.Mesh(points, [("triangle", triangles)]), binary=True)
    forces = []
    for body in (Box(lower, upper), TriangleBody.from_stl(tmp_path / "plate.stl")):
        contact = [RigidContact(body, "z1", motion=(0.0, 0.0, -0.05))]
        mesh = box((1.0, 1.0, 1.0), (2, 2, 2), kind)
        system = System(mesh, {"body": neo_hookean(1.0, 10.0)}, [Clamped("z0")], contact=contact)
        forces.append(system.touches(solve_path(system, [1.0])[0].state)[0].force)
    assert forces[0][2] > 0.1
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-5, atol=1e-6)


def test_refusals(tmp_path):
    points, triangles = hull(CUBE)
    with pytest.raises(InputError, match="do not close"):
        TriangleBody(points, triangles[:-1])
    with pytest.raises(InputError, match="inside out"):
        TriangleBody(points, triangles[:, [0, 2, 1]])
    with pytest.raises(InputError, match=r"nothing\.stl"):
        TriangleBody.from_stl(tmp_path / "nothing.stl")
    (tmp_path / "text.stl").write_text("not an STL file")
    with pytest.raises(InputError, match=r"text\.stl"):
        TriangleBody.from_stl(tmp_path / "text.stl")
