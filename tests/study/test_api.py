"""The Python story of the README."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import turgor as tg
from turgor.common.errors import InputError, SolverError
from turgor.materials.library import get
from turgor.results.store import RunStore
from turgor.solver.path import LimitPressureError
from turgor.study.case import load_case
from turgor.study.run import run


@pytest.fixture(scope="module")
def mesh() -> tg.Mesh:
    return tg.CappedTube(inner_radius="6 mm", wall="3 mm", length="40 mm", cap="6 mm").mesh(size="6 mm")


@pytest.fixture(scope="module")
def path(mesh: tg.Mesh) -> tg.Path:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    return tg.Model(mesh, body=rubber).inflate("20 kPa", steps=4)


def test_the_story_and_the_case_file_tell_the_same(
    path: tg.Path, small_tube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)
    done = run(load_case(small_tube), tmp_path / "run")
    stored = RunStore.open(done.folder)
    u = stored.load(3).displacement
    np.testing.assert_allclose(path.records[-1].displacement, u, atol=1e-7 * np.abs(u).max())
    ours, theirs = path.summary["final"], done.summary["final"]
    assert ours.keys() == theirs.keys()
    for key, value in ours.items():
        assert value == pytest.approx(theirs[key], rel=1e-7, abs=1e-7), key


def test_series_have_units(path: tg.Path) -> None:
    assert path.pressure.to("kPa").magnitude == pytest.approx([5.0, 10.0, 15.0, 20.0])
    assert path.tip_displacement.shape == (4, 3)
    assert np.all(np.diff(path.tip_displacement.to("mm").magnitude[:, 2]) > 0)
    assert np.all(np.abs(path.bending_angle.to("deg").magnitude) < 1.0)
    assert path.cavity_volume.to("ml").magnitude[0] == pytest.approx(np.pi * 6**2 * 28 / 1000, rel=0.1)
    assert path.stable is not False
    with pytest.raises(InputError, match=r"no such series.*expected 'twist'"):
        path.series("twits")


def test_the_path_makes_a_report(path: tg.Path, tmp_path: Path) -> None:
    report = path.report(tmp_path / "finger")
    text = report.read_text(encoding="utf-8")
    assert report.name == "report.html"
    assert "neo-hookean" in text
    assert RunStore.open(tmp_path / "finger").n_steps == 4
    with pytest.raises(InputError, match="holds a run already"):
        path.report(tmp_path / "finger")


def test_every_cavity_and_other_loads_act(mesh: tg.Mesh) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499, density="1070 kg/m^3")
    model = tg.Model(mesh, body=rubber, loads=[{"type": "gravity", "direction": [0, 0, 1]}])
    reached: list[int] = []
    heavy = model.inflate("1 kPa", steps=1, on_step=lambda path: reached.append(len(path.records)))
    assert reached == [1, 2]  # the weight alone comes first
    assert heavy.records[0].fraction == 0.0
    assert heavy.tip_displacement.magnitude[0, 2] > 0
    assert set(heavy.records[-1].loads) == {"pressure:cavity", "gravity"}


def test_a_table_in_the_way_holds_the_tip_back(mesh: tg.Mesh, path: tg.Path) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    table = {"type": "plane", "point": ("0 mm", "0 mm", "40.2 mm"), "normal": (0, 0, -1), "surface": "tip-face"}
    held = tg.Model(mesh, body=rubber, contact={"bodies": [table]}).inflate("20 kPa", steps=1)
    free, stopped = (p.records[-1].displacement[mesh.marker("tip")][0, 2] for p in (path, held))
    assert free > 0.4
    assert stopped == pytest.approx(0.2, abs=0.05)


def test_a_body_that_touches_nothing_moves_as_without_contact(mesh: tg.Mesh, path: tg.Path) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    alone = tg.Model(mesh, body=rubber, contact=True).inflate("20 kPa", steps=1)
    u = path.records[-1].displacement
    np.testing.assert_allclose(alone.records[-1].displacement, u, atol=1e-6 * np.abs(u).max())


def test_a_sheet_and_a_fibre_family_stiffen_the_tube(mesh: tg.Mesh, path: tg.Path) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    paper = {"surface": "outer", "youngs_modulus": "10 MPa", "thickness": "0.1 mm"}
    around = {"law": {"type": "quadratic", "k": "0.5 MPa"}, "direction": {"type": "helical", "angle": "90 deg"}}
    volume = path.records[-1].cavity_volumes["cavity"]
    for parts in ({"sheets": [paper]}, {"fibre_families": [around]}):
        stiffer = tg.Model(mesh, body=rubber, **parts).inflate("20 kPa", steps=1)
        assert stiffer.records[-1].cavity_volumes["cavity"] < 0.95 * volume
    assert "sheets" in tg.Model(mesh, body=rubber, sheets=[paper]).inflate("1 kPa", steps=1).description


def test_fibres_run_along_every_curve_unless_one_is_named() -> None:
    tube = tg.FibreTube(length="50 mm", cap="8 mm", fibre_length="30 mm", tilt="0 deg", winding="both")
    mesh = tube.mesh(size="12 mm", per_circle=6)
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    kevlar = {"youngs_modulus": "31 GPa", "diameter": "0.2 mm"}
    free, one, both = (
        tg.Model(mesh, body=rubber, fibres=fibres).inflate("5 kPa", steps=1).cavity_volume.magnitude[-1]
        for fibres in ([], [kevlar | {"curve": "fibre-1"}], [kevlar])
    )
    assert both < one < free
    with pytest.raises(InputError, match=r"fibres.0.curve: the actuator has no such curve.*fibre-1, fibre-2"):
        tg.Model(mesh, body=rubber, fibres=[kevlar | {"curve": "fibre"}])


def test_what_the_mesh_does_not_have_is_refused(mesh: tg.Mesh) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"})
    with pytest.raises(InputError, match=r"materials.bodi: the actuator has no such region.*'body'"):
        tg.Model(mesh, bodi=rubber)
    with pytest.raises(InputError, match=r"no material is given for the region 'body'"):
        tg.Model(mesh)
    with pytest.raises(InputError, match="cavity-9"):
        tg.Model(mesh, body=rubber).inflate("1 kPa", cavity="cavity-9")
    with pytest.raises(InputError, match="pressure: a unit is missing"):
        tg.Model(mesh, body=rubber).inflate(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="steps"):
        tg.Model(mesh, body=rubber).inflate("1 kPa", steps=0)
    with pytest.raises(InputError, match="size: a unit is missing"):
        tg.CappedTube().mesh(size=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", ["foo", None, 0.05])
def test_what_is_no_material_is_refused_with_its_region(mesh: tg.Mesh, wrong: object) -> None:
    found = "'foo'" if wrong == "foo" else type(wrong).__name__
    with pytest.raises(InputError, match=rf"^body: this is not a material \(found .*{found}.*; expected .*C10"):
        tg.Model(mesh, body=wrong)  # type: ignore[arg-type]


def test_regions_without_a_material_are_made_of_the_body() -> None:
    mesh = tg.PneuNet(chambers=1, symmetric=True).mesh(size="4 mm")
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"})
    model = tg.Model(mesh, body=rubber)
    assert dict.fromkeys(mesh.regions, rubber) == model.materials
    assert [held.surface for held in model.setup.supports] == ["mount", "symmetry"]


def test_a_path_beyond_the_limit_raises_with_facts(mesh: tg.Mesh) -> None:
    rubber = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499)
    kept: list[tg.Path] = []
    with pytest.raises(SolverError, match="kPa in cavity") as stop:
        tg.Model(mesh, body=rubber).inflate("500 kPa", steps=20, on_step=kept.append)
    assert stop.value.facts["pressure:cavity_kPa"] == pytest.approx(kept[-1].pressure.magnitude[-1])


def test_the_limit_of_a_soft_chamber_is_located() -> None:
    # It has grown nineteenfold there: what lies between two states of the walk is far from a straight line.
    finger = tg.PneuNet(chambers=1, symmetric=True)
    model = tg.Model(finger.mesh(size="5 mm"), body=get("ecoflex-00-35-fast-yeoh"))
    kept: list[tg.Path] = []
    with pytest.raises(LimitPressureError, match="limit is reached") as stop:
        model.inflate("100 kPa", steps=1, on_step=kept.append)
    (state,) = kept[-1].history
    assert stop.value.facts["pressure:cavity_kPa"] == pytest.approx(state["pressure_kPa"])
    # inflate_to("2100 %", steps=20) finds 18.906 kPa at 3705 and at 3900 mm³
    assert 3705 < state["cavity_volume_mm3"] < 3900
    assert state["pressure_kPa"] == pytest.approx(18.907, rel=1e-3)
