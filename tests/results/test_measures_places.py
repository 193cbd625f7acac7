"""Measures at points, over surfaces and of forces, each against a closed form."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from results.hollow_finger import HEIGHT, LENGTH, hollow_finger, moved, rod

from turgor.common.errors import InputError
from turgor.geometry.section import PlaneSection
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle
from turgor.results.measures import Choice, check, evaluate
from turgor.results.stored import Body, StoredState

FINGER = Body(hollow_finger())
GRADIENT = np.array([[1.3, 0.2, 0.0], [0.0, 0.9, -0.4], [0.1, 0.0, 1.1]])
AFFINE = FINGER.mesh.points @ (GRADIENT - np.eye(3)).T + [5.0, -3.0, 2.0]


def one(state: StoredState, name: str, /, **parameters: object) -> dict[str, float]:
    return evaluate([Choice.read({name: parameters})], state)


def test_any_point_moves_with_the_material_around_it() -> None:
    place = np.array([2.3, -1.7, 4.9])
    found = one(moved(FINGER, AFFINE), "displacement", at=[f"{x} mm" for x in place], name="here")
    expected = (GRADIENT - np.eye(3)) @ place + [5.0, -3.0, 2.0]
    for axis, value in zip("xyz", expected, strict=True):
        assert found[f"displacement_here_{axis}_mm"] == pytest.approx(value, abs=1e-9)


def test_the_tip_is_where_it_began_plus_its_displacement() -> None:
    state = moved(FINGER, rod(FINGER.mesh.points, 1.0))
    position, displacement = (one(state, name) for name in ("tip_position", "tip_displacement"))
    for axis, start in zip("xyz", (LENGTH, 0.0, -HEIGHT / 2), strict=True):
        assert position[f"tip_position_{axis}_mm"] == pytest.approx(start + displacement[f"tip_displacement_{axis}_mm"])


def test_the_chord_may_run_between_markers() -> None:
    # The marker's line lies 6 mm below the axis and bends to an arc as well: its chord turns by half the angle.
    state = moved(FINGER, rod(FINGER.mesh.points, math.radians(80.0)))
    assert one(state, "chord-angle", base="base", tip="tip")["chord_angle_deg"] == pytest.approx(40.0)


def test_extents_grow_in_percent() -> None:
    stretched = moved(FINGER, FINGER.mesh.points * [0.5, -0.1, 0.0])
    assert one(stretched, "expansion", axis="x")["expansion_x_percent"] == pytest.approx(50.0)
    assert one(stretched, "expansion", axis="y")["expansion_y_percent"] == pytest.approx(-10.0)


def test_volumes_are_those_of_the_slice_and_of_the_full_turn() -> None:
    grid = rectangle((9.0, 8.0), (3, 4), corner=(0.0, -4.0))
    centres = grid.points[grid.cells].mean(axis=1)
    hole = (centres[:, 0] < 6.0) & (np.abs(centres[:, 1]) < 2.0)
    nodes, cells = np.unique(grid.cells[~hole], return_inverse=True)
    mesh = Mesh(grid.points[nodes], cells.reshape(-1, 9))
    faces = np.array([f for f in boundary_faces(mesh.cells) if _on_hole(mesh.points[f])])
    mesh = Mesh(mesh.points, mesh.cells, surfaces={"cavity": faces})
    rest = np.zeros_like(mesh.points)
    turned = Body(mesh, PlaneSection("axisymmetric"))
    assert turned.enclosed_volume("cavity", rest) == pytest.approx(math.pi * 36.0 * 4.0)
    swollen = moved(turned, mesh.points * [0.1, 0.0])
    assert one(swollen, "enclosed_volume", surface="cavity")["enclosed_volume_cavity_mm3"] == pytest.approx(
        math.pi * 36.0 * 1.21 * 4.0
    )
    assert one(swollen, "expansion", axis="x")["expansion_x_percent"] == pytest.approx(10.0)
    flat = Body(mesh, PlaneSection("plane-strain", 20.0))
    assert flat.enclosed_volume("cavity", rest) == pytest.approx(6.0 * 4.0 * 20.0)


def _on_hole(points: np.ndarray) -> bool:
    inside = (points[:, 0] <= 6.0 + 1e-9).all() and (np.abs(points[:, 1]) <= 2.0 + 1e-9).all()
    return bool(inside and (points[:, 0] > 1e-9).any())


def test_stress_over_a_surface_is_weighted_by_area() -> None:
    x = FINGER.mesh.points[:, 0]
    state = moved(FINGER, np.zeros_like(FINGER.mesh.points), von_mises=x / LENGTH)
    found = one(state, "von_mises", surface="outer")
    assert found["von_mises_outer_max_MPa"] == pytest.approx(1.0)
    assert found["von_mises_outer_mean_MPa"] == pytest.approx(0.5)
    assert found["von_mises_outer_p99_MPa"] == pytest.approx(0.99, abs=0.02)
    wall = one(state, "von_mises", surface="mount")
    assert wall["von_mises_mount_max_MPa"] == wall["von_mises_mount_mean_MPa"] == 0.0
    assert one(state, "von_mises")["von_mises_mean_MPa"] == pytest.approx(0.5)
    # Turned about y, the mean over the disc of a stress r/R is 2/3.
    disc = rectangle((9.0, 1.0), (4, 1))
    body = Body(disc, PlaneSection("axisymmetric"))
    radial = moved(body, np.zeros_like(disc.points), von_mises=disc.points[:, 0] / 9.0)
    assert one(radial, "von_mises", surface="y1")["von_mises_y1_mean_MPa"] == pytest.approx(2.0 / 3.0)
    assert one(radial, "von_mises", region="body")["von_mises_body_mean_MPa"] == pytest.approx(2.0 / 3.0)


def test_the_percentile_does_not_exceed_the_largest_stress() -> None:
    # With 0 at the corners and 1 at the middles of the edges, the quadratic shape functions give 4/3 in a triangle.
    stress = np.ones(FINGER.mesh.n_points)
    stress[FINGER.mesh.cells[:, :4]] = 0.0
    state = moved(FINGER, np.zeros_like(FINGER.mesh.points), von_mises=stress)
    for chosen, key in (({"surface": "outer"}, "outer_"), ({"region": "body"}, "body_"), ({}, "")):
        found = one(state, "von_mises", **chosen)
        assert 1.0 < found[f"von_mises_{key}p99_MPa"] <= found[f"von_mises_{key}max_MPa"] <= 4.0 / 3.0


def test_the_force_on_a_rigid_body_is_its_size() -> None:
    body = Body(FINGER.mesh, rigid_bodies=("table", "wall"))
    standing = {"contact": {"table": {"force_N": [0.0, 3.0, -4.0]}, "wall": {"force_N": [1.0, 0.0, 0.0]}}}
    state = moved(body, np.zeros_like(FINGER.mesh.points), standing=standing)
    assert one(state, "tip_force", body="table") == {"tip_force_N": 5.0}
    with pytest.raises(InputError, match=r"several rigid bodies; expected one of: table, wall"):
        check([Choice.read("tip_force")], body)
    with pytest.raises(InputError, match=r"meets no rigid body; expected a rigid body under contact.bodies"):
        check([Choice.read("tip-force")], FINGER)


def test_the_reaction_at_a_support_turns_about_the_point_that_is_named() -> None:
    body = Body(FINGER.mesh, supports=("mount", "symmetry"))
    facts = {"force_N": [0.0, 3.0, -4.0], "torque_N_mm": [1.0, 0.0, 0.0], "about_mm": [0.0, 0.0, 2.0]}
    state = moved(body, np.zeros_like(FINGER.mesh.points), standing={"supports": {"mount": facts}})
    found = one(state, "reaction", surface="mount")
    assert [found[f"reaction_mount_{key}N"] for key in ("x_", "y_", "z_", "")] == [0.0, 3.0, -4.0, 5.0]
    assert [found[f"reaction_mount_torque_{axis}_N_mm"] for axis in "xyz"] == [1.0, 0.0, 0.0]
    # T = (0 0 2 − 10 0 0) × (0 3 −4) + (1 0 0)
    moment = one(state, "reaction", surface="mount", about=["10 mm", "0 mm", "0 mm"], name="foot")
    assert [moment[f"reaction_mount_foot_torque_{axis}_N_mm"] for axis in "xyz"] == [-5.0, -40.0, -30.0]
    with pytest.raises(InputError, match=r"no support holds this surface .*expected one of: mount, symmetry"):
        check([Choice.read({"reaction": {"surface": "outer"}})], body)


MARKERS = [["20 mm", "6 mm", "0 mm"], ["60 mm", "6 mm", "0 mm"], ["100 mm", "6 mm", "0 mm"]]


def table(path: Path, offsets: np.ndarray, header: str = "pressure (bar),marker,x (cm),y (cm),z (cm)") -> Path:
    """Markers of a finger at rest and at 0.4 bar, where it is bent by one radian, moved by `offsets` (3, 3) in mm."""
    rest = np.array([[float(x.split()[0]) for x in place] for place in MARKERS])
    bent = rest + rod(rest, 1.0) + offsets
    rows = [f"{p},{n + 1},{','.join(map(repr, (place / 10).tolist()))}"
            for p, places in ((0.0, rest), (0.4, bent)) for n, place in enumerate(places)]  # fmt: skip
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def at_pressure(pressure: float) -> StoredState:
    return moved(FINGER, rod(FINGER.mesh.points, 1.0), loads={"pressure:cavity": pressure})


def test_markers_are_held_against_measured_positions(tmp_path: Path) -> None:
    offsets = np.array([[3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    file = table(tmp_path / "markers.csv", offsets)
    found = one(at_pressure(0.04), "marker_rmse", file=str(file), at=MARKERS)
    assert found["marker_rmse_percent"] == pytest.approx(math.sqrt(25.0 / 3.0) / LENGTH * 100.0, rel=1e-4)
    longer = one(at_pressure(0.04), "marker_rmse", file=str(file), at=MARKERS, length="200 mm", name="camera")
    assert longer["marker_rmse_camera_percent"] == pytest.approx(0.5 * found["marker_rmse_percent"])
    assert math.isnan(one(at_pressure(0.03), "marker_rmse", file=str(file), at=MARKERS)["marker_rmse_percent"])


def test_only_the_coordinates_that_were_measured_count(tmp_path: Path) -> None:
    file = tmp_path / "side.csv"
    full = table(tmp_path / "markers.csv", np.array([[0.0, 5.0, 0.0]] * 3)).read_text(encoding="utf-8").splitlines()
    kept = [",".join(cell for place, cell in enumerate(line.split(",")) if place != 3) for line in full]
    file.write_text("\n".join(kept), encoding="utf-8")
    found = one(at_pressure(0.04), "marker_rmse", file=str(file), at=MARKERS)
    assert found["marker_rmse_percent"] == pytest.approx(0.0, abs=1e-3)  # y, where they differ, is not in the table


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("pressure (bar)", "pressure"), "the unit is missing"),
        (("x (cm)", "x (bar)"), "is not a unit of length"),
        (("marker,", "number,"), "there is no column 'marker'"),
        (("0.4,3,", "0.4,2,"), "this marker is not one more"),
        (("0.4,3,", "0.5,3,"), "marker 3 is missing at 40 kPa"),
        (("0.4,3,", "0.4,3,oops"), "this cell is not a number"),
        (("0.4,3,", "0.4,3,7,"), "row 7: this row has more cells than the header"),
        (("0.4,3,", "0.4,3e9,"), r"row 7, column 'marker': this is not the number of a marker \(found '3e9'\)"),
        (("0.4,3,", "0.4,2.5,"), r"row 7, column 'marker': .*found '2.5'"),
        (("0.0,1,", "0.0,0,"), r"row 2, column 'marker': .*found '0'.*from 1 to that of the rows, 6"),
        (("y (cm)", "x (cm)"), r"columns 3 and 4: two columns hold the x"),
    ],
)
def test_a_table_that_is_not_well_formed_is_refused(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    file = table(tmp_path / "markers.csv", np.zeros((3, 3)))
    file.write_text(file.read_text(encoding="utf-8").replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=words) as caught:
        check([Choice.read({"marker_rmse": {"file": str(file), "at": MARKERS}})], FINGER)
    assert "markers.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        ({"displacement": {}}, r"displacement.at: this key is missing"),
        ({"displacement": {"at": ["0 mm", "0 mm", "0"]}}, r"a unit is missing"),
        ({"displacement": {"at": ["0 mm", "99 mm", "0 mm"]}}, r"the point lies outside the body at \(0, 99, 0\) mm"),
        ({"displacement": {"at": ["50 mm", "0 mm", "0 mm"]}}, r"the point lies outside the body"),
        ({"von_mises": {"surface": "inside"}}, r"no surface of this name"),
        ({"von_mises": {"surface": "outer", "region": "body"}}, r"region: a surface and a region are given"),
        ({"interface_stress": {"first": "body", "second": "base"}}, r"second: the mesh has no such region"),
        ({"expansion": {"axis": "up"}}, r"expansion.axis.*'x', 'y' or 'z'"),
        ({"marker_rmse": {"file": "nowhere.csv", "at": MARKERS}}, r"no such file.*nowhere.csv"),
        ({"twist": {}, "coil": {}}, r"there is no such measure"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_a_run(choice: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        check([Choice.read(choice)], FINGER)


@pytest.mark.parametrize("other", ["far", "near"])
def test_regions_that_do_not_touch_have_no_interface(other: str) -> None:
    bar = box((9.0, 1.0, 1.0), (3, 1, 1), "hex27")
    cells = {name: np.array([k], np.int32) for k, name in enumerate(("near", "middle", "far"))}
    body = Body(Mesh(bar.points, bar.cells, regions=cells, surfaces=bar.surfaces))
    check([Choice.read({"interface_stress": {"first": "middle", "second": other}})], body)
    with pytest.raises(InputError, match=f"interface_stress.second: the two regions have no interface.*'{other}'"):
        check([Choice.read({"interface_stress": {"first": "near", "second": other}})], body)


def test_two_measures_of_a_kind_need_names() -> None:
    places = [{"displacement": {"at": place}} for place in MARKERS[:2]]
    with pytest.raises(InputError, match=r"two measures are called 'displacement_x_mm'.*'name' of their own"):
        check([Choice.read(place) for place in places], FINGER)


def test_measures_that_a_model_has_no_room_for_are_refused() -> None:
    strip = rectangle((9.0, 8.0), (2, 2))
    named = Mesh(strip.points, strip.cells, surfaces={"mount": strip.surfaces["y0"], "tip-face": strip.surfaces["y1"]})
    with pytest.raises(InputError, match=r"'twist' has no meaning in a plane section; expected a body in space"):
        check([Choice.read("twist")], Body(named, PlaneSection("plane-stress", 1.0)))
    turned = Body(named, PlaneSection("axisymmetric"))
    with pytest.raises(InputError, match=r"'bending_angle' has no meaning in a body of revolution"):
        check([Choice.read("bending_angle")], turned)
    with pytest.raises(InputError, match=r"axis: a plane model has no such extent"):
        check([Choice.read({"expansion": {"axis": "z"}})], turned)
    with pytest.raises(InputError, match=r"outside the plane of the model"):
        check([Choice.read({"displacement": {"at": ["1 mm", "1 mm", "1 mm"]}})], turned)
    longer = moved(turned, named.points * [0.3, 0.25])
    assert one(longer, "elongation")["elongation_mm"] == pytest.approx(2.0)


def test_a_choice_is_written_as_it_is_read() -> None:
    plain = {"displacement": {"at": ["1 mm", "2 mm", "3 mm"], "name": "here"}}
    assert Choice.read(plain).plain() == plain
    assert Choice.read(Choice.read(plain).plain()) == Choice.read(plain)
    assert Choice.read({"centreline": {"stations": 20}}).plain() == "centreline"
    assert Choice.read("bending-angle").plain() == "bending_angle"
