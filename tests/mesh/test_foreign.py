"""Mesh files of other programs: written here by meshio or by hand, as those programs write them."""

import meshio
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.mesh.cells import CELLS
from turgor.mesh.decks import write_deck
from turgor.mesh.elevate import KINDS, completed
from turgor.mesh.faces import boundary_faces
from turgor.mesh.files import read
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle, shell_octant

CUBE = """*Heading
 two bricks, one upon the other
** the second in a set of its own
*Node, nset=Nall
 1, 0., 0., 0.
 2, 1., 0., 0.
 3, 1., 1., 0.
 4, 0., 1., 0.
 15, 0., 0., 1.
 16, 1., 0., 1.
 17, 1., 1., 1.
 18, 0., 1., 1.
 29, 0., 0., 3.
 30, 1., 0., 3.
 31, 1., 1., 3.
 32, 0., 1., 3.
*Element, type=C3D8R
 7, 1, 2, 3, 4, 15,
   16, 17, 18
 9, 15, 16, 17, 18, 29, 30, 31, 32
*Elset, elset=Lower
 7,
*Elset, elset=Upper, generate
 9, 9, 1
*Nset, nset=Held
 1, 2, 3, 4
*Nset, nset=Probe
 31,
*Surface, type=ELEMENT, name=Top_Face
 Upper, S2
*Solid Section, elset=Lower, material=soft
*Solid Section, elset=Upper, material=stiff
"""


def hollow(lengths=(3.0, 3.0, 3.0)):
    """A block of 27 bricks without the middle one, in tetrahedra."""
    block = box(lengths, (3, 3, 3))
    centres = block.points[block.cells[:, :4]].mean(axis=1) / np.array(lengths)
    kept = ~(np.abs(centres - 0.5) < 1 / 6).all(axis=1)
    used, cells = np.unique(block.cells[kept], return_inverse=True)
    return block.points[used], cells.reshape(-1, 10).astype(np.int32)


@pytest.mark.parametrize("kind", KINDS)
def test_cells_of_every_kind_keep_their_shape_and_share_their_nodes(kind):
    cell = CELLS[KINDS[kind].cell]
    whole = box((2.0, 1.0, 1.0), (2, 1, 1), cell.name) if cell.dimension == 3 else rectangle((2, 1), (2, 1), cell.name)
    points, cells = completed(whole.points, whole.cells[:, : KINDS[kind].n_nodes], KINDS[kind])
    np.testing.assert_allclose(points[cells], whole.points[whole.cells], atol=1e-14)
    assert len(np.unique(cells)) == whole.n_points


def test_a_serendipity_brick_keeps_its_curved_faces():
    cell = CELLS["hex27"]
    bent = cell.nodes + np.column_stack([0.2 * cell.nodes[:, 1] ** 2, 0 * cell.nodes[:, :2]])
    points, cells = completed(bent[:20], np.arange(20, dtype=np.int32)[None], KINDS["hexahedron20"])
    # Quadratic functions are among the serendipity ones.
    np.testing.assert_allclose(points[cells[0]], bent, atol=1e-14)


def test_an_abaqus_file_brings_sets_sections_and_surfaces(tmp_path, caplog):
    (tmp_path / "cube.inp").write_text(CUBE)
    with caplog.at_level("WARNING"):
        mesh = read(tmp_path / "cube.inp")
    assert "straight edges" in caplog.text
    assert mesh.cell_type == "hex27"
    assert {name: mesh.volume(name) for name in mesh.regions} == pytest.approx({"lower": 1.0, "upper": 2.0})
    assert set(mesh.surfaces) == {"held", "top-face", "outer"}
    assert (mesh.points[mesh.surface_nodes("held"), 2] == 0.0).all()
    assert (mesh.points[mesh.surface_nodes("top-face"), 2] == 3.0).all()
    assert mesh.surface_area("outer") == pytest.approx(12.0)
    np.testing.assert_array_equal(mesh.points[mesh.marker("probe")], [[1.0, 1.0, 3.0]])


def test_a_deck_of_ours_comes_back(tmp_path):
    shell = shell_octant(1.0, 1.5, 1)
    half = np.arange(shell.n_cells) % 2 == 0
    regions = {"body": np.flatnonzero(half), "base": np.flatnonzero(~half)}
    mesh = Mesh(shell.points, shell.cells, regions, shell.surfaces, {"tip": [3]})
    write_deck(mesh, tmp_path / "shell.inp")
    back = read(tmp_path / "shell.inp")
    assert {name: back.volume(name) for name in back.regions} == pytest.approx({n: mesh.volume(n) for n in regions})
    for name in mesh.surfaces:
        assert back.surface_area(name) == pytest.approx(mesh.surface_area(name))
    np.testing.assert_allclose(back.points[back.marker("tip")], mesh.points[[3]])


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_a_pocket_is_a_cavity_and_groups_are_names(suffix, tmp_path):
    points, cells = hollow()
    skin = boundary_faces(cells)
    bottom = skin[(points[skin, 2] == 0.0).all(axis=1)]
    blocks = [("tetra10", cells), ("triangle6", bottom)]
    number = [np.full(len(cells), 4), np.full(len(bottom), 5)]
    path = tmp_path / f"hollow{suffix}"
    if suffix == ".msh":
        names = {"Soft Part": np.array([4, 3]), "Mount": np.array([5, 2])}
        data = {"gmsh:physical": number, "gmsh:geometrical": number}
        meshio.gmsh.write(path, meshio.Mesh(points, blocks, cell_data=data, field_data=names), "2.2", binary=False)
    else:
        meshio.vtu.write(path, meshio.Mesh(points, blocks, cell_data={"MaterialIds": number}))
    mesh = read(path)
    mount, region = ("mount", "soft-part") if suffix == ".msh" else ("region-5", "region-4")
    assert set(mesh.regions) == {region}
    assert set(mesh.surfaces) == {mount, "cavity", "outer"}
    assert mesh.enclosed_volume("cavity") == pytest.approx(1.0)
    assert mesh.surface_area(mount) == pytest.approx(9.0)
    assert mesh.surface_area("outer") == pytest.approx(45.0)


def test_cells_that_another_program_turns_the_other_way_are_turned(tmp_path):
    points, cells = hollow()
    mirrored = cells[:, CELLS["tet10"].mirrored]
    meshio.vtu.write(tmp_path / "hollow.vtu", meshio.Mesh(points, [("tetra10", mirrored)]))
    assert read(tmp_path / "hollow.vtu").volume() == pytest.approx(26.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("C3D8R", "C3D6"), "no elements of a kind that is known"),
        ((" 9, 15, 16", " 9, 15, 99"), "a node that the file does not define.*99"),
        (("Upper, S2", "Uper, S2"), "a set is named that the file does not define.*UPER"),
        (("17, 18, 29, 30, 31, 32", "17, 18, 29, 30, 31"), "too few or too many nodes"),
        (("1., 3.", "1., x"), "not a readable mesh file"),
        (("*Elset, elset=Lower\n 7,", "*Elset, elset=Lower\n 7, 9"), "a cell is in the sets 'LOWER' and 'UPPER'"),
        (
            ("*Elset, elset=Lower\n 7,", "*Elset, elset=Lower, generate\n 7, 7, 0"),
            "GENERATE.*7, 7, 0.*a step of 1",
        ),
        (("*Elset, elset=Lower\n 7,", "*Elset, elset=Lower, generate\n 7, 999999999999"), "GENERATE.*at most 10000000"),
        (("*Elset, elset=Lower", "*Include, input=gone.inp\n*Elset, elset=Lower"), "no such file to include.*gone.inp"),
        (("*Elset, elset=Lower", "*Include\n*Elset, elset=Lower"), "to be included and not named"),
        (("*Elset, elset=Lower", "*Include, input=cube.inp\n*Elset, elset=Lower"), "include each other without end"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(change, message, tmp_path):
    assert CUBE.count(change[0]) >= 1
    (tmp_path / "cube.inp").write_text(CUBE.replace(*change))
    with pytest.raises(InputError, match=message) as found:
        read(tmp_path / "cube.inp")
    assert found.value.file == str(tmp_path / "cube.inp")


def test_mixed_cells_are_refused(tmp_path):
    points = np.vstack([CELLS["hex27"].nodes[:8], [[0.5, 0.5, 2.0]]])
    blocks = [("hexahedron", np.arange(8)[None]), ("pyramid", np.array([[4, 5, 6, 7, 8]]))]
    meshio.vtu.write(tmp_path / "house.vtu", meshio.Mesh(points, blocks))
    with pytest.raises(InputError, match=r"mixes cells of several kinds .*hexahedron, pyramid"):
        read(tmp_path / "house.vtu")


@pytest.mark.parametrize("size", [4, 10])
def test_cells_that_are_there_twice_are_refused_with_the_place_of_the_first(size, tmp_path):
    points, cells = hollow()
    # The corners come in another order, as where another part of the file repeats a cell.
    again = cells[[40, 9], :][:, [1, 2, 0, 3, 5, 6, 4, 8, 9, 7]]
    x, y, z = points[cells[9, :4]].mean(axis=0)
    repeated = meshio.Mesh(points, [("tetra" if size == 4 else "tetra10", np.vstack([cells, again])[:, :size])])
    meshio.vtu.write(tmp_path / "twice.vtu", repeated)
    place = rf"cells are there more than once: 2 of {len(cells) + 2}, .*\({x:.6g}, {y:.6g}, {z:.6g}\)"
    with pytest.raises(InputError, match=place):
        read(tmp_path / "twice.vtu")


def test_a_face_of_three_cells_is_refused_with_its_place(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 2]])
    cells = np.array([[0, 1, 2, 3], [0, 2, 1, 4], [0, 1, 2, 5]])
    meshio.vtu.write(tmp_path / "three.vtu", meshio.Mesh(points, [("tetra", cells)]))
    with pytest.raises(InputError, match=r"faces belong to more than two cells: 1, .*\(0.333333, 0.333333, 0\)"):
        read(tmp_path / "three.vtu")


def test_an_edge_of_three_plane_cells_is_refused(tmp_path):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 1, 0]])
    cells = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    meshio.vtu.write(tmp_path / "three.vtu", meshio.Mesh(points, [("triangle", cells)]))
    with pytest.raises(InputError, match=r"edges belong to more than two cells: 1, .*\(0.5, 0\)"):
        read(tmp_path / "three.vtu")
