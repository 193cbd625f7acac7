"""From an actuator to its mesh: gmsh draws, cuts and curves; every element is proved valid; names are kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, Shape
from turgor.mesh.blocks import structured_mesh
from turgor.mesh.cells import CELLS, body_cell
from turgor.mesh.faces import outward_faces
from turgor.mesh.layers import check_layers, with_layers
from turgor.mesh.mesh import Mesh
from turgor.mesh.polyline import nodes_on_polyline
from turgor.mesh.tet10 import FloatArray, IntArray, jacobian_coefficients

LOG = logger("mesh")

Progress = Callable[[str], None]
"""Called with the name of each stage before it begins."""

MOST_CELLS = 3_000_000
"""Meshes beyond this are refused; they need more than ten gigabytes before the first step."""

PER_CIRCLE_OF_SECTION = 16
"""Elements along a full circle of a section by default, whatever the template takes in space."""

KINDS = {2: ("triangles", "quadrilaterals"), 3: ("tetrahedra", "hexahedra")}
"""Number of coordinates → the cells that gmsh cuts any shape into, and those of shapes made of blocks."""

LEAST_DISTORTION = 0.1
"""Smallest ratio of the bounds of an element's Jacobian; below it a moderate strain turns the element inside out."""
_HALVINGS = 4

# gmsh's numbers for these elements, and its tetrahedron's nodes in our order.
_TET10, _TRI6, _LINE3 = 11, 9, 8
_NODES = {_TET10: 10, _TRI6: 6, _LINE3: 3}
_GMSH_TO_VTK = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]


def generate(
    actuator: Actuator,
    size: float | None = None,
    *,
    sizes: Mapping[str, float] | None = None,
    per_circle: int | None = None,
    cells: str | None = None,
    layers: int | None = None,
    progress: Progress = LOG.info,
) -> Mesh:
    """Mesh an actuator with curved ten-node tetrahedra, or a section with six-node triangles, all of them valid.

    Where the template allows it, also with 27-node hexahedra or nine-node quadrilaterals in rows.

    The same actuator and size give the same mesh to the last bit on the same machine and version of gmsh.

    Parameters
    ----------
    actuator
        What to mesh.
    size
        Largest edge length in mm; left out, the template's own default.
    sizes
        Smaller edge lengths in mm, by the name of a region or surface. The template's own local sizes, if it has any,
        are refined with `size` and hold where none is given here.
    per_circle
        Elements along a full circle, in tetrahedra about; 0 lets them be as long as `size`. Left out, the template's
        own.
    cells
        ``tetrahedra`` or ``hexahedra``, of a section ``triangles`` or ``quadrilaterals``; left out, the first of
        the two. The second come in rows, for shapes that are made of blocks; their Jacobian is positive at every node.
    layers
        Elements through the walls, at least, behind all but 5 % of the skin: edges follow the walls' thickness
        (:mod:`turgor.mesh.layers`). Left out, walls do not count.
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
        If a size is not positive, names nothing or would fill the memory, if gmsh finds no valid mesh, or if the shape
        is not made of blocks and is to be meshed so.
    MissingPackageError
        If gmsh or a system library that it loads is absent.
    """
    # A shape from a file opens a session of its own to find its size.
    default = actuator.default_size
    chosen = default if size is None else size
    _check_sizes({"size": chosen, **{f"sizes.{name}": local for name, local in (sizes or {}).items()}})
    if _in_rows(actuator, cells):
        if layers is not None:
            problem = "layers are for tetrahedra; rows follow the size"
            raise InputError(problem, key="layers", value=layers, expected="size or sizes")
        progress(f"meshing in rows with elements of {chosen:g} mm")
        return _structured(actuator, chosen, sizes, per_circle)
    with cad.session(actuator.template) as gmsh:
        progress("drawing")
        shape = actuator.draw()
        scale = min(1.0, chosen / default)
        limits = {**{name: scale * local for name, local in shape.sizes.items()}, **(sizes or {})}
        usual = actuator.per_circle if shape.dimension == 3 else PER_CIRCLE_OF_SECTION
        return _unstructured(gmsh, shape, chosen, limits, usual if per_circle is None else per_circle, layers, progress)


def _check_sizes(sizes: Mapping[str, float]) -> None:
    for key, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError("the element size must be positive", key=key, value=value)


def _in_rows(actuator: Actuator, cells: str | None) -> bool:
    """Whether cells in rows are asked for."""
    kinds = KINDS[2 if actuator.section else 3]
    if cells is not None and cells not in kinds:
        problem = "a plane shape has no such cells" if actuator.section else "a shape in space has no such cells"
        raise InputError(problem, key="cells", value=cells, expected=" or ".join(kinds))
    return cells == kinds[1]


def _unstructured(
    gmsh: ModuleType,
    shape: Shape,
    size: float,
    sizes: Mapping[str, float],
    per_circle: int,
    layers: int | None,
    progress: Progress,
) -> Mesh:
    limits = _local_sizes(gmsh, shape, sizes)
    _check_count(gmsh, shape, size)

    def meshed(*further: int) -> Mesh:
        progress(f"meshing with elements of {size:g} mm")
        _set_smallest(gmsh, [*limits, *further])
        _divide(gmsh, size, per_circle, shape.dimension)
        progress("curving")
        return _named_mesh(gmsh, shape, _curved(gmsh, shape))

    if layers is None:
        return meshed()
    check_layers(layers, shape.dimension)
    progress("measuring walls")
    _divide(gmsh, size, per_circle, 2)
    return with_layers(gmsh, shape, size, layers, MOST_CELLS, meshed)


def _structured(actuator: Actuator, size: float, sizes: Mapping[str, float] | None, per_circle: int | None) -> Mesh:
    blocks = actuator.blocks()
    if blocks is None:
        raise InputError(
            "this shape is not made of blocks", key="cells", expected=KINDS[2 if actuator.section else 3][0]
        )
    if sizes:
        raise InputError("a mesh in rows has one size", key="sizes", expected="no sizes by region or surface")
    model = str(actuator.model_dump().get("model", "full"))
    usual = PER_CIRCLE_OF_SECTION if actuator.section else actuator.per_circle
    return structured_mesh(blocks, model, size, usual if per_circle is None else per_circle, MOST_CELLS // 8)


@dataclass(frozen=True)
class _Cells:
    """The solid's elements as gmsh left them: points, cells in VTK order, regions, and gmsh's node tag → our index."""

    points: FloatArray
    cells: IntArray
    regions: dict[str, IntArray]
    index: IntArray


def _local_sizes(gmsh: ModuleType, shape: Shape, sizes: Mapping[str, float]) -> list[int]:
    """Return fields that limit the size inside named regions and on named surfaces; from there it grows by itself."""
    field = gmsh.model.mesh.field
    limits = []
    for name, size in sizes.items():
        if name not in shape.regions and name not in shape.surfaces:
            expected = "one of: " + ", ".join([*shape.regions, *shape.surfaces])
            raise InputError("the shape has no region or surface of this name", key=f"sizes.{name}", expected=expected)
        limit = field.add("Constant")
        field.setNumber(limit, "VIn", size)
        regions, surfaces = ("VolumesList", "SurfacesList") if shape.dimension == 3 else ("SurfacesList", "CurvesList")
        field.setNumbers(limit, regions, shape.regions.get(name, []))
        field.setNumbers(limit, surfaces, shape.surfaces.get(name, []))
        limits.append(limit)
    return limits


def _set_smallest(gmsh: ModuleType, limits: list[int]) -> None:
    """Let the smallest of the fields limit the size."""
    if limits:
        field = gmsh.model.mesh.field
        smallest = field.add("Min")
        field.setNumbers(smallest, "FieldsList", limits)
        field.setAsBackgroundMesh(smallest)


def _check_count(gmsh: ModuleType, shape: Shape, size: float) -> None:
    """Refuse a size that would fill the memory before anybody could interrupt."""
    volume, area = shape.faceted or (
        sum(gmsh.model.occ.getMass(dimension, tag) for _, tag in gmsh.model.getEntities(dimension))
        for dimension in (3, 2)
    )
    # Regular tetrahedra and, where walls are thinner than the size, three to every triangle of the skin.
    count = 8.5 * volume / size**3 + 3 * 2.3 * area / size**2
    if count > MOST_CELLS:
        problem = f"this element size needs about {count:.1g} elements"
        expected = f"a larger size: at most {MOST_CELLS:.0g} elements"
        raise InputError(problem, key="size", value=f"{size:g} mm", expected=expected)


def _divide(gmsh: ModuleType, size: float, per_circle: int, dimension: int) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", per_circle)
    try:
        gmsh.model.mesh.generate(dimension)
        if dimension == 3:
            gmsh.model.mesh.optimize("Netgen")
    except Exception as error:  # gmsh raises bare Exceptions that carry its own text
        problem = f"gmsh cannot mesh this shape: {error}"
        raise InputError(problem, key="size", value=f"{size:g} mm", expected="a smaller size") from error


def _curved(gmsh: ModuleType, shape: Shape) -> _Cells:
    """Put the middle nodes on the geometry and take back the curvature of elements that it would tangle."""
    gmsh.model.mesh.setOrder(2)
    mesh = _read_cells(gmsh, shape)
    points, count = untangled(mesh.points, mesh.cells)
    if count:
        LOG.warning(
            "%d of %d elements are less curved than the shape, or they would be invalid; a smaller size helps",
            count,
            len(mesh.cells),
        )
    return replace(mesh, points=points)


def _read_cells(gmsh: ModuleType, shape: Shape) -> _Cells:
    kind, order = (_TET10, _GMSH_TO_VTK) if shape.dimension == 3 else (_TRI6, list(range(6)))
    blocks = {name: _elements(gmsh, kind, tags) for name, tags in shape.regions.items()}
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
    # What lies in a coordinate plane lies in it exactly: a symmetry plane or an axis depends on it.
    points[np.abs(points) < 1e-10 * np.ptp(points, axis=0).max()] = 0.0
    cells = cells.reshape(-1, len(order))[:, order]
    if shape.dimension == 2:
        points = points[:, [0, 2]]
        clockwise = jacobian_coefficients(points[cells]).mean(axis=1) < 0.0
        cells[clockwise] = cells[clockwise][:, CELLS["tri6"].mirrored]
    return _Cells(points, np.asarray(cells, dtype=np.int32), regions, index)


def _elements(gmsh: ModuleType, kind: int, tags: Sequence[int]) -> npt.NDArray[np.uint64]:
    """Return gmsh's node tags ``(k, n)`` of the elements of one kind on some entities."""
    found = [gmsh.model.mesh.getElementsByType(kind, tag)[1] for tag in tags]
    return np.concatenate(found).reshape(-1, _NODES[kind])


def _named_mesh(gmsh: ModuleType, shape: Shape, mesh: _Cells) -> Mesh:
    surfaces = {}
    kind = _TRI6 if shape.dimension == 3 else _LINE3
    for name, tags in shape.surfaces.items():
        faces = _elements(gmsh, kind, tags)[:, : shape.dimension]
        surfaces[name] = outward_faces(mesh.cells, mesh.index[faces])
    markers = {name: nodes_on_polyline(mesh.points, line, name) for name, line in shape.markers.items()}
    caps = {name: mesh.index[_elements(gmsh, _LINE3, tags)] for name, tags in shape.caps.items()}
    named = Mesh(mesh.points, mesh.cells, mesh.regions, surfaces, markers, shape.curves, caps)
    _check_caps(named)
    return named


def _check_caps(mesh: Mesh) -> None:
    """Refuse a cap with no air behind it, as over the outline of a face."""
    least = 1e-6 * mesh.volume()
    for name, edges in mesh.caps.items():
        for surface, faces in mesh.surfaces.items():
            behind = surface.startswith("cavity") and np.isin(edges, faces).all()
            if behind and mesh.enclosed_volume(surface) < least:
                raise InputError(
                    "there is no air behind this rim", key=f"caps.{name}", expected="the rim of an opening"
                )


def untangled(points: FloatArray, cells: IntArray) -> tuple[FloatArray, int]:
    """Take back curvature, halving it up to four times and then to none, where it spoils an element.

    Parameters
    ----------
    points, cells
        Shapes ``(n, 3)`` and ``(m, 10)``, or ``(n, 2)`` and ``(m, 6)``.

    Returns
    -------
    points, count
        The points with the middle nodes of spoilt cells moved towards the middles of their edges, so that the lower
        bound of every cell's Jacobian is at least `LEAST_DISTORTION` of its upper bound; and how many cells that took.

    Raises
    ------
    InputError
        If a cell is inside out even with straight edges.
    """
    points = points.copy()
    rounds = np.zeros(len(cells), dtype=np.int64)
    first, second = np.array(body_cell(cells).edges).T
    corners = body_cell(cells).n_corners
    while (spoilt := _is_spoilt(points[cells])).any():
        if (rounds[spoilt] > _HALVINGS).any():
            cell = int(np.flatnonzero(spoilt & (rounds > _HALVINGS))[0])
            place = points[cells[cell, :corners]].mean(axis=0).round(2).tolist()
            raise InputError(f"gmsh left an element inside out near {place} mm", key="size", expected="a smaller size")
        # A middle node belongs to several cells and must move once; a neighbour that this spoils has its turn next.
        straight = 0.5 * (points[cells[spoilt][:, first]] + points[cells[spoilt][:, second]])
        middles, place_of = np.unique(cells[spoilt, corners:], return_index=True)
        share = np.zeros(len(points))
        np.maximum.at(share, cells[spoilt, corners:], np.where(rounds[spoilt] < _HALVINGS, 0.5, 1.0)[:, None])
        points[middles] += share[middles, None] * (straight.reshape(-1, points.shape[1])[place_of] - points[middles])
        rounds[spoilt] += 1
    return points, int((rounds > 0).sum())


def _is_spoilt(nodes: FloatArray) -> npt.NDArray[np.bool_]:
    coefficients = jacobian_coefficients(nodes)
    spoilt: npt.NDArray[np.bool_] = coefficients.min(axis=1) < LEAST_DISTORTION * np.abs(coefficients).max(axis=1)
    return spoilt
