import math
import re
from pathlib import Path

import gmsh
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry import cad
from turgor.geometry.imported.step import StepFile
from turgor.mesh.generate import generate

BOTTOM = {"normal": (0, 0, -1), "nearest": ("0 mm", "0 mm", "0 mm")}
TOP = {"normal": (0, 0, 1), "nearest": ("0 mm", "0 mm", "20 mm")}


def write(path, draw):
    with cad.session("part"):
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return str(path)


@pytest.fixture(scope="module")
def hollow(tmp_path_factory):
    """A block of 10 × 10 × 20 mm with a cylindrical and a smaller spherical pocket."""

    def draw(occ):
        block = occ.addBox(-5, -5, 0, 10, 10, 20)
        occ.cut([(3, block)], [(3, occ.addCylinder(0, 0, 3, 0, 0, 8, 3)), (3, occ.addSphere(0, 0, 15.5, 2))])

    return write(tmp_path_factory.mktemp("step") / "hollow.step", draw)


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    """Two cylinders, one on the other."""

    def draw(occ):
        occ.addCylinder(0, 0, 0, 0, 0, 8, 4)
        occ.addCylinder(0, 0, 8, 0, 0, 12, 3)

    path = tmp_path_factory.mktemp("step") / "assembly.stp"
    text = Path(write(path, draw)).read_text()
    # gmsh writes no names; other programs do, in these places.
    for number, name in (("1", "Soft Part"), ("2", "Stiff Part")):
        text = re.sub(rf"'Open CASCADE STEP translator [\d.]+ \d+\.{number}'", f"'{name}'", text)
    assert text.count("Stiff Part") >= 1
    path.write_text(text)
    return str(path)


def test_bodies_without_names_are_numbered(tmp_path):
    path = write(tmp_path / "two.step", lambda occ: (occ.addBox(0, 0, 0, 1, 1, 1), occ.addBox(1, 0, 0, 1, 1, 1)))
    assert sorted(generate(StepFile(file=path, mount=BOTTOM), 1.0).regions) == ["body-1", "body-2"]


def test_pockets_are_cavities_and_rules_name_the_rest(hollow):
    mesh = generate(StepFile(file=hollow, mount=BOTTOM, tip_face=TOP), 3.0)
    assert list(mesh.regions) == ["body"]
    assert mesh.enclosed_volume("cavity-1") == pytest.approx(math.pi * 9 * 8, rel=1e-3)
    assert mesh.enclosed_volume("cavity-2") == pytest.approx(math.pi * 32 / 3, rel=5e-3)
    assert mesh.volume() == pytest.approx(2000 - math.pi * (72 + 32 / 3), rel=1e-3)
    assert mesh.surface_area("mount") == pytest.approx(100.0)
    assert mesh.surface_area("tip-face") == pytest.approx(100.0)
    assert mesh.surface_area("outer") == pytest.approx(800.0)
    assert (mesh.points[mesh.surface_nodes("mount"), 2] < 1e-9).all()
    np.testing.assert_allclose(mesh.points[mesh.marker("tip")][0, 2], 20.0)


def test_touching_bodies_share_their_interface(assembly):
    mesh = generate(StepFile(file=assembly, mount=BOTTOM, tip_face=TOP), 3.0)
    assert sorted(mesh.regions) == ["soft-part", "stiff-part"]
    assert mesh.volume("soft-part") == pytest.approx(math.pi * 16 * 8, rel=1e-3)
    assert mesh.volume("stiff-part") == pytest.approx(math.pi * 9 * 12, rel=1e-3)
    shared = np.intersect1d(mesh.cells[mesh.region("soft-part")], mesh.cells[mesh.region("stiff-part")])
    assert len(shared) > 10
    np.testing.assert_allclose(mesh.points[shared, 2], 8.0)
    assert "cavity" not in mesh.surfaces


def test_the_default_size_is_the_mean_thickness(hollow):
    part = StepFile(file=hollow, mount=BOTTOM)
    area = 1000 + 2 * math.pi * 9 + 48 * math.pi + 16 * math.pi
    assert part.default_size == pytest.approx(2 * (2000 - math.pi * (72 + 32 / 3)) / area, rel=1e-6)


def test_rules_combine(hollow):
    sides = {"within": (("4 mm", "-6 mm", "-1 mm"), ("6 mm", "6 mm", "21 mm"))}
    mesh = generate(StepFile(file=hollow, mount=BOTTOM, surfaces={"right": sides}), 4.0)
    np.testing.assert_allclose(mesh.points[mesh.surface_nodes("right"), 0], 5.0)
    near_axis = {"inside": {"point": ("0 mm", "0 mm", "0 mm"), "direction": (0, 0, 2), "radius": "7.5 mm"}}
    mesh = generate(StepFile(file=hollow, mount=BOTTOM, surfaces={"top": {**near_axis, "normal": (0, 0, 3)}}), 4.0)
    np.testing.assert_allclose(mesh.points[mesh.surface_nodes("top"), 2], 20.0)


BAD = {
    "not STEP": ({"file": "part.iges"}, "file: this is not a STEP file"),
    "absent": ({"file": "absent.step"}, "file: there is no such file"),
    "tip without face": ({"tip": ("0 mm", "0 mm", "0 mm")}, "tip: a tip needs a tip_face"),
    "name taken": ({"surfaces": {"outer": BOTTOM}}, "surfaces.outer: this name is taken"),
    "unknown rule": ({"mount": {"color": "red"}}, "mount.color"),
    "bare numbers": ({"mount": {"nearest": (0, 0, 0)}}, "mount.nearest.0: a unit is missing"),
}


@pytest.mark.parametrize(("changes", "message"), BAD.values(), ids=BAD)
def test_bad_parts_are_refused(hollow, changes, message):
    with pytest.raises(InputError, match=message):
        StepFile(**{"file": hollow, "mount": BOTTOM, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mount": {}}, "mount: no rule says what is meant"),
        ({"mount": {"normal": (1, 1, 1)}}, "mount: nothing follows these rules"),
        ({"mount": {"normal": (0, 0, 0)}}, "a direction has no length"),
        ({"tip_face": BOTTOM}, "tip_face: a face of it belongs to 'mount' already"),
        ({"surfaces": {"cavity-1": TOP}}, "surfaces.cavity-1: a closed pocket has this name"),
    ],
)
def test_rules_that_do_not_fit_the_part_are_refused(hollow, changes, message):
    with pytest.raises(InputError, match=message):
        generate(StepFile(**{"file": hollow, "mount": BOTTOM, **changes}), 4.0)


def test_a_key_that_is_missing_is_named(hollow):
    with pytest.raises(InputError, match=r"^mount: this key is missing; expected where the actuator is held$"):
        StepFile(file=hollow)
    with pytest.raises(
        InputError, match=r"^file: this key is missing \(also wrong: mount\); expected path of the file$"
    ):
        StepFile()


def test_a_file_that_is_no_step_is_refused(tmp_path):
    path = tmp_path / "letter.step"
    path.write_text("Dear Sir or Madam")
    with pytest.raises(InputError, match=r"letter\.step: the STEP file"):
        generate(StepFile(file=str(path), mount=BOTTOM), 4.0)


def test_bodies_that_overlap_are_refused(tmp_path):
    def draw(occ):
        occ.addBox(0, 0, 0, 2, 2, 2)
        occ.addBox(1, 0, 0, 2, 2, 2)

    path = write(tmp_path / "overlap.step", draw)
    with pytest.raises(InputError, match=r"overlap\.step: the bodies .* overlap"):
        generate(StepFile(file=path, mount=BOTTOM), 1.0)
