"""Plane and axisymmetric models from a case file or Python to their results."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import turgor as tg
from turgor.common.errors import InputError
from turgor.geometry.section import PlaneSection
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import rectangle
from turgor.results.store import RunStore
from turgor.study.case import load_case
from turgor.study.run import run

BELLOWS = """\
geometry: {template: bellows, model: axisymmetric, convolutions: 1}
materials:
  body: {model: neo-hookean, constants: {C10: 0.5 MPa}, density: 1000 kg/m^3}
mesh: {size: 1.2 mm}
supports:
  - {type: clamped, surface: mount}
loads:
  - {type: pressure, cavity: cavity, value: 10 kPa}
  - {type: gravity}
solver: {steps: 2}
measures:
  [tip_displacement, elongation, {expansion: {axis: x}}, {marker_rmse: {file: tips.csv, at: [[0 mm, TIP, 0 mm]]}}]
"""


def bellows_case(folder: Path, height: float, measured: tuple[float, ...]) -> Path:
    """Write the case, and a table with its top at rest at the pressures that are `measured`, kPa."""
    rows = "".join(f"{pressure},1,0,{height},0\n" for pressure in measured)
    (folder / "tips.csv").write_text(f"pressure (kPa),marker,x (mm),y (mm),z (mm)\n{rows}", encoding="utf-8")
    case = folder / "bellows.yaml"
    case.write_text(BELLOWS.replace("TIP", f"{height!r} mm"), encoding="utf-8")
    return case


@pytest.fixture
def unreported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)


@pytest.mark.usefixtures("unreported")
def test_a_body_of_revolution_runs_from_a_case_file(tmp_path: Path) -> None:
    height = tg.Bellows(convolutions=1).height
    done = run(load_case(bellows_case(tmp_path, height, (5,))), tmp_path / "run")
    rows = RunStore.open(done.folder).history
    assert [entry["pressure_kPa"] for entry in rows] == pytest.approx([0.0, 5.0, 10.0])
    assert rows[0]["tip_displacement_y_mm"] < 0.0  # its weight acts along −y
    final = done.summary["final"]
    assert final["tip_displacement_mm"][0] == final["tip_displacement_mm"][2] == 0.0
    assert final["tip_displacement_mm"][1] > 0.05
    # Marker by marker the error is that of the tip, in per cent of the height, where there is a measurement.
    assert [entry["marker_rmse_percent"] is None for entry in rows] == [True, False, True]
    assert rows[1]["marker_rmse_percent"] == pytest.approx(100.0 * rows[1]["tip_displacement_y_mm"] / height, rel=0.02)
    assert "marker_rmse" not in (done.folder / "run.log").read_text(encoding="utf-8")
    # The resolved case stands on its own copy of the table, and is resumed without a step.
    (tmp_path / "tips.csv").unlink()
    again = run(load_case(done.folder / "case.yaml"), done.folder, resume=True)
    assert again.summary["final"] == final
    stored = json.loads((done.folder / "store.json").read_text(encoding="utf-8"))
    assert stored["section"] == {"kind": "axisymmetric", "thickness": None}
    assert stored["measures"][3]["marker_rmse"]["file"] == "data/tips.csv"


@pytest.mark.usefixtures("unreported")
def test_a_comparison_with_no_measured_state_is_told(tmp_path: Path) -> None:
    case = bellows_case(tmp_path, tg.Bellows(convolutions=1).height, (7, 20))
    done = run(load_case(case), tmp_path / "run")
    told = (done.folder / "run.log").read_text(encoding="utf-8")
    assert "measures.marker_rmse: marker_rmse_percent is empty in every step; 'tips.csv' has what was measured" in told
    assert "at 7, 20 kPa" in told
    (warning,) = done.summary["warnings"]
    assert warning in told


def test_a_comparison_with_no_measured_state_is_told_in_python_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("turgor.study.path.report", lambda folder: folder)
    table = tmp_path / "tips.csv"
    table.write_text("pressure (kPa),marker,x (mm),y (mm),z (mm)\n7,1,0,40,0\n", encoding="utf-8")
    tube = tg.CappedTube(inner_radius="6 mm", wall="3 mm", length="40 mm", cap="6 mm")
    compared = {"marker_rmse": {"file": str(table), "at": [["0 mm", "0 mm", "40 mm"]]}}
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    model = tg.Model(tube.mesh(size="6 mm"), body=rubber, measures=[compared])
    path = model.inflate("4 kPa", steps=1)
    (warning,) = path.warnings
    assert "marker_rmse_percent is empty in every step; 'tips.csv' has what was measured at 7 kPa" in warning
    assert [record.getMessage() for record in caplog.records if record.name == "turgor.study"] == [warning]
    path.report(tmp_path / "run")
    store = RunStore.open(tmp_path / "run")
    assert store.summary is not None
    assert store.summary["warnings"] == store.warnings == [warning]
    measured = model.inflate("7 kPa", steps=1)
    assert measured.warnings == []


def tube_wall() -> Mesh:
    """The wall of a tube between two lids that slide, radius 6 to 9 mm."""
    solid = rectangle((3.0, 2.0), (4, 2), corner=(6.0, 0.0))
    names = {"mount": "y0", "tip-face": "y1", "cavity": "x0", "outer": "x1"}
    return Mesh(solid.points, solid.cells, surfaces={name: solid.surfaces[side] for name, side in names.items()})


def test_a_turned_section_swells_as_a_tube_does() -> None:

    mu, sides = 0.1, [{"type": "sliding", "surface": name} for name in ("mount", "tip-face")]
    rubber = tg.material("neo-hookean", {"C10": f"{mu / 2} MPa"}, bulk_modulus="1e4 MPa")
    section = PlaneSection("axisymmetric")
    model = tg.Model(tube_wall(), supports=sides, section=section, measures=[{"expansion": {"axis": "x"}}], body=rubber)
    path = model.inflate("20 kPa", steps=1)
    u = float(path.records[-1].displacement[path.mesh.surface_nodes("cavity"), 0].mean())
    inner = (6.0 + u) / 6.0
    outer = math.sqrt(1.0 + (inner**2 - 1.0) * 36.0 / 81.0)
    # Closed form of the thick tube (Ogden 1997): p = μ/2 [ln(λa²/λb²) + 1/λb² − 1/λa²].
    pressure = 0.5 * mu * (math.log(inner**2 / outer**2) + 1.0 / outer**2 - 1.0 / inner**2)
    assert pressure == pytest.approx(0.02, rel=1e-3)
    assert path.series("expansion_x").magnitude == pytest.approx([100.0 * (outer - 1.0)], rel=1e-3)
    assert path.cavity_volume.magnitude == pytest.approx([math.pi * (6.0 + u) ** 2 * 2.0])
    assert path.measure("displacement", at=("6 mm", "1 mm", "0 mm"))[0] == pytest.approx([u, 0.0, 0.0], rel=1e-6)
    assert np.all(path.measure("elongation") == pytest.approx(0.0))


def test_a_plane_mesh_needs_to_be_told_what_it_stands_for() -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"})
    with pytest.raises(InputError, match=r"needs a section; expected plane strain, plane stress or axisymmetric"):
        tg.Model(tube_wall(), body=rubber)
    family = {"law": {"type": "quadratic", "k": "1 MPa"}, "direction": {"type": "constant", "vector": [1, 0, 0]}}
    with pytest.raises(InputError, match=r"fibre_families: a plane section cannot have these"):
        tg.Model(tube_wall(), section=PlaneSection("axisymmetric"), fibre_families=[family], body=rubber)
    with pytest.raises(InputError, match=r"measures.expansion.axis: a plane model has no such extent"):
        tg.Model(
            tube_wall(), section=PlaneSection("axisymmetric"), measures=[{"expansion": {"axis": "z"}}], body=rubber
        )
