"""What CalculiX makes of an exported case, against Turgor and against closed forms."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials.registry import create
from turgor.study.export.calculix import inp_model
from turgor.study.export.problem import problem_of
from turgor.study.materials import build_materials

needs_calculix = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")

STRETCHING = (
    *("neo-hookean", "mooney-rivlin-2", "mooney-rivlin-5", "mooney-rivlin-9", "yeoh-2", "yeoh-3", "ogden-1", "ogden-3"),
    "arruda-boyce",
)


def solved(lines, folder):
    """Return the displacement that CalculiX prints last for each node."""
    (folder / "model.inp").write_text("\n".join(lines) + "\n")
    run = subprocess.run(["ccx", "model"], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert "Job finished" in run.stdout, run.stdout[-1000:]
    rows = [line.split() for line in (folder / "model.dat").read_text().splitlines()]
    return {int(row[0]) - 1: np.array([float(x) for x in row[1:]]) for row in rows if len(row) == 4}


def lines_of(case, mesh, **materials):
    return inp_model(problem_of(case, mesh, materials or build_materials(case.materials)[0], "CalculiX"))


@needs_calculix
def test_a_compressible_ball_swells_as_in_turgor(ball, octant, swollen, tmp_path):
    (moved,) = solved(lines_of(ball(), octant), tmp_path).values()
    np.testing.assert_allclose(moved, swollen, atol=0.01 * swollen[2])


@needs_calculix
@pytest.mark.parametrize("model", STRETCHING)
def test_every_model_stretches_a_bar_as_its_formula_says(model, stretched, tmp_path):
    case, bar, material, corner, expected = stretched
    moved = solved(lines_of(case, bar, body=material), tmp_path)[corner]
    # Arruda and Boyce's law of the volume change is another one there, equal to second order only.
    tolerance = 2e-3 if model == "arruda-boyce" else 2e-6
    np.testing.assert_allclose(moved, expected, atol=tolerance)


@needs_calculix
def test_weight_and_a_force_pull_a_bar(hanging, tmp_path):
    case, bar, end, expected = hanging
    assert solved(lines_of(case, bar), tmp_path)[end][2] == pytest.approx(expected, rel=0.01)


def test_each_state_is_the_end_of_a_step(ball, octant):
    text = "\n".join(lines_of(ball(), octant))
    assert text.count("*STEP, NLGEOM") == 2
    assert set(re.findall(r"^CAVITY_S\d, P\d, (\S+)$", text, re.MULTILINE)) == {"0.0125", "0.025"}
    assert "X0, 1, 1\nY0, 2, 2\nZ0, 3, 3" in text
    # CalculiX drops what follows the twentieth character of a number.
    assert max(len(word) for line in text.splitlines() if line[0].isdigit() for word in line.split(", ")) <= 20


SWELLING = {"type": "pressure"}
UP = {"time": ["0 s", "1 s"], "pressure": ["0 kPa", "5 kPa"]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact": True}, "contact: this is not written for CalculiX"),
        ({"loads": [SWELLING], "control": {"type": "volume", "target": "150 %"}}, r"control\.type: this is not"),
        ({"loads": [{**SWELLING, "programme": UP}]}, r"loads\.0\.programme: this is not written"),
        ({"supports": [{"type": "elastic", "surface": "x0", "stiffness": "1 N/mm^3"}]}, "a bed of springs"),
        ({"supports": [{"type": "sliding", "surface": "outer"}]}, r"supports\.0\.surface: a sliding surface"),
    ],
)  # fmt: skip
def test_what_calculix_lacks_is_refused(changes, message, ball, octant):
    with pytest.raises(InputError, match=message):
        list(lines_of(ball(**changes), octant))


@pytest.mark.parametrize("model", ["gent", "hencky", "van-der-waals", "extended-tube"])
def test_a_model_that_calculix_lacks_is_refused_by_its_name(model, ball, octant):
    constants = {
        "gent": {"mu": 0.1, "Jm": 50.0},
        "hencky": {"mu": 0.1},
        "van-der-waals": {"mu": 0.1, "lambda_m": 8.0, "a": 0.2, "beta": 0.0},
        "extended-tube": {"Gc": 0.1, "delta": 0.1, "Ge": 0.1, "beta": 0.5},
    }
    with pytest.raises(InputError, match=f"CalculiX has no such material.*{model}"):
        list(lines_of(ball(), octant, body=create(model, constants[model])))
