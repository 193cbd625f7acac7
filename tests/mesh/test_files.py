import re

import meshio
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.mesh.files import read, write
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quarter_ring, shell_octant

SPIRAL = np.array([[1.2, 0.1, 0.1], [1.0, 0.7, 0.2], [0.8, 0.9, 0.4]])


@pytest.fixture(scope="module")
def mesh():
    shell = shell_octant(1.0, 1.5, 1)
    half = np.arange(shell.n_cells) % 2 == 0
    return Mesh(
        shell.points,
        shell.cells,
        regions={"body": np.flatnonzero(half), "base": np.flatnonzero(~half)},
        surfaces={**shell.surfaces, "cavity": shell.surface("inner")},
        # A marker may share its name with a region, and its order counts.
        markers={"base": [0], "centreline": [5, 2, 9]},
        curves={"fibre-1": SPIRAL, "fibre-2": SPIRAL[::-1]},
    )


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_a_mesh_comes_back_with_all_its_names(mesh, suffix, tmp_path):
    path = tmp_path / f"mesh{suffix}"
    write(mesh, path)
    back = read(path)
    # Cells come back region by region; everything else to the bit.
    order = np.concatenate(list(mesh.regions.values()))
    np.testing.assert_array_equal(back.points, mesh.points)
    np.testing.assert_array_equal(back.cells, mesh.cells[order])
    assert {name: len(cells) for name, cells in back.regions.items()} == {"body": 36, "base": 36}
    for kind in ("surfaces", "markers", "curves"):
        before, after = getattr(mesh, kind), getattr(back, kind)
        assert list(before) == list(after)
        for name in before:
            np.testing.assert_array_equal(after[name], before[name], err_msg=name)


OTHER_CELLS = {
    "hex27": lambda: box((2.0, 1.0, 1.0), (2, 1, 1), "hex27"),
    "tri6": lambda: quarter_ring(1.0, 1.5, 1, "tri6"),
    "quad9": lambda: quarter_ring(1.0, 1.5, 1, "quad9"),
}


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
@pytest.mark.parametrize("make", OTHER_CELLS.values(), ids=OTHER_CELLS)
def test_other_kinds_of_cells_come_back_too(make, suffix, tmp_path):
    mesh = make()
    path = tmp_path / f"mesh{suffix}"
    write(mesh, path)
    back = read(path)
    np.testing.assert_array_equal(back.points, mesh.points)
    np.testing.assert_array_equal(back.cells, mesh.cells)
    for name in mesh.surfaces:
        assert {tuple(sorted(face)) for face in back.surface(name)} == {tuple(sorted(f)) for f in mesh.surface(name)}


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_a_cut_off_file_is_refused(mesh, suffix, tmp_path):
    path = tmp_path / f"cut{suffix}"
    write(mesh, path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=f"cut{suffix}: "):
        read(path)


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
@pytest.mark.parametrize("part", [0.05, 0.3, 0.7, 0.99])
def test_a_file_that_ends_early_is_told_in_plain_words(mesh, suffix, part, tmp_path):
    path = tmp_path / f"cut{suffix}"
    write(mesh, path)
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with pytest.raises(InputError, match=f"cut{suffix}: the file ends early") as found:
        read(path)
    assert not re.search("shape|array|index|broadcast", str(found.value))


def test_a_file_without_its_middle_is_damaged_in_plain_words(mesh, tmp_path):
    path = tmp_path / "gap.msh"
    write(mesh, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + whole[len(whole) // 2 + 1000 :])
    with pytest.raises(InputError, match=r"gap\.msh: this is not a readable mesh file: it is damaged") as found:
        read(path)
    assert not re.search("shape|array|index|broadcast", str(found.value))


@pytest.mark.parametrize("suffix", [".msh", ".vtu"])
def test_what_is_no_mesh_is_refused(suffix, tmp_path):
    path = tmp_path / f"letter{suffix}"
    path.write_text("Dear Sir or Madam")
    with pytest.raises(InputError, match=f"letter{suffix}: this is not a readable mesh file"):
        read(path)


def test_absent_and_unknown_files_are_refused(mesh, tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read(tmp_path / "none.msh")
    with pytest.raises(InputError, match=r"found '.obj'\); expected a name that ends in .msh or .vtu"):
        write(mesh, tmp_path / "mesh.obj")
    with pytest.raises(InputError, match=r"'.obj'.*\.vtu, or in \.vtk \(straight cells only\)$"):
        write(mesh, tmp_path / "mesh.obj")
    with pytest.raises(InputError, match=r"'.obj'.*\.vtu, or in \.inp \(a deck of another program\)$"):
        read(tmp_path / "mesh.obj")
    with pytest.raises(InputError, match="the mesh cannot be written"):
        write(mesh, tmp_path / "no" / "folder.vtu")


def test_a_vtk_file_holds_straight_cells_and_their_regions(mesh, tmp_path):
    write(mesh, tmp_path / "mesh.vtk")
    assert (tmp_path / "mesh.vtk").read_text().startswith("# vtk DataFile Version 4.2")
    stored = meshio.read(tmp_path / "mesh.vtk")
    (block,) = stored.cells
    assert block.type == "tetra"
    np.testing.assert_allclose(stored.points[block.data], mesh.points[mesh.cells[:, :4]], atol=1e-12)
    (region,) = stored.cell_data["region"]
    np.testing.assert_array_equal(np.flatnonzero(region == 1), mesh.region("base"))
