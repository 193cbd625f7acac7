"""Plane sections and bodies of revolution in the store, the tables, the pictures and the report."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from pathlib import Path

import meshio
import numpy as np
import pytest
from results.hollow_finger import bent_record, hollow_finger, moved

from turgor.geometry.section import PlaneSection
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import quarter_ring, rectangle
from turgor.results import report as report_module
from turgor.results.drawing import drawing_of
from turgor.results.history import row
from turgor.results.measures import Choice, available
from turgor.results.pictures import Pictures
from turgor.results.record import StepRecord
from turgor.results.report import report
from turgor.results.skin import flat_triangles
from turgor.results.store import RunStore
from turgor.results.stored import Body

TURNED = PlaneSection("axisymmetric")


def strip(kind: str = "quad9") -> Mesh:
    """A strip along y, 2 mm from the axis of x = 0."""
    solid = rectangle((3.0, 20.0), (2, 8), kind, corner=(2.0, 0.0))
    tip = np.array([int(np.argmax(solid.points @ [1e-3, 1.0]))])
    ends = {"mount": solid.surfaces["y0"], "tip-face": solid.surfaces["y1"], "cavity": solid.surfaces["x0"]}
    return Mesh(solid.points, solid.cells, surfaces=ends, markers={"tip": tip})


def record_of(body: Body, displacement: np.ndarray, index: int = 0) -> StepRecord:
    facts = {"iterations": 3, "factorisations": 3, "stable": True, "residual": 1e-9, "wall_s": 0.1}
    state = moved(
        body, displacement, index=index, fraction=0.5 * (index + 1), loads={"pressure:cavity": 0.01}, solver=facts,
        von_mises=np.linspace(0.0, 0.1, body.mesh.n_points), von_mises_max=0.11, von_mises_p99=0.09,
    )  # fmt: skip
    return state.record


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
@pytest.mark.parametrize("section", [TURNED, PlaneSection("plane-stress", 2.0)], ids=lambda section: section.kind)
def test_a_plane_run_comes_back_with_what_it_stands_for(tmp_path: Path, kind: str, section: PlaneSection) -> None:
    mesh = strip(kind)
    record = record_of(Body(mesh, section), 0.1 * mesh.points)
    with RunStore.create(tmp_path / "run", mesh, "name: strip\n", section=section) as store:
        store.append(record)
    found = RunStore.open(tmp_path / "run")
    assert found.body.section == section
    assert np.array_equal(found.load(0).displacement, record.displacement)
    (entry,) = found.history
    assert entry["tip_displacement_y_mm"] == pytest.approx(2.0)
    assert entry["tip_displacement_z_mm"] == 0.0
    grid = meshio.read(tmp_path / "run" / "steps" / "0000.vtu")
    assert grid.cells[0].type == {"tri6": "triangle6", "quad9": "quad9"}[kind]
    assert np.array_equal(grid.points[:, :2], mesh.points)
    assert (grid.points[:, 2] == 0.0).all()
    assert grid.point_data["displacement_mm"][:, :2] == pytest.approx(record.displacement, abs=1e-6)


def test_a_section_has_the_measures_that_it_can_have() -> None:
    mesh = strip()
    names = [choice.entry.name for choice in available(Body(mesh, TURNED))]
    assert names == ["elongation", "tip_displacement"]
    names = [choice.entry.name for choice in available(Body(mesh, PlaneSection("plane-strain", 2.0)))]
    assert names == ["bending_angle", "chord_angle", "elongation", "tip_displacement"]


def outside(body: Body, positions: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Area of what is drawn, the sum of its normals, and the volume that it encloses."""
    drawing = drawing_of(body)
    triangles = flat_triangles(drawing.faces, quartered=True)
    a, b, c = np.moveaxis(drawing.places(positions)[triangles], 1, 0)
    normals = 0.5 * np.cross(b - a, c - a)
    volume = float(np.einsum("ki,ki->", normals, (a + b + c) / 3.0)) / 3.0
    return float(np.linalg.norm(normals, axis=1).sum()), normals.sum(axis=0), volume


def test_the_revolved_body_is_closed_and_turns_outward() -> None:
    tube = Body(strip(), TURNED)
    area, normals, volume = outside(tube, tube.mesh.points)
    share = 0.75
    expected = share * 2 * math.pi * 7.0 * 20.0 + 2 * share * math.pi * (25.0 - 4.0) + 2 * 3.0 * 20.0
    assert area == pytest.approx(expected, rel=2e-3)
    assert normals == pytest.approx(0.0, abs=1e-9)
    assert volume == pytest.approx(share * math.pi * 21.0 * 20.0, rel=4e-3)
    # A solid that reaches the axis: half a spherical shell, and a displacement that swells it by a tenth.
    shell = quarter_ring(4.0, 5.0, 2, "tri6")
    _, normals, volume = outside(Body(shell, TURNED), 1.1 * shell.points)
    assert normals == pytest.approx(0.0, abs=1e-9)
    assert volume == pytest.approx(share * 2.0 / 3.0 * math.pi * (125.0 - 64.0) * 1.331, rel=1e-2)


def test_a_flat_body_is_drawn_whole() -> None:
    flat = Body(strip("quad9"), PlaneSection("plane-strain", 2.0))
    area, normals, volume = outside(flat, flat.mesh.points)
    assert area == pytest.approx(60.0)
    assert normals == pytest.approx([0.0, 0.0, 60.0])
    assert volume == 0.0


@pytest.mark.parametrize("section", [TURNED, PlaneSection("plane-strain", 2.0)], ids=lambda section: section.kind)
def test_the_report_shows_a_plane_run(tmp_path: Path, section: PlaneSection) -> None:
    mesh = strip()
    body = Body(mesh, section)
    with RunStore.create(tmp_path, mesh, "name: strip\n", section=section) as store:
        for index in range(2):
            store.append(record_of(body, 0.1 * index * mesh.points, index))
    html = report(tmp_path).read_text(encoding="utf-8")
    assert "nine-node quadrilaterals" in html
    assert ("turned about the y axis" in html) == (section == TURNED)
    pictures = html.count('<img src="data:image/png;base64,')
    assert pictures in (2, 0)  # none where OpenGL does not start
    assert "cut open" not in html


STANDING = {
    "contact": {
        "self": {"area_mm2": 3.0, "overlap_mm": 0.01, "overlap_per_wall": 0.005},
        "table": {"area_mm2": 2.0, "overlap_mm": 0.02, "overlap_per_wall": 0.004, "force_N": [0.0, 3.0, -4.0],
                  "torque_N_mm": [1.0, 0.0, 0.0]},
    },
    "fibres": {"one": {"largest_tension_N": 2.0, "largest_strain": 1e-4},
               "two": {"largest_tension_N": 1.0, "largest_strain": 3e-4, "largest_moment_N_mm": 5.0}},
}  # fmt: skip


def test_contacts_and_fibres_have_columns_of_their_own(small_finger: Mesh) -> None:
    body = Body(small_finger, rigid_bodies=("table",))
    record = dataclasses.replace(bent_record(small_finger, 0, 1.0), standing=STANDING)
    entry = row(moved(body, record.displacement, **_fields(record)), [Choice.read("tip_force")])
    assert entry["contact_self_area_mm2"] == 3.0
    assert entry["contact_self_overlap_per_wall"] == 0.005
    assert entry["contact_table_force_N"] == entry["tip_force_N"] == 5.0
    assert entry["contact_table_force_z_N"] == -4.0
    assert entry["contact_table_torque_x_N_mm"] == 1.0
    assert entry["fibre_largest_tension_N"] == 2.0
    assert entry["fibre_largest_strain"] == 3e-4
    assert entry["fibre_two_largest_tension_N"] == 1.0
    assert entry["fibre_largest_moment_N_mm"] == entry["fibre_two_largest_moment_N_mm"] == 5.0  # the first bends freely


def _fields(record: StepRecord) -> dict[str, object]:
    return {
        field.name: getattr(record, field.name) for field in dataclasses.fields(record) if field.name != "displacement"
    }


def test_curves_have_a_file_and_a_figure_and_survive_a_resume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report_module, "draw", lambda _, records, *__: Pictures((b"a",) * len(records)))
    finger = hollow_finger((12, 3, 3))
    wanted = ["bending_angle", {"centreline": {"stations": 9}}, {"centreline": {"stations": 7, "name": "short"}}]
    choices = [Choice.read(choice) for choice in wanted]
    with RunStore.create(tmp_path, finger, "name: finger\n", measures=choices) as store:
        store.append(dataclasses.replace(bent_record(finger, 0, 0.5), standing=STANDING))
    with RunStore.resume(tmp_path) as store:
        store.append(dataclasses.replace(bent_record(finger, 1, 1.0), standing=STANDING))
    with (tmp_path / "curves" / "centreline.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(entry["station"]) for entry in rows] == [*range(1, 10), *range(1, 10)]
    assert [float(entry["pressure_kPa"]) for entry in rows] == [20.0] * 9 + [40.0] * 9
    assert float(rows[13]["curvature_per_mm"]) == pytest.approx(math.radians(200.0) / 100.0, rel=2e-2)
    assert (tmp_path / "curves" / "centreline-short.csv").is_file()
    stored = json.loads((tmp_path / "store.json").read_text(encoding="utf-8"))
    assert stored["measures"] == ["bending_angle", {"centreline": {"stations": 9}}, wanted[2]]
    html = report(tmp_path).read_text(encoding="utf-8").replace("\\u002f", "/")
    for words in (
        "<h2>Contact</h2>",
        "<h2>Fibres</h2>",
        "<h2>Centreline</h2>",
        "Force / N",
        "Largest strain",
        "Torsion / (1/mm)",
    ):
        assert words in html
    with RunStore.create(tmp_path, finger, "name: finger\n", overwrite=True):
        assert not list((tmp_path / "curves").iterdir())
