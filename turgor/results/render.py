"""The process that draws: ``python -m turgor.results.render FOLDER`` turns the job in a folder into PNG files.

It is started by :mod:`turgor.results.pictures`, which writes ``job.npz`` and ``job.json``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger, vtkObject

FloatArray = npt.NDArray[np.float64]

_STRESS = "von Mises stress / MPa"
_REFERENCE = "reference"
_INK, _OUTLINE = "#222222", "#8a8f98"
_SUBDIVISIONS = 2
_BAR_PART, _LABEL_PART = 0.16, 0.09
"""Parts of the picture's height that belong to the colour bar below and to the label above."""
_BAR_LEFT = 0.2
_EDGE_ANGLE_DEG = 35.0
_CELLS = {10: pyvista.CellType.QUADRATIC_TETRA, 27: pyvista.CellType.TRIQUADRATIC_HEXAHEDRON}


def main(folder: Path) -> None:
    """Draw the job in `folder`: ``state-0.png``, ``state-1.png``, … and of a body in space ``last.png``.

    That is the last state cut open, or from outside where a second camera is given.
    """
    # Without a screen VTK falls back to EGL by itself, but warns on the way about the X server it did not find.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    vtkObject.GlobalWarningDisplayOff()
    scene = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    with np.load(folder / "job.npz", allow_pickle=False) as job:
        arrays = {name: job[name] for name in job.files}
    rest = _skin(arrays, None)
    for state, label in enumerate(scene["labels"]):
        _save(folder / f"state-{state}.png", _skin(arrays, state), rest, label, scene, scene["camera"])
    if "cells" in arrays:
        _save(folder / "last.png", _section(arrays, scene["camera"]), None, scene["last_label"], scene, scene["camera"])
    elif "outside" in scene:
        last = _skin(arrays, len(scene["labels"]) - 1)
        _save(folder / "last.png", last, rest, scene["last_label"], scene, scene["outside"])


def _skin(arrays: dict[str, npt.NDArray[Any]], state: int | None) -> Any:
    """What is drawn of the body in one state, or at rest (None), its curved faces cut into small flat ones."""
    places = arrays["places"][0 if state is None else state + 1]
    grid = pyvista.UnstructuredGrid({pyvista.CellType.QUADRATIC_TRIANGLE: arrays["faces"]}, places)
    if state is not None:
        grid.point_data[_STRESS] = arrays["von_mises"][state]
    return _smooth(grid)


def _section(arrays: dict[str, npt.NDArray[Any]], camera: dict[str, Any]) -> Any:
    """The half of the last state behind the plane across the camera's side that halves the body's extent at rest."""
    side = camera["side"]
    reference = arrays["points"][:, side]
    across = reference - 0.5 * (reference.min() + reference.max())
    behind = across * -np.sign(camera["towards"][side])
    kind = _CELLS[arrays["cells"].shape[1]]
    grid = pyvista.UnstructuredGrid({kind: arrays["cells"]}, arrays["moved"])
    grid.point_data[_STRESS] = arrays["nodal"]
    grid.point_data[_REFERENCE] = behind
    return _smooth(grid.clip_scalar(scalars=_REFERENCE, value=0.0, invert=False))


def _smooth(grid: Any) -> Any:
    surface = grid.extract_surface(nonlinear_subdivision=_SUBDIVISIONS, algorithm="dataset_surface")
    return surface.compute_normals(split_vertices=True, feature_angle=_EDGE_ANGLE_DEG, auto_orient_normals=False)


def _save(path: Path, body: Any, rest: Any, label: str, scene: dict[str, Any], camera: dict[str, Any]) -> None:
    """Draw a state in colours, and of the body at rest, if given, the sharp edges and the outline."""
    plotter = pyvista.Plotter(off_screen=True, window_size=scene["size"])
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    # Once a camera is set, nothing that is added asks the bounds of everything to place one.
    _aim(plotter.camera, camera)
    plotter.camera_set = True
    if rest is not None:
        plotter.add_silhouette(
            rest.clean(), color=_OUTLINE, line_width=2.0, feature_angle=_EDGE_ANGLE_DEG, decimate=None
        )
    plotter.add_mesh(
        body,
        scalars=_STRESS,
        cmap="viridis",
        clim=(0.0, scene["scale_max"]),
        smooth_shading=True,
        split_sharp_edges=False,
        ambient=0.25,
        diffuse=0.75,
        specular=0.15,
        scalar_bar_args={
            "title": _STRESS,
            "vertical": False,
            "position_x": _BAR_LEFT,
            "position_y": 0.02,
            "width": 1.0 - 2.0 * _BAR_LEFT,
            "height": 0.1,
            "color": _INK,
            "label_font_size": 26,
            "n_labels": 3,
            "fmt": "%.3g",
        },
    )
    # The bar's own title would sit on the label in its middle.
    plotter.scalar_bars[_STRESS].SetTitle("")
    width, height = scene["size"]
    plotter.add_text(_STRESS, position=(_BAR_LEFT * width, _BAR_PART * height - 34), font_size=15, color=_INK)
    plotter.add_text(label, position=(24, height - 60), font_size=20, color=_INK)
    plotter.renderer.ResetCameraClippingRange()
    plotter.screenshot(str(path))
    plotter.close()


def _aim(camera: Any, view: dict[str, Any]) -> None:
    """Look at the target, between the colour bar and the label."""
    left = 1.0 - _BAR_PART - _LABEL_PART
    target, towards, up = (np.array(view[name]) for name in ("target", "towards", "up"))
    half_height = view["half_height"]
    camera.parallel_projection = True
    camera.parallel_scale = half_height / left
    focus = target - (_BAR_PART - _LABEL_PART) / left * half_height * up
    camera.focal_point = focus
    camera.position = focus + 10.0 * half_height * towards
    camera.up = up


if __name__ == "__main__":
    main(Path(sys.argv[1]))
