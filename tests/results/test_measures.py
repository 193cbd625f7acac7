"""Measures against motions known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from results.hollow_finger import HEIGHT, LENGTH, WIDTH, hollow_finger, moved, rod
from scipy.spatial.transform import Rotation

from turgor.common.errors import InputError
from turgor.mesh.mesh import Mesh
from turgor.results import measures
from turgor.results.measures import MEASURES, Choice, available
from turgor.results.measures.motion import max_displacement
from turgor.results.sections import motion
from turgor.results.stored import Body

FINGER = hollow_finger()
BARE_FINGER = hollow_finger(markers=False)
ANGLES = [0.0, 30.0, 89.0, 150.0, 179.9, 180.0, 180.1, 240.0, 311.0, 330.0, 359.0, 420.0]


def evaluate(names: list[str], mesh: Mesh, displacement: np.ndarray) -> dict[str, float]:
    return measures.evaluate(names, moved(Body(mesh), displacement))


def cavity_volume(mesh: Mesh, displacement: np.ndarray, surface: str) -> float:
    return Body(mesh).enclosed_volume(surface, displacement)


def moved_rigidly(mesh: Mesh, displacement: np.ndarray, rotation: Rotation, shift: np.ndarray) -> np.ndarray:
    return rotation.apply(mesh.points + displacement) + shift - mesh.points


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("mesh", [FINGER, BARE_FINGER], ids=["with markers", "without"])
def test_circular_arc_is_measured_exactly(mesh: Mesh, degrees: float) -> None:
    result = evaluate(["bending_angle", "twist", "chord_angle"], mesh, rod(mesh.points, math.radians(degrees)))
    assert result["bending_angle_deg"] == pytest.approx(degrees, abs=1e-8)
    assert result["twist_deg"] == pytest.approx(0.0, abs=1e-8)
    assert result["chord_angle_deg"] == pytest.approx((degrees / 2) % 180.0, abs=1e-6)


@pytest.mark.parametrize("degrees", [-400.0, -101.0, 0.0, 36.0, 180.0, 300.0])
def test_twist_alone_is_measured_exactly_and_with_its_sign(degrees: float) -> None:
    result = motion(FINGER, rod(FINGER.points, 0.0, math.radians(degrees)))
    assert math.degrees(result.twist) == pytest.approx(degrees, abs=1e-9)
    assert math.degrees(result.bending) == pytest.approx(0.0, abs=1e-6)
    assert result.elongation == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("bending", "twist"), [(55.0, -36.0), (90.0, 90.0), (200.0, 45.0), (311.0, -120.0)])
def test_bending_and_twist_are_told_apart(bending: float, twist: float) -> None:
    result = motion(FINGER, rod(FINGER.points, math.radians(bending), math.radians(twist)))
    assert math.degrees(result.bending) == pytest.approx(bending, abs=1e-8)
    assert math.degrees(result.twist) == pytest.approx(twist, rel=2e-4)  # one term of second order in the slice length


@settings(max_examples=25, deadline=None)
@given(
    bending=st.floats(0.0, 5.5),
    twist=st.floats(-2.0, 2.0),
    vector=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
)
def test_a_rigid_motion_of_everything_changes_no_angle(
    bending: float, twist: float, vector: tuple[float, ...], shift: tuple[float, ...]
) -> None:
    displacement = rod(FINGER.points, bending, twist)
    turned = moved_rigidly(FINGER, displacement, Rotation.from_rotvec(vector), np.array(shift))
    names = ["bending_angle", "twist", "chord_angle", "elongation"]
    before, after = (evaluate(names, FINGER, field) for field in (displacement, turned))
    for key, value in before.items():
        assert after[key] == pytest.approx(value, abs=1e-6)
    assert cavity_volume(FINGER, turned, "cavity") == pytest.approx(cavity_volume(FINGER, displacement, "cavity"))


def test_walls_that_bulge_do_not_count_as_bending() -> None:
    x, y, z = FINGER.points.T
    swell = 0.5 * np.sin(math.pi * x / LENGTH)
    bulge = np.column_stack([np.zeros_like(x), swell * y, swell * z])
    angle = math.radians(120.0)
    bulged = FINGER.points + bulge
    displacement = rod(bulged, angle) + bulge
    result = motion(FINGER, displacement)
    assert math.degrees(result.bending) == pytest.approx(120.0, abs=1e-8)
    assert math.degrees(result.twist) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("plane", [0.0, 90.0, 180.0, 233.0])
def test_bending_counts_in_any_plane_and_is_never_negative(plane: float) -> None:
    about_x = Rotation.from_euler("x", plane, degrees=True).as_matrix()
    turned = Mesh(FINGER.points @ about_x.T, FINGER.cells, surfaces=FINGER.surfaces)
    assert motion(turned, rod(FINGER.points, 1.2) @ about_x.T).bending == pytest.approx(1.2, abs=1e-9)


def test_s_shape_ends_without_bending() -> None:
    x = FINGER.points[:, 0]
    angle = 0.8 * np.sin(2.0 * math.pi * x / LENGTH)
    turned = Rotation.from_rotvec(np.outer(angle, [0.0, -1.0, 0.0]))
    axis = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    displacement = axis + turned.apply(FINGER.points * [0.0, 1.0, 1.0]) - FINGER.points
    assert motion(FINGER, displacement).bending == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("stretch", [0.8, 1.0, 1.37])
def test_elongation_of_a_straight_and_of_a_bent_body(stretch: float) -> None:
    straight = evaluate(["elongation"], FINGER, rod(FINGER.points, 0.0, 0.0, stretch))
    assert straight["elongation_mm"] == pytest.approx((stretch - 1.0) * LENGTH, abs=1e-9)
    bent = evaluate(["elongation"], FINGER, rod(FINGER.points, math.radians(200.0), 0.0, stretch))
    assert bent["elongation_mm"] == pytest.approx((stretch - 1.0) * LENGTH, abs=1e-3 * LENGTH)


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("at_rest", [90.0, 180.0])
def test_a_body_that_is_curved_at_rest_is_measured_along_its_centreline(at_rest: float, half: bool) -> None:
    straight, arc = hollow_finger(half=half), math.radians(at_rest)
    points = straight.points + rod(straight.points, arc)
    mesh = Mesh(points, straight.cells, surfaces=straight.surfaces, markers=straight.markers)
    names = ["bending_angle", "elongation", "twist"]

    def found(bending: float, twist: float = 0.0, stretch: float = 1.0) -> dict[str, float]:
        return evaluate(names, mesh, straight.points + rod(straight.points, bending, twist, stretch) - points)

    longer = found(arc + math.radians(100.0), stretch=1.2)
    assert longer["bending_angle_deg"] == pytest.approx(100.0, rel=1e-6)
    # Chords between the middles of slices are shorter than the arc.
    assert longer["elongation_mm"] == pytest.approx(0.2 * LENGTH, rel=1e-2)
    assert evaluate(names, mesh, 0.1 * points)["elongation_mm"] == pytest.approx(0.1 * LENGTH, rel=1e-2)
    if not half:
        assert found(arc, math.radians(60.0))["twist_deg"] == pytest.approx(60.0, rel=1e-2)


def test_tip_displacement_is_that_of_the_end_of_an_arc() -> None:
    angle = math.radians(130.0)
    result = evaluate(["tip_displacement"], FINGER, rod(FINGER.points, angle))
    radius = LENGTH / angle + HEIGHT / 2  # the marker runs along the bottom
    expected = {"x": radius * math.sin(angle) - LENGTH, "y": 0.0, "z": radius * (1.0 - math.cos(angle))}
    for axis, value in expected.items():
        assert result[f"tip_displacement_{axis}_mm"] == pytest.approx(value, abs=1e-9)


def test_cavity_volume_follows_an_affine_deformation() -> None:
    gradient = np.array([[1.3, 0.2, 0.0], [0.0, 0.9, -0.4], [0.1, 0.0, 1.1]])
    displacement = FINGER.points @ (gradient - np.eye(3)).T + [5.0, -3.0, 2.0]
    volume = 90.0 * (WIDTH - 6.0) * (HEIGHT - 6.0)
    rest = np.zeros_like(FINGER.points)
    assert cavity_volume(FINGER, rest, "cavity") == pytest.approx(volume)
    assert cavity_volume(FINGER, displacement, "cavity") == pytest.approx(volume * np.linalg.det(gradient))


def test_largest_displacement_is_a_length() -> None:
    assert max_displacement(np.array([[0.0, 0.0, 1.0], [3.0, 4.0, 0.0]])) == 5.0


def test_missing_names_are_told_together_with_what_there_is() -> None:
    with pytest.raises(InputError, match="'tip_displacement' needs the marker 'tip'") as caught:
        evaluate(["tip_displacement"], BARE_FINGER, np.zeros_like(BARE_FINGER.points))
    message = str(caught.value)
    assert "surfaces cavity, mount, outer, tip-face" in message
    assert "bending_angle" in message
    usual = {choice.entry.name for choice in available(Body(BARE_FINGER))}
    assert usual == {"bending_angle", "twist", "chord_angle", "elongation"}


def test_mesh_without_any_name_has_no_measure() -> None:
    bare = Mesh(FINGER.points, FINGER.cells)
    assert available(Body(bare)) == ()
    with pytest.raises(InputError, match=r"surface 'mount' and the surface 'tip-face'.*markers none"):
        measures.check([Choice.read("twist")], Body(bare))


def test_unknown_measure_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no such measure.*bending_angle"):
        Choice.read("bending")


def test_every_measure_has_keys_that_end_in_a_unit_and_a_docstring() -> None:
    units = ("deg", "mm", "mm3", "N", "MPa", "percent", "turns", "per_mm")
    for entry in MEASURES.values():
        assert entry.function.__doc__
        assert all(key.endswith(tuple(f"_{unit}" for unit in units)) for key in entry.keys), entry.name
