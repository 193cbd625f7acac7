"""Pictures: drawn without a screen, comparable with each other, and never the end of the process."""

from __future__ import annotations

import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image
from results.hollow_finger import bent_record, hollow_finger

from turgor.common.errors import MissingPackageError
from turgor.mesh.mesh import Mesh
from turgor.results import pictures
from turgor.results.camera import camera_for
from turgor.results.drawing import drawing_of
from turgor.results.pictures import SIZE, draw
from turgor.results.skin import compact, flat_triangles, outside_faces, smooth_patches
from turgor.results.stored import Body


def pixels(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB")).astype(float)


@pytest.fixture(scope="module")
def drawn(finger: Mesh) -> pictures.Pictures:
    records = [bent_record(finger, index, fraction) for index, fraction in enumerate((0.25, 1.0))]
    try:
        return draw(Body(finger), records, ["10 kPa", "40 kPa"], 0.08)
    except MissingPackageError as error:
        pytest.skip(str(error))


def test_pictures_show_a_coloured_body_that_moves(drawn: pictures.Pictures) -> None:
    assert drawn.last is not None
    first, last, section = (pixels(png) for png in (*drawn.states, drawn.last))
    for picture in (first, last, section):
        assert picture.shape == (SIZE[1], SIZE[0], 3)
        body = picture[: int(0.8 * SIZE[1])]  # without the colour bar
        coloured = np.ptp(body, axis=2) > 40.0
        assert 0.02 < coloured.mean() < 0.6
        assert (picture[2] == 255.0).all()  # nothing reaches the upper edge
    coloured = [np.ptp(picture[: int(0.8 * SIZE[1])], axis=2) > 40.0 for picture in (first, last)]
    assert (coloured[0] & coloured[1]).sum() < 0.5 * coloured[1].sum()  # bent by 200 degrees it is elsewhere
    assert (last != section).any()
    assert drawn.last_label == "40 kPa, cut open"


def test_the_body_is_drawn_in_the_colour_of_its_stress(drawn: pictures.Pictures) -> None:
    # viridis runs from violet (much blue, little green) to yellow (much green, little blue)
    def greenness(picture: np.ndarray) -> float:
        body = picture[: int(0.8 * SIZE[1])]
        coloured = body[np.ptp(body, axis=2) > 40.0]
        return float((coloured[:, 1] - coloured[:, 2]).mean())

    first, last = (pixels(png) for png in drawn.states)
    assert greenness(first) < 0.0 < greenness(last)


def test_a_process_that_dies_leaves_a_message_with_the_packages(
    small_finger: Mesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object, **__: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess([], -11, "", "")

    monkeypatch.setattr(pictures.subprocess, "run", killed)
    with pytest.raises(MissingPackageError, match="apt-get install libegl1 libgl1 libgl1-mesa-dri"):
        draw(Body(small_finger), [bent_record(small_finger, 0, 1.0)], ["40 kPa"], 0.08)


def test_a_library_that_is_missing_is_named_with_its_package(
    small_finger: Mesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    loader = "Traceback\nImportError: libXrender.so.1: cannot open shared object file: No such file or directory\n"
    failed = subprocess.CompletedProcess([], 1, "", loader)
    monkeypatch.setattr(pictures.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(MissingPackageError, match="apt-get install libxrender1"):
        draw(Body(small_finger), [bent_record(small_finger, 0, 1.0)], ["40 kPa"], 0.08)


@pytest.mark.parametrize("turn", range(6))
def test_the_camera_sees_every_point_from_the_side_of_the_motion(turn: int) -> None:
    generator = np.random.default_rng(turn)
    axes = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)][turn]
    points = (generator.uniform(-1.0, 1.0, (200, 3)) * [50.0, 4.0, 30.0] + [10.0, 20.0, 30.0])[:, axes]
    camera = camera_for(points, aspect=4 / 3)
    right = np.cross(camera.up, camera.towards)
    assert np.allclose([camera.up @ camera.up, camera.towards @ camera.towards, right @ right], 1.0)
    assert camera.up @ camera.towards == pytest.approx(0.0, abs=1e-12)
    seen = (points - camera.target) @ np.column_stack([right, camera.up])
    assert np.abs(seen[:, 1]).max() < camera.half_height
    assert np.abs(seen[:, 0]).max() < camera.half_height * 4 / 3
    filled = max(np.abs(seen[:, 1]).max() / camera.half_height, np.abs(seen[:, 0]).max() / camera.half_height * 3 / 4)
    assert filled > 0.9
    assert axes[camera.side] == 1
    assert np.argmax(np.abs(camera.towards)) == camera.side


@pytest.mark.parametrize(
    "cuts",
    [
        [(0, -1, 0)],
        [(0, 1, 0)],
        [(-1, 0, 0)],
        [(0, 0, 1)],
        [(-1, 0, 0), (0, -1, 0)],
        [(1, 0, 0), (0, -1, 0), (0, 0, -1)],
    ],
    ids=str,
)
def test_the_camera_sees_every_cut(cuts: list[tuple[int, int, int]]) -> None:
    points = np.random.default_rng(0).uniform(0.0, 1.0, (50, 3)) * [4.0, 30.0, 50.0]
    normals = np.array(cuts, float)
    camera = camera_for(points, 4 / 3, normals)
    assert (normals @ camera.towards > 0.25).all()
    assert max(normals @ camera.towards) > 0.8
    behind = camera_for(points, 4 / 3, -normals)
    assert (normals @ behind.towards < -0.25).all()


def test_a_half_is_seen_from_its_cut_with_the_walls_of_its_cavity() -> None:
    body = Body(hollow_finger(half=True))
    drawing = drawing_of(body)
    assert drawing.cuts.tolist() == [[0.0, -1.0, 0.0]]
    faces = {tuple(sorted(face)) for face in outside_faces(body.mesh).tolist()}
    assert {tuple(sorted(face)) for face in body.mesh.surface("cavity").tolist()} < faces
    try:
        drawn = draw(body, [bent_record(body.mesh, 0, 0.01)], ["40 kPa"], 0.08)
    except MissingPackageError as error:
        pytest.skip(str(error))
    assert drawn.last_label == "40 kPa, from outside"
    assert drawn.last is not None
    # From the cut one looks into the cavity, whose corners are seen; from outside upon a smooth wall.
    inside, outside = (
        np.abs(np.diff(pixels(png)[150:550].mean(axis=2), axis=0)) for png in (drawn.states[0], drawn.last)
    )
    assert (inside > 3.0).sum() > 1.2 * (outside > 3.0).sum()


def test_the_outside_leaves_the_cavity_out(finger: Mesh) -> None:
    faces = outside_faces(finger)
    named = np.concatenate([finger.surfaces[name] for name in ("mount", "tip-face", "outer")])
    assert {tuple(sorted(face)) for face in faces.tolist()} == {tuple(sorted(face)) for face in named.tolist()}
    nodes, compacted = compact(faces)
    assert np.array_equal(nodes[compacted], faces)


def test_flat_triangles_cover_the_faces_once(finger: Mesh) -> None:
    faces = outside_faces(finger)

    def area(triangles: np.ndarray) -> np.ndarray:
        a, b, c = np.moveaxis(finger.points[triangles], 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    for quartered in (True, False):
        vectors = area(flat_triangles(faces, quartered=quartered))
        assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(2 * 144.0 + 4 * 1200.0)
        assert vectors.sum(axis=0) == pytest.approx(0.0, abs=1e-9)  # all turn outward


def test_patches_end_at_sharp_edges_only() -> None:
    mesh = hollow_finger((6, 3, 3))
    assert len(np.unique(smooth_patches(mesh.points, outside_faces(mesh)))) == 6
    rounded = np.array(mesh.points)
    rounded[:, 2] += 2.0 * np.sin(rounded[:, 0] / 20.0)
    assert len(np.unique(smooth_patches(rounded, outside_faces(mesh)))) == 6


def test_importing_the_room_loads_no_drawing_package() -> None:
    code = "import sys, turgor.results, turgor.results.store; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"plotly", "pyvista", "vtk", "vtkmodules", "matplotlib"} & set(loaded)
