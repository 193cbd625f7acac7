"""A model for FEBio: well formed, every name it uses defined, its numbers in FEBio's conventions."""

import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials.registry import create
from turgor.mesh.structured import box
from turgor.study.export.febio import Stepping, feb_model
from turgor.study.export.problem import problem_of
from turgor.study.materials import build_materials


def written(case, mesh, **materials):
    return "\n".join(feb_model(problem_of(case, mesh, materials or build_materials(case.materials)[0], "FEBio")))


def constants_of(text):
    (material,) = ElementTree.fromstring(text).find("Material")
    return material.get("type"), {entry.tag: float(entry.text) for entry in material}


def test_every_name_and_number_that_is_used_is_defined(ball, octant):
    case = ball(
        materials={
            "body": {
                "model": "neo-hookean", "constants": {"C10": "0.05 MPa"}, "poisson": 0.4, "density": "1e-9 t/mm^3"
            }
        },
        loads=[
            {"type": "pressure", "value": "60 kPa"},
            {"type": "gravity"},
            {"type": "traction", "surface": "outer", "value": "1 kPa", "direction": [0, 0, 2]},
        ],
    )  # fmt: skip
    model = ElementTree.fromstring(written(case, octant))
    assert model.get("version") == "4.0"
    mesh = model.find("Mesh")
    nodes = {int(node.get("id")) for node in mesh.find("Nodes")}
    assert nodes == set(range(1, octant.n_points + 1))
    used = [element.text for tag in ("Elements", "Surface") for block in mesh.findall(tag) for element in block]
    used += [block.text for block in mesh.findall("NodeSet")]
    assert {int(number) for text in used for number in text.split(",")} <= nodes
    names = {tag: {block.get("name") for block in mesh.findall(tag)} for tag in ("Elements", "Surface", "NodeSet")}
    materials = {material.get("name") for material in model.find("Material")}
    for domain in model.find("MeshDomains"):
        assert domain.get("name") in names["Elements"]
        assert domain.get("mat") in materials
        assert domain.get("elem_type") == "TET10G4"
    assert {condition.get("node_set") for condition in model.find("Boundary")} == {"x0", "y0", "z0"} <= names["NodeSet"]
    surfaces = {load.get("surface") for load in model.find("Loads").findall("surface_load")}
    assert surfaces == {"cavity", "outer"} <= names["Surface"]
    controllers = {entry.get("id") for entry in model.find("LoadData")}
    assert {entry.get("lc") for entry in model.iter() if entry.get("lc")} == controllers == {"1", "2"}
    # The weight takes the first unit of time; FEBio subtracts the force.
    assert model.find("Loads/body_load/force").text == "-0.0,-0.0,9806.65"
    assert [pt.text for pt in model.find("LoadData")[0].iter("pt")] == ["0.0,0.0", "1.0,0.0", "2.0,1.0"]
    assert [float(pt.text.split(",")[0]) for pt in model.find("LoadData")[1].iter("pt")] == [0.0, 1.0, 1.5, 2.0]
    assert model.find("Control/time_steps").text == "20"


def test_a_displacement_grows_with_the_load(ball):
    case = ball(
        supports=[{"type": "clamped", "surface": "x0"}, {"type": "displacement", "surface": "x1", "x": "0.5 mm"}],
        loads=[{"type": "force", "surface": "y1", "value": "3 N", "direction": [0, 1, 0]}],
    )
    model = ElementTree.fromstring(written(case, box((3.0, 1.0, 1.0), (3, 1, 1))))
    *clamped, moved = model.find("Boundary")
    assert [[entry.tag for entry in condition] for condition in clamped] == [["x_dof"], ["y_dof"], ["z_dof"]]
    assert (moved.find("dof").text, moved.find("value").text, moved.find("value").get("lc")) == ("x", "0.5", "1")
    # 3 N on 3 mm².
    assert [float(x) for x in model.find("Loads/surface_load/traction").text.split(",")] == pytest.approx([0, 1, 0])


def test_constants_are_in_febios_conventions(ball, octant):
    case = ball()
    kind, constants = constants_of(written(case, octant, body=create("yeoh-3", {"C10": 1, "C20": 2, "C30": 3}, D1=1.0)))
    assert kind == "Yeoh"
    assert constants == {"density": 1e-9, "c1": 1.0, "c2": 4.0, "c3": 9.0, "k": 2.0, "pressure_model": 2.0}
    kind, constants = constants_of(written(case, octant, body=create("ogden-1", {"mu1": 0.3, "alpha1": 4.0}, D1=1.0)))
    assert (kind, constants["c1"], constants["m1"]) == ("Ogden", 0.6, 4.0)
    kind, constants = constants_of(written(case, octant, body=create("neo-hookean", {"C10": 0.3})))
    assert (kind, constants["c1"], constants["c2"]) == ("Mooney-Rivlin", 0.3, 0.0)
    kind, constants = constants_of(written(case, octant, body=create("hencky", {"mu": 0.5}, poisson=0.25)))
    assert kind == "isotropic Hencky"
    assert (constants["E"], constants["v"]) == (pytest.approx(1.25), pytest.approx(0.25))
    with pytest.raises(InputError, match=r"FEBio has no such material.*arruda-boyce"):
        written(case, octant, body=create("arruda-boyce", {"mu": 0.1, "lambda_m": 2.0}))


def test_steps_and_tolerance_can_be_given(ball, octant):
    problem = problem_of(ball(), octant, build_materials(ball().materials)[0], "FEBio")
    model = ElementTree.fromstring("\n".join(feb_model(problem, Stepping(0.25, force_tolerance=1e-3))))
    control = model.find("Control")
    assert (control.find("time_steps").text, control.find("step_size").text) == ("4", "0.25")
    assert [pt.text.split(",")[1] for pt in model.find("LoadData")[1].iter("pt")] == ["0.25"] * 3
    solver = control.find("solver")
    assert [float(solver.find(f"{of}tol").text) for of in "der"] == [0.0, 0.0, pytest.approx(1e-6)]


needs_febio = pytest.mark.skipif(shutil.which("febio4") is None, reason="FEBio is not installed")

STRETCHING = ("neo-hookean", "mooney-rivlin-2", "yeoh-2", "yeoh-3", "ogden-1", "ogden-3", "gent", "hencky")


def solved(text, node, folder):
    """Return the displacement that FEBio prints last for a node."""
    (folder / "model.feb").write_text(text)
    command = ["febio4", "-i", "model.feb"]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert "N O R M A L" in run.stdout, run.stdout[-2000:]
    rows = re.findall(rf"^{node + 1} (\S+) (\S+) (\S+)$", (folder / "model.log").read_text(), re.MULTILINE)
    return np.array(rows[-1], dtype=float)


@needs_febio
def test_a_compressible_ball_swells_as_in_turgor(ball, octant, swollen, tmp_path):
    moved = solved(written(ball(), octant), octant.marker("tip")[0], tmp_path)
    np.testing.assert_allclose(moved, swollen, atol=1e-6)


@needs_febio
@pytest.mark.parametrize("model", STRETCHING)
def test_every_model_stretches_a_bar_as_its_formula_says(model, stretched, tmp_path):
    case, bar, material, corner, expected = stretched
    moved = solved(written(case, bar, body=material), corner, tmp_path)
    # Hencky's law of the volume change is another one there, equal to second order only.
    tolerance = 2e-3 if model == "hencky" else 2e-6
    np.testing.assert_allclose(moved, expected, atol=tolerance)


@needs_febio
def test_weight_and_a_force_pull_a_bar(hanging, tmp_path):
    case, bar, end, expected = hanging
    assert solved(written(case, bar), end, tmp_path)[2] == pytest.approx(expected, rel=0.01)
