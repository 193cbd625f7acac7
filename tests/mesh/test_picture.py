from functools import partial
from unittest.mock import MagicMock

import matplotlib.image
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.named_parts import save_named_parts
from turgor.mesh.picture import add_edges, save_picture
from turgor.mesh.structured import box, rectangle


@pytest.fixture
def block():
    plain = box((3.0, 1.0, 1.0), (3, 1, 1))
    surfaces = {"mount": plain.surface("x0"), "tip-face": plain.surface("x1"), "outer": plain.surface("y0")}
    fibre = np.array([[0.0, 0.1, 0.5], [3.0, 0.1, 0.5]])
    return Mesh(plain.points, plain.cells, surfaces=surfaces, markers={"tip": [0]}, curves={"fibre-1": fibre})


@pytest.mark.parametrize("show", ["names", "quality"])
def test_the_picture_shows_the_body(block, show, tmp_path):
    path = tmp_path / "block.png"
    save_picture(block, path, show=show)
    pixels = matplotlib.image.imread(path)
    assert pixels.shape[:2] == (900, 1400)
    drawn = (pixels[..., :3] < 0.98).any(axis=-1)
    assert 0.05 < drawn.mean() < 0.9


@pytest.mark.parametrize("show", ["names", "quality"])
@pytest.mark.parametrize("kind", ["tri6", "quad9", "hex27"])
def test_every_kind_of_cell_is_drawn(kind, show, tmp_path):
    mesh = box((3.0, 1.0, 1.0), (3, 1, 1), kind) if kind == "hex27" else rectangle((3.0, 1.0), (3, 1), kind)
    for number, save in enumerate((lambda path: save_picture(mesh, path, show=show), partial(save_named_parts, mesh))):
        path = tmp_path / f"{number}.png"
        save(path)
        drawn = (matplotlib.image.imread(path)[..., :3] < 0.98).any(axis=-1)
        assert 0.05 < drawn.mean() < 0.95


def test_only_png(block, tmp_path):
    with pytest.raises(InputError, match=r"saved as \.png"):
        save_picture(block, tmp_path / "block.jpg")


@pytest.mark.parametrize(("cell", "edges"), [("hex27", 12), ("tet10", 18)])
def test_edges_are_those_of_the_elements(cell, edges):
    block = box((1.0, 1.0, 1.0), (1, 1, 1), cell)
    plotter = MagicMock()
    add_edges(plotter, block, boundary_faces(block.cells))
    # Twelve edges of a cube, and a diagonal on each side of one made of tetrahedra: each once, through its middle.
    (drawn,) = plotter.add_mesh.call_args.args
    assert drawn.n_lines == edges
    for start, middle, end in drawn.lines.reshape(-1, 4)[:, 1:]:
        np.testing.assert_allclose(block.points[middle], 0.5 * (block.points[start] + block.points[end]))
