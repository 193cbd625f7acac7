"""The store of a run: exact, whole after every step, and clear about damage."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import signal
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from results.hollow_finger import CASE, bent_record, finished_run

from turgor.common.errors import InputError
from turgor.common.writing import UnwritableError
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import EDGES
from turgor.results.curve_plots import line
from turgor.results.record import ARRAY_FIELDS, PLAIN_FIELDS
from turgor.results.store import RunStore
from turgor.results.summary import summarise

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")


def started_run(folder: Path, mesh: Mesh, steps: int) -> Path:
    with RunStore.create(folder, mesh, CASE) as store:
        for index in range(steps):
            store.append(bent_record(mesh, index, (index + 1) / 10))
    return folder


def test_a_record_comes_back_bit_by_bit(tmp_path: Path, small_finger: Mesh) -> None:
    record = bent_record(small_finger, 0, 0.3)
    record = dataclasses.replace(record, solver={**record.solver, "stable": None})
    with RunStore.create(tmp_path / "run", small_finger, CASE) as store:
        assert store.last() is None
        store.append(record)
    found = RunStore.open(tmp_path / "run").last()
    assert found is not None
    for name in ARRAY_FIELDS:
        assert np.array_equal(getattr(found, name), getattr(record, name))
    for name in PLAIN_FIELDS:
        assert getattr(found, name) == getattr(record, name)


def test_the_mesh_and_the_case_come_back(run_folder: Path, finger: Mesh) -> None:
    store = RunStore.open(run_folder)
    assert np.array_equal(store.mesh.points, finger.points)
    assert np.array_equal(store.mesh.cells, finger.cells)
    for kind in ("regions", "surfaces", "markers", "curves"):
        names, expected = getattr(store.mesh, kind), getattr(finger, kind)
        assert set(names) == set(expected)
        assert all(np.array_equal(names[name], expected[name]) for name in expected)
    assert store.case_text == CASE
    assert store.fit is None


def test_case_as_plain_data_becomes_yaml(tmp_path: Path, small_finger: Mesh) -> None:
    with RunStore.create(tmp_path, small_finger, {"name": "μ-finger", "mesh": {"size": "2 mm"}}) as store:
        assert store.case_text == "name: μ-finger\nmesh:\n  size: 2 mm\n"


def test_history_has_a_row_a_step_with_units(run_folder: Path) -> None:
    with (run_folder / "history.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["step"]) for row in rows] == [0, 1, 2, 3, 4]
    assert [float(row["bending_angle_deg"]) for row in rows] == pytest.approx([40, 80, 120, 160, 200])
    assert [float(row["pressure_kPa"]) for row in rows] == pytest.approx([8, 16, 24, 32, 40])
    assert rows[0]["stable"] == "true"
    assert {"max_displacement_mm", "max_von_mises_MPa", "von_mises_p99_MPa", "cavity_volume_mm3", "twist_deg"} < set(
        rows[0]
    )
    assert list(rows[0])[-6:] == ["iterations", "factorisations", "stable", "residual", "wall_s", "event"]
    assert [row["bending_angle_deg"] for row in RunStore.open(run_folder).history] == pytest.approx(
        [40, 80, 120, 160, 200]
    )


def test_summary_has_the_keys_of_the_contract(run_folder: Path) -> None:
    summary = json.loads((run_folder / "summary.json").read_text(encoding="utf-8"))
    assert list(summary) == ["converged", "reason", "outcome", "final", "mesh", "solver", "versions"]
    assert summary["mesh"].keys() == {"elements", "nodes", "dofs"}
    solver = {"steps", "iterations", "factorisations", "wall_s", "peak_memory_MB", "stable"}
    assert summary["solver"].keys() == solver
    assert summary["solver"]["iterations"] == 20
    final = summary["final"]
    assert final["bending_angle_deg"] == pytest.approx(200.0)
    assert len(final["tip_displacement_mm"]) == 3
    assert not {"tip_displacement_x_mm", "iterations", "step"} & final.keys()
    assert {"pressure_kPa", "max_displacement_mm", "max_von_mises_MPa", "cavity_volume_mm3"} < final.keys()


def test_paraview_files_hold_the_curved_cells_and_the_state(run_folder: Path, finger: Mesh) -> None:
    datasets = ET.parse(run_folder / "result.pvd").getroot().findall("Collection/DataSet")
    assert [float(entry.attrib["timestep"]) for entry in datasets] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    grid = meshio.read(run_folder / datasets[2].attrib["file"])
    record = RunStore.open(run_folder).load(2)
    assert np.array_equal(grid.points, finger.points)
    assert np.array_equal(grid.cells_dict["tetra10"], finger.cells)
    assert grid.point_data["displacement_mm"] == pytest.approx(record.displacement, abs=1e-4)
    assert grid.point_data["von_mises_MPa"] == pytest.approx(record.von_mises, rel=1e-6)
    assert grid.cell_data["mean_pressure_MPa"][0] == pytest.approx(record.element_pressure, rel=1e-6)


def test_several_cavities_and_other_loads_have_columns_of_their_own(tmp_path: Path, small_finger: Mesh) -> None:
    record = dataclasses.replace(
        bent_record(small_finger, 0, 0.5),
        loads={"pressure:cavity-1": 0.01, "pressure:cavity-2": -0.03, "gravity": 1.0},
        cavity_volumes={"cavity-1": 10.0, "cavity-2": 20.0},
    )
    with RunStore.create(tmp_path, small_finger, CASE, measures=["twist"]) as store:
        store.append(record)
        (row,) = store.history
    assert row["pressure_kPa"] == pytest.approx(-30.0)
    assert row["pressure_cavity-1_kPa"] == pytest.approx(10.0)
    assert row["gravity_factor"] == 1.0
    assert row["cavity_volume_mm3"] == 30.0
    assert row["volume_cavity-2_mm3"] == 20.0
    assert "twist_deg" in row
    assert "bending_angle_deg" not in row


def test_a_run_is_not_overwritten_unless_told(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 2)
    (folder / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"holds a run already.*resume"):
        RunStore.create(folder, small_finger, CASE)
    assert RunStore.open(folder).n_steps == 2
    with RunStore.create(folder, small_finger, CASE, overwrite=True) as store:
        assert store.n_steps == 0
    assert not list((folder / "steps").iterdir())
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_resume_goes_on_where_the_run_stopped(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 3)
    with RunStore.resume(folder) as store:
        last = store.last()
        assert last is not None
        assert last.index == 2
        store.append(bent_record(small_finger, 3, 0.4))
    straight = finished_run(tmp_path / "straight", small_finger, np.array([0.1, 0.2, 0.3, 0.4]))
    for name in ("history.csv", "result.pvd", "case.yaml"):
        assert (folder / name).read_bytes() == (straight / name).read_bytes()


def test_curves_under_a_programme_say_their_time(tmp_path: Path, small_finger: Mesh) -> None:
    with RunStore.create(tmp_path, small_finger, CASE, measures=["centreline"]) as store:
        for index, time in enumerate((1.5, 3.0)):
            record = bent_record(small_finger, index, 0.5 * (index + 1))
            solver = {**record.solver, "time_s": time}
            store.append(dataclasses.replace(record, loads={"pressure:cavity": 0.002}, solver=solver))
    with (tmp_path / "curves" / "centreline.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[0])[:5] == ["step", "fraction", "time_s", "pressure_kPa", "station"]
    assert {row["time_s"] for row in rows} == {"1.5", "3.0"}
    drawn = line(RunStore.open(tmp_path).curves["centreline"])
    assert [trace.name for trace in drawn.data if trace.showlegend] == ["1.5 s", "3 s"]


def test_a_summary_stays_until_a_step_is_added(tmp_path: Path, small_finger: Mesh) -> None:
    folder = finished_run(tmp_path / "run", small_finger, np.array([0.1, 0.2]))
    RunStore.resume(folder).close()
    assert RunStore.open(folder).summary is not None
    with RunStore.resume(folder) as store:
        store.append(bent_record(small_finger, 2, 0.3))
    assert RunStore.open(folder).summary is None


def test_what_a_killed_process_left_is_cleaned_and_rebuilt(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 2)
    whole = (folder / "history.csv").read_bytes()
    (folder / "steps" / "0002.npz.part").write_bytes(b"half a st")
    (folder / "steps" / "0002.vtu").write_bytes(b"state whose npz never came")
    (folder / "history.csv").write_bytes(whole[:100])
    assert RunStore.open(folder).n_steps == 2
    with RunStore.resume(folder) as store:
        assert store.n_steps == 2
        assert not list(folder.rglob("*.part"))
        assert (folder / "history.csv").read_bytes() == whole
        store.append(bent_record(small_finger, 2, 0.3))
    assert meshio.read(folder / "steps" / "0002.vtu").points.shape == small_finger.points.shape


_ENDLESS_RUN = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from results.hollow_finger import CASE, bent_record, hollow_finger
from turgor.results.store import RunStore
mesh = hollow_finger((6, 3, 3))
store = RunStore.create(Path(sys.argv[1]), mesh, CASE)
for index in range(100_000):
    store.append(bent_record(mesh, index, min(1.0, index / 1000)))
    print(index, flush=True)
"""


@needs_posix
@pytest.mark.parametrize("wait", [1, 4, 9])
def test_kill_9_loses_no_finished_step(tmp_path: Path, wait: int, small_finger: Mesh) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-c", _ENDLESS_RUN, str(folder), str(Path(__file__).parents[1])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(wait):
            told = int(process.stdout.readline())
        os.kill(process.pid, signal.SIGKILL)
        told = max([told, *(int(line) for line in process.stdout)])
    assert process.returncode == -signal.SIGKILL
    with RunStore.resume(folder) as store:  # the dead process holds no lock
        assert store.n_steps in (told + 1, told + 2)  # a step may be finished and not yet told
        assert [record.index for record in store.records()] == list(range(store.n_steps))
        store.append(bent_record(small_finger, store.n_steps, 1.0))


@pytest.mark.parametrize(
    "name", ["case.yaml", "fit.json", "report.html", "run.log", "curves/force.csv", "data/force.csv"]
)
def test_what_no_run_has_written_is_not_replaced(tmp_path: Path, small_finger: Mesh, name: str) -> None:
    measured = tmp_path / "force.csv"
    measured.write_text("measured", encoding="utf-8")
    folder = tmp_path / "mine"
    own = folder / name
    own.parent.mkdir(parents=True)
    own.write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=f"{name}: this file is no run's"):
        RunStore.create(folder, small_finger, {}, files={measured: "data/force.csv"}, overwrite=True)
    assert own.read_text(encoding="utf-8") == "mine"
    own.unlink()
    RunStore.create(folder, small_finger, {}, overwrite=True).close()
    RunStore.create(folder, small_finger, {}, overwrite=True).close()


def test_a_run_that_replaces_another_leaves_nothing_of_it(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 1)
    for name in ("report.html", "run.log"):
        (folder / name).write_text("of the run before", encoding="utf-8")
    RunStore.create(folder, small_finger, CASE, overwrite=True).close()
    assert not {"report.html", "run.log"} & {path.name for path in folder.iterdir()}


def test_two_runs_cannot_write_one_folder(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 1)
    with RunStore.resume(folder):
        with pytest.raises(InputError, match="another run is writing"):
            RunStore.resume(folder)
        with pytest.raises(InputError, match="another run is writing"):
            RunStore.create(folder, small_finger, CASE, overwrite=True)
        assert RunStore.open(folder).n_steps == 1
    RunStore.resume(folder).close()


def test_a_folder_that_may_not_be_written_is_told(tmp_path: Path, small_finger: Mesh) -> None:
    folder = started_run(tmp_path / "run", small_finger, 1)
    (folder / ".lock").unlink()
    (folder / ".lock").mkdir()  # cannot be opened, whoever tries
    with pytest.raises(UnwritableError, match=r"\.lock: the file cannot be written"):
        RunStore.resume(folder)
    with pytest.raises(UnwritableError, match=r"\.lock: the file cannot be written"):
        RunStore.create(folder, small_finger, CASE, overwrite=True)
    assert RunStore.open(folder).n_steps == 1


def test_an_open_store_only_reads(run_folder: Path, finger: Mesh) -> None:
    store = RunStore.open(run_folder)
    with pytest.raises(InputError, match="only to be read"):
        store.append(bent_record(finger, 5, 1.0))
    with pytest.raises(InputError, match="only to be read"):
        store.finish({})


def test_a_record_that_does_not_fit_is_refused(tmp_path: Path, small_finger: Mesh) -> None:
    record = bent_record(small_finger, 0, 0.1)
    with RunStore.create(tmp_path, small_finger, CASE) as store:
        with pytest.raises(InputError, match="not the next step"):
            store.append(dataclasses.replace(record, index=1))
        with pytest.raises(InputError, match=r"von_mises.*does not fit the mesh"):
            store.append(dataclasses.replace(record, von_mises=record.von_mises[1:]))
        with pytest.raises(InputError, match="lack factorisations"):
            store.append(dataclasses.replace(record, solver={"iterations": 1, "stable": 1, "residual": 0, "wall_s": 0}))
        assert store.n_steps == 0
        with pytest.raises(InputError, match="no such step"):
            store.load(0)


def test_impossible_measures_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middles = [(corners[a] + corners[b]) / 2 for a, b in EDGES]
    mesh = Mesh(np.vstack([corners, middles]), np.arange(10)[None, :])
    with pytest.raises(InputError, match="'twist' needs"):
        RunStore.create(tmp_path / "run", mesh, CASE, measures=["twist"])
    assert not (tmp_path / "run").exists()


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 64] = bytes(255 - byte for byte in content[middle : middle + 64])
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("name", "harm", "message"),
    [
        ("mesh.npz", Path.unlink, "mesh.npz: the file is missing"),
        ("mesh.npz", truncate, "mesh.npz: the file is damaged"),
        ("mesh.npz", flip, "mesh.npz: "),
        ("steps/0001.npz", truncate, "0001.npz: the file is damaged"),
        ("steps/0001.npz", flip, "0001.npz: the file is damaged"),
        ("steps/0001.npz", lambda path: path.write_bytes(b""), "0001.npz: the file is damaged"),
        ("store.json", Path.unlink, "holds no run"),
        ("store.json", lambda path: path.write_text("{"), "store.json: the file is damaged"),
        ("store.json", lambda path: path.write_text("[]"), "store.json: the file is damaged"),
        ("store.json", lambda path: path.write_text('{"layout": 99}'), "another layout .found 99."),
        ("summary.json", lambda path: path.write_text('{"conv'), "summary.json: the file is damaged"),
        ("case.yaml", Path.unlink, "case.yaml: the file is missing"),
    ],
)
def test_damage_is_told_with_the_file(
    tmp_path: Path, small_finger: Mesh, name: str, harm: Callable[[Path], object], message: str
) -> None:
    folder = finished_run(tmp_path / "run", small_finger, np.array([0.5, 1.0]))
    harm(folder / name)
    with pytest.raises(InputError, match=message):  # noqa: PT012 - what is damaged shows when it is first read
        store = RunStore.open(folder)
        list(store.records())
        assert store.summary
        assert store.case_text


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path, small_finger: Mesh) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be made"):
        RunStore.create(tmp_path / "file" / "run", small_finger, CASE)


def test_an_incomplete_summary_is_refused(tmp_path: Path, small_finger: Mesh) -> None:
    facts = {"converged": False, "reason": "limit point", "dofs": 3, "wall_s": float("nan"), "peak_memory_mb": 1.0}
    with RunStore.create(tmp_path, small_finger, CASE) as store:
        summary = summarise(store.history, small_finger, **facts)  # type: ignore[arg-type]
        for section, key in (("solver", "stable"), ("mesh", "dofs")):
            inner = {name: value for name, value in summary[section].items() if name != key}
            with pytest.raises(InputError, match=f"{section}.{key}: the summary is incomplete"):
                store.finish({**summary, section: inner})
        store.finish(summary)
        assert store.summary is not None
        assert store.summary["solver"]["wall_s"] is None  # JSON has no NaN
        assert store.summary["final"] == {}
