"""Pictures of a mesh: its named surfaces in colours, or the quality of its elements with the worst one marked."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from turgor.common.errors import InputError
from turgor.common.optional import require
from turgor.common.rows import row_numbers
from turgor.common.writing import writing
from turgor.mesh.faces import boundary_faces, host_cells
from turgor.mesh.mesh import Mesh, in_space
from turgor.mesh.quality import quality
from turgor.mesh.tet10 import IntArray

COLOURS = {
    "mount": "#444444",
    "tip-face": "#c8553d",
    "outer": "#9aa5b1",
    "symmetry": "#d9b44a",
    "cavity": "#5b9bd5",
}
"""Colour of a surface by the beginning of its name; others are grey."""

_VTK_TYPES = {3: 21, 6: 22, 9: 28}
"""VTK's number of the curved edge, triangle and quadrilateral with so many nodes."""

PICTURE_EDGES: dict[str, Any] = {"show_edges": True, "line_width": 0.5, "edge_opacity": 0.25}
LINES: dict[str, Any] = {"line_width": 5}
_BAR: dict[str, Any] = {"vertical": True, "position_x": 0.88, "position_y": 0.15, "width": 0.06, "height": 0.7}


def save_picture(
    mesh: Mesh,
    path: str | Path,
    *,
    show: Literal["names", "quality"] = "names",
    cut: bool = False,
    window: tuple[int, int] = (1400, 900),
) -> None:
    """Draw the skin of a mesh with its elements' edges and save it as a PNG file.

    Parameters
    ----------
    mesh
        What to draw.
    path
        Ends in .png.
    show
        Colours by surface ``names`` with fibres and markers, or the ``quality`` (scaled Jacobian) of the element behind
        each face, with the place of the worst element.
    cut
        Draw only the faces beyond the middle of y, to look inside.
    window
        Width and height in pixels.

    Raises
    ------
    InputError
        If the path does not end in .png.
    MissingPackageError
        If pyvista or a system library that it loads is absent.
    """
    with drawing(path, window_size=window) as plotter:
        _draw(plotter, mesh, show, cut)


def _draw(plotter: Any, mesh: Mesh, show: str, cut: bool) -> None:
    pyvista = require("pyvista")
    if show == "quality":
        _draw_quality(pyvista, plotter, mesh, cut)
    else:
        _draw_names(pyvista, plotter, mesh, cut)
    look(plotter, mesh, (0.5, -1.0, 0.45))
    extent = np.ptp(mesh.points, axis=0)
    # A tall body fills the height already, up to the names of its ends; beside a long one stands the scale of quality.
    long = 1.1 if show == "quality" else 1.3
    plotter.camera.zoom(long if mesh.dimension == 3 and extent[2] < extent.max() else 0.93)


def _draw_quality(pyvista: Any, plotter: Any, mesh: Mesh, cut: bool) -> None:
    measured = quality(mesh)
    seen = mesh.cells if mesh.dimension == 2 else _beyond(mesh, boundary_faces(mesh.cells), cut)
    hosts = np.arange(mesh.n_cells) if mesh.dimension == 2 else host_cells(mesh.cells, seen)
    skin = skin_of(pyvista, mesh, seen)
    skin.cell_data["scaled Jacobian"] = measured.scaled_jacobian[hosts]
    plotter.add_mesh(skin, scalars="scaled Jacobian", cmap="RdYlGn", clim=(0, 1), scalar_bar_args=_BAR, ambient=0.5)
    add_edges(plotter, mesh, seen)
    worst = in_space(measured.centres[measured.worst_cell][None])
    plotter.add_point_labels(worst, [f"worst {measured.scaled_jacobian.min():.2f}"], always_visible=True)


def _draw_names(pyvista: Any, plotter: Any, mesh: Mesh, cut: bool) -> None:
    if mesh.dimension == 2:
        plotter.add_mesh(skin_of(pyvista, mesh, mesh.cells), color="#e8eaed")
        add_edges(plotter, mesh, mesh.cells)
    for name, faces in mesh.surfaces.items():
        kept = _beyond(mesh, faces, cut)
        if len(kept):
            # Fibres run inside the wall; they show through the outside.
            opacity = 0.3 if mesh.curves and name == "outer" else 1.0
            options = {"color": colour_of(name) or "#aaaaaa", "label": name, "opacity": opacity}
            add_surface(plotter, mesh, kept, **options)
    _add_lines(pyvista, plotter, mesh)
    plotter.add_legend(bcolor="white", size=(0.16, 0.2))


def _beyond(mesh: Mesh, faces: IntArray, cut: bool) -> IntArray:
    """Return the faces beyond the middle of y, or all of them."""
    kept: IntArray = faces[mesh.points[faces].mean(axis=1)[:, 1] >= mesh.points[:, 1].mean()] if cut else faces
    return kept


def look(plotter: Any, mesh: Mesh, view: tuple[float, float, float]) -> None:
    """Look at a body from `view`, at a section from the front."""
    if mesh.dimension == 2:
        plotter.view_xy()
    else:
        plotter.view_vector(view, (0, 0, 1))


def skin_of(pyvista: Any, mesh: Mesh, faces: IntArray) -> Any:
    """Return curved faces of a mesh, or edges or cells of a plane one, as a grid to draw."""
    n = faces.shape[1]
    cells = np.hstack([np.full((len(faces), 1), n), faces]).ravel()
    return pyvista.UnstructuredGrid(cells, np.full(len(faces), _VTK_TYPES[n]), in_space(mesh.points))


def add_surface(plotter: Any, mesh: Mesh, faces: IntArray, **options: Any) -> None:
    """Draw faces of a mesh, with the edges of their elements if opaque; of a plane mesh edges as thick lines."""
    if mesh.dimension == 2:
        plotter.add_mesh(skin_of(require("pyvista"), mesh, faces), **options, **LINES)
    else:
        plotter.add_mesh(skin_of(require("pyvista"), mesh, faces), **options)
        if options.get("opacity", 1.0) == 1.0:
            add_edges(plotter, mesh, faces)


def add_edges(plotter: Any, mesh: Mesh, faces: IntArray) -> None:
    """Draw the curved edges of faces; VTK, asked for edges, also draws those of the flat pieces it cuts faces into."""
    corners = 3 if faces.shape[1] == 6 else 4
    start = np.arange(corners)
    chain = np.stack([faces[:, start], faces[:, corners + start], faces[:, (start + 1) % corners]], axis=2)
    chain = _ascending(chain.reshape(-1, 3))
    chain = chain[np.unique(row_numbers(chain), return_index=True)[1]]
    lines = np.column_stack([np.full(len(chain), 3), chain]).ravel()
    drawn = require("pyvista").PolyData(in_space(mesh.points), lines=lines)
    actor = plotter.add_mesh(drawn, color="black", line_width=1, opacity=0.35, lighting=False)
    # The lines lie in the faces: drawn as if a little nearer, they are seen.
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, -30.0)


def _ascending(chain: IntArray) -> IntArray:
    """Return chains of three nodes so that each begins at the lower end."""
    turned: IntArray = np.where((chain[:, :1] > chain[:, 2:]), chain[:, ::-1], chain)
    return turned


def _add_lines(pyvista: Any, plotter: Any, mesh: Mesh) -> None:
    for curve in mesh.curves.values():
        plotter.add_mesh(pyvista.lines_from_points(in_space(curve)), color="#8b1a1a", line_width=3)
    for name, nodes in mesh.markers.items():
        size = 6 if len(nodes) > 1 else 16
        plotter.add_points(
            in_space(mesh.points[nodes]), color="#117733", point_size=size, render_points_as_spheres=True
        )
        if len(nodes) == 1:
            plotter.add_point_labels(in_space(mesh.points[nodes]), [name], always_visible=True, shape_opacity=0.6)


def colour_of(name: str) -> str | None:
    """Return the usual colour of a surface of this name, if it has one."""
    return next((colour for start, colour in COLOURS.items() if name.startswith(start)), None)


def check_png(path: str | Path) -> None:
    """Raise InputError if a path does not end in .png."""
    if Path(path).suffix != ".png":
        raise InputError("a picture is saved as .png", file=path, expected="a name that ends in .png")


@contextlib.contextmanager
def drawing(path: str | Path, **options: Any) -> Iterator[Any]:
    """Open a plotter without a screen, white, and save what was drawn as a PNG file.

    Raises
    ------
    InputError
        If the path does not end in .png or nothing can be written there.
    MissingPackageError
        If pyvista or a system library that it loads is absent.
    """
    check_png(path)
    pyvista, logger = require("pyvista"), require("vtkmodules.vtkCommonCore").vtkLogger
    # Without a screen VTK falls back to EGL by itself, but warns on the way about the X server it did not find.
    verbosity = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    plotter = pyvista.Plotter(off_screen=True, **options)
    try:
        plotter.set_background("white", all_renderers=True)
        yield plotter
        with writing(path, "the picture cannot be written"):
            plotter.screenshot(str(path))
    finally:
        plotter.close()
        logger.SetStderrVerbosity(verbosity)
