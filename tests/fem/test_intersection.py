"""The independent check for intersections: it lets pass what is allowed and no more."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.intersection import IntersectionCheck
from turgor.fem.contact.skin import Skin
from turgor.fem.section import PlaneStrain
from turgor.mesh.faces import boundary_faces
from turgor.mesh.structured import box, quarter_ring, rectangle, shell_octant


def checked(mesh):
    section = PlaneStrain() if mesh.dimension == 2 else None
    skin = Skin(mesh, boundary_faces(mesh.cells), {"body": neo_hookean()}, 0.0, section)
    return skin, IntersectionCheck(skin)


@pytest.mark.parametrize("kind", ["quad9", "tet10", "hex27"])
def test_blocks_may_overlap_by_one_percent_of_their_walls(kind):
    if kind == "quad9":
        low, high, away = rectangle((2.0, 1.0), (4, 2)), rectangle((1.0, 1.0), (3, 1)), (0.3, 1.0)
    else:
        low, high = box((2.0, 2.0, 1.0), (4, 4, 2), kind), box((1.0, 1.0, 1.0), (3, 3, 1), kind)
        away = (0.3, 0.5, 1.0)
    mesh = merged(low=low, high=shifted_mesh(high, *away))
    skin, check = checked(mesh)
    assert skin.wall == pytest.approx(np.ones(len(skin.faces)))
    u = np.zeros_like(mesh.points)
    for gap, expected in ((0.1, False), (0.0, False), (-0.009, False), (-0.011, True), (-0.3, True)):
        u[low.n_points :, -1] = gap
        assert check.intersects(u) == expected, gap


@pytest.mark.parametrize(
    "mesh", [shell_octant(1.0, 1.2, 1), shell_octant(1.0, 1.2, 2, "hex27"), quarter_ring(1.0, 1.2, 1)]
)
def test_a_curved_shell_does_not_meet_itself(mesh):
    _, check = checked(mesh)
    u = np.zeros_like(mesh.points)
    assert not check.intersects(u)
    # a part of its inside pushed out through its outside
    radius = np.linalg.norm(mesh.points, axis=1)
    inside = (radius < 1.05) & (mesh.points[:, 0] > 0.5) & (mesh.points[:, 0] < 0.9)
    u[inside] = 0.3 * mesh.points[inside]
    assert check.intersects(u)
