import numpy as np
import pytest

from turgor.mesh.mesh import Mesh
from turgor.mesh.quality import quality
from turgor.mesh.structured import box, quadrilateral, rectangle, shell_octant
from turgor.mesh.tet10 import EDGES


def straight(corners):
    corners = np.asarray(corners, dtype=float)
    points = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES]])
    return Mesh(points, np.arange(10)[None])


REGULAR = [[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]]


def test_the_regular_tetrahedron_is_perfect():
    measured = quality(straight(REGULAR))
    assert measured.scaled_jacobian[0] == pytest.approx(1.0)
    assert measured.aspect[0] == pytest.approx(1.0)
    assert measured.distortion[0] == pytest.approx(1.0)


def test_the_corner_of_a_cube_by_hand():
    # Legs 1, hypotenuses √2. At the right angle √2·1; at the others √2·(½·1/√2·…): triple product of unit tangents ½.
    measured = quality(straight([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]))
    assert measured.scaled_jacobian[0] == pytest.approx(np.sqrt(2) / 2)
    inradius = 3 * (1 / 6) / (3 / 2 + np.sqrt(3) / 2)
    assert measured.aspect[0] == pytest.approx(np.sqrt(2) / (2 * np.sqrt(6) * inradius))


def test_flattening_makes_every_measure_worse():
    flat = straight(np.array(REGULAR) * [1, 1, 0.1])
    measured = quality(flat)
    assert measured.scaled_jacobian[0] < 0.3
    assert measured.aspect[0] > 4


def test_distortion_sees_a_bent_edge_and_says_where():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    points = mesh.points.copy()
    middle = mesh.cells[0, 4]
    points[middle] += 0.05
    measured = quality(Mesh(points, mesh.cells))
    worst = int(np.argmin(measured.distortion))
    assert middle in mesh.cells[worst]
    assert measured.distortion[worst] < 0.8
    summary = measured.summary()
    assert summary["elements"] == 48
    assert summary["worst_place_mm"] == measured.centres[measured.worst_cell].round(3).tolist()


def test_cubes_squares_and_equilateral_triangles_are_perfect():
    triangle = quadrilateral([[0, 0], [0.5, -(0.75**0.5)], [1, 0], [0.5, 0.75**0.5]], (1, 1), "tri6")
    shapes = [box((1.0, 1.0, 1.0), (2, 2, 2), "hex27"), rectangle((1.0, 1.0), (2, 2)), triangle]
    for shape in shapes:
        measured = quality(shape)
        for values in (measured.scaled_jacobian, measured.distortion):
            np.testing.assert_allclose(values, 1.0, err_msg=shape.cell_type)
    np.testing.assert_allclose(quality(rectangle((3.0, 1.0), (1, 1))).aspect, 3.0)
    # A right-angled isosceles triangle: hypotenuse √2, perimeter 2 + √2, area ½.
    np.testing.assert_allclose(
        quality(rectangle((1.0, 1.0), (1, 1), "tri6")).aspect, np.sqrt(2) * (2 + np.sqrt(2)) / (2 * np.sqrt(3))
    )


def test_curved_elements_of_a_shell_are_good():
    measured = quality(shell_octant(1.0, 1.5, 2))
    assert 0.5 < measured.distortion.min() < 1.0
    assert measured.scaled_jacobian.min() > 0.3
