import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.optimize import fsolve

from turgor.common.errors import InputError
from turgor.geometry.pneunet import PneuNet
from turgor.mesh.decks import write_deck
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box

MU, BULK, TRACTION = 0.1, 0.5, 0.08


def stretched_bar():
    """Stretches along and across a compressible neo-Hookean bar (W = μ/2 (Ī1 − 3) + K/2 (J − 1)²) pulled at its end."""

    def unbalanced(stretches):
        along, across = stretches
        volume = along * across**2
        squares = volume ** (-2 / 3) * np.array([along**2, across**2])
        mean = (squares[0] + 2 * squares[1]) / 3
        stress = MU / volume * (squares - mean) + BULK * (volume - 1)
        return stress - [TRACTION, 0.0]

    return fsolve(unbalanced, [1.2, 0.95], xtol=1e-12)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_stretches_an_exported_bar_as_it_should(tmp_path):
    write_deck(box((2.0, 1.0, 1.0), (2, 1, 1)), tmp_path / "mesh.inp")
    text = (tmp_path / "mesh.inp").read_text()
    faces = sorted(set(re.findall(r"X1_S(\d)", text)))
    deck = [
        "*INCLUDE, INPUT=mesh.inp",
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE",
        f"{MU / 2}, {2 / BULK}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=RUBBER",
        "*BOUNDARY",
        *(f"{face}0, {axis}, {axis}" for axis, face in enumerate("XYZ", start=1)),
        "*STEP, NLGEOM",
        "*STATIC",
        "0.25, 1.0",
        "*DLOAD",
        *(f"X1_S{face}, P{face}, {-TRACTION}" for face in faces),
        "*NODE PRINT, NSET=ALL_NODES, FREQUENCY=100",
        "U",
        "*END STEP",
    ]
    (tmp_path / "bar.inp").write_text("\n".join(deck) + "\n")
    run = subprocess.run(["ccx", "bar"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert "Job finished" in run.stdout, run.stdout[-1000:]
    rows = [line.split() for line in (tmp_path / "bar.dat").read_text().splitlines()]
    moved = np.array([[float(x) for x in row[1:]] for row in rows if len(row) == 4 and row[0].isdigit()])
    along, across = stretched_bar()
    assert along > 1.2
    expected = box((2.0, 1.0, 1.0), (2, 1, 1)).points * [along - 1, across - 1, across - 1]
    # CalculiX stops at half a percent of the force.
    np.testing.assert_allclose(moved, expected, atol=1e-3)


def test_an_inp_names_everything(tmp_path):
    mesh = generate(PneuNet(chambers=1), 4.0)
    write_deck(mesh, tmp_path / "finger.inp")
    text = (tmp_path / "finger.inp").read_text()
    assert len(re.findall(r"^\d+, \S+, \S+, \S+$", text, re.M)) >= mesh.n_points
    for keyword in (
        "*ELEMENT, TYPE=C3D10, ELSET=BODY",
        "*ELEMENT, TYPE=C3D10, ELSET=BASE",
        "*NSET, NSET=TIP_FACE",
        "*NSET, NSET=CENTRELINE",
        "*SURFACE, NAME=CAVITY, TYPE=ELEMENT",
    ):
        assert f"{keyword}\n" in text
    assert max(len(line) for line in text.splitlines()) < 133
    first = text.split("*ELEMENT, TYPE=C3D10, ELSET=BODY\n")[1].splitlines()[0]
    cell = mesh.region("body")[0]
    assert [int(number) for number in first.split(",")] == [cell + 1, *(mesh.cells[cell] + 1)]


def test_a_feb_holds_the_mesh(tmp_path):
    mesh = generate(PneuNet(chambers=1), 4.0)
    write_deck(mesh, tmp_path / "finger.feb")
    stored = ElementTree.parse(tmp_path / "finger.feb").getroot().find("Mesh")
    points = [[float(x) for x in node.text.split(",")] for node in stored.find("Nodes")]
    np.testing.assert_array_equal(points, mesh.points)
    elements = {block.get("name"): block for block in stored.findall("Elements")}
    for name, cells in mesh.regions.items():
        found = [[int(x) - 1 for x in element.text.split(",")] for element in elements[name]]
        np.testing.assert_array_equal(found, mesh.cells[cells])
    surfaces = {block.get("name"): block for block in stored.findall("Surface")}
    found = [[int(x) - 1 for x in face.text.split(",")] for face in surfaces["cavity"]]
    np.testing.assert_array_equal(found, mesh.surface("cavity"))
    assert {block.get("name") for block in stored.findall("NodeSet")} >= {"mount", "tip", "centreline"}


def test_what_cannot_be_written_is_refused(tmp_path):
    block = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=r"expected a name that ends in \.inp or \.feb"):
        write_deck(block, tmp_path / "mesh.bdf")
    with pytest.raises(InputError, match="cannot be written"):
        write_deck(block, tmp_path / "no" / "mesh.inp")
    twins = Mesh(block.points, block.cells, surfaces={"a-b": block.surface("x0"), "a b": block.surface("x1")})
    with pytest.raises(InputError, match=r"two names become the same label .*A_B"):
        write_deck(twins, tmp_path / "mesh.inp")
