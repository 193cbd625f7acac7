"""Draw the pictures of docs/shapes.md: dimensions and mesh of every template, cut open where that shows more."""

from pathlib import Path

from turgor.geometry.catalogue import actuator
from turgor.mesh.drawing import save_drawing
from turgor.mesh.generate import generate
from turgor.mesh.picture import save_picture

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

if __name__ == "__main__":
    for name, (parameters, size, cut) in PICTURES.items():
        save_drawing(actuator(name), Path(__file__).parent / f"{name}-drawing.png")
        mesh = generate(actuator(name, **parameters), size)
        save_picture(mesh, Path(__file__).parent / f"{name}.png", cut=cut, window=(900, 580))
    for name, (parameters, size) in SECTIONS.items():
        section = generate(actuator(name, **parameters), size)
        save_picture(section, Path(__file__).parent / f"{name}-section.png", window=(900, 580))
