"""Draw the pictures of docs/shapes.md: dimensions and mesh of every template, cut open where that shows more.

`draw.py stl-cup fibre-tube-drawing` draws these only.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from turgor.geometry.catalogue import actuator
from turgor.geometry.imported.stl import StlFile
from turgor.geometry.space import Space
from turgor.mesh.drawing import save_drawing
from turgor.mesh.generate import generate
from turgor.mesh.named_parts import save_named_parts
from turgor.mesh.partition import partition
from turgor.mesh.picture import save_picture

HERE = Path(__file__).parent

PICTURES = {
    "tube": ({}, None, True),
    "pneunet": ({"symmetric": True}, None, False),
    "bellows": ({"model": "quarter"}, None, False),
    "membrane": ({"segments": 3}, None, True),
    "honeycomb": ({"columns": 2, "rows": 2, "model": "half"}, None, False),
    "reinforced-tube": ({"symmetric": True}, None, False),
    "fibre-tube": ({"length": "140 mm", "fibre_length": "106 mm"}, None, False),
}
"""Template → parameters, element size in mm, whether to look inside."""

SECTIONS = {
    "tube": ({"model": "axisymmetric", "length": "60 mm"}, 2.0),
    "bellows": ({"model": "axisymmetric"}, 0.8),
    "membrane": ({"model": "plane", "segments": 3}, 0.8),
    "honeycomb": ({"model": "plane", "columns": 2, "rows": 2, "plate": "3 mm"}, 1.0),
}
"""Template → parameters of the model that is drawn in the plane, element size in mm."""

COLOURS = 256
"""Of a picture: enough for the shades of a few surfaces and their names, and a third of the bytes."""


def draw_cup(path: Path) -> None:
    """Draw a cup with a capped mouth, outer radius 6 mm, in two regions, from an STL file of 32 sides."""
    corners = np.array([[0, 0], [6, 0], [6, 20], [4, 20], [4, 3], [0, 3]], dtype=float)
    # Facets about as high as wide, as other programs write them.
    outline = np.vstack(
        [
            np.linspace(start, end, round(float(np.linalg.norm(end - start))), endpoint=False)
            for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True)
        ]
    )
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    rings = np.array([[(r * np.cos(t), r * np.sin(t), z) for t in angle] for r, z in outline])
    facets = []
    for low, high in zip(rings, np.roll(rings, -1, axis=0), strict=True):
        for a, b, c, d in zip(low[:-1], low[1:], high[1:], high[:-1], strict=True):
            facets += [(a, b, c), (a, c, d)]
    kept = [facet for facet in facets if np.linalg.norm(np.cross(facet[1] - facet[0], facet[2] - facet[0])) > 1e-9]
    loops = "".join(
        "facet normal 0 0 0 outer loop\n"
        + "".join("vertex {:.9g} {:.9g} {:.9g}\n".format(*corner) for corner in facet)
        + "endloop endfacet\n"
        for facet in kept
    )
    with TemporaryDirectory() as folder:
        (Path(folder) / "cup.stl").write_text(f"solid body\n{loops}endsolid body\n", encoding="ascii")
        cup = StlFile(
            file=str(Path(folder) / "cup.stl"),
            unit="mm",
            mount={"normal": (0, 0, -1)},
            tip_face={"normal": (0, 0, 1), "nearest": ("5 mm", "0 mm", "20 mm")},
            surfaces={"flank": {"nearest": ("6 mm", "0 mm", "10 mm")}},
            caps={"inlet": {"nearest": ("0 mm", "0 mm", "20 mm")}},
        )
        mesh = generate(cup, 1.2)
    upper = Space(half_space={"point": ("0 mm", "0 mm", "13 mm"), "normal": (0, 0, 1)})
    save_named_parts(partition(mesh, {"stiff": upper}), path, panel=(410, 410))


def draw_mesh(
    name: str, parameters: dict[str, object], size: float | None, cut: bool = False
) -> Callable[[Path], None]:
    """Return what draws the mesh of a template."""
    return lambda path: save_picture(generate(actuator(name, **parameters), size), path, cut=cut, window=(900, 580))


def drawings() -> dict[str, Callable[[Path], None]]:
    """Return what draws each picture, by its name."""
    found: dict[str, Callable[[Path], None]] = {"stl-cup": draw_cup}
    for name, (parameters, size, cut) in PICTURES.items():
        found[f"{name}-drawing"] = lambda path, name=name: save_drawing(actuator(name), path)  # type: ignore[misc]
        found[name] = draw_mesh(name, parameters, size, cut)
    for name, (parameters, size) in SECTIONS.items():
        found[f"{name}-section"] = draw_mesh(name, parameters, size)
    return found


if __name__ == "__main__":
    for name, draw in drawings().items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            path = HERE / f"{name}.png"
            draw(path)
            Image.open(path).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
