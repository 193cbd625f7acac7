"""Every malformed file in ``bad/`` ends in exit code 2 and one message that names the file, the key and the cure."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from turgor.cli.app import app

BAD = Path(__file__).parent / "bad"

CASES: dict[str, tuple[str, ...]] = {
    "a-list.yaml": ("no keys",),
    "barrier-with-friction.yaml": ("contact.friction", "barrier knows no friction", "method: penalty"),
    "bare-constant.yaml": ("materials.body.constants.C10", "a unit is missing", "0.05"),
    "bare-number.yaml": ("mesh.size", "a unit is missing", "found 6", "'3 mm'"),
    "billion-laughs.yaml": ("line 2", "alias"),
    "binary.yaml": ("UTF-8",),
    "boolean-for-a-number.yaml": ("solver.steps", "True", "whole number"),
    "box-inside-out.yaml": ("contact.bodies.0.upper", "no volume"),
    "caps-meet.yaml": ("geometry.cap", "no cavity is left", "less than half of the length"),
    "circular.yaml": ("line 3", "alias"),
    "constant-of-wrong-unit.yaml": ("materials.body.constants.C10", "'mm' is not a unit of pressure"),
    "contact-misspelt.yaml": ("contact.selv", "unknown key", "'self'"),
    "contact-of-a-number.yaml": ("contact", "3", "key: value"),
    "contact-of-nothing.yaml": ("contact", "nothing may touch", "self: true"),
    "contact-on-unknown-surface.yaml": ("contact.bodies.0.surface", "'tip'", "tip-face"),
    "contact-self-of-text.yaml": ("contact.self", "'all'", "true or false"),
    "contact-with-a-torus.yaml": ("contact.bodies.0.type", "torus", "plane"),
    "control-character.yaml": ("not YAML", "x0007"),
    "csv-without-stress.yaml": ("no-stress.csv", "Force (N)", "cross-section"),
    "cylinder-without-length.yaml": ("contact.bodies.0.end", "begins where it ends"),
    "deeper-than-vacuum.yaml": ("loads.0.value", "vacuum", "-0.101325 MPa"),
    "deeply-nested.yaml": ("nested too deeply",),
    "direction-of-two-numbers.yaml": ("loads.1.direction.2", "missing"),
    "direction-without-length.yaml": ("loads.1.direction", "length 0"),
    "displacement-nowhere.yaml": ("supports.0", "at least one of x, y and z"),
    "duplicate-inner-key.yaml": ("line 3", "'C10' is given twice"),
    "duplicate-key.yaml": ("line 10", "'mesh' is given twice"),
    "empty-loads.yaml": ("loads", "empty"),
    "empty.yaml": ("the file is empty",),
    "expression.yaml": ("loads.0.value", "2 * 3 kPa"),
    "family-angle-of-length.yaml": ("fibre_families.0.direction.angle", "not a unit of angle"),
    "family-of-unknown-law.yaml": ("fibre_families.0.law.type", "cubic", "quadratic"),
    "family-too-dispersed.yaml": ("fibre_families.0.dispersion", "0.5", "less than or equal"),
    "fibre-bending-in-mm.yaml": ("fibres.0.bending_stiffness", "not a unit of bending stiffness", "20 N mm^2"),
    "fibre-modulus-in-mm.yaml": ("fibres.0.youngs_modulus", "not a unit of pressure"),
    "fibre-of-no-diameter.yaml": ("fibres.0.diameter", "greater than 0"),
    "fibre-without-curve.yaml": ("fibres.0.curve", "no curves"),
    "fit-of-unknown-model.yaml": ("materials.body.models.0", "yeah-3", "yeoh-3"),
    "gravity-without-density.yaml": ("materials.body.density", "1070 kg/m^3"),
    "harder-than-diamond.yaml": ("materials.body", "diamond"),
    "infinite.yaml": ("materials.body.constants.C10", "not finite"),
    "latin-1.yaml": ("byte 181", "UTF-8"),
    "list-as-key.yaml": ("line 4", "cannot be a key"),
    "list-for-a-mapping.yaml": ("mesh", "['6 mm']", "'key: value'"),
    "local-size-bare.yaml": ("mesh.sizes.outer", "a unit is missing"),
    "local-size-of-nothing.yaml": ("mesh.sizes.tip", "no region or surface", "tip-face"),
    "mapping-for-a-list.yaml": ("supports", "a list"),
    "measure-outside.yaml": ("measures.displacement.at", "outside the body", "(0, 0, 900) mm"),
    "measure-without-axis.yaml": ("measures.0.expansion.axis", "missing"),
    "merge-key.yaml": ("mesh.<<", "unknown key"),
    "missing-constant.yaml": ("materials.body.constants.C10", "missing"),
    "name-with-a-path.yaml": ("name", "../elsewhere"),
    "nan-number.yaml": ("materials.body.poisson", "finite"),
    "nan.yaml": ("loads.0.value", "not finite"),
    "negative-D1.yaml": ("materials.body.D1", "greater than 0"),
    "negative-modulus.yaml": ("materials.body", "shear modulus of -0.2 MPa", "positive"),
    "negative-thickness.yaml": ("geometry.wall", "greater than 0 mm", "-3 mm"),
    "no-load-type.yaml": ("loads.0.type", "missing"),
    "no-loads.yaml": ("loads", "missing"),
    "no-material.yaml": ("materials.body", "library, model and fit"),
    "no-steps.yaml": ("solver.steps", "greater than or equal to 1"),
    "no-supports.yaml": ("supports", "missing"),
    "no-template.yaml": ("geometry.template", "missing", "tube"),
    "not-a-quantity.yaml": ("loads.0.value", "five kPa", "'12 psi'"),
    "not-held.yaml": ("supports", "free to shift along x"),
    "not-yaml.yaml": ("line 5", "not YAML"),
    "only-comments.yaml": ("the file is empty",),
    "only-text.yaml": ("no keys", "a tube of rubber"),
    "control-of-air-in-rest.yaml": ("control.target", "at rest"),
    "control-of-a-number.yaml": ("control.target", "a unit is missing", "found 250", "'250 %'"),
    "control-of-less-than-nothing.yaml": ("control.target", "greater than 0", "-20 %", "'5 ml'"),
    "control-of-a-length.yaml": ("control.target", "'mm' is not a unit of volume", "'5 ml'"),
    "control-with-friction.yaml": ("control", "friction follows the path of the loads", "pressure"),
    "control-beside-a-traction.yaml": ("loads.1", "no pressure is given", "in proportion"),
    "control-of-bare-volume.yaml": ("control.target", "unit is missing", "'12'"),
    "control-of-no-cavity.yaml": ("control.cavity", "outer"),
    "control-with-programme.yaml": ("loads.0.programme", "follows time"),
    "outputs-not-volumes.yaml": ("solver.outputs.1", "3 kPa", "250 %"),
    "outputs-not-to-the-volume.yaml": ("solver.outputs", "the last equal to control.target"),
    "outputs-not-times.yaml": ("solver.outputs.0", "'kPa' is not a unit of time"),
    "pressure-of-nothing.yaml": ("loads.0", "no pressure is given", "programme"),
    "pressure-twice-told.yaml": ("loads.0", "both value and programme"),
    "programme-backwards.yaml": ("loads.0.programme.time.2", "ascend"),
    "programme-from-nowhere.yaml": ("loads.0.programme.file", "nowhere.csv"),
    "programme-of-one-point.yaml": ("loads.0.programme.time", "1 of at least 2 entries"),
    "programme-not-from-rest.yaml": ("loads.0.programme", "starts from rest"),
    "programme-of-bare-times.yaml": ("loads.0.programme.time.0", "unit is missing"),
    "outputs-beyond-the-load.yaml": ("solver.outputs", "from 0 to the load's"),
    "outputs-out-of-order.yaml": ("solver.outputs", "in order"),
    "negative-friction.yaml": ("contact.friction", "-0.3", "greater than or equal to 0"),
    "pair-of-one.yaml": ("contact.pairs.0.1", "missing"),
    "plane-without-normal.yaml": ("contact.bodies.0.normal", "length 0"),
    "linear-path-unknown.yaml": ("solver.linear", "'krylov'", "'iterative'"),
    "poisson-0.6.yaml": ("materials.body.poisson", "0.6", "below 0.5"),
    "pressure-of-1e9.yaml": ("loads.0.value", "times the shear modulus", "check both units"),
    "python-tag.yaml": ("line 4", "python/object/apply:os.system", "not allowed"),
    "region-at-least-5.yaml": ("regions.stiff.at_least", "5", "less than or equal to 4"),
    "region-misspelt.yaml": ("regions.stiff.where.bal", "unknown key"),
    "region-nowhere.yaml": ("regions.stiff", "no cell lies"),
    "region-of-bare-radius.yaml": ("regions.stiff.where.any_of.0.ball.radius", "a unit is missing"),
    "region-of-no-file.yaml": ("regions.stiff.where.stl.file", "no such file", "insert.stl"),
    "region-of-no-rule.yaml": ("regions.stiff", "no rule says which part of space", "ball"),
    "sheet-between-unknown.yaml": ("sheets.0.between.1", "'base'", "body"),
    "sheet-nowhere.yaml": ("sheets.0", "either surface or between"),
    "sheet-poisson-1.yaml": ("sheets.0.poisson", "1.0", "less than 1"),
    "spring-of-wrong-unit.yaml": ("contact.bodies.0.spring.stiffness", "not a unit of stiffness"),
    "sphere-of-bare-radius.yaml": ("contact.bodies.0.radius", "a unit is missing"),
    "step-without-file.yaml": ("geometry.file", "nowhere.step", "STEP file"),
    "step-without-mount.yaml": ("geometry.mount",),
    "steps-against-each-other.yaml": ("solver.smallest_step", "more than the largest step"),
    "steps-and-outputs.yaml": ("solver", "only one of the two"),
    "stl-cap-on-nothing.yaml": ("geometry.caps.inlet", "nothing follows these rules"),
    "stl-cap-over-a-face.yaml": ("geometry.caps.inlet", "no air behind this rim"),
    "stl-crossed.yaml": ("crossed.stl", "passes through itself", "near"),
    "stl-of-furlongs.yaml": ("geometry.unit", "furlong", "inch"),
    "stl-open-cavity.yaml": ("loads.0.cavity", "no closed cavity", "caps"),
    "stl-rule-misspelt.yaml": ("geometry.caps.inlet.nearst",),
    "stl-without-unit.yaml": ("geometry.unit",),
    "strain-range-of-one.yaml": ("materials.body.strain_range", "0:3"),
    "strain-range-reversed.yaml": ("materials.body.strain_range", "1:0.5", "empty"),
    "tab-indented.yaml": ("line 6", "not YAML"),
    "text-for-a-list.yaml": ("measures", "a list"),
    "text-for-a-number.yaml": ("solver.steps", "'one'", "whole number"),
    "text-tag.yaml": ("line 4", "tag"),
    "tolerance-of-a-half.yaml": ("solver.tolerance", "0.5", "less than or equal to 0.001"),
    "too-fine.yaml": ("mesh.size", "more than 20 elements", "0.15 mm"),
    "turned-and-twisted.yaml": ("measures", "'twist' has no meaning in a body of revolution", "in space"),
    "turned-and-pulled-aside.yaml": ("loads.tip-face", "along y, the axis of revolution"),
    "two-bodies-of-one-name.yaml": ("contact.bodies", "sphere", "name of its own"),
    "two-bulk-moduli.yaml": ("materials.body.poisson", "given twice", "bulk_modulus"),
    "two-documents.yaml": ("line 4", "another document"),
    "two-pressures.yaml": ("loads", "two pressures"),
    "unknown-cavity.yaml": ("loads.0.cavity", "'outer'", "cavity"),
    "unknown-constant.yaml": ("materials.body.constants.D10", "C10 [MPa]"),
    "unknown-csv.yaml": ("materials.body.fit", "nowhere.csv", "relative to the case file"),
    "unknown-key.yaml": ("mesh.sise", "unknown key", "'size'"),
    "unknown-material.yaml": ("materials.body.library", "unobtainium", "turgor materials"),
    "unknown-measure.yaml": ("measures", "'bending'", "bending_angle"),
    "unknown-model.yaml": ("materials.body.model", "neo-hokean", "neo-hookean"),
    "unknown-parameter.yaml": ("geometry.wal", "wall"),
    "unknown-region.yaml": ("materials.base", "region", "body"),
    "unknown-support.yaml": ("supports.0.type", "glued", "clamped"),
    "unknown-surface.yaml": ("supports.0.surface", "mounting", "'mount'"),
    "unknown-template.yaml": ("geometry.template", "tubes", "'tube'"),
    "unknown-top-key.yaml": ("suports", "unknown key", "'supports'"),
    "unknown-unit.yaml": ("loads.0.value", "5 kPaa", "known unit"),
    "utf-16.yaml": ("UTF-8",),
    "walls-meet.yaml": ("geometry.tunnel_roof", "walls meet", "less than"),
    "wrong-unit.yaml": ("mesh.size", "'kPa' is not a unit of length"),
    "zero-size.yaml": ("mesh.size", "greater than 0 mm"),
}
"""Case file → words that its message must hold besides the name of the file."""

TESTS: dict[str, tuple[str, ...]] = {
    "all-nan.csv": ("usable points",),
    "binary.csv": ("not a text file",),
    "compressed-away.csv": ("row", "-100 %", "impossible"),
    "empty.csv": ("empty",),
    "header-only.csv": ("no rows",),
    "no-header.csv": ("header",),
    "no-stress.csv": ("Force (N)", "cross-section"),
    "one-point.csv": ("usable points",),
    "spreadsheet.csv": ("not a text file",),
    "text-in-columns.csv": ("row 2", "Engineering Strain", "not a number", "small"),
    "unknown-unit.csv": ("Engineering Stress (furlong)", "unit"),
}
"""Tensile test → words that the message of ``turgor fit`` must hold."""

NOT_BAD = {"good.csv", "empty.step", "crossed.stl", "cup.stl"}


def the_message(arguments: list[str]) -> str:
    """Run a command that must refuse its input and return the one message it gives."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    assert result.stdout == ""
    messages = [line for line in result.stderr.splitlines() if line.startswith("turgor:")]
    assert len(messages) == 1, result.stderr
    assert result.stderr.rstrip().endswith(messages[0])
    return messages[0]


def test_every_bad_file_is_listed() -> None:
    assert {path.name for path in BAD.iterdir()} == CASES.keys() | TESTS.keys() | NOT_BAD
    assert len(CASES) + len(TESTS) >= 40


@pytest.mark.parametrize("name", CASES)
def test_a_malformed_case_is_refused(name: str, tmp_path: Path) -> None:
    message = the_message(["run", str(BAD / name), "--out", str(tmp_path / "out")])
    assert name in message or "no-stress.csv" in message or "crossed.stl" in message
    for words in CASES[name]:
        assert words in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", TESTS)
def test_a_malformed_test_is_refused(name: str) -> None:
    message = the_message(["fit", str(BAD / name), "--model", "yeoh-1"])
    for words in (name, *TESTS[name]):
        assert words in message


def test_a_folder_is_not_a_case(tmp_path: Path) -> None:
    message = the_message(["run", str(tmp_path)])
    assert str(tmp_path) in message
    assert "not a file" in message


def test_a_case_may_be_missing(tmp_path: Path) -> None:
    assert "no such file" in the_message(["run", str(tmp_path / "tube.yaml")])


def test_a_case_may_be_too_long(tmp_path: Path) -> None:
    case = tmp_path / "long.yaml"
    case.write_text("# long\n" * 200_000, encoding="utf-8")
    assert "too long" in the_message(["run", str(case)])


def test_a_bad_change_names_the_option() -> None:
    case = str(BAD.parents[2] / "examples" / "tube.yaml")
    assert "--set: mesh.sise: unknown key" in the_message(["run", case, "--set", "mesh.sise=3 mm"])
    assert "--set: loads.3.value: there is no such item" in the_message(["run", case, "--set", "loads.3.value=1 kPa"])
    assert "--set: this is not an assignment" in the_message(["run", case, "--set", "mesh.size"])
    assert "--set: name.x: 'name' holds no keys" in the_message(["run", case, "--set", "name.x=1"])
    # What shows only when the mesh is there.
    change = "supports.0.surface=nowhere"
    assert "--set: supports.0.surface: the actuator has no" in the_message(["run", case, "--set", change])


def test_no_python_of_a_case_is_run() -> None:
    the_message(["run", str(BAD / "python-tag.yaml")])
    assert not Path("pwned").exists()
