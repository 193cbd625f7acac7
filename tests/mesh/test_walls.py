import numpy as np
import pytest

from turgor.mesh.faces import boundary_faces
from turgor.mesh.structured import box, shell_octant
from turgor.mesh.thickness import wall_thickness
from turgor.mesh.walls import walls


def test_a_plate_is_as_thick_as_it_is():
    plate = box((4.0, 4.0, 1.0), (4, 4, 2))
    skin = boundary_faces(plate.cells)[:, :3]
    thickness = wall_thickness(plate.points, skin)
    flat = np.ptp(plate.points[skin][..., 2], axis=1) == 0
    np.testing.assert_allclose(thickness[flat], 1.0)
    np.testing.assert_allclose(thickness[~flat], 4.0)


def test_a_ray_that_meets_nothing_is_infinite():
    assert np.isinf(wall_thickness(np.eye(3), np.array([[0, 1, 2]]))).all()


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_elements_are_counted_through_a_shell(layers):
    summary = walls(shell_octant(4.0, 5.0, layers)).summary()
    assert summary["thinnest_mm"] == pytest.approx(1.0, abs=0.1)
    # Six tetrahedra to a cube: their mean edge is 1.2 of its.
    assert summary["elements_through_median"] == pytest.approx(layers, rel=0.2)


def test_other_cells_have_no_measure():
    assert walls(box((1.0, 1.0, 1.0), (1, 1, 1), "hex27")) is None
