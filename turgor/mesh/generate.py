"""From an actuator to its mesh: gmsh draws, cuts and curves; every element is proved valid; names are kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, Shape
from turgor.mesh.faces import outward_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import EDGES, FloatArray, IntArray, jacobian_coefficients

LOG = logger("mesh")

Progress = Callable[[str], None]
"""Called with the name of each stage before it begins."""

# gmsh's numbers for these elements, and its tetrahedron's nodes in our order.
_TET10, _TRI6 = 11, 9
_GMSH_TO_VTK = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]


def generate(actuator: Actuator, size: float | None = None, *, progress: Progress = LOG.info) -> Mesh:
    """Mesh an actuator with curved ten-node tetrahedra, all of them valid.

    The same actuator and size give the same mesh to the last bit on the same machine and version of gmsh.

    Parameters
    ----------
    actuator
        What to mesh.
    size
        Largest edge length in mm; left out, the template's own default.
    progress
        Called with the name of each stage; the default logs it.

    Returns
    -------
    Mesh
        With the regions, surfaces, markers and curves of the template. The Jacobian of every element is positive
        everywhere, proved by its Bézier coefficients.

    Raises
    ------
    InputError
        If the size is not positive, or gmsh finds no valid mesh for this shape and size.
    MissingPackageError
        If gmsh or a system library that it loads is absent.
    """
    chosen = actuator.default_size if size is None else size
    if not (np.isfinite(chosen) and chosen > 0.0):
        raise InputError("the element size must be positive", key="size", value=chosen)
    with cad.session(actuator.template) as gmsh:
        progress("drawing")
        shape = actuator.draw()
        progress(f"meshing with elements of {chosen:g} mm")
        _tetrahedralise(gmsh, chosen)
        progress("curving")
        return _named_mesh(gmsh, shape, _curved(gmsh, shape))


@dataclass(frozen=True)
class _Cells:
    """The solid's elements as gmsh left them: points, cells in VTK order, regions, and gmsh's node tag → our index."""

    points: FloatArray
    cells: IntArray
    regions: dict[str, IntArray]
    index: IntArray


def _tetrahedralise(gmsh: ModuleType, size: float) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.7 * size)
    try:
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("Netgen")
    except Exception as error:  # gmsh raises bare Exceptions that carry its own text
        problem = f"gmsh cannot mesh this shape: {error}"
        raise InputError(problem, key="size", value=f"{size:g} mm", expected="a smaller size") from error


def _curved(gmsh: ModuleType, shape: Shape) -> _Cells:
    """Put the middle nodes on the geometry; untangle what that tangles, by gmsh's optimiser, then by straightening."""
    gmsh.model.mesh.setOrder(2)
    mesh = _read_cells(gmsh, shape)
    if _tangled(mesh.points, mesh.cells).any():
        gmsh.model.mesh.optimize("HighOrder")
        mesh = _read_cells(gmsh, shape)
    points, count = straightened(mesh.points, mesh.cells)
    if count:
        LOG.warning("%d of %d elements have straight edges: curved ones would be invalid", count, len(mesh.cells))
    return replace(mesh, points=points)


def _read_cells(gmsh: ModuleType, shape: Shape) -> _Cells:
    blocks = {
        name: np.concatenate([gmsh.model.mesh.getElementsByType(_TET10, tag)[1] for tag in tags]).reshape(-1, 10)
        for name, tags in shape.regions.items()
    }
    tags, cells = np.unique(np.vstack(list(blocks.values())), return_inverse=True)
    all_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    points = coordinates.reshape(-1, 3)[np.argsort(all_tags)][np.searchsorted(np.sort(all_tags), tags)]
    index = np.full(int(all_tags.max()) + 1, -1, dtype=np.int32)
    index[tags] = np.arange(len(tags))
    ends = np.cumsum([0] + [len(block) for block in blocks.values()])
    regions = {
        name: np.arange(start, end, dtype=np.int32)
        for name, start, end in zip(blocks, ends[:-1], ends[1:], strict=True)
    }
    return _Cells(points, cells.reshape(-1, 10)[:, _GMSH_TO_VTK].astype(np.int32), regions, index)


def _named_mesh(gmsh: ModuleType, shape: Shape, mesh: _Cells) -> Mesh:
    surfaces = {}
    for name, faces in shape.surfaces.items():
        triangles = [gmsh.model.mesh.getElementsByType(_TRI6, face)[1].reshape(-1, 6) for face in faces]
        surfaces[name] = outward_faces(mesh.cells, mesh.index[np.vstack(triangles)[:, :3]])
    markers = {name: nodes_on_polyline(mesh.points, line, name) for name, line in shape.markers.items()}
    return Mesh(mesh.points, mesh.cells, mesh.regions, surfaces, markers, shape.curves)


def _tangled(points: FloatArray, cells: IntArray) -> npt.NDArray[np.bool_]:
    """Say of each cell whether its Jacobian is not proved positive everywhere."""
    coefficients = jacobian_coefficients(points[cells])
    tangled: npt.NDArray[np.bool_] = coefficients.min(axis=1) <= 1e-6 * np.abs(coefficients).max(axis=1)
    return tangled


def straightened(points: FloatArray, cells: IntArray) -> tuple[FloatArray, int]:
    """Straighten the edges of the cells whose curved Jacobian is not proved positive everywhere.

    Parameters
    ----------
    points, cells
        Shapes ``(n, 3)`` and ``(m, 10)``.

    Returns
    -------
    points, count
        The points with the middle nodes of those cells moved to the middles of their edges, and how many cells.

    Raises
    ------
    InputError
        If a cell is inside out even with straight edges.
    """
    points = points.copy()
    straight = np.zeros(len(cells), dtype=bool)
    while (tangled := _tangled(points, cells)).any():
        if (tangled & straight).any():
            cell = int(np.argmax(tangled & straight))
            place = points[cells[cell, :4]].mean(axis=0).round(2).tolist()
            raise InputError(f"gmsh left an element inside out near {place} mm", key="size", expected="a smaller size")
        # Straightening one cell may tangle a curved neighbour, which is then straightened in the next round.
        straight |= tangled
        first, second = np.array(EDGES).T
        points[cells[tangled, 4:]] = 0.5 * (points[cells[tangled][:, first]] + points[cells[tangled][:, second]])
    return points, int(straight.sum())


def nodes_on_polyline(points: FloatArray, line: FloatArray, name: str) -> IntArray:
    """Return the nodes on a polyline in order from its first point to its last.

    Parameters
    ----------
    points
        Shape ``(n, 3)``.
    line
        Shape ``(k, 3)``; a single point asks for the node there.
    name
        For the message.

    Raises
    ------
    InputError
        If no node lies on it.
    """
    tolerance = 1e-6 * float(np.ptp(points, axis=0).max())
    starts, ends = (line, line) if len(line) == 1 else (line[:-1], line[1:])
    found: list[int] = []
    for start, end in zip(starts, ends, strict=True):
        along = end - start
        fraction = np.clip((points - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        near = np.flatnonzero(np.linalg.norm(points - start - fraction[:, None] * along, axis=1) < tolerance)
        found += [int(node) for node in near[np.argsort(fraction[near])] if node not in found[-1:]]
    if not found:
        raise InputError("no node of the mesh lies on this marker", key=name, value=line.tolist())
    return np.array(found, dtype=np.int32)
