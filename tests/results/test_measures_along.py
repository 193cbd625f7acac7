"""The centreline with its curvature and torsion, and the coil, against circles and helices known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from results.hollow_finger import LENGTH, WIDTH, hollow_finger, moved, rod

from turgor.common.errors import InputError
from turgor.geometry.tube import CappedTube
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle
from turgor.results.material_line import section_centroids
from turgor.results.measures import Choice, check
from turgor.results.stored import Body

FINGER = Body(hollow_finger())
S, X, Y, Z, CURVATURE, TORSION = range(6)


def helix(points: np.ndarray, radius: float, pitch: float) -> np.ndarray:
    """Displacement that lays a body along x on a helix about z, its cross-sections in the normal plane of the line."""
    rise = pitch / (2.0 * math.pi)
    length = math.hypot(radius, rise)
    phi = points[:, 0] / length
    c, s, one = np.cos(phi), np.sin(phi), np.ones_like(phi)
    line = np.column_stack([radius * c, radius * s, rise * phi])
    normal = np.column_stack([-c, -s, 0 * one])
    binormal = np.column_stack([rise * s, -rise * c, radius * one]) / length
    return line + points[:, 1:2] * normal + points[:, 2:3] * binormal - points


def measured(body: Body, displacement: np.ndarray, name: str, **parameters: object) -> np.ndarray:
    return Choice.read({name: parameters}).of(moved(body, displacement))


@pytest.mark.parametrize("by", ["sections", "marker", "opposite"])
@pytest.mark.parametrize("degrees", [10.0, 90.0, 311.0])
def test_an_arc_has_one_curvature_and_no_torsion(by: str, degrees: float) -> None:
    angle = math.radians(degrees)
    line = measured(FINGER, rod(FINGER.mesh.points, angle), "centreline", stations=30, by=by)
    radius = LENGTH / angle + (WIDTH / 2 if by == "marker" else 0.0)
    assert line[1:-1, CURVATURE] == pytest.approx(1.0 / radius, rel=5e-3)
    assert line[:, TORSION] == pytest.approx(0.0, abs=1e-9)
    assert line[-1, S] == pytest.approx(radius * angle, rel=1e-4)
    centre = np.array([0.0, 0.0, LENGTH / angle])
    assert np.linalg.norm(line[:, X : Z + 1] - centre, axis=1) == pytest.approx(radius, rel=2e-4)


@pytest.mark.parametrize("stations", [7, 8, 12, 20])
def test_few_stations_follow_an_arc_of_nearly_a_full_turn(stations: int) -> None:
    angle = math.radians(311.0)
    line = measured(FINGER, rod(FINGER.mesh.points, angle), "centreline", stations=stations)
    assert line[1:-1, CURVATURE] == pytest.approx(angle / LENGTH, rel=2e-2)
    assert line[:, CURVATURE] == pytest.approx(angle / LENGTH, rel=0.15)


@pytest.mark.parametrize("pitch", [40.0, -25.0])
@pytest.mark.parametrize("by", ["sections", "opposite"])
def test_a_helix_has_its_curvature_torsion_radius_and_pitch(pitch: float, by: str) -> None:
    radius, rise = 9.0, pitch / (2.0 * math.pi)
    displacement = helix(FINGER.mesh.points, radius, pitch)
    line = measured(FINGER, displacement, "centreline", stations=40, by=by)
    assert line[1:-1, CURVATURE] == pytest.approx(radius / (radius**2 + rise**2), rel=1e-2)
    assert line[1:-1, TORSION] == pytest.approx(rise / (radius**2 + rise**2), rel=3e-2)
    found = measured(FINGER, displacement, "coil", stations=40, by=by)
    assert found == pytest.approx([radius, pitch, LENGTH / math.hypot(radius, rise) / (2.0 * math.pi)], rel=1e-3)


@pytest.mark.parametrize("pitch", [40.0, -45.0])
def test_whole_turns_of_a_coil_are_not_counted_as_bending(pitch: float) -> None:
    radius, rise = 9.0, pitch / (2.0 * math.pi)
    length = math.hypot(radius, rise)
    # Between the tangents (−r sin φ, r cos φ, h) / √(r² + h²) at both ends.
    angle = math.acos((radius**2 * math.cos(LENGTH / length) + rise**2) / length**2)
    found = measured(FINGER, helix(FINGER.mesh.points, radius, pitch), "bending_angle")
    assert found == pytest.approx(math.degrees(angle), abs=0.5)


def test_a_coil_does_not_depend_on_where_it_stands() -> None:
    turned = helix(FINGER.mesh.points, 9.0, 40.0) + FINGER.mesh.points
    axes = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    axes *= np.linalg.det(axes)
    there = turned @ axes.T + [3.0, -7.0, 90.0] - FINGER.mesh.points
    here = turned - FINGER.mesh.points
    assert measured(FINGER, there, "coil") == pytest.approx(measured(FINGER, here, "coil"), rel=1e-9)


def test_a_straight_body_has_no_coil_and_no_torsion() -> None:
    stretched = rod(FINGER.mesh.points, 0.0, 0.3, 1.2)
    radius, pitch, turns = measured(FINGER, stretched, "coil")
    assert math.isnan(radius)
    assert math.isnan(pitch)
    assert turns == 0.0
    line = measured(FINGER, stretched, "centreline")
    assert line[:, TORSION] == pytest.approx(0.0)
    assert line[:, X] == pytest.approx(np.linspace(0.0, 1.2 * LENGTH, 20), abs=1e-3)


def tube(model: str) -> Mesh:
    """A straight tube along z, 60 mm long, of tetrahedra whose nodes lie nowhere in particular."""
    shape = CappedTube(inner_radius="3 mm", wall="2 mm", length="60 mm", cap="3 mm", model=model)
    return generate(shape, 4.0)


@pytest.mark.parametrize("model", ["full", "half", "quarter"])
@pytest.mark.parametrize("by", ["sections", "opposite"])
def test_the_line_through_a_straight_tube_is_its_axis_to_both_ends(model: str, by: str) -> None:
    body = Body(tube(model))
    line = measured(body, np.zeros_like(body.mesh.points), "centreline", by=by)
    # A chord of the flat pieces of the outside, on which the opposite points lie, is off by their height.
    assert line[:, X : Y + 1] == pytest.approx(0.0, abs=1e-3 if by == "sections" else 1e-2)
    assert line[:, Z] == pytest.approx(np.linspace(0.0, 60.0, 20), abs=1e-3)
    assert line[:, CURVATURE] == pytest.approx(0.0, abs=1e-4 if by == "sections" else 5e-3)
    assert math.isnan(measured(body, np.zeros_like(body.mesh.points), "coil", by=by)[0])


@pytest.mark.parametrize("model", ["full", "half"])
def test_a_tube_bent_to_an_arc_has_one_curvature_to_both_ends(model: str) -> None:
    body, angle = Body(tube(model)), math.radians(90.0)
    x, y, z = body.mesh.points.T
    radius = 60.0 / angle
    arc = np.column_stack([radius - (radius - x) * np.cos(z / radius), y, (radius - x) * np.sin(z / radius)])
    line = measured(body, arc - body.mesh.points, "centreline")
    assert line[1:-1, CURVATURE] == pytest.approx(1.0 / radius, rel=2e-2)
    assert line[[0, -1], CURVATURE] == pytest.approx(1.0 / radius, rel=5e-2)
    assert line[:, Y] == pytest.approx(0.0, abs=1e-3)
    assert line[-1, S] == pytest.approx(60.0, rel=1e-3)


@pytest.mark.parametrize("degrees", [40.0, 120.0])
def test_the_sections_of_a_body_that_is_curved_at_rest_are_whole(degrees: float) -> None:
    straight, angle = FINGER.mesh, math.radians(degrees)
    points = straight.points + rod(straight.points, angle)
    body = Body(Mesh(points, straight.cells, surfaces=straight.surfaces))
    radius = LENGTH / angle
    line = measured(body, np.zeros_like(points), "centreline", stations=30)
    away = np.linalg.norm(line[:, X : Z + 1] - [0.0, 0.0, radius], axis=1)
    # A plane across the chord cuts the arc at an angle, the more the nearer to its ends.
    assert away == pytest.approx(radius, abs=(0.02 if degrees < 90.0 else 0.06) * WIDTH)
    assert line[:, Y] == pytest.approx(0.0, abs=1e-2)


def test_end_faces_that_leave_no_room_for_a_section_are_refused() -> None:
    solid = box((4.0, 8.0, 8.0), (2, 2, 2))
    sheared = solid.points + np.outer(solid.points[:, 1], [1.0, 0.0, 0.0])
    ends = {"mount": solid.surfaces["x0"], "tip-face": solid.surfaces["x1"]}
    with pytest.raises(InputError, match=r"no plane across the axis clears both end faces.*marker"):
        section_centroids(Mesh(sheared, solid.cells, surfaces=ends), 9)


@pytest.mark.parametrize("kind", ["tet10", "hex27", "tri6", "quad9"])
def test_the_centroid_of_a_section_is_the_mean_over_its_area(kind: str) -> None:
    d = 3 if kind in ("tet10", "hex27") else 2
    solid = box((60.0, 8.0, 6.0), (7, 2, 1), kind) if d == 3 else rectangle((60.0, 8.0), (7, 2), kind)
    mesh = Mesh(solid.points, solid.cells, surfaces={"mount": solid.surfaces["x0"], "tip-face": solid.surfaces["x1"]})
    shares = section_centroids(mesh, 9)
    assert np.asarray(shares.sum(axis=1)).ravel() == pytest.approx(1.0)
    # Warped by y², the mean over −4 < y < 4 of which is 16/3.
    warped = shares @ ((mesh.points[:, 1] - 4.0) ** 2)
    assert warped == pytest.approx(16.0 / 3.0)
    assert shares @ mesh.points[:, 0] == pytest.approx(np.linspace(6e-5, 60.0 - 6e-5, 9))


def test_a_plane_strip_bends_in_its_plane() -> None:
    solid = rectangle((100.0, 6.0), (20, 2), corner=(0.0, -3.0))
    mesh = Mesh(solid.points, solid.cells, surfaces={"mount": solid.surfaces["x0"], "tip-face": solid.surfaces["x1"]})
    body, angle = Body(mesh), math.radians(250.0)
    around, radius = angle * mesh.points[:, 0] / 100.0, 100.0 / angle - mesh.points[:, 1]
    places = np.column_stack([radius * np.sin(around), 100.0 / angle - radius * np.cos(around)])
    for by in ("sections", "opposite"):
        line = measured(body, places - mesh.points, "centreline", by=by, stations=30)
        assert line[1:-1, CURVATURE] == pytest.approx(angle / 100.0, rel=5e-3)
        assert (line[:, Z] == 0.0).all()
    assert measured(body, places - mesh.points, "bending_angle") == pytest.approx(250.0)
    assert measured(body, places - mesh.points, "chord_angle") == pytest.approx(125.0)
    assert measured(body, places - mesh.points, "elongation") == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"stations": 3}, r"centreline.stations.*greater than or equal to 7"),
        ({"by": "magic"}, r"centreline.by.*'sections'"),
        ({"by": "opposite", "across": [0.0, 0.0, 0.0]}, r"across: this direction has length 0"),
        ({"by": "opposite", "across": [2.0, 0.0, 0.0]}, r"across: this direction runs along the axis"),
        ({"station": 9}, r"centreline.station: unknown key; expected one of: stations"),
    ],
)
def test_a_centreline_that_cannot_be_is_refused(parameters: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        check([Choice.read({"centreline": parameters})], FINGER)
