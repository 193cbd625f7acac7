"""What the commands print, where they print it, and how they end."""

from __future__ import annotations

import errno
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner, Result

import turgor as tg
from turgor.cli.app import app
from turgor.common.errors import MissingPackageError

SMALL = Path(__file__).parents[1] / "study" / "small.yaml"
GOOD_TEST = Path(__file__).parent / "bad" / "good.csv"


def turgor(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def printed(*arguments: object) -> Any:
    """Return the JSON that a command prints; nothing else may stand on standard output."""
    result = turgor(*arguments)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_version() -> None:
    assert turgor("--version").stdout == f"turgor {tg.__version__}\n"


def test_help_lists_the_commands() -> None:
    result = turgor("--help")
    assert result.exit_code == 0
    for command in ("run", "fit", "materials", "templates", "mesh", "export", "schema", "doctor"):
        assert f"\n  {command} " in result.stdout
        assert turgor(command, "--help").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["runn"], "No such command 'runn'"),
        (["run"], "Missing argument"),
        (["run", "a.yaml", "--nothing"], "No such option"),
        (["run", "a.yaml", "b.yaml"], "unexpected extra argument"),
        (["fit", "--strain-range"], "--strain-range"),
        (["materials", "unobtainium"], "unobtainium"),
        (["templates", "tubes"], "tubes"),
        (["fit", "nowhere.csv"], "nowhere.csv"),
    ],
)
def test_a_wrong_command_line_ends_with_2(arguments: list[str], words: str) -> None:
    result = turgor(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.output


def test_run_prints_its_summary_and_nothing_else(tmp_path: Path) -> None:
    summary = printed("run", SMALL, "--out", tmp_path / "run", "--json", "--set", "solver.steps=1")
    assert summary == json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["converged"] is True


def test_run_tells_its_steps_on_standard_error(tmp_path: Path) -> None:
    result = turgor("run", SMALL, "--out", tmp_path / "run", "--set", "solver.steps=2")
    assert result.exit_code == 0
    assert "50.0 %  10 kPa in cavity" in result.stderr
    assert "100.0 %  20 kPa in cavity" in result.stderr
    assert "kPa in cavity" not in result.stdout
    assert "max_displacement_mm" in result.stdout


def test_a_run_that_stops_short_ends_with_3(tmp_path: Path) -> None:
    result = turgor("run", SMALL, "--out", tmp_path / "run", "--json", "--set", "loads.0.value=500 kPa")
    assert result.exit_code == 3
    summary = json.loads(result.stdout)
    assert summary["converged"] is False
    assert f"turgor: stopped short of the full load: {summary['reason']}\n" in result.stderr
    assert "kPa in cavity" in summary["reason"]


def test_an_interrupt_ends_with_130_and_says_how_to_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("turgor.study.course.solve_path", interrupted)
    result = turgor("run", SMALL, "--out", tmp_path / "run")
    assert result.exit_code == 130
    assert "turgor: interrupted; 0 finished steps" in result.stderr
    assert "--resume" in result.stderr


def test_an_unexpected_failure_leaves_one_line_and_a_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("a flaw\nin two lines")

    monkeypatch.setattr("turgor.study.course.solve_path", broken)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    result = turgor("run", SMALL, "--out", tmp_path / "run")
    assert result.exit_code == 1
    assert "Traceback" not in result.output
    assert "turgor: unexpected ZeroDivisionError: a flaw in two lines; please report it with" in result.stderr
    (log,) = tmp_path.glob("turgor-*.log")
    assert "Traceback" in log.read_text(encoding="utf-8")


def test_what_the_system_refuses_is_no_flaw_to_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*arguments: object, **options: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", "/somewhere")

    monkeypatch.setattr("turgor.study.course.solve_path", refused)
    result = turgor("run", SMALL, "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "Permission denied: '/somewhere'" in result.stderr
    assert "report it" not in result.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full disk")
@pytest.mark.parametrize("arguments", [["schema"], ["materials"], ["--version"], ["run", "--help"]])
def test_a_full_disk_under_standard_output_is_told_in_one_line(arguments: list[str]) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "turgor", *arguments]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "No space left on device" in done.stderr


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*arguments: object, **options: object) -> None:
        raise MissingPackageError("libGLU.so.1 is missing; on Debian or Ubuntu: apt-get install libglu1-mesa")

    monkeypatch.setattr("turgor.study.meshing.generate", absent)
    result = turgor("run", SMALL, "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "apt-get install libglu1-mesa" in result.stderr


def test_fit_prints_what_was_promised(tmp_path: Path) -> None:
    found = printed("fit", GOOD_TEST, "--model", "yeoh-1", "--model", "mooney-rivlin-2", "--json")
    assert {entry["model"] for entry in found["fits"]} == {"yeoh-1", "mooney-rivlin-2"}
    assert found["recommended"] in {"yeoh-1", "mooney-rivlin-2"}
    for key in ("parameters", "units", "rmse_MPa", "residual_norm_MPa", "r2", "stable"):
        assert key in found["fits"][0]
    assert found["data"]


def test_constants_of_a_fit_carry_their_unit(tmp_path: Path) -> None:
    models = ("--model", "ogden-1", "--model", "gent", "--model", "yeoh-1")
    table = " ".join(turgor("fit", GOOD_TEST, *models, "--report", tmp_path).stdout.split())
    for pattern in (
        r"C10 = \S+ MPa",
        r"mu1 = \S+ MPa, alpha1 = [\d.-]+ (?!MPa)",
        r"mu = \S+ MPa, Jm = [\d.e+]+ (?!MPa)",
    ):
        assert re.search(pattern, table), table
    page = " ".join((tmp_path / "fit.html").read_text(encoding="utf-8").split())
    assert re.search(r"mu1 = \S+ MPa", page)
    assert not re.search(r"alpha1 = \S+ MPa", page)
    fits = {entry["model"]: entry for entry in printed("fit", GOOD_TEST, *models, "--json")["fits"]}
    assert fits["ogden-1"]["parameter_units"] == {"mu1": "MPa", "alpha1": ""}
    assert fits["gent"]["parameter_units"] == {"mu": "MPa", "Jm": ""}
    assert fits["gent"]["units"] == "MPa"


def test_a_fit_says_which_rows_it_does_not_use(tmp_path: Path) -> None:
    rows = [f"{0.1 * k:.1f},{0.03 * k - 0.001 * k * k:.3f}" for k in range(9)]
    rows[4] = "0.4,"
    file = tmp_path / "rubber.csv"
    file.write_text("\n".join(["Strain,Stress (MPa)", *rows]), encoding="utf-8")
    result = turgor("fit", file, "--model", "neo-hookean")
    assert result.exit_code == 0
    assert "rubber.csv: not used: row 6 (no number)" in result.stderr


def test_a_written_material_fits_into_a_case(tmp_path: Path) -> None:
    result = turgor("fit", GOOD_TEST, "--model", "yeoh-1", "--out", tmp_path / "m.yaml", "--report", tmp_path / "fit")
    assert result.exit_code == 0
    assert "yeoh-1" in result.stdout
    material = yaml.safe_load((tmp_path / "m.yaml").read_text(encoding="utf-8"))
    case = tg.load_case(SMALL, [f"materials.body={json.dumps(material)}"])
    assert case.materials["body"].build().shear_modulus == pytest.approx(0.1, rel=1e-3)
    assert "yeoh-1" in (tmp_path / "fit" / "fit.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "fit" / "fit.json").read_text(encoding="utf-8"))["recommended"] == "yeoh-1"


def test_a_material_of_a_model_of_ones_own_fits_into_a_case_anywhere(tmp_path: Path, monkeypatch) -> None:
    own = "name: mine\nenergy: mu/2*(I1 - 3)\nconstants: {mu: {unit: MPa}}\n"
    (tmp_path / "own.yaml").write_text(own, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    result = turgor("fit", GOOD_TEST, "--model", "own.yaml", "--out", "fitted.yaml")
    assert result.exit_code == 0
    material = yaml.safe_load(Path("fitted.yaml").read_text(encoding="utf-8"))
    case = tg.load_case(SMALL, [f"materials.body={json.dumps(material)}"])
    assert case.materials["body"].build().shear_modulus == pytest.approx(0.1, rel=1e-3)
    result = turgor("export", SMALL, "--set", f"materials.body={json.dumps(material)}")
    assert result.exit_code == 2
    assert "materials.body: CalculiX has no such material (found 'mine')" in result.stderr


def test_a_file_of_tests_counts_once(tmp_path: Path) -> None:
    refused = turgor("fit", GOOD_TEST, GOOD_TEST.parent / "." / GOOD_TEST.name, "--model", "yeoh-1")
    assert (refused.exit_code, "good.csv: this file of tests is given twice" in refused.stderr) == (2, True)
    twice = f"materials.body={{fit: ['{GOOD_TEST}', '{GOOD_TEST}'], models: [yeoh-1]}}"
    refused = turgor("run", SMALL, "--set", twice, "--out", tmp_path / "run")
    assert (refused.exit_code, "good.csv: this file of tests is given twice" in refused.stderr) == (2, True)


def test_a_fit_is_told_what_its_file_does_not_say() -> None:
    plain = printed("fit", GOOD_TEST, "--model", "yeoh-1", "--json")
    told = turgor("fit", GOOD_TEST, "--model", "yeoh-1", "--strain-source", "crosshead", "--json")
    assert "crosshead" in told.stderr
    assert "gauge" in told.stderr
    assert json.loads(told.stdout)["data"]["tests"][0]["strain_source"] == "crosshead"
    lengths = ("--gauge-length", "33 mm", "--effective-gauge-length", "66 mm")
    stiffer = printed("fit", GOOD_TEST, "--model", "yeoh-1", "--json", *lengths)
    assert stiffer["data"]["tests"][0]["strain_max"] == pytest.approx(plain["data"]["tests"][0]["strain_max"] / 2)
    stress = printed("fit", GOOD_TEST, "--model", "yeoh-1", "--json", "--known-modulus", "0.1 MPa")
    assert stress["data"]["tests"][0]["corrections"]
    relative = printed("fit", GOOD_TEST, "--model", "yeoh-1", "--relative", "--weight", "2", "--json")
    assert relative["data"]["error"] == "relative"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--gauge-length", "33"], ("gauge_length", "a unit is missing")),
        (["--effective-gauge-length", "33 mm"], ("gauge_length", "the gauge length that was used")),
        (["--strain-source", "guess"], ("strain_source", "'guess'", "crosshead")),
        (["--weight", "1", "--weight", "2"], ("weights", "1 numbers, one for each test")),
        (["--stability", "maybe"], ("stability", "'maybe'", "prefer, require or ignore")),
        (["--stable-to", "0.5"], ("stable_to", "from 1 up")),
        (["--stable-to", "inf"], ("stable_to", "from 1 up")),
        (["--known-modulus", "500 MPa"], ("does not reach the known modulus",)),
    ],
)
def test_a_wrong_option_of_a_fit_is_refused(options: list[str], words: tuple[str, ...]) -> None:
    result = turgor("fit", GOOD_TEST, "--model", "yeoh-1", *options)
    assert result.exit_code == 2, result.output
    for word in words:
        assert word in result.stderr
    assert "Traceback" not in result.output


def test_a_material_is_assessed() -> None:
    found = printed("materials", "tpu-0deg-mooney-rivlin-5", "--json")["assessment"]
    assert found["drucker_stable"] is False
    assert found["drucker_lost"]["equibiaxial"]["tension"] == pytest.approx(1.09, abs=0.02)
    assert "equibiaxial beyond 1." in turgor("materials", "tpu-0deg-mooney-rivlin-5").stdout


def test_materials() -> None:
    names = [entry["name"] for entry in printed("materials", "--json")]
    assert len(names) > 20
    assert printed("materials", names[0], "--json")["name"] == names[0]
    assert names[0] in turgor("materials").stdout
    assert "constants" in turgor("materials", names[0]).stdout


def test_a_preview_is_a_picture(tmp_path: Path) -> None:
    path = tmp_path / "sheet.png"
    changes = ("--set", "wall=2 mm", "--set", "model=axisymmetric")
    assert turgor("templates", "tube", "--preview", *changes, "--out", path).stdout.strip() == str(path)
    assert path.read_bytes()[:4] == b"\x89PNG"
    refused = turgor("templates", "tube", "--out", path)
    assert (refused.exit_code, "expected --preview" in refused.stderr) == (2, True)


def test_templates() -> None:
    described = {entry["template"]: entry for entry in printed("templates", "--json")}
    assert {"tube", "pneunet"} <= set(described)
    assert printed("templates", "tube", "--json") == described["tube"]
    assert "inner_radius" in turgor("templates", "tube").stdout
    assert "pneunet" in turgor("templates").stdout


def test_mesh_writes_the_mesh_it_describes(tmp_path: Path) -> None:
    facts = printed("mesh", SMALL, "--out", tmp_path / "tube.msh", "--json")
    assert facts["regions"] == {"body": facts["elements"]}
    assert (tmp_path / "tube.msh").stat().st_size > 10_000
    assert turgor("mesh", SMALL, "--out", tmp_path / "tube.stl").exit_code == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mesh", SMALL, "--out", "x.foo"], "x.foo: this kind of mesh file is not known (found '.foo')"),
        (["mesh", SMALL, "--out", "none/x.vtu"], "none/x.vtu: there is no such folder"),
        (["mesh", SMALL, "--out", "."], ".: this is a folder; expected the name of a file"),
        (["mesh", SMALL, "--out", "a.vtu", "--picture", "b.jpg"], "b.jpg: a picture is saved as .png"),
        (["mesh", SMALL, "--picture", "b.png", "--quality-picture", "b.png"], "b.png: two things are to be written"),
        (["export", SMALL, "--out", "x.foo"], "x.foo: models of this kind are not written"),
        (["export", SMALL, "--out", "none/x.inp"], "none/x.inp: there is no such folder"),
        (["fit", GOOD_TEST, "--out", "none/x.yaml"], "none/x.yaml: there is no such folder"),
        (["fit", GOOD_TEST, "--report", "file"], "file: the folder cannot be made here: this is a file"),
        (["run", SMALL, "--out", "file"], "file: the folder cannot be made here: this is a file"),
        (["templates", "tube", "--preview", "--out", "none/x.png"], "none/x.png: there is no such folder"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is_computed(
    arguments: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def computed(*_: object, **__: object) -> None:
        raise AssertionError("too late")

    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    for place in ("mesh.preview.generate", "study.meshing.generate", "materials.fit.solve"):
        monkeypatch.setattr(f"turgor.{place}", computed)
    refused = turgor(*arguments)
    assert (refused.exit_code, refused.stderr.startswith(f"turgor: {words}")) == (2, True), refused.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_the_schema_is_one_of_case_files() -> None:
    assert set(printed("schema")["properties"]) == set(tg.Case.model_fields)


def test_doctor_tells_what_it_stands_on(monkeypatch: pytest.MonkeyPatch) -> None:
    found = printed("doctor", "--json")
    assert found["versions"]["turgor"] == tg.__version__
    assert found["linear_solver"] in {"MKL PARDISO", "MUMPS", "SuperLU"}
    assert found["threads"]["kernels"] >= 1
    assert found["missing"] == []
    assert "linear_solver" in turgor("doctor").stdout

    def absent(name: str) -> None:
        raise MissingPackageError(f"{name} needs libGL.so.1; on Debian or Ubuntu: apt-get install libgl1")

    monkeypatch.setattr("turgor.study.environment.require", absent)
    assert "apt-get install libgl1" in turgor("doctor").stderr


@pytest.mark.parametrize("suffix", [".inp", ".feb"])
def test_export_writes_a_model(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"tube{suffix}"
    facts = printed("export", SMALL, "--out", path, "--json")
    assert facts["file"] == str(path)
    assert path.read_text(encoding="utf-8").count({".inp": "*STEP", ".feb": "<pt>"}[suffix]) >= 4


def test_export_refuses_what_the_program_lacks(tmp_path: Path) -> None:
    result = turgor("export", SMALL, "--out", tmp_path / "tube.bdf")
    assert result.exit_code == 2
    assert ".inp (CalculiX, Abaqus) or .feb (FEBio)" in result.stderr
    result = turgor("export", SMALL, "--out", tmp_path / "tube.inp", "--set", "contact=true")
    assert result.exit_code == 2
    assert "contact" in result.stderr
    assert not (tmp_path / "tube.inp").exists()


def test_export_refuses_and_doubts_what_a_run_does(tmp_path: Path) -> None:
    place = ("--out", tmp_path / "tube.inp")
    refused = turgor("export", SMALL, *place, "--set", "materials.body.constants.C10=1 Pa")
    assert (refused.exit_code, place[1].exists()) == (2, False)
    assert "loads.0.value: this is" in refused.stderr
    assert "times the shear modulus" in refused.stderr
    doubted = turgor("export", SMALL, *place, "--set", "loads.0.value=3 mPa")
    assert doubted.exit_code == 0
    assert "loads.0: a pressure of 0.003 Pa moves nothing" in doubted.stderr


MESHED = """\
geometry: {template: mesh, file: FILE}
materials: {body: {model: neo-hookean, constants: {C10: 0.05 MPa}}}
supports: [{type: clamped, surface: held}]
loads: [{type: gravity}]
"""

DECK = """\
*Node
 1, 0., 0., 0.
 2, 1., 0., 0.
 3, 0., 1., 0.
 4, 0., 0., 1.
*Include, input=cells.txt
*Nset, nset=held
 1, 2, 3
"""


@pytest.mark.parametrize(
    ("command", "read", "target"),
    [
        ("mesh", "part.vtu", None),
        ("export", "part.inp", None),
        ("export", "part.inp", "./part.inp"),
        ("mesh", "part.inp", "linked.vtu"),
        ("export", "part.inp", "cells.inp"),
        ("mesh", "part.vtu", "part.yaml"),
    ],
)
def test_no_file_that_is_read_is_written_over(
    command: str, read: str, target: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    included = "cells.inp" if target == "cells.inp" else "cells.txt"
    files = {
        "part.yaml": MESHED.replace("FILE", read),
        read: DECK.replace("cells.txt", included) if read.endswith(".inp") else "a mesh that nobody looks at",
        included: "*Element, type=C3D4, elset=body\n 1, 1, 2, 3, 4\n",
    }
    for name, text in files.items():
        Path(name).write_text(text, encoding="utf-8")
    Path("linked.vtu").symlink_to(read)
    result = turgor(command, "part.yaml", *(("--out", target) if target else ()))
    assert result.exit_code == 2, result.output
    assert f"turgor: {Path(target or read).name}: this file is read here" in result.stderr
    assert "expected another name" in result.stderr
    assert {name: Path(name).read_text(encoding="utf-8") for name in files} == files
    assert not Path(f"{read}.part").exists()


@pytest.mark.parametrize("written", [("--out", "fit.json"), ("--report", ".")])
def test_a_fit_does_not_replace_its_test(
    written: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    data = Path("fit.json")
    data.write_bytes(GOOD_TEST.read_bytes())
    monkeypatch.setattr(tg, "fit", None)  # what would be lost is known before
    result = turgor("fit", data, "--model", "yeoh-1", *written)
    assert result.exit_code == 2, result.output
    assert "turgor: fit.json: this file is read here" in result.stderr
    assert data.read_bytes() == GOOD_TEST.read_bytes()
    assert not Path("fit.html").exists()


def test_the_python_story_keeps_what_it_reads_too(tmp_path: Path) -> None:
    data = tmp_path / "pull.csv"
    data.write_bytes(GOOD_TEST.read_bytes())
    fitted = tg.fit(tg.read_tests(data), "yeoh-1")
    with pytest.raises(tg.InputError, match=r"pull.csv: this file is read here"):
        tg.write_material(fitted, data)
    deck = tmp_path / "part.inp"
    deck.write_text(DECK, encoding="utf-8")
    (tmp_path / "case.yaml").write_text(MESHED.replace("FILE", deck.name), encoding="utf-8")
    with pytest.raises(tg.InputError, match=r"part.inp: this file is read here"):
        tg.export_case(tg.load_case(tmp_path / "case.yaml"), deck)
    assert data.read_bytes() == GOOD_TEST.read_bytes()
    assert deck.read_text(encoding="utf-8") == DECK


@pytest.mark.parametrize(("model", "cells"), [("axisymmetric", "triangles"), ("quarter", "hexahedra")])
def test_sections_and_rows_are_meshed_too(model: str, cells: str, tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "examples" / "tube.yaml"
    changes = ("--set", f"geometry.model={model}", "--set", f"mesh.cells={cells}", "--set", "mesh.size=5 mm")
    facts = printed("mesh", example, *changes, "--out", tmp_path / "tube.vtu", "--json")
    assert facts["elements"] > 50
    # Of a section the area within its outline, of the quarter the volume.
    section = 9.85 * 120 - 6.35 * 86
    quarter = math.pi / 4 * (9.85**2 * 120 - 6.35**2 * 86)
    name, exact = ("area_mm2", section) if model == "axisymmetric" else ("volume_mm3", quarter)
    assert facts[name] == pytest.approx(exact, rel=1e-3)
    assert ("walls" in facts) is False  # measured on tetrahedra only
    assert (tmp_path / "tube.vtu").stat().st_size > 1000


def test_mesh_counts_elements_through_the_walls_and_draws_them(tmp_path: Path) -> None:
    picture = tmp_path / "tube.png"
    arguments = ("--out", tmp_path / "tube.vtu", "--quality-picture", picture, "--set", "mesh.layers=2", "--json")
    facts = printed("mesh", SMALL, *arguments)
    assert facts["walls"]["thinnest_mm"] == pytest.approx(3.0, rel=0.1)
    assert facts["walls"]["elements_through_median"] > 2.0
    assert facts["quality"]["scaled_jacobian_min"] > 0.0
    assert picture.read_bytes().startswith(b"\x89PNG")
