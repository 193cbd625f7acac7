"""Stretches of a surface, against those of a known deformation."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.fem.section import Axisymmetric, PlaneStrain, PlaneStress
from turgor.fem.surface import surface_stretches
from turgor.mesh.structured import box, quarter_ring, rectangle


def test_stretches_of_a_plane_in_a_uniform_deformation():
    mesh = box((1.0, 2.0, 3.0), (1, 2, 2))
    F = np.eye(3) + 0.3 * np.random.default_rng(3).standard_normal((3, 3))
    F /= np.cbrt(np.linalg.det(F))
    assert np.linalg.det(F) == pytest.approx(1.0)
    stretches, places = surface_stretches(mesh.points, mesh.points @ (F - np.eye(3)).T, mesh.surface("y1"), None)
    assert places[:, :, 1] == pytest.approx(2.0)
    smaller, larger = sorted(np.linalg.svd(F[:, [0, 2]], compute_uv=False))
    # along the normal: what is left of an unchanged volume
    expected = np.broadcast_to([smaller, larger, 1.0 / (smaller * larger)], stretches.shape)
    np.testing.assert_allclose(stretches, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("section", "expected"),
    [(PlaneStrain(), (0.5, 1.0, 2.0)), (PlaneStress(), (0.5, 2.0**0.5, 2.0**0.5))],
    ids=["plane strain", "plane stress"],
)
def test_stretches_of_the_edge_of_a_slice(section, expected):
    mesh = rectangle((2.0, 1.0), (3, 2), "quad9")
    u = mesh.points * [-0.5, 0.7]
    stretches, _ = surface_stretches(mesh.points, u, mesh.surface("y1"), section)
    np.testing.assert_allclose(stretches, np.broadcast_to(expected, stretches.shape), rtol=1e-12)


def test_stretches_of_a_sphere_turned_about_its_axis():
    mesh = quarter_ring(1.0, 1.5, 8, "quad9")
    stretches, _ = surface_stretches(mesh.points, 0.25 * mesh.points, mesh.surface("inner"), Axisymmetric())
    np.testing.assert_allclose(stretches, np.broadcast_to([1.25, 1.25, 1.25**-2], stretches.shape), rtol=1e-9)
