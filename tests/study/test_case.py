"""Case files: what they mean, how they are changed, and that the resolved one means the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from turgor.common.errors import InputError
from turgor.common.units import EXAMPLES as EXAMPLES_OF_QUANTITIES
from turgor.common.units import to_internal
from turgor.geometry import cad
from turgor.geometry.tube import CappedTube
from turgor.materials import create
from turgor.study.build import check_sizes, doubts
from turgor.study.case import Case, load_case
from turgor.study.datafiles import data_names
from turgor.study.materials import build_materials
from turgor.study.meshing import mesh_case
from turgor.study.setup import Setup
from turgor.study.validation import suggestion

PLAIN = "materials.body={model: neo-hookean, constants: {C10: 50 kPa}, density: 1 g/cm^3}"
HELD = [{"type": "clamped", "surface": "mount"}]
EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.yaml"))


def test_quantities_are_kept_in_internal_units(small_tube: Path) -> None:
    case = load_case(small_tube, ["loads.0.value=1 bar", "mesh.size=0.25 in"])
    assert case.full_pressure == pytest.approx(0.1, rel=1e-12)
    assert case.mesh.size == pytest.approx(6.35, rel=1e-12)


def test_the_name_comes_from_the_file(small_tube: Path) -> None:
    odd = small_tube.rename(small_tube.with_name("1 tube (new).yaml"))
    assert load_case(odd).name == "1-tube--new"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_resolved_case_of_an_example_is_the_same_case(path: Path, tmp_path: Path) -> None:
    case = load_case(path)
    resolved = tmp_path / "case.yaml"
    resolved.write_text(case.to_yaml(), encoding="utf-8")
    again = load_case(resolved)
    assert again == case
    assert again.to_yaml() == case.to_yaml()


AWKWARD = """\
name: awkward
geometry: {template: tube, wall: 0.1 in, cap: 0.7 inch}
materials:
  body: {model: ogden-2, constants: {mu1: 9.11e-4 MPa, alpha1: 5.88, mu2: 9.79 psi, alpha2: 1.45},
         D1: 3e-2 1/kPa, density: 1.07 g/cm^3, convention: abaqus}
mesh: {size: 0.1 in, sizes: {outer: 0.07 in}, per_circle: 16}
supports:
  - {type: displacement, surface: mount, x: 0 mm, y: 1 thou}
  - {type: elastic, surface: outer, stiffness: 0.1 kPa/mm, normal_only: true}
loads:
  - {type: pressure, value: 1.1 psi}
  - {type: gravity, direction: [1, 2, 3]}
  - {type: traction, surface: tip-face, value: 0.3 kPa, direction: [0, 1, 1]}
  - {type: force, surface: tip-face, value: 0.1 gram_force, direction: [0, 0, -2]}
contact:
  self: true
  pairs: [[outer, tip-face]]
  bodies:
    - {type: plane, point: [0 mm, 0 mm, 1 ft], normal: [0, 0, -1], surface: tip-face, move: [0 mm, 1 in, -0.1 in]}
    - {type: box, lower: [0 cm, 0 cm, 20 cm], upper: [1 in, 1 in, 1 ft]}
    - {type: cylinder, start: [0 mm, 9 cm, 0 mm], end: [0 mm, 9 cm, 1 cm], radius: 0.1 in, name: bar}
    - {type: sphere, centre: [9 cm, 0 mm, 0 mm], radius: 0.3 in}
fibres:
  - {youngs_modulus: 4506 ksi, diameter: 7 thou, bending_stiffness: solid}
  - curve: fibre-1
    youngs_modulus: 31 GPa
    diameter: 0.1 mm
    tension_only: false
    bar_length: 0.1 in
    bending_stiffness: 0.003 pound_force*inch^2
sheets:
  - {surface: outer, youngs_modulus: 1 GPa, thickness: 4 thou, poisson: 0.25}
  - {between: [body, base], youngs_modulus: 1 GPa, thickness: 4 thou}
fibre_families:
  - law: {type: exponential, k1: 7 psi, k2: 0.1}
    direction: {type: helical, angle: 54.7356 deg, axis: [0, 1, 0], origin: [0.1 in, 0 mm, 0 mm]}
  - {law: {type: quadratic, k: 0.1 psi}, direction: {type: constant, vector: [1, 2, 0]}, dispersion: 0.1}
solver: {outputs: [0.1 psi, 0.7 psi, 1.1 psi]}
measures: [twist]
"""


def test_no_digit_is_lost_in_the_resolved_case(tmp_path: Path) -> None:
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text(AWKWARD.replace("3e-2 1/kPa", "3e-2 kPa^-1"), encoding="utf-8")
    case = load_case(first)
    second.write_text(case.to_yaml(), encoding="utf-8")
    assert load_case(second) == case
    assert load_case(second).fractions() == case.fractions()
    assert [load.build() for load in load_case(second).loads] == [load.build() for load in case.loads]


def test_outputs_are_fractions_of_the_pressure(small_tube: Path) -> None:
    assert load_case(small_tube).fractions() == (0.25, 0.5, 0.75, 1.0)
    case = load_case(small_tube, ["solver={outputs: [5 kPa, 0.2 bar]}"])
    assert case.fractions() == pytest.approx((0.25, 1.0))
    assert case.fractions()[-1] == 1.0
    for whole, part, units in (
        ("10 kPa", "100 mbar", "50 mbar"),
        ("3 kPa", "0.03 bar", "0.01 bar"),
        ("7 psi", "48.2633010521 kPa", "1 psi"),
    ):
        outputs = load_case(
            small_tube, [f"loads.0.value={whole}", f"solver={{outputs: [{units}, {part}]}}"]
        ).fractions()
        assert outputs[-1] == 1.0
    vacuum = load_case(small_tube, ["loads.0.value=-10 kPa", "solver={outputs: [-1 kPa, -10 kPa]}"])
    assert vacuum.fractions() == pytest.approx((0.1, 1.0))


def test_direction_and_size_make_a_vector() -> None:
    (gravity,) = Setup.read(supports=HELD, loads=[{"type": "gravity", "direction": [0, 3, -4]}]).loads
    assert gravity.build().acceleration == pytest.approx((0.0, 0.6 * 9806.65, -0.8 * 9806.65))
    pull = {"type": "force", "surface": "tip-face", "value": "2 N", "direction": [0, 0, 5]}
    (force,) = Setup.read(supports=HELD, loads=[pull]).loads
    assert force.build().vector == (0.0, 0.0, 2.0)


def test_items_of_the_python_story_are_checked_as_in_a_file() -> None:
    with pytest.raises(InputError, match=r"supports.0.surfac: unknown key; expected 'surface'"):
        Setup.read(supports=[{"type": "clamped", "surfac": "mount"}])
    with pytest.raises(InputError, match=r"loads.0.value: a unit is missing"):
        Setup.read(supports=HELD, loads=[{"type": "pressure", "value": 3}])


def test_materials_take_their_volume_change_and_density(small_tube: Path) -> None:
    case = load_case(
        small_tube, ["materials.body={model: yeoh-1, constants: {C10: 50 kPa}, poisson: 0.45, density: 1 g/cm^3}"]
    )
    materials, fit = build_materials(case.materials)
    assert fit is None
    assert materials["body"].poisson_ratio == pytest.approx(0.45)
    assert materials["body"].density == pytest.approx(1e-9)
    assert materials["body"].shear_modulus == pytest.approx(0.1)


def test_what_is_doubtful_in_tests_is_told(small_tube: Path, caplog: pytest.LogCaptureFixture) -> None:
    curve = "strain,stress (MPa)\n" + "".join(f"{0.1 * k},{1e4 * k}\n" for k in range(8))
    small_tube.with_name("pull.csv").write_text(curve, encoding="utf-8")
    change = "materials.body={fit: pull.csv, models: [neo-hookean], specimen: {strain_source: crosshead}}"
    build_materials(load_case(small_tube, [change]).materials)
    crosshead, unit = caplog.messages
    assert "pull.csv: the strain comes from the crosshead" in crosshead
    assert "pull.csv: the stress is up to 7e+04 MPa at strains up to 0.7: stiffer than elastomers are" in unit


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("loads.0.value=20 mPa", "loads.0: a pressure of 0.02 Pa moves nothing"),
        ("materials.body.density=1070 g/cm^3", "materials.body.density: 1.07e+06 kg/m³ is heavier than any element"),
        ("materials.body.density=1 g/m^3", "materials.body.density: 0.001 kg/m³ is lighter than foams"),
        ("materials.body.poisson=-0.9", "no elastomer has a negative one"),
    ],
)
def test_slips_of_a_unit_that_leave_a_run_possible_are_doubted(small_tube: Path, change: str, words: str) -> None:
    case = load_case(small_tube, [PLAIN])
    assert doubts(case, build_materials(case.materials)[0]) == []
    case = load_case(small_tube, [PLAIN, change])
    (doubt,) = doubts(case, build_materials(case.materials)[0])
    assert words in doubt


def test_the_library_material_can_be_given_a_density(small_tube: Path) -> None:
    change = "materials.body={library: ecoflex-00-30-yeoh, density: 2 g/cm^3}"
    materials, _ = build_materials(load_case(small_tube, [change]).materials)
    assert materials["body"].density == pytest.approx(2e-9)
    assert materials["body"].parameters["C10"] == pytest.approx(0.007734)


@pytest.mark.parametrize(
    ("value", "refused"), [("9.9 MPa", False), ("10.1 MPa", True), ("-0.1 MPa", False), ("-0.11 MPa", True)]
)
def test_the_bounds_of_a_pressure(small_tube: Path, value: str, refused: bool) -> None:
    case = load_case(small_tube, [f"loads.0.value={value}"])
    materials = {"body": create("neo-hookean", {"C10": 0.05})}
    if refused:
        with pytest.raises(InputError, match=r"loads.0.value"):
            check_sizes(case, materials)
    else:
        check_sizes(case, materials)


STEP = """\
geometry: {template: step, file: tube.step, mount: {normal: [0, 0, -1]}, tip_face: {normal: [0, 0, 1]}}
materials: {body: {model: neo-hookean, constants: {C10: 0.05 MPa}}}
mesh: {size: 6 mm}
supports: [{type: clamped, surface: mount}]
loads: [{type: pressure, value: 5 kPa}]
"""


def test_a_shape_may_come_from_a_step_file(tmp_path: Path) -> None:
    with cad.session("export") as gmsh:
        CappedTube(inner_radius="6 mm", wall="3 mm", length="40 mm", cap="6 mm").draw()
        gmsh.write(str(tmp_path / "tube.step"))
    (tmp_path / "case.yaml").write_text(STEP, encoding="utf-8")
    case = load_case(tmp_path / "case.yaml")
    assert data_names(case) == {tmp_path / "tube.step": "data/tube.step"}
    assert "file: data/tube.step" in case.to_yaml(data_names(case))
    assert {"mount", "tip-face", "cavity"} <= mesh_case(case).surfaces.keys()


def test_copies_of_data_files_have_names_of_their_own(tmp_path: Path) -> None:
    curve = "strain,stress (MPa)\n" + "".join(f"{0.1 * k},{0.01 * k}\n" for k in range(8))
    files = ["a/2-pull.csv", "a/pull.csv", "b/pull.csv", "c/PULL.csv", "d/pull.csv"]
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(curve, encoding="utf-8")
    text = (EXAMPLES[0].parent / "tube.yaml").read_text(encoding="utf-8")
    (tmp_path / "case.yaml").write_text(text, encoding="utf-8")
    fitted = f"materials={{body: {{fit: [{', '.join(files)}], models: [neo-hookean]}}}}"
    names = data_names(load_case(tmp_path / "case.yaml", [fitted]))
    assert [path.relative_to(tmp_path).as_posix() for path in names] == files
    assert len({name.lower() for name in names.values()}) == len(files)


OWN_MODEL = """
name: my-rubber
energy: mu/2*(I1 - 3)
constants: {mu: {unit: MPa}}
"""


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("{model: none.yaml, constants: {mu: 0.1 MPa}}", ["--set: materials.body.model", "no such file", "YAML"]),
        ("{fit: pull.csv, models: [none.yaml]}", ["--set: materials.body.models.0", "no such file", "YAML"]),
        ("{model: broken.yaml, constants: {mu: 0.1 MPa}}", ["broken.yaml: energy", "I3", "one of I1, I2"]),
        ("{fit: pull.csv, models: [broken.yaml]}", ["broken.yaml: energy", "I3", "one of I1, I2"]),
        ("{model: own.yaml, constants: {mu: 0.1}}", ["materials.body.constants.mu", "unit"]),
        ("{model: own.yaml, constants: {C10: 0.1 MPa}}", ["materials.body.constants.C10", "my-rubber", "mu [MPa]"]),
        ("{fit: pull.csv, models: [own.yaml, copy.yaml]}", ["materials.body.models", "same name", "my-rubber"]),
    ],
)
def test_what_is_wrong_with_a_model_of_ones_own(small_tube: Path, change: str, words: list[str]) -> None:
    for name in ("own", "copy"):
        small_tube.with_name(f"{name}.yaml").write_text(OWN_MODEL, encoding="utf-8")
    small_tube.with_name("broken.yaml").write_text(OWN_MODEL.replace("I1", "I3"), encoding="utf-8")
    curve = "strain,stress (MPa)\n" + "".join(f"{0.1 * k},{0.01 * k}\n" for k in range(8))
    small_tube.with_name("pull.csv").write_text(curve, encoding="utf-8")
    with pytest.raises(InputError) as found:
        build_materials(load_case(small_tube, [f"materials.body={change}"]).materials)
    for word in words:
        assert word in str(found.value)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("name=../up", "name"),
        ("regions={'a/b': {inside: {half-space: {normal: [0, 0, 1], above: 3 mm}}}}", "regions.a/b"),
        ("measures=[{displacement: {at: [0 mm, 0 mm, 0 mm], name: '../../up'}}]", "measures.0.displacement.name"),
    ],
)
def test_names_that_become_files_are_names(small_tube: Path, change: str, key: str) -> None:
    with pytest.raises(InputError, match="cannot be a name") as found:
        load_case(small_tube, [change])
    assert found.value.key == key


PULL = "loads.0={type: traction, surface: outer"
MOUNT = "{normal: [0, 0, -1]}"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("control={type: volume}", "control.target: MISSING volume with unit, or per cent of that at rest"),
        (f"{PULL}, value: 3 kPa, direction: [0, 1]}}", "loads.0.direction.2: MISSING a number"),
        (f"{PULL}, direction: [0, 1, 0]}}", "loads.0.value: MISSING pressure with unit, such as '12 psi'"),
        ("measures=[{displacement: {at: [0 mm, 0 mm]}}]", "at.2: MISSING length with unit, such as '3 mm'"),
        ("materials.body={model: yeoh-1}", "body.constants: MISSING 'key: value' lines"),
        (f"geometry={{template: stl, file: small.yaml, mount: {MOUNT}}}", "geometry.unit: MISSING "),
        ("loads.0={value: 3 kPa}", "loads.0.type: MISSING one of: force, gravity, pressure, traction"),
        ("contact={bodies: [{friction: 0.1}]}", "bodies.0.type: MISSING one of: box, cylinder, plane, sphere"),
        ("geometry={wall: 3 mm}", "geometry.template: MISSING one of: bellows, "),
        ("measures=[foo]", "measures.0: there is no such measure (found 'foo'); expected one of: bending_angle, "),
        ("measures=[3]", "measures.0: there is no such measure (found 3); expected the name of one"),
        ("geometry.model=whole", "geometry.model: this value does not fit (found 'whole'); expected 'full', 'half', "),
        (
            "geometry={template: pneunet, chambers: 2.5}",
            "chambers: this value does not fit (found 2.5); expected a whole",
        ),
        ("supports.0={type: elastic, surface: outer, stiffness: 3 N/mm^2}", "'N/mm^2' is not a unit of stiffness per"),
    ],
)
def test_a_message_says_what_would_be_right(small_tube: Path, change: str, words: str) -> None:
    with pytest.raises(InputError) as found:
        load_case(small_tube, [change])
    assert words.replace("MISSING", "this key is missing; expected") in str(found.value)


@pytest.mark.parametrize(
    ("name", "known", "expected"),
    [
        ("cavity", ["cavity-2", "cavity-1"], "'cavity-1' or 'cavity-2' (of: cavity-1, cavity-2)"),
        ("cavity", [f"cavity-{k}" for k in range(1, 6)], "one of: cavity-1, cavity-2, cavity-3, cavity-4, cavity-5"),
        ("outr", ["outer", "mount"], "'outer' (of: mount, outer)"),
        ("x", [], "one of: nothing"),
    ],
)
def test_names_that_are_as_near_are_all_suggested(name: str, known: list[str], expected: str) -> None:
    assert suggestion(name, known) == expected


def test_the_schema_names_every_key_and_template() -> None:
    schema = Case.model_json_schema()
    assert set(schema["properties"]) == set(Case.model_fields)
    assert set(schema["required"]) == {"geometry", "materials", "supports", "loads"}
    names = {entry["properties"]["template"]["const"] for entry in schema["properties"]["geometry"]["oneOf"]}
    assert {"tube", "pneunet"} <= names
    assert json.loads(json.dumps(schema)) == schema


def test_the_defaults_of_the_schema_are_what_turgor_accepts() -> None:
    schema = Case.model_json_schema()
    dimensions = {example: dimension for dimension, example in EXAMPLES_OF_QUANTITIES.items()}
    read = []

    def check(node: dict[str, Any], value: Any) -> None:
        if "$ref" in node:
            check(schema["$defs"][node["$ref"].rsplit("/", 1)[1]], value)
        elif "examples" in node:
            read.append(to_internal(value, dimensions[node["examples"][0]]))
        elif isinstance(value, list):
            for number, item in enumerate(value):
                check(node["prefixItems"][number] if "prefixItems" in node else node["items"], item)
        elif isinstance(value, dict):
            for key, item in value.items():
                if item is not None and key in node.get("properties", {}):
                    check(node["properties"][key], item)

    def walk(node: Any) -> None:
        for part in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
            walk(part)
        if isinstance(node, dict) and node.get("default") is not None:
            check(node, node["default"])

    walk(schema)
    assert len(read) > 60
    defaults = {name: part["properties"] for name, part in schema["$defs"].items() if "properties" in part}
    assert defaults["GravityCase"]["acceleration"]["default"] == "9.80665 m/s^2"
    assert defaults["AirControl"]["surroundings"]["default"] == "0.101325 MPa"
    assert defaults["HelicalCase"]["origin"]["default"] == ["0 mm"] * 3
    (gravity,) = Setup.read(supports=HELD, loads=[{"type": "gravity"}]).loads
    assert gravity.build().acceleration == (0.0, 0.0, -9806.65)


def test_a_quantity_of_the_examples_means_what_it_says() -> None:
    case = load_case(next(path for path in EXAMPLES if path.stem == "tube"))
    materials, _ = build_materials(case.materials)
    assert materials["body"].shear_modulus == pytest.approx(0.1047)
    assert materials["body"].bulk_modulus == pytest.approx(1000 * 0.1047)
    assert case.full_pressure == to_internal("0.03 MPa", "pressure")
    assert case.geometry.default_size == pytest.approx(3.5)
