"""A picture to check what rules selected: the names on the skin from both sides, the regions inside, or a fault."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from turgor.common.optional import require
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.picture import PICTURE_EDGES, add_edges, add_surface, colour_of, drawing, look, skin_of
from turgor.mesh.tet10 import FloatArray, IntArray

_ABOVE, _BELOW = (0.6, -1.0, 0.5), (-0.6, 1.0, -0.5)
_REGIONS = ("#b9c4d0", "#c8553d", "#5b9bd5", "#d9b44a", "#117733", "#aa4499", "#882255", "#44aa99")


def save_named_parts(mesh: Mesh, path: str | Path, *, panel: tuple[int, int] = (700, 700)) -> None:
    """Draw a mesh in space three times: its surfaces from above, from below, and its regions cut open along y.

    A plane mesh is drawn twice from the front, its surfaces as lines.

    Every surface has a colour of its own; the rims under caps and the markers are drawn and named.

    Parameters
    ----------
    mesh
        What to draw.
    path
        Ends in .png.
    panel
        Width and height of each of the three in pixels.

    Raises
    ------
    InputError
        If the path does not end in .png.
    MissingPackageError
        If pyvista or a system library that it loads is absent.
    """
    flat = mesh.dimension == 2
    views = [("edges", _ABOVE)] if flat else [("from above", _ABOVE), ("from below", _BELOW)]
    count = len(views) + 1
    with drawing(path, shape=(1, count), window_size=(count * panel[0], panel[1])) as plotter:
        for number, (title, view) in enumerate(views):
            _begin(plotter, number, title)
            _add_surfaces(plotter, mesh)
            _add_caps(plotter, mesh)
            _look(plotter, mesh, view)
        _begin(plotter, count - 1, "regions" if flat else "regions, cut open")
        _add_regions(plotter, mesh)
        _add_caps(plotter, mesh)
        _look(plotter, mesh, _ABOVE)


def save_fault(
    points: FloatArray, triangles: NDArray[np.integer], wrong: NDArray[np.integer], path: str | Path
) -> None:
    """Draw a surface of triangles with the `wrong` ones in red, whole and close by; errors as of `save_named_parts`."""
    pyvista = require("pyvista")
    parts = (np.delete(triangles, wrong, axis=0), triangles[wrong])
    sound, fault = (pyvista.PolyData.from_regular_faces(points, some) for some in parts)
    with drawing(path, shape=(1, 2), window_size=(1400, 700)) as plotter:
        for number, title in enumerate(("the surface", "the fault")):
            _begin(plotter, number, title)
            plotter.add_mesh(sound, color="#9aa5b1", opacity=0.35, **PICTURE_EDGES)
            plotter.add_mesh(fault, color="#d01c1c", show_edges=True, line_width=2, ambient=0.5)
            plotter.view_vector(_ABOVE, (0, 0, 1))
        # Close by means around the smallest of the wrong facets: the largest may be a whole side.
        spans = np.ptp(points[triangles[wrong]], axis=1)
        smallest = int(np.argmin(np.linalg.norm(spans, axis=1)))
        reach = float(np.linalg.norm(spans[smallest]))
        ends = np.add.outer((-reach, reach), points[triangles[wrong[smallest]]].mean(axis=0))
        plotter.reset_camera(bounds=tuple(ends.T.ravel().tolist()))


def _begin(plotter: Any, number: int, title: str) -> None:
    plotter.subplot(0, number)
    plotter.add_text(title, font_size=10, color="black")


def _surface_colours(mesh: Mesh) -> dict[str, str]:
    """Return the usual colour of each surface, and one of its own to each that has none."""
    own = iter(_REGIONS[3:] * len(mesh.surfaces))
    return {name: colour_of(name) or next(own) for name in mesh.surfaces}


def _look(plotter: Any, mesh: Mesh, view: tuple[float, float, float]) -> None:
    plotter.add_legend(bcolor="white", size=(0.26, 0.2), loc="lower right", face="rectangle")
    look(plotter, mesh, view)


def _add_surfaces(plotter: Any, mesh: Mesh) -> None:
    colours = _surface_colours(mesh)
    for name, faces in mesh.surfaces.items():
        if len(faces):
            add_surface(plotter, mesh, faces, color=colours[name], label=name)


def _add_caps(plotter: Any, mesh: Mesh) -> None:
    for name, edges in mesh.caps.items():
        lines = np.column_stack([np.full(len(edges), 2), edges[:, :2]]).ravel()
        rim = require("pyvista").PolyData(mesh.points, lines=lines)
        plotter.add_mesh(rim, color="#d01cd0", line_width=5)
        middle = mesh.points[np.unique(edges)].mean(axis=0)
        plotter.add_point_labels([middle], [f"cap {name}"], shape_opacity=0.6, font_size=12)


def _add_regions(plotter: Any, mesh: Mesh) -> None:
    flat = mesh.dimension == 2
    centres = mesh.points[mesh.cells].mean(axis=1)
    behind = flat | (centres[:, 1] >= np.median(mesh.points[:, 1]))
    for number, (name, cells) in enumerate(mesh.regions.items()):
        kept: IntArray = mesh.cells[cells[behind[cells]]]
        if len(kept):
            seen = kept if flat else boundary_faces(kept)
            plotter.add_mesh(
                skin_of(require("pyvista"), mesh, seen), color=_REGIONS[number % len(_REGIONS)], label=name
            )
            add_edges(plotter, mesh, seen)
