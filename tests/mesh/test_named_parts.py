import matplotlib.image
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.mesh.faces import rim_edges
from turgor.mesh.mesh import Mesh
from turgor.mesh.named_parts import save_fault, save_named_parts
from turgor.mesh.structured import box


def panels(path, number):
    pixels = matplotlib.image.imread(path)[..., :3]
    return np.split(pixels[:, : pixels.shape[1] // number * number], number, axis=1)


def share(pixels, red, green, blue):
    """Part of the pixels whose hue is this one, whatever the light on it."""
    wanted = np.array([red, green, blue]) / np.linalg.norm([red, green, blue])
    length = np.linalg.norm(pixels, axis=2)
    return float(((pixels @ wanted > 0.995 * length) & (length > 0.2)).mean())


def test_what_was_selected_is_seen_from_both_sides(tmp_path):
    plain = box((3.0, 2.0, 1.0), (4, 2, 2))
    names = {"pad": plain.surface("z0"), "outer": plain.surface("z1"), "cavity": plain.surface("y0")}
    regions = {"a": np.arange(40), "b": np.arange(40, plain.n_cells)}
    caps = {"inlet": rim_edges(plain.surface("z1"))}
    save_named_parts(Mesh(plain.points, plain.cells, regions, names, caps=caps), tmp_path / "block.png")
    above, below, inside = panels(tmp_path / "block.png", 3)
    pad = (0xD9, 0xB4, 0x4A)
    assert share(below, *pad) > 0.1 > 0.03 > share(above, *pad)
    assert share(inside, 0xC8, 0x55, 0x3D) > 0.02
    assert share(above, 0xD0, 0x1C, 0xD0) > 0.001


def test_a_fault_is_red(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    save_fault(points, triangles, np.array([1]), tmp_path / "fault.png")
    whole, close = panels(tmp_path / "fault.png", 2)
    assert share(whole, 0xD0, 0x1C, 0x1C) > 0.01
    assert share(close, 0xD0, 0x1C, 0x1C) > 0.01


def test_the_path_is_checked(tmp_path):
    block = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=r"saved as \.png"):
        save_named_parts(block, tmp_path / "block.gif")
    with pytest.raises(InputError, match="cannot be written"):
        save_named_parts(block, tmp_path / "no" / "block.png")
