"""Points are found again in curved cells, on their boundary too, and refused outside."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.fem.locate import locate
from turgor.mesh.structured import box, shell_octant, tube_sector


def mapped(mesh, cell, local):
    return np.einsum("pa,pai->pi", mesh.cell.shape(local), mesh.points[mesh.cells[cell]])


@pytest.fixture(scope="module")
def octant():
    return shell_octant(1.0, 1.5, 2)


@pytest.fixture(scope="module")
def bricks():
    return tube_sector(1.0, 1.5, 1.0, 2, cell_type="hex27")


def test_random_points_of_hexahedra_are_found_again(bricks):
    rng = np.random.default_rng(0)
    cell = rng.integers(bricks.n_cells, size=300)
    local = rng.uniform(0.01, 0.99, (300, 3))
    found, coordinates = locate(bricks.points, bricks.cells, mapped(bricks, cell, local), "curve")
    assert np.array_equal(found, cell)
    np.testing.assert_allclose(coordinates, local, atol=1e-8)


def test_random_points_of_curved_cells_are_found_again(octant):
    rng = np.random.default_rng(0)
    cell = rng.integers(octant.n_cells, size=500)
    local = rng.dirichlet(np.ones(4), size=500)[:, 1:]
    places = mapped(octant, cell, local)
    found, coordinates = locate(octant.points, octant.cells, places, "curve")
    np.testing.assert_allclose(mapped(octant, found, coordinates), places, atol=1e-9)
    inner = local.min(axis=1) > 1e-3
    assert (found == cell)[inner & (local.sum(axis=1) < 0.999)].all()


def test_nodes_on_every_boundary_are_found(octant):
    found, local = locate(octant.points, octant.cells, octant.points, "curve")
    np.testing.assert_allclose(mapped(octant, found, local), octant.points, atol=1e-9)
    assert (octant.cells[found] == np.arange(octant.n_points)[:, None]).any(axis=1).all()


def test_flat_cells_are_no_obstacle():
    # Cells twenty times as long as thick: the host's centre is not among the nearest ones.
    mesh = box((20.0, 20.0, 1.0), (2, 2, 10))
    places = np.random.default_rng(1).uniform(0.0, 1.0, (300, 3)) * [20.0, 20.0, 1.0]
    found, local = locate(mesh.points, mesh.cells, places, "curve")
    np.testing.assert_allclose(mapped(mesh, found, local), places, atol=1e-8)
    assert min(local.min(), (1.0 - local.sum(axis=1)).min()) > -1e-9


def test_the_same_answer_every_time_where_cells_meet(octant):
    cell, _ = locate(octant.points, octant.cells, octant.points, "curve")
    again, _ = locate(octant.points, octant.cells, octant.points[::-1], "curve")
    assert np.array_equal(cell, again[::-1])


@pytest.mark.parametrize("place", [(0.4, 0.4, 0.4), (1.5, 1.5, 1.5), (-0.1, 1.0, 0.7)])
def test_a_place_outside_is_refused_by_name(octant, place):
    inside = octant.points[octant.cells[0]].mean(axis=0)
    with pytest.raises(InputError, match=rf"thread: .*leaves the body at \({place[0]:.4g}"):
        locate(octant.points, octant.cells, np.array([inside, place]), "thread")


def test_a_place_just_outside_a_curved_wall_counts_as_inside(octant):
    direction = np.array([[1.0, 0.8, 0.9]])
    direction /= np.linalg.norm(direction)
    _, local = locate(octant.points, octant.cells, 1.505 * direction, "curve")
    assert min(local.min(), 1.0 - local.sum()) < 0.0
    with pytest.raises(InputError, match="leaves the body"):
        locate(octant.points, octant.cells, 1.53 * direction, "curve")
