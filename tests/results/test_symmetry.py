"""Measures of halves and quarters: those of the whole that they stand for, without what symmetry forbids."""

from __future__ import annotations

import math

import numpy as np
import pytest
from results.hollow_finger import LENGTH, hollow_finger, moved, rod

from turgor.geometry.section import PlaneSection
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle, tube_sector
from turgor.results import report as report_module
from turgor.results.drawing import drawing_of
from turgor.results.measures import evaluate
from turgor.results.stored import Body
from turgor.results.symmetry import symmetry_of

NAMES = ["bending_angle", "twist", "chord_angle", "elongation"]
HALF = hollow_finger(half=True)


def quarter_tube(cuts: dict[str, list[str]]) -> Mesh:
    """A quarter of a tube around z, of radii 4 and 6 mm, 30 mm long; `cuts` are the sides of each symmetry surface."""
    sector = tube_sector(4.0, 6.0, 30.0, 1)
    named = {name: np.concatenate([sector.surfaces[side] for side in sides]) for name, sides in cuts.items()}
    ends = {"mount": sector.surfaces["z0"], "tip-face": sector.surfaces["z1"]}
    return Mesh(sector.points, sector.cells, surfaces={**ends, **named})


def bulged(points: np.ndarray, along: int) -> np.ndarray:
    """Displacement along one axis, more the farther from it: whole cross-sections bulge, and none of them turns."""
    displacement = np.zeros_like(points)
    away = np.delete(points, along, axis=1)
    displacement[:, along] = 4e-3 * points[:, along] * (away**2).sum(axis=1)
    return displacement


def test_a_half_whose_sections_bulge_neither_bends_nor_twists() -> None:
    found = evaluate(NAMES, moved(Body(HALF), bulged(HALF.points, 0)))
    for name in ("bending_angle_deg", "twist_deg", "chord_angle_deg"):
        assert found[name] == pytest.approx(0.0, abs=1e-6), name
    # The mean of y² + z² over a square of 12 mm is 12² / 6.
    assert found["elongation_mm"] == pytest.approx(4e-3 * LENGTH * 24.0)


def test_a_half_that_bends_in_its_plane_is_measured_as_the_whole_is() -> None:
    whole = hollow_finger()
    for degrees in (30.0, 200.0, 311.0):
        angle = math.radians(degrees)
        half, both = (evaluate(NAMES, moved(Body(mesh), rod(mesh.points, angle))) for mesh in (HALF, whole))
        for name, value in both.items():
            assert half[name] == pytest.approx(value, abs=1e-6), name


@pytest.mark.parametrize("cuts", [{"symmetry-x": ["x0"], "symmetry-y": ["y0"]}, {"symmetry": ["x0", "y0"]}])
def test_a_quarter_whose_sections_bulge_becomes_longer_by_the_mean(cuts: dict[str, list[str]]) -> None:
    mesh = quarter_tube(cuts)
    found = evaluate(NAMES, moved(Body(mesh), bulged(mesh.points, 2)))
    for name in ("bending_angle_deg", "twist_deg", "chord_angle_deg"):
        assert found[name] == pytest.approx(0.0, abs=1e-6), name
    # The mean of r² over a ring is (a² + b²) / 2.
    assert found["elongation_mm"] == pytest.approx(4e-3 * 30.0 * 26.0, rel=1e-4)


def test_a_quarter_has_four_images_and_its_middle_on_the_axis() -> None:
    mesh = quarter_tube({"symmetry-x": ["x0"], "symmetry-y": ["y0"]})
    whole = symmetry_of(mesh)
    assert len(whole.turns) == 4
    assert whole.places(mesh.points).mean(axis=0) == pytest.approx([0.0, 0.0, mesh.points[:, 2].mean()])
    assert whole.middle(np.array([3.0, 4.0, 5.0])) == pytest.approx([0.0, 0.0, 5.0])


@pytest.mark.parametrize("cuts", [{"symmetry-x": ["x0"], "symmetry-y": ["y0"]}, {"symmetry": ["x0", "y0"]}])
def test_a_quarter_is_told_and_drawn_as_one_however_its_cuts_are_named(cuts: dict[str, list[str]]) -> None:
    mesh = quarter_tube(cuts)
    assert report_module._part(mesh) == "quarter"
    assert sorted(drawing_of(Body(mesh)).cuts.tolist()) == [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]
    assert report_module._part(HALF) == "half"
    assert report_module._part(hollow_finger((6, 3, 3))) is None


def test_planes_at_sixty_degrees_have_six_images() -> None:
    mesh = quarter_tube({"symmetry-x": ["x0"], "symmetry-y": ["y0"]})
    radius, angle = np.hypot(*mesh.points[:, :2].T), np.arctan2(*mesh.points[:, 1::-1].T) * 2.0 / 3.0
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), mesh.points[:, 2]])
    assert len(symmetry_of(Mesh(points, mesh.cells, surfaces=mesh.surfaces)).turns) == 6


def test_a_plane_away_from_the_origin_mirrors_there() -> None:
    shifted = Mesh(HALF.points + np.array([0.0, 7.0, 0.0]), HALF.cells, surfaces=HALF.surfaces)
    assert symmetry_of(shifted).middle(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 7.0, 3.0])
    found = evaluate(NAMES, moved(Body(shifted), bulged(HALF.points, 0)))
    assert found["bending_angle_deg"] == pytest.approx(0.0, abs=1e-6)


def test_a_plane_across_the_body_has_other_sections_behind_it() -> None:
    solid = box((30.0, 4.0, 4.0), (6, 1, 1))
    ends = {"mount": solid.surfaces["x0"], "tip-face": solid.surfaces["x1"], "symmetry": solid.surfaces["x1"]}
    body = Body(Mesh(solid.points, solid.cells, surfaces=ends))
    assert len(symmetry_of(body.mesh).turns) == 1
    longer = evaluate(["elongation"], moved(body, 0.1 * body.mesh.points * [1.0, 0.0, 0.0]))
    assert longer["elongation_mm"] == pytest.approx(3.0)


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
def test_half_a_strip_whose_ends_bulge_does_not_bend(kind: str) -> None:
    solid = rectangle((60.0, 5.0), (12, 2), kind)
    ends = {"mount": solid.surfaces["x0"], "tip-face": solid.surfaces["x1"], "symmetry": solid.surfaces["y0"]}
    body = Body(Mesh(solid.points, solid.cells, surfaces=ends), PlaneSection("plane-strain", 1.0))
    found = evaluate(["bending_angle", "chord_angle", "elongation"], moved(body, bulged(body.mesh.points, 0)))
    assert found["bending_angle_deg"] == pytest.approx(0.0, abs=1e-6)
    assert found["chord_angle_deg"] == pytest.approx(0.0, abs=1e-6)
    assert found["elongation_mm"] == pytest.approx(4e-3 * 60.0 * 25.0 / 3.0)


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
def test_a_body_of_revolution_becomes_longer_by_the_mean_over_its_ends(kind: str) -> None:
    solid = rectangle((6.0, 20.0), (3, 5), kind)
    ends = {"mount": solid.surfaces["y0"], "tip-face": solid.surfaces["y1"]}
    body = Body(Mesh(solid.points, solid.cells, surfaces=ends), PlaneSection("axisymmetric"))
    found = evaluate(["elongation"], moved(body, bulged(body.mesh.points, 1)))
    # The mean of r² over a disc is b² / 2, that over its radius b² / 3.
    assert found["elongation_mm"] == pytest.approx(4e-3 * 20.0 * 18.0)
