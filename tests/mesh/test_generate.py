import math
import subprocess
import sys

import gmsh
import numpy as np
import pytest

from turgor.common.errors import InputError, MissingPackageError
from turgor.geometry.bellows import Bellows
from turgor.geometry.membrane import Membrane
from turgor.geometry.pneunet import PneuNet
from turgor.geometry.tube import CappedTube
from turgor.mesh.faces import boundary_faces, rim_edges
from turgor.mesh.generate import LEAST_DISTORTION, generate, nodes_on_polyline, untangled
from turgor.mesh.layers import FEWEST, outward
from turgor.mesh.structured import box, shell_octant
from turgor.mesh.tet10 import jacobian_coefficients
from turgor.mesh.walls import walls


@pytest.fixture(scope="module")
def tube():
    return generate(CappedTube(), 3.0)


@pytest.fixture(scope="module")
def finger():
    return generate(PneuNet(chambers=3), 3.0)


@pytest.fixture(scope="module")
def half_finger():
    return generate(PneuNet(chambers=3, symmetric=True), 3.0)


def pneunet_air(finger):
    passage = (finger.chambers - 1) * (2 * finger.wall + finger.gap) * finger.tunnel_width * finger.tunnel_height
    return finger.chambers * finger.chamber_length * finger.chamber_width * finger.chamber_height + passage


def pneunet_solid(finger):
    """The bounding block less the gaps between the chambers and less the air."""
    width = finger.chamber_width + 2 * finger.side_wall
    length = 2 * finger.end_wall + finger.chambers * finger.chamber_length
    length += (finger.chambers - 1) * (2 * finger.wall + finger.gap)
    height = finger.first_layer + finger.second_layer + finger.chamber_height + finger.top_wall
    gap_height = finger.chamber_height + finger.top_wall - finger.tunnel_height - finger.tunnel_roof
    return length * width * height - (finger.chambers - 1) * finger.gap * width * gap_height - pneunet_air(finger)


def assert_sound(mesh):
    """Every element proved valid, and the named surfaces tile the skin: each face once, nothing left out."""
    assert jacobian_coefficients(mesh.points[mesh.cells]).min() > 0.0
    named = np.vstack(list(mesh.surfaces.values()))
    assert len(np.unique(np.sort(named, axis=1), axis=0)) == len(named)
    assert len(named) == len(boundary_faces(mesh.cells))


def test_case_t_has_the_size_that_was_measured_before(tube):
    assert 5_000 < tube.n_cells < 6_500
    assert_sound(tube)


def test_the_tube_has_its_exact_volumes(tube):
    assert tube.enclosed_volume("cavity") == pytest.approx(math.pi * 6.35**2 * 86, rel=1e-4)
    assert tube.volume() == pytest.approx(math.pi * (9.85**2 * 120 - 6.35**2 * 86), rel=1e-4)
    assert tube.enclosed_volume("cavity") == pytest.approx(math.pi * 6.35**2 * 86, rel=1e-4)
    assert len(rim_edges(tube.surface("cavity"))) == 0


def test_the_tubes_middle_nodes_lie_on_the_cylinders(tube):
    nodes = tube.surface_nodes("outer")
    np.testing.assert_allclose(np.hypot(*tube.points[nodes, :2].T), 9.85, atol=1e-6)


def test_the_tubes_names_are_where_they_should_be(tube):
    assert (np.abs(tube.points[tube.surface_nodes("mount"), 2]) < 1e-9).all()
    assert (np.abs(tube.points[tube.surface_nodes("tip-face"), 2] - 120.0) < 1e-9).all()
    np.testing.assert_allclose(tube.points[tube.marker("tip")], [[0.0, 0.0, 120.0]], atol=1e-9)
    np.testing.assert_allclose(tube.points[tube.marker("base")], [[0.0, 0.0, 0.0]], atol=1e-9)
    line = tube.points[tube.marker("centreline")]
    assert (np.diff(line[:, 2]) > 0.0).all()
    np.testing.assert_allclose(line[[0, -1], 2], [0.0, 120.0], atol=1e-9)


def test_the_finger_has_its_exact_volumes(finger):
    template = PneuNet(chambers=3)
    assert finger.enclosed_volume("cavity") == pytest.approx(pneunet_air(template), rel=1e-9)
    assert finger.volume() == pytest.approx(pneunet_solid(template), rel=1e-9)
    assert finger.volume("base") == pytest.approx(14.0 * 27.0 * 1.0, rel=1e-9)
    assert set(finger.surfaces) == {"mount", "tip-face", "outer", "cavity"}
    assert_sound(finger)


def test_the_half_finger_is_half_the_finger(finger, half_finger):
    assert half_finger.volume() == pytest.approx(0.5 * finger.volume(), rel=1e-9)
    assert half_finger.enclosed_volume("cavity") == pytest.approx(0.5 * finger.enclosed_volume("cavity"), rel=1e-9)
    assert (np.abs(half_finger.points[half_finger.surface_nodes("symmetry"), 1]) < 1e-9).all()
    assert half_finger.points[:, 1].min() > -1e-9
    assert_sound(half_finger)


@pytest.mark.parametrize("name", ["finger", "half_finger"])
def test_the_fingers_centreline_runs_along_the_bottom(name, request):
    mesh = request.getfixturevalue(name)
    line = mesh.points[mesh.marker("centreline")]
    np.testing.assert_allclose(line[:, 1:], 0.0, atol=1e-9)
    assert (np.diff(line[:, 0]) > 0.0).all()
    assert line[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert line[-1, 0] == pytest.approx(27.0)
    assert mesh.marker("base")[0] == mesh.marker("centreline")[0]
    assert mesh.marker("tip")[0] == mesh.marker("centreline")[-1]
    assert len(line) % 2 == 1


def test_a_finger_without_second_layer_has_one_region():
    mesh = generate(PneuNet(chambers=1, second_layer="0 mm"), 4.0)
    assert list(mesh.regions) == ["body"]
    assert mesh.volume() == pytest.approx(pneunet_solid(PneuNet(chambers=1, second_layer="0 mm")), rel=1e-9)


def test_the_default_finger_is_small_enough_for_a_laptop():
    template = PneuNet()
    full, half = generate(template), generate(template.changed(symmetric=True))
    assert full.n_cells < 25_000
    assert half.n_cells < 12_000


def test_the_same_input_gives_the_same_bits(tube):
    again = generate(CappedTube(), 3.0)
    for name in ("points", "cells"):
        assert getattr(again, name).tobytes() == getattr(tube, name).tobytes()
    for name, triangles in tube.surfaces.items():
        assert again.surface(name).tobytes() == triangles.tobytes()


def test_another_process_gives_the_same_bits_too():
    code = (
        "import hashlib, sys; from turgor.geometry.reinforced_tube import ReinforcedTube as Tube; "
        "from turgor.mesh.generate import generate; m = generate(Tube(rings=3, length='30 mm', cavity_length='20 mm'), "
        "4.0, layers=1); print(hashlib.sha256(m.points.tobytes() + m.cells.tobytes()).hexdigest())"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    assert len(runs[0].stdout) == 65
    assert runs[0].stdout == runs[1].stdout


def test_layers_follow_the_walls():
    template = CappedTube(inner_radius="6 mm", wall="2 mm", length="30 mm", cap="6 mm")
    plain, one, two = (walls(generate(template, 6.0, layers=layers)) for layers in (None, 1, 2))
    assert np.median(plain.thickness) == pytest.approx(2.0, rel=0.1)
    thin = [w.elements[w.thickness < 2.2] for w in (plain, one, two)]
    assert np.median(thin[0]) < 0.8
    assert np.median(thin[1]) > 1.0
    assert np.median(thin[2]) > 2.0
    # The caps are thick and stay coarse.
    assert generate(template, 6.0, layers=1).n_cells < 0.6 * generate(template, 1.6).n_cells


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize(
    "template",
    [
        CappedTube(inner_radius="6 mm", wall="2 mm", length="30 mm", cap="6 mm"),
        PneuNet(chambers=2, symmetric=True),
        Membrane(segments=1, model="quarter", chamber_length="5 mm", membrane="0.4 mm"),
    ],
    ids=lambda template: template.template,
)
def test_walls_have_the_layers_that_were_asked_for(template, layers):
    counted = walls(generate(template, 4.0, layers=layers))
    assert np.percentile(counted.elements, FEWEST) >= layers


def test_layers_that_fall_short_are_meshed_again_finer(monkeypatch, caplog):
    template, stages = CappedTube(inner_radius="6 mm", wall="2 mm", length="20 mm", cap="4 mm"), []
    monkeypatch.setattr("turgor.mesh.layers.EDGE_OF_LAYER", 1.7)
    counted = walls(generate(template, 6.0, layers=2, progress=stages.append))
    assert stages.count("curving") == 3
    assert np.percentile(counted.elements, FEWEST) >= 2.0
    # Twice is not always enough: then it is said.
    monkeypatch.setattr("turgor.mesh.layers._REPEATS", 0)
    with caplog.at_level("WARNING"):
        generate(template, 6.0, layers=2)
    assert "behind 5 % of the skin walls have fewer than" in caplog.text


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_skin_is_turned_outward_whatever_its_sense(symmetric):
    mesh = generate(PneuNet(chambers=2, symmetric=symmetric), 4.0)
    skin = boundary_faces(mesh.cells)[:, :3]
    mixed = skin.copy()
    mixed[::3] = mixed[::3, ::-1]
    turned = outward(mesh.points, mixed)

    def normals(triangles):
        corners = mesh.points[triangles]
        return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    np.testing.assert_allclose(normals(turned), normals(skin), atol=1e-12)


@pytest.mark.parametrize("layers", [0, 200])
def test_layers_that_cannot_be_are_refused(layers):
    with pytest.raises(InputError, match="layers"):
        generate(CappedTube(), 3.0, layers=layers)


def test_finer_elements_bring_the_volume_closer():
    exact = math.pi * (6.0**2 * 20 - 4.0**2 * 14)
    template = CappedTube(inner_radius="4 mm", wall="2 mm", length="20 mm", cap="3 mm")
    coarse, fine = (abs(generate(template, size).volume() - exact) for size in (1.8, 0.9))
    assert fine < coarse / 6


def test_progress_is_told():
    stages = []
    generate(CappedTube(), 8.0, progress=stages.append)
    assert stages == ["drawing", "meshing with elements of 8 mm", "curving"]


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf])
def test_a_wrong_size_is_refused(size):
    with pytest.raises(InputError, match="size: the element size must be positive"):
        generate(CappedTube(), size)


def test_a_size_that_fills_the_memory_is_refused_before_meshing():
    with pytest.raises(InputError, match=r"size: this element size needs about .* elements"):
        generate(CappedTube(), 0.01)
    assert not gmsh.isInitialized()


def test_gmsh_is_closed_after_a_failure(monkeypatch):
    def stop(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(CappedTube, "draw", stop)
    with pytest.raises(KeyboardInterrupt):
        generate(CappedTube())
    assert not gmsh.isInitialized()


def test_a_session_of_somebody_else_is_left_alone():
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        with pytest.raises(InputError, match="already open"):
            generate(CappedTube())
        assert gmsh.isInitialized()
    finally:
        gmsh.finalize()


def test_a_missing_gmsh_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(MissingPackageError, match="pip install gmsh"):
        generate(CappedTube())


def test_tangled_elements_lose_curvature_and_are_counted():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    points = mesh.points.copy()
    middle = mesh.cells[0, 4]
    points[middle] += [0.4, 0.1, 0.0]
    assert jacobian_coefficients(points[mesh.cells]).min() < 0.0
    repaired, count = untangled(points, mesh.cells)
    coefficients = jacobian_coefficients(repaired[mesh.cells])
    assert (coefficients.min(axis=1) >= LEAST_DISTORTION * coefficients.max(axis=1)).all()
    assert 0 < count < mesh.n_cells
    # Half the way was enough, and no other node moved.
    np.testing.assert_allclose(repaired[middle] - mesh.points[middle], [0.1, 0.025, 0.0])
    np.testing.assert_array_equal(np.delete(repaired, middle, axis=0), np.delete(mesh.points, middle, axis=0))


def test_good_elements_keep_their_curvature():
    mesh = shell_octant(1.0, 1.5, 1)
    points, count = untangled(mesh.points, mesh.cells)
    assert count == 0
    np.testing.assert_array_equal(points, mesh.points)


def test_an_element_that_is_inside_out_cannot_be_repaired():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match="inside out near"):
        untangled(mesh.points, mesh.cells[:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]])


def test_a_thin_wall_of_coarse_elements_is_reported(caplog):
    with caplog.at_level("WARNING"):
        mesh = generate(CappedTube(inner_radius="14 mm", wall="0.6 mm", length="40 mm", cap="5 mm"), 6.0)
    assert "less curved than the shape" in caplog.text
    assert_sound(mesh)


def test_nodes_on_a_polyline_come_in_its_order():
    points = box((1.0, 1.0, 1.0), (1, 1, 1)).points
    line = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    places = points[nodes_on_polyline(points, line, "edge")]
    np.testing.assert_array_equal(places, [[1, 0, 0], [0.5, 0, 0], [0, 0, 0], [0, 0, 0.5], [0, 0, 1]])
    with pytest.raises(InputError, match="edge: no node"):
        nodes_on_polyline(points, np.array([[0.3, 0.3, 0.3]]), "edge")


@pytest.mark.parametrize("count", [8, 12])
def test_round_edges_in_space_get_elements_by_their_radius(count):
    bellows = Bellows(model="quarter", convolutions=1)
    mesh = generate(bellows, 3.0, per_circle=count)
    across = np.column_stack([np.hypot(*mesh.points[:, :2].T), mesh.points[:, 2]])
    radius = bellows.rounding - bellows.wall / 2
    lengths = []
    for centre in (piece.centre for piece in bellows._line(0.0) if piece.centre is not None):
        on_arc = np.abs(np.linalg.norm(across - centre, axis=1) - radius) < 1e-4
        faces = np.vstack([faces[:, :3] for faces in mesh.surfaces.values()])
        corners = mesh.points[faces[on_arc[faces].all(axis=1)]]
        lengths.append(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).ravel())
    relative = np.concatenate(lengths) / (2 * math.pi * radius / count)
    assert len(relative) > 1000
    assert 0.9 < np.median(relative) < 1.05
    assert np.percentile(relative, 90) < 1.1
    assert relative.max() < 1.5


@pytest.mark.parametrize("count", [16, 32, 64])
def test_round_edges_get_elements_by_their_radius(count):
    bellows = Bellows(model="axisymmetric", convolutions=1)
    mesh = generate(bellows, 1.6, per_circle=count)
    radius = bellows.rounding + bellows.wall / 2
    centre = next(piece.centre for piece in bellows._line(0.0)[2:] if piece.centre is not None)
    on_crest = np.abs(np.hypot(*(mesh.points - centre).T) - radius) < 1e-6
    edges = mesh.surfaces["outer"]
    edges = edges[on_crest[edges].all(axis=1)]
    lengths = np.linalg.norm(mesh.points[edges[:, 0]] - mesh.points[edges[:, 1]], axis=1)
    wanted = 2 * math.pi * radius / count
    assert lengths.max() <= wanted
    assert lengths.min() > 0.9 * wanted
