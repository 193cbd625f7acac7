"""Control by volume, air, arc length and programmes in case files and from Python, and how a run says that it ended."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from samples import neo_hookean

import turgor as tg
from turgor.common.errors import InputError
from turgor.fem.cavity import Cavity
from turgor.fem.loads import Gravity, Pressure
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.decks import write_deck
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, shell_octant
from turgor.results import plots
from turgor.results.store import RunStore
from turgor.solver.newton import Equilibrium
from turgor.solver.path import PathOptions
from turgor.study.case import load_case
from turgor.study.control import VolumeControl
from turgor.study.course import course_by
from turgor.study.progress import Silent
from turgor.study.run import Run, run
from turgor.study.states import Recorder

FREE = "loads=[{type: pressure, cavity: cavity}]"
SURROUNDINGS = 101.325
LIMIT = 33.8865
"""Limit pressure of the small tube on its mesh, kPa, found by pressure control."""


@pytest.fixture(autouse=True)
def unreported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the report out: its pictures take longer than the solver."""
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)


def ran(small_tube: Path, *changes: str) -> tuple[Run, list[dict[str, str]]]:
    done = run(load_case(small_tube, changes), small_tube.parent / "run", overwrite=True)
    with (done.folder / "history.csv").open(encoding="utf-8") as stream:
        return done, list(csv.DictReader(stream))


def column(rows: list[dict[str, str]], key: str) -> np.ndarray:
    return np.array([float(row[key]) for row in rows])


def rest_volume(done: Run) -> float:
    mesh = RunStore.open(done.folder).mesh
    return Cavity(mesh.points, mesh.surface("cavity"), 0, "cavity").volume(np.zeros_like(mesh.points))


def test_volumes_are_hit_and_the_run_goes_on_where_it_was_cut(small_tube: Path) -> None:
    changes = [FREE, "control={type: volume, target: 400 %}", "solver={outputs: [200 %, 400 %]}"]
    done, rows = ran(small_tube, *changes)
    asked = [row for row in rows if not row["event"]]
    rest = rest_volume(done)
    assert column(asked, "cavity_volume_mm3") / rest == pytest.approx([2.0, 4.0], rel=1e-5)
    assert [row["event"] for row in rows] == ["", "limit-pressure", ""]
    pressure = column(rows, "pressure_kPa")
    assert pressure[1] == pressure.max() > pressure[2]
    assert pressure[1] == pytest.approx(LIMIT, rel=1e-4)
    assert column(rows, "fraction")[-1] == 1.0
    assert all(row["stable"] in ("true", "") for row in rows)
    summary = done.summary
    assert (summary["converged"], summary["outcome"]) == (True, "target-reached")
    (event,) = summary["events"]
    assert event["step"] == 1
    # the mode is there for ParaView and in the archive, in the step of the limit alone
    stored = RunStore.open(done.folder)
    mode = stored.load(1).mode
    assert mode is not None
    assert np.abs(mode).max() == pytest.approx(1.0)
    assert "mode" in meshio.read(done.folder / "steps" / "0001.vtu").point_data
    assert stored.load(2).mode is None
    # the curve of pressure over volume is the first one in the report, and falls
    curve = plots.load_motion(stored.history).data[0]
    assert list(curve.y) == pytest.approx(list(pressure))
    # cut just behind the limit, it goes on without storing the limit once more
    for end in ("npz", "vtu"):
        (done.folder / "steps" / f"0002.{end}").unlink()
    again = run(load_case(small_tube, changes), done.folder, resume=True)
    assert [row["event"] for row in RunStore.open(done.folder).history] == ["", "limit-pressure", ""]
    assert again.summary["final"]["pressure_kPa"] == pytest.approx(pressure[2], rel=1e-6)
    assert [e["event"] for e in again.summary["events"]] == ["limit-pressure"]


def test_air_obeys_boyle(small_tube: Path) -> None:
    done, rows = ran(small_tube, FREE, "control={type: air, target: 200 %}", "solver.steps=1")
    amount = (column(rows, "pressure_kPa") + SURROUNDINGS) * column(rows, "cavity_volume_mm3")
    assert amount / (SURROUNDINGS * rest_volume(done)) == pytest.approx([2.0], rel=1e-5)


@pytest.mark.slow
def test_arc_length_meets_the_same_limit(small_tube: Path) -> None:
    done, rows = ran(small_tube, "control={type: arc-length, target: 400 %}", "solver.steps=1")
    assert rows[-1]["fraction"] == "1.0"
    assert done.summary["final"]["cavity_volume_mm3"] == pytest.approx(4.0 * rest_volume(done), rel=1e-5)
    assert done.summary["events"][0]["pressure_kPa"] == pytest.approx(LIMIT, rel=1e-4)


class Until(Silent):
    """Interrupts a run at a state."""

    def __init__(self, states: int) -> None:
        self.left = states

    def advance(self, fraction: float, text: str) -> None:
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The case file of an arch that snaps over a shallow cavity: along its path the volume turns back at state 5."""
    block = box((10.0, 0.4, 1.0), (8, 1, 1), "tet10")
    points = block.points.copy()
    points[:, 1] += -3.0 + 1.5 * np.sin(np.pi * points[:, 0] / 20.0)
    surfaces = {"cavity" if name == "y1" else name: faces for name, faces in block.surfaces.items()}
    folder = tmp_path_factory.mktemp("turning")
    write_deck(Mesh(points, block.cells, regions=block.regions, surfaces=surfaces), folder / "arch.inp")
    (folder / "arch.yaml").write_text(
        """
geometry: {template: mesh, file: arch.inp, unit: 1 mm}
materials: {body: {model: neo-hookean, constants: {C10: 0.5 MPa}, bulk_modulus: 1000 MPa}}
supports:
  - {type: clamped, surface: x0}
  - {type: sliding, surface: x1}
  - {type: sliding, surface: z0}
  - {type: sliding, surface: z1}
loads: [{type: pressure, cavity: cavity, value: 0.2 kPa}]
control: {type: arc-length, target: 190 %}
solver: {steps: 3}
measures: []
""",
        encoding="utf-8",
    )
    return folder / "arch.yaml"


def cut_and_resumed(case: Path, kept: int, states: int) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
    """Return the first states of a run, and the same where it was killed behind `kept` of them and resumed."""
    folder, rows = case.parent / "run", []
    with pytest.raises(KeyboardInterrupt):
        run(load_case(case), folder, overwrite=True, progress=Until(states))
    for resumed in (False, True):
        if resumed:
            for step in range(kept, states):
                for end in ("npz", "vtu"):
                    (folder / "steps" / f"{step:04d}.{end}").unlink()
            with pytest.raises(KeyboardInterrupt):
                run(load_case(case), folder, resume=True, progress=Until(states - kept))
        with (folder / "history.csv").open(encoding="utf-8") as stream:
            rows.append(list(csv.DictReader(stream)))
    return rows[0], rows[1]


@pytest.mark.parametrize("kept", [7, 8])
def test_an_arc_that_was_cut_behind_a_turn_of_the_volume_goes_on(turning: Path, kept: int) -> None:
    # the minimum of the pressure is the last state that is kept, or the one before
    whole, resumed = cut_and_resumed(turning, kept, 11)
    volume = column(whole, "cavity_volume_mm3")
    assert volume[5] > volume[6] > volume[7] > volume[8]
    assert [row["event"] for row in whole[6:9]] == ["", "pressure-minimum", ""]
    assert [row["event"] for row in resumed] == [row["event"] for row in whole]
    assert column(resumed, "cavity_volume_mm3") == pytest.approx(volume, rel=1e-6)
    assert column(resumed, "pressure_kPa") == pytest.approx(column(whole, "pressure_kPa"), abs=1e-6)


def test_a_programme_goes_up_and_down(small_tube: Path) -> None:
    table = small_tube.with_name("pressures.csv")
    table.write_text("Time [ms];Cavity [psi]\n0;0\n1000;2\n2000;2\n4000;0.5\n", encoding="utf-8")
    changes = ["loads=[{type: pressure, programme: {file: pressures.csv}}]", "solver={outputs: [0.5 s, 3 s, 4 s]}"]
    done, rows = ran(small_tube, *changes)
    assert column(rows, "time_s") == pytest.approx([0.5, 3.0, 4.0])
    psi = 6.894757
    assert column(rows, "pressure_kPa") == pytest.approx([psi, 1.25 * psi, 0.5 * psi], rel=1e-6)
    volume = column(rows, "cavity_volume_mm3")
    assert volume[1] > volume[0] > volume[2]
    # the resolved case holds the table itself
    table.unlink()
    again = load_case(done.folder / "case.yaml")
    assert again.pressures[0].programme == load_case(done.folder / "case.yaml").pressures[0].programme
    assert again.duration == 4.0


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("time (s),pressure (kPa)\n0,0,0,0\n1,5,2,5\n", r"row 2: this row has more cells .*a decimal comma needs ';'"),
        ("time (s);pressure (kPa);pressure (kPa)\n0;0;0\n1;2;3\n", "columns 2 and 3: two columns hold the pressure"),
        ("time (s);time (ms);pressure (kPa)\n0;0;0\n1;2;3\n", r"'time \(s\)' and 'time \(ms\)'"),
        ("time (s);pressure (Pa)\n0;0\n1;2,500\n", "thousands or decimals.*expected 2500 or 2.500"),
        ("time (s);volume (ml)\n0;0\n1;2\n", r"expected a header such as 'time \(s\),cavity \(kPa\)'"),
    ],
)
def test_a_programme_that_can_be_read_in_two_ways_is_refused(small_tube: Path, table: str, words: str) -> None:
    small_tube.with_name("pressures.csv").write_text(table, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        load_case(small_tube, ["loads=[{type: pressure, programme: {file: pressures.csv}}]"])


def test_under_weight_the_volumes_lead_away_from_where_it_has_settled():
    held = [Clamped("z0"), Sliding("x0"), Sliding("y0")]
    loads = [Pressure("inner", 0.01), Gravity((0.0, 0.0, 2000.0))]
    system = System(shell_octant(1.0, 1.5, 1), {"body": neo_hookean(0.01, density=1e-6)}, held, loads)
    weights = np.array([1.0, 0.0])
    rest = system.conjugate(system.reference_state(), weights)
    for target, steps in (("120 %", 20), ("100 %", 2)):
        course = course_by(VolumeControl(type="volume", target=target), system, None, steps, PathOptions())
        found: list[Equilibrium] = []
        course.walk(None, found.append, None)
        assert [course.parameter(e) for e in found] == pytest.approx(np.linspace(0.0, 1.0, steps + 1))
        assert 1.05 < system.conjugate(found[0].state, weights) / rest < 1.1, "under its weight alone"
        assert system.conjugate(found[-1].state, weights) / rest == pytest.approx(float(target[:-1]) / 100.0)
    control = VolumeControl(type="volume", target="120 %")
    with pytest.raises(tg.InputError, match=r"solver\.outputs"):
        course_by(control, system, ["102 %", "120 %"], 2, PathOptions())


def test_where_a_pressure_falls_below_a_vacuum_the_run_says_so_once(
    small_tube: Path, caplog: pytest.LogCaptureFixture
) -> None:
    changes = [FREE, "control={type: volume, target: 60 %}", "materials.body.constants.C10=2 MPa", "solver.steps=3"]
    done, rows = ran(small_tube, *changes)
    deeper = column(rows, "pressure_kPa") < -SURROUNDINGS
    assert deeper.any()
    told = [record.message for record in caplog.records if "deeper than a vacuum" in record.message]
    assert len(told) == 1
    assert f"at step {int(np.argmax(deeper))}" in told[0]
    assert done.converged


def test_a_cavity_that_encloses_less_than_nothing_is_told_of_once(
    small_tube: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    recorded = Recorder.record
    monkeypatch.setattr(Recorder, "record", lambda *told: replace(recorded(*told), cavity_volumes={"cavity": -1.0}))
    ran(small_tube, "loads.0.value=4 kPa", "solver.steps=2")
    told = [record.message for record in caplog.records if "less than nothing" in record.message]
    assert told == [
        "cavity encloses less than nothing at step 0: its walls have passed through each other, which contact: true "
        "would not let them"
    ]


@pytest.mark.slow
def test_a_run_that_stopped_at_a_limit_stops_there_again(small_tube: Path) -> None:
    changes = ["loads.0.value=36 kPa", "solver={outputs: [30 kPa, 36 kPa]}"]
    done, rows = ran(small_tube, *changes)
    assert [row["event"] for row in rows] == ["", "limit-pressure"]
    with pytest.raises(tg.InputError, match="only one of the two"):
        run(load_case(small_tube, changes), done.folder, resume=True, overwrite=True)
    again = run(load_case(small_tube, changes), done.folder, resume=True)
    assert (again.summary["outcome"], again.summary["reason"]) == ("limit-pressure", done.summary["reason"])
    assert RunStore.open(done.folder).n_steps == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time (s),outer (kPa)\n0,0\n1,2\n", "no column 'cavity' or 'pressure'"),
        ("time,cavity (kPa)\n0,0\n1,2\n", "unit is missing"),
        ("time (s),cavity (mm)\n0,0\n1,2\n", "not a unit of pressure"),
        ("time (s),cavity (kPa)\n0,0\n1,\n", "a number is missing"),
        ("time (s),cavity (kPa)\n0,0\n1,two\n", "not a number"),
        ("time (s),cavity (kPa)\n0,0\n2,1\n1,2\n", "ascend"),
    ],
)
def test_a_table_that_is_none_is_refused(small_tube: Path, text: str, words: str) -> None:
    small_tube.with_name("pressures.csv").write_text(text, encoding="utf-8")
    with pytest.raises(tg.InputError, match=words):
        load_case(small_tube, ["loads=[{type: pressure, programme: {file: pressures.csv}}]"])


def test_the_python_story_has_volume_and_programmes_too() -> None:
    mesh = tg.CappedTube(inner_radius="6 mm", wall="3 mm", length="40 mm", cap="6 mm").mesh(size="6 mm")
    model = tg.Model(mesh, body=tg.material("neo-hookean", {"C10": "0.05 MPa"}))
    grown = model.inflate_to("150 %", steps=2)
    assert grown.reached
    volume = grown.cavity_volume.magnitude
    assert volume[1] / volume[0] == pytest.approx(1.5 / 1.25, rel=1e-5)
    played = model.play({"cavity": {"time": ["0 s", "1 s", "2 s"], "pressure": ["0 kPa", "10 kPa", "5 kPa"]}}, steps=4)
    assert played.pressure.magnitude == pytest.approx([5.0, 10.0, 7.5, 5.0])
    assert played.series("time").magnitude == pytest.approx([0.5, 1.0, 1.5, 2.0])
    for wrong in ("150", 150):
        with pytest.raises(tg.InputError, match=r"unit is missing .*volume"):
            model.inflate_to(wrong)
    with pytest.raises(tg.InputError, match="no cavity has a programme"):
        model.play({})
    with pytest.raises(tg.InputError, match="vacuum"):
        model.inflate("-500 kPa")
    with pytest.raises(tg.InputError, match="times the shear modulus"):
        model.inflate("500 MPa")
    with pytest.raises(tg.InputError, match="cavity: this is no name"):
        model.inflate("20 kPa", cavity=["cavity"])
    pulled = [{"type": "traction", "surface": "tip-face", "value": "3 kPa", "direction": [0, 0, 1]}]
    with pytest.raises(tg.InputError, match="proportion"):
        tg.Model(mesh, loads=pulled, body=tg.material("neo-hookean", {"C10": "0.05 MPa"})).inflate_to("150 %")
