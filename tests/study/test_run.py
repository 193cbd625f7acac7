"""A run keeps every finished step, can be resumed, and says what it came to."""

from __future__ import annotations

import contextlib
import csv
import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from turgor.common.errors import InputError
from turgor.materials.library import find
from turgor.results.archive import save_record
from turgor.results.files import replacing
from turgor.results.store import RunStore
from turgor.study.case import load_case
from turgor.study.run import Run, run
from turgor.study.states import Recorder


class Watch:
    """A progress that remembers, and can interrupt after a number of steps as Ctrl-C would."""

    def __init__(self, interrupt_after: int | None = None) -> None:
        self.stages: list[str] = []
        self.told: list[str] = []
        self.warnings: list[str] = []
        self.before_warnings: list[tuple[str, ...]] = []
        self.fractions: list[float] = []
        self.interrupt_after = interrupt_after

    def stage(self, name: str) -> None:
        self.stages.append(name)

    def note(self, text: str) -> None:
        if self.interrupt_after is not None and len(self.fractions) >= self.interrupt_after:
            raise KeyboardInterrupt

    def tell(self, text: str) -> None:
        self.told.append(text)

    def warn(self, text: str) -> None:
        self.warnings.append(text)
        self.before_warnings.append(tuple(self.stages))

    def advance(self, fraction: float, text: str) -> None:
        self.fractions.append(fraction)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run of the small tube that nobody disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    case = folder / "small.yaml"
    case.write_text(small_tube_text(), encoding="utf-8")
    return run(load_case(case), folder / "run")


@pytest.fixture
def unreported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the report out: its pictures take longer than the solver, and ``whole`` has one."""
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)


def small_tube_text() -> str:
    return (Path(__file__).parent / "small.yaml").read_text(encoding="utf-8")


def displacements(folder: Path) -> np.ndarray:
    return np.array([record.displacement for record in RunStore.open(folder).records()])


def same_motion(one: Path, other: Path) -> None:
    """Two runs of the same case: the factorisation on several threads rounds differently each time."""
    first, second = displacements(one), displacements(other)
    assert first.shape == second.shape
    np.testing.assert_allclose(first, second, atol=1e-7 * np.abs(first).max())


def test_the_folder_holds_what_was_promised(whole: Run) -> None:
    names = {path.name for path in whole.folder.iterdir()}
    assert {"summary.json", "history.csv", "result.pvd", "report.html", "case.yaml", "run.log"} <= names
    summary = json.loads((whole.folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["converged"] is True
    assert summary["final"]["pressure_kPa"] == pytest.approx(20.0)
    assert len(summary["final"]["tip_displacement_mm"]) == 3
    assert summary["final"]["tip_displacement_mm"][2] > 0.05
    assert summary["mesh"]["dofs"] < 3 * summary["mesh"]["nodes"]
    assert summary["solver"]["steps"] == 4
    assert summary["solver"]["stable"] is not False
    assert summary["solver"]["peak_memory_MB"] > 10
    with (whole.folder / "history.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["pressure_kPa"]) for row in rows] == pytest.approx([5.0, 10.0, 15.0, 20.0])
    assert "linear solver" in (whole.folder / "run.log").read_text(encoding="utf-8")


@pytest.mark.usefixtures("unreported")
def test_the_resolved_case_gives_the_same_run(whole: Run, tmp_path: Path) -> None:
    again = run(load_case(whole.folder / "case.yaml"), tmp_path / "again")
    same_motion(again.folder, whole.folder)
    assert (again.folder / "case.yaml").read_bytes() == (whole.folder / "case.yaml").read_bytes()


@pytest.mark.usefixtures("unreported")
def test_an_interrupted_run_keeps_its_steps_and_is_resumed(whole: Run, small_tube: Path, tmp_path: Path) -> None:
    folder, case = tmp_path / "run", load_case(small_tube)
    with pytest.raises(KeyboardInterrupt, match=r"2 finished steps .* --resume"):
        run(case, folder, progress=Watch(interrupt_after=2))
    assert RunStore.open(folder).n_steps == 2
    assert not (folder / "summary.json").exists()
    watch = Watch()
    resumed = run(case, folder, resume=True, progress=watch)
    assert resumed.converged
    steps = [row["wall_s"] for row in RunStore.open(folder).history]
    assert resumed.summary["solver"]["wall_s"] > sum(steps)
    assert watch.fractions == [0.75, 1.0]
    assert "mesh" not in watch.stages
    assert displacements(folder) == pytest.approx(displacements(whole.folder), abs=1e-5)
    assert "resuming behind step 2" in (folder / "run.log").read_text(encoding="utf-8")


@pytest.mark.usefixtures("unreported")
def test_a_finished_run_is_resumed_without_a_step(whole: Run) -> None:
    before = displacements(whole.folder)
    watch = Watch()
    again = run(load_case(whole.folder / "case.yaml"), whole.folder, resume=True, progress=watch)
    assert again.converged
    assert watch.fractions == []
    assert again.summary["solver"]["wall_s"] == whole.summary["solver"]["wall_s"]
    assert np.array_equal(displacements(whole.folder), before)


@pytest.mark.usefixtures("unreported")
@pytest.mark.parametrize("summed_up", [True, False])
def test_a_resumed_run_counts_the_time_of_its_earlier_parts(small_tube: Path, tmp_path: Path, summed_up: bool) -> None:
    folder, case = tmp_path / "run", load_case(small_tube)
    run(case, folder)
    (folder / "steps" / "0003.npz").unlink()
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary["solver"] |= {"wall_s": 1000.0, "peak_memory_MB": 1e6}
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    if not summed_up:  # as where the process was killed
        (folder / "summary.json").unlink()
        steps = [row["wall_s"] for row in RunStore.open(folder).history]
    begun = time.perf_counter()
    solver = run(case, folder, resume=True).summary["solver"]
    lasted = time.perf_counter() - begun
    earlier = 1000.0 if summed_up else sum(steps)
    assert earlier < solver["wall_s"] < earlier + lasted
    assert (solver["peak_memory_MB"] == 1e6) is summed_up


def test_a_run_of_another_case_is_not_resumed(whole: Run) -> None:
    before = contents(whole.folder)
    other = load_case(whole.folder / "case.yaml", ["loads.0.value=19 kPa"])
    with pytest.raises(InputError, match="one of another case"):
        run(other, whole.folder, resume=True)
    assert contents(whole.folder) == before


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("folder", "changes", "words"),
    [
        ("mine.yaml", [], r"mine\.yaml: .* cannot be made here: this is a file; expected a folder"),
        ("mine.yaml/run", [], r"mine\.yaml: .* cannot be made here: this is a file; expected a folder"),
        ("case", [], r"case/history\.csv: this file is no run's"),
        ("closed/run", [], r"closed: .* cannot be written.*expected another folder"),
        (
            "run",
            ["geometry.model=axisymmetric", "measures=[bending_angle]"],
            r"'bending_angle' has no meaning in a body",
        ),
        ("run", ["measures=[twist, twist]"], r"measures: two measures are called 'twist_deg'"),
    ],
)
def test_what_needs_no_mesh_is_refused_before_there_is_one(
    small_tube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, changes: list[str], words: str
) -> None:
    (tmp_path / "mine.yaml").write_text("mine", encoding="utf-8")
    (tmp_path / "case" / "history.csv").write_text("mine", encoding="utf-8")
    (tmp_path / "closed").mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: Path(path).name != "closed")
    watch = Watch()
    with pytest.raises(InputError, match=words):
        run(load_case(small_tube, changes), tmp_path / folder, progress=watch)
    assert watch.stages == []
    assert not (tmp_path / "run").exists()
    assert (tmp_path / "mine.yaml").read_text(encoding="utf-8") == "mine"


def test_a_run_is_not_overwritten_unasked(whole: Run) -> None:
    with pytest.raises(InputError, match=r"holds a run already.*--overwrite"):
        run(load_case(whole.folder / "case.yaml"), whole.folder)


@pytest.mark.usefixtures("unreported")
def test_to_resume_where_nothing_was_stored_is_to_begin(small_tube: Path, tmp_path: Path) -> None:
    case = load_case(small_tube, ["solver.steps=1"])
    assert run(case, tmp_path / "run", resume=True).converged


def test_a_run_that_stops_short_keeps_what_it_reached(small_tube: Path, tmp_path: Path) -> None:
    changes = ["loads.0.value=500 kPa", "solver.steps=20", "solver.smallest_step=0.02"]
    stopped = run(load_case(small_tube, changes), tmp_path / "run")
    assert not stopped.converged
    assert "kPa in cavity" in stopped.reason
    summary = json.loads((stopped.folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["solver"]["steps"] == RunStore.open(stopped.folder).n_steps > 0
    assert summary["outcome"] == "limit-pressure" == summary["events"][-1]["event"]
    assert 0 < summary["facts"]["last_fraction"] < 1
    assert summary["facts"]["pressure:cavity_kPa"] == pytest.approx(summary["final"]["pressure_kPa"])
    assert (stopped.folder / "report.html").exists()


@pytest.mark.usefixtures("unreported")
def test_an_unstable_material_is_told_of_before_the_mesh(small_tube: Path, tmp_path: Path) -> None:
    unstable = "materials.body={library: tpu-0deg-mooney-rivlin-5}"
    of_library = f"tpu-0deg-mooney-rivlin-5: {find('tpu-0deg-mooney-rivlin-5').unusable}"
    watch = Watch()
    done = run(load_case(small_tube, [unstable, "solver.steps=1"]), tmp_path / "run", progress=watch)
    assert watch.warnings[0] == of_library
    assert "materials.body: the material is unstable where the run may go (equibiaxial beyond" in watch.warnings[1]
    assert watch.warnings[1] in (done.folder / "run.log").read_text(encoding="utf-8")
    assert all("mesh" not in stages for stages in watch.before_warnings), "too late"
    watch = Watch()
    run(load_case(small_tube, [unstable, "solver.steps=1", "largest_stretch=1.04"]), tmp_path / "2", progress=watch)
    assert watch.warnings == [of_library]
    watch = Watch()
    run(load_case(small_tube, ["solver.steps=1"]), tmp_path / "3", progress=watch)
    assert watch.warnings == []


@pytest.mark.usefixtures("unreported")
def test_warnings_stay_with_the_run_and_are_not_doubled_where_it_goes_on(
    small_tube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = Recorder.record
    overlap = {"contact": {"self": {"surfaces_intersect": True}}}
    monkeypatch.setattr(
        Recorder,
        "record",
        lambda *told: replace(recorded(*told), cavity_volumes={"cavity": -1.0}, standing=overlap),
    )
    folder, case = tmp_path / "run", load_case(small_tube, ["materials.body={library: tpu-0deg-mooney-rivlin-5}"])
    watch = Watch(interrupt_after=2)
    with pytest.raises(KeyboardInterrupt):
        run(case, folder, progress=watch)
    told = RunStore.open(folder).warnings
    assert told == watch.warnings[:-1]  # the last one is the interrupt itself
    assert len(told) == 5
    assert "the material is unstable" in told[1]
    assert "cavity encloses less than nothing at step 0" in told[3]
    assert told[4] == "contact 'self': the surfaces are seen to overlap by more than 1 % of the wall at step 0"
    done = run(case, folder, resume=True)
    assert done.summary["warnings"] == RunStore.open(folder).warnings == told
    assert run(case, folder, resume=True).summary["warnings"] == told
    monkeypatch.undo()
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)
    clean = run(load_case(small_tube), folder, overwrite=True)
    assert "warnings" not in clean.summary
    assert RunStore.open(folder).warnings == []


@pytest.mark.usefixtures("unreported")
def test_what_ends_a_run_is_its_reason_and_no_warning(small_tube: Path, tmp_path: Path) -> None:
    changes = ["loads.0.value=500 kPa", "solver.steps=20", "solver.smallest_step=0.02"]
    stopped = run(load_case(small_tube, changes), tmp_path / "run")
    (event,) = stopped.summary["warnings"]
    assert event.startswith("limit-pressure at ")


@pytest.mark.usefixtures("unreported")
def test_what_is_doubtful_about_the_system_is_told_on_the_way(small_tube: Path, tmp_path: Path) -> None:
    pressing = "contact={bodies: [{type: plane, point: [0 mm, 0 mm, 39.9 mm], normal: [0, 0, -1]}]}"
    watch = Watch()
    done = run(load_case(small_tube, [pressing, "solver.steps=1"]), tmp_path / "run", progress=watch)
    (warning,) = watch.warnings
    assert warning.startswith("contact.bodies.0: at rest 'plane' presses already, 0.1 mm deep")
    assert warning in (done.folder / "run.log").read_text(encoding="utf-8")


TABLE = "{type: plane, name: table, point: [0 mm, 0 mm, 40.2 mm], normal: [0, 0, -1], surface: tip-face}"


@pytest.mark.usefixtures("unreported")
def test_the_summary_tells_what_a_rigid_body_feels(small_tube: Path, tmp_path: Path) -> None:
    case = load_case(small_tube, [f"contact.bodies=[{TABLE}]", "contact.self=true", "solver.steps=1"])
    done = run(case, tmp_path / "run")
    touch = done.summary["contact"]["table"]
    assert touch["force_N"][2] > 0.1
    assert abs(touch["force_N"][0]) < 1e-9
    assert 0 < touch["overlap_per_wall"] < 0.01
    assert 0 < touch["area_mm2"] <= np.pi * 9**2
    assert done.summary["contact"]["self"]["area_mm2"] == 0.0
    resumed = run(case, done.folder, resume=True)
    assert resumed.summary["contact"]["table"]["force_N"] == pytest.approx(touch["force_N"])


RUBBING = TABLE.replace("}", ", move: [2 mm, 0 mm, 0 mm], friction: 0.3}")


@pytest.mark.usefixtures("unreported")
def test_friction_is_remembered_where_a_run_is_resumed(small_tube: Path, tmp_path: Path) -> None:
    case = load_case(small_tube, [f"contact.bodies=[{RUBBING}]", "loads.0.value=30 kPa"])
    done = run(case, tmp_path / "whole")
    push, _, press = done.summary["contact"]["table"]["force_N"]
    assert press > 0.1
    # the table moves towards +x, and the tip holds it back
    assert -0.301 * press < push < -0.05 * press
    with pytest.raises(KeyboardInterrupt):
        run(case, tmp_path / "parts", progress=Watch(interrupt_after=3))
    resumed = run(case, tmp_path / "parts", resume=True)
    assert resumed.summary["contact"]["table"]["force_N"][0] == pytest.approx(push, rel=1e-3)


@pytest.mark.usefixtures("unreported")
def test_a_body_on_a_spring_is_a_dynamometer_also_where_a_run_is_resumed(small_tube: Path, tmp_path: Path) -> None:
    sprung = TABLE.replace("}", ", spring: {stiffness: 0.3 N/mm, direction: [0, 0, 1]}}")
    case = load_case(small_tube, [f"contact.bodies=[{sprung}]", "loads.0.value=30 kPa"])
    done = run(case, tmp_path / "whole")
    touch = done.summary["contact"]["table"]
    assert touch["force_N"][2] > 0.1
    assert touch["force_N"][2] == pytest.approx(0.3 * touch["displacement_mm"][2], rel=1e-6)
    with (done.folder / "history.csv").open() as file:
        last = list(csv.DictReader(file))[-1]
    moved, force = (float(last[f"contact_table_{key}"]) for key in ("displacement_mm", "force_N"))
    assert force == pytest.approx(0.3 * moved, rel=1e-6)
    with pytest.raises(KeyboardInterrupt):
        run(case, tmp_path / "parts", progress=Watch(interrupt_after=3))
    resumed = run(case, tmp_path / "parts", resume=True)
    assert resumed.summary["contact"]["table"]["force_N"][2] == pytest.approx(touch["force_N"][2], rel=1e-5)


FIT = "materials.body={fit: 'soft rubber.csv', models: [yeoh-1, neo-hookean], poisson: 0.499}"


@pytest.mark.usefixtures("unreported")
def test_the_test_data_go_with_the_run(small_tube: Path, tmp_path: Path) -> None:
    strain = np.linspace(0.0, 2.0, 41)
    stress = 2 * 0.05 * ((1 + strain) - (1 + strain) ** -2)
    lines = [f"{a:.5f};{b:.7f}" for a, b in zip(strain, stress, strict=True)]
    data = small_tube.with_name("soft rubber.csv")
    data.write_text("\n".join(["Engineering Strain;Engineering Stress (MPa)", *lines]), encoding="utf-8")
    case = load_case(small_tube, [FIT, "solver.steps=1"])
    fitted = run(case, tmp_path / "run")
    resolved = yaml.safe_load((fitted.folder / "case.yaml").read_text(encoding="utf-8"))
    assert resolved["materials"]["body"]["fit"] == ["data/soft rubber.csv"]
    moved = fitted.folder.rename(tmp_path / "elsewhere")
    document = RunStore.open(moved).fit
    assert document is not None
    assert document["recommended"] in {"yeoh-1", "neo-hookean"}
    assert document["fits"][0]["parameters"]["C10"] == pytest.approx(0.05, rel=1e-4)
    assert document["fits"][0]["curve"]["stress_MPa"][-1] == pytest.approx(stress[-1], rel=1e-3)
    data.unlink()
    again = run(load_case(moved / "case.yaml"), tmp_path / "again")
    same_motion(again.folder, moved)
    (moved / "data" / "soft rubber.csv").write_text("\n".join(["Strain;Stress (MPa)", *lines]), encoding="utf-8")
    with pytest.raises(InputError, match="another case"):
        run(load_case(again.folder / "case.yaml"), moved, resume=True)


OWN_MODEL = """
name: my-rubber
energy: mu/2*(I1 - 3) + c*(I2 - 3)
constants: {mu: {unit: MPa}, c: {unit: MPa}}
"""
OWN = {
    "model": "materials.body={model: own/rubber.yaml, constants: {mu: 0.1 MPa, c: 1 kPa}, poisson: 0.499}",
    "fit": "materials.body={fit: pull.csv, models: [neo-hookean, own/rubber.yaml], poisson: 0.499}",
}


@pytest.mark.usefixtures("unreported")
@pytest.mark.parametrize("kind", OWN)
def test_a_model_of_ones_own_goes_with_the_run(kind: str, small_tube: Path, tmp_path: Path) -> None:
    own = small_tube.parent / "own" / "rubber.yaml"
    own.parent.mkdir()
    own.write_text(OWN_MODEL, encoding="utf-8")
    x = np.linspace(1.0, 3.0, 41)
    stress = (0.1 + 0.02 / x) * (x - x**-2)
    lines = [f"{a - 1:.5f},{b:.8f}" for a, b in zip(x, stress, strict=True)]
    small_tube.with_name("pull.csv").write_text("\n".join(["Strain,Stress (MPa)", *lines]), encoding="utf-8")
    case = load_case(small_tube, [OWN[kind], "solver.steps=1"])
    done = run(case, tmp_path / "run")
    assert run(case, tmp_path / "run", resume=True).converged
    resolved = yaml.safe_load((done.folder / "case.yaml").read_text(encoding="utf-8"))["materials"]["body"]
    assert (resolved["model"] if kind == "model" else resolved["models"][1]) == "data/rubber.yaml"
    if kind == "fit":
        document = RunStore.open(done.folder).fit
        assert document is not None
        assert document["recommended"] == "my-rubber"
    moved = done.folder.rename(tmp_path / "elsewhere")
    own.unlink()
    again = run(load_case(moved / "case.yaml"), tmp_path / "again")
    same_motion(again.folder, moved)
    (moved / "data" / "rubber.yaml").write_text(OWN_MODEL.replace("mu/2", "mu"), encoding="utf-8")
    with pytest.raises(InputError, match="another case"):
        run(load_case(again.folder / "case.yaml"), moved, resume=True)


@pytest.mark.usefixtures("unreported")
@pytest.mark.parametrize("kept", [False, True])
def test_who_waits_for_the_compiler_is_told_so(
    small_tube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    monkeypatch.setattr("turgor.study.run.kernels_are_kept", lambda room: kept)
    shown = Watch()
    run(load_case(small_tube), tmp_path / "run", progress=shown)
    assert any("compiled" in text for text in shown.told) is not kept


@pytest.mark.skipif(sys.platform == "win32", reason="needs kill")
def test_who_ends_the_process_is_told_what_is_kept(small_tube: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with begun(small_tube, folder, stderr=subprocess.PIPE) as process:
        process.send_signal(signal.SIGTERM)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 143
    assert "interrupted; " in told.decode()
    assert "--resume" in told.decode()


def test_a_full_disk_costs_no_finished_step(small_tube: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *arrays: object) -> None:
        if path.stem == "0002":
            with replacing(path):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        save_record(path, *arrays)

    folder = tmp_path / "run"
    with monkeypatch.context() as disk:
        disk.setattr("turgor.results.store.save_record", full)
        with pytest.raises(InputError, match=r"0002.*No space left.*2 finished steps are kept, and --resume"):
            run(load_case(small_tube), folder)
    assert RunStore.open(folder).n_steps == 2
    assert run(load_case(small_tube), folder, resume=True).converged


@contextlib.contextmanager
def begun(case: Path, folder: Path, **streams: int) -> Iterator[subprocess.Popen[bytes]]:
    """A run in a process of its own that has stored its first step."""
    command = [sys.executable, "-m", "turgor", "run", str(case), "--out", str(folder)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, env=environment, **(quiet | streams)) as process:
        deadline = time.monotonic() + 120
        while not list(folder.glob("steps/*.npz")) and time.monotonic() < deadline:
            time.sleep(0.005)
        yield process


@pytest.mark.skipif(sys.platform == "win32", reason="needs kill -9")
@pytest.mark.usefixtures("unreported")
def test_kill_9_loses_no_finished_step(whole: Run, small_tube: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with begun(small_tube, folder) as process:
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=30)
    kept = RunStore.open(folder).n_steps
    assert 1 <= kept <= 4
    assert run(load_case(small_tube), folder, resume=True).converged
    assert displacements(folder) == pytest.approx(displacements(whole.folder), abs=1e-5)
