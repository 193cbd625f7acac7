import math

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.mesh.cells import face_fluxes
from turgor.mesh.faces import boundary_faces, host_cells, outward_faces, rim_edges
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, shell_octant, tube_sector
from turgor.mesh.tet10 import EDGES, FACES, jacobian_coefficients, jacobian_determinants

REFERENCE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
REFERENCE = np.vstack([REFERENCE, [(REFERENCE[a] + REFERENCE[b]) / 2 for a, b in EDGES]])


def reference_mesh(**changes):
    return Mesh(**({"points": REFERENCE, "cells": np.arange(10)[None]} | changes))


def bent_tetrahedron(amplitude, seed=0):
    shifts = np.random.default_rng(seed).uniform(-amplitude, amplitude, (10, 3))
    return (REFERENCE + shifts)[None]


def test_bezier_coefficients_bound_the_determinant_and_give_the_volume():
    nodes = bent_tetrahedron(0.15)
    coefficients = jacobian_coefficients(nodes)[0]
    samples = np.random.default_rng(2).dirichlet(np.ones(4), size=20_000)[:, :3]
    determinants = jacobian_determinants(nodes, samples)[0]
    assert coefficients.min() <= determinants.min()
    assert coefficients.max() >= determinants.max()
    assert determinants.mean() == pytest.approx(coefficients.mean(), rel=2e-3)


def test_divergence_theorem_holds_to_the_last_digit_on_a_bent_tetrahedron():
    points = bent_tetrahedron(0.1)[0]
    mesh = reference_mesh(points=points, surfaces={"skin": FACES})
    flux, area_vectors = face_fluxes(points[FACES])
    assert flux.sum() / 3 == pytest.approx(mesh.volume(), rel=1e-13)
    np.testing.assert_allclose(area_vectors.sum(axis=0), 0.0, atol=1e-14)
    assert mesh.enclosed_volume("skin") == pytest.approx(-mesh.volume(), rel=1e-13)


def test_box_is_exact_and_its_sides_look_outward():
    mesh = box((2.0, 3.0, 4.0), (2, 3, 1))
    assert mesh.volume() == pytest.approx(24.0, rel=1e-14)
    assert mesh.n_cells == 36
    for axis, letter in enumerate("xyz"):
        for end, sign in ((0, -1.0), (1, 1.0)):
            _, area_vectors = face_fluxes(mesh.points[mesh.surface(f"{letter}{end}")])
            expected = np.zeros(3)
            expected[axis] = sign * 24.0 / (2.0, 3.0, 4.0)[axis]
            np.testing.assert_allclose(area_vectors.sum(axis=0), expected, atol=1e-13)


@pytest.mark.parametrize("measure", ["volume", "cavity", "area"])
def test_curved_bodies_converge_at_fourth_order(measure):
    def error(n):
        mesh = shell_octant(1.0, 1.5, n)
        if measure == "volume":
            return abs(mesh.volume() / (math.pi / 6 * (1.5**3 - 1.0)) - 1.0)
        if measure == "cavity":
            return abs(mesh.enclosed_volume("inner") / (math.pi / 6) - 1.0)
        return abs(mesh.surface_area("inner") / (math.pi / 2) - 1.0)

    rate = math.log2(error(1) / error(2))
    assert 3.8 < rate < 6.0
    assert error(2) < 3e-5


@pytest.mark.parametrize("mesh", [shell_octant(1.0, 1.5, 1), tube_sector(6.35, 9.85, 3.0, 1)], ids=["shell", "tube"])
def test_structured_meshes_are_conforming_and_valid(mesh):
    assert sum(len(triangles) for triangles in mesh.surfaces.values()) == len(boundary_faces(mesh.cells))
    assert jacobian_coefficients(mesh.points[mesh.cells]).min() > 0.0
    closed = np.vstack(list(mesh.surfaces.values()))
    assert len(rim_edges(closed)) == 0
    flux, _ = face_fluxes(mesh.points[closed])
    assert flux.sum() / 3 == pytest.approx(mesh.volume(), rel=1e-12)


def test_tube_nodes_lie_on_their_cylinders_and_planes():
    mesh = tube_sector(6.35, 9.85, 3.0, 2)
    for name, radius in (("inner", 6.35), ("outer", 9.85)):
        np.testing.assert_allclose(np.hypot(*mesh.points[mesh.surface_nodes(name), :2].T), radius, rtol=1e-14)
    assert (mesh.points[mesh.surface_nodes("x0"), 0] == 0.0).all()
    assert mesh.volume() == pytest.approx(math.pi / 4 * (9.85**2 - 6.35**2) * 3.0, rel=1e-4)


def test_planes_at_the_ends_close_a_cavity_and_others_do_not():
    mesh = tube_sector(1.0, 1.5, 1.0, 1)
    assert mesh.enclosed_volume("inner") == pytest.approx(math.pi / 4, rel=1e-3)
    half = Mesh(mesh.points, mesh.cells, surfaces={"inner": mesh.surface("inner")[:1]})
    with pytest.raises(InputError, match="inner: the cavity leaks: its wall ends near"):
        half.enclosed_volume("inner")


def test_faces_are_found_and_turned_outward_whatever_the_order_given():
    mesh = shell_octant(1.0, 1.5, 1)
    wanted = mesh.surface("inner")
    found = outward_faces(mesh.cells, wanted[::-1][:, [1, 0, 2]])
    assert {tuple(sorted(face)) for face in found} == {tuple(sorted(face)) for face in wanted}
    assert (host_cells(mesh.cells, found) >= 0).all()
    assert (host_cells(mesh.cells, found[:, [1, 0, 2, 3, 5, 4]]) == -1).all()
    with pytest.raises(InputError, match="not a face on the boundary"):
        outward_faces(mesh.cells, np.array([[0, 1, 2], [0, 1, mesh.n_points - 1]]))


def test_surface_hosts_own_their_faces():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    hosts = mesh.surface_hosts("z1")
    for host, triangle in zip(hosts, mesh.surface("z1"), strict=True):
        assert set(triangle) <= set(mesh.cells[host])


def test_a_mesh_does_not_change():
    points = REFERENCE.copy()
    mesh = reference_mesh(points=points)
    points[0] = 9.0
    assert (mesh.points[0] == 0.0).all()
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0] = 1.0
    with pytest.raises(TypeError):
        mesh.regions["new"] = np.array([0])
    with pytest.raises(AttributeError):
        mesh.points = points


def test_unknown_names_list_what_there_is():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=r"no surface of this name \(found 'lid'\); expected one of: x0, x1, y0"):
        mesh.surface_nodes("lid")
    with pytest.raises(InputError, match=r"no marker of this name \(found 'tip'\); expected one of: no marker at all"):
        mesh.marker("tip")


INSIDE_OUT = REFERENCE * [1.0, 1.0, -1.0]
BAD = {
    "not finite": ({"points": np.where(REFERENCE == 1.0, np.nan, REFERENCE)}, "not finite"),
    "two dimensions": ({"points": REFERENCE[:, :2]}, r"points: the array has shape \(10, 2\)"),
    "linear cells": ({"cells": np.arange(4)[None]}, r"cells: .*shape \(n, 10\) or shape \(n, 27\) of integers"),
    "no cells": ({"cells": np.zeros((0, 10), int)}, "no cells"),
    "index outside": ({"cells": np.arange(1, 11)[None]}, "cells: an index points outside the mesh .found 10"),
    "orphan": ({"points": np.vstack([REFERENCE, [[5, 5, 5]]])}, "belongs to no cell .found 10"),
    "inside out": ({"points": INSIDE_OUT}, "turned inside out"),
    "no region": ({"regions": {"body": np.zeros(0, int)}}, "in no region"),
    "two regions": ({"regions": {"body": [0], "base": [0]}}, "in two regions"),
    "marker outside": ({"markers": {"tip": [10]}}, "markers.tip: an index points outside"),
    "inward face": ({"surfaces": {"mount": FACES[:, [1, 0, 2, 3, 5, 4]]}}, "not the outward face"),
    "bare face": ({"surfaces": {"mount": FACES[:, :3]}}, r"surfaces.mount: the array has shape \(4, 3\)"),
}


@pytest.mark.parametrize(("changes", "message"), BAD.values(), ids=BAD)
def test_a_wrong_mesh_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        reference_mesh(**changes)


@pytest.mark.parametrize(
    "make",
    [
        lambda: box((1.0, 0.0, 1.0), (1, 1, 1)),
        lambda: box((1.0, 1.0, 1.0), (1, 0, 1)),
        lambda: tube_sector(2.0, 1.0, 1.0, 1),
        lambda: tube_sector(1.0, 2.0, -1.0, 1),
        lambda: shell_octant(0.0, 1.0, 1),
    ],
)
def test_impossible_bodies_are_refused(make):
    with pytest.raises(InputError):
        make()
