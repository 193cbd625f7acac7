"""Elements through the walls: a field of sizes that follows their thickness, counted on the mesh that comes of it."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.geometry.actuator import Shape
from turgor.geometry.imported.triangles import agreeing
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray, IntArray
from turgor.mesh.thickness import wall_thickness
from turgor.mesh.walls import walls

LOG = logger("mesh")

EDGE_OF_LAYER = 0.9
"""Edge length asked for over the thickness of a layer: between the two sides of a wall gmsh leaves longer ones."""

FEWEST = 5
"""Per cent of the skin's faces behind which walls may have fewer elements than asked for."""

_REPEATS = 2
_TRI3 = 2


def with_layers(
    gmsh: ModuleType, shape: Shape, size: float, layers: int, most: int, meshed: Callable[[int], Mesh]
) -> Mesh:
    """Mesh a drawn body with at least `layers` elements through its walls behind all but 5 % of its skin.

    The skin has been meshed with `size`. Where the count on the mesh that comes of it falls short, thickness is
    measured again on that finer skin, with sizes smaller by what was missing, at most twice; what is then still short
    is logged.

    Parameters
    ----------
    gmsh, shape
        The open session and what was drawn in it.
    size
        Largest edge length, mm.
    layers
        Elements through each wall.
    most
        Number of elements beyond which the layers are refused.
    meshed
        Meshes the body with the size limited by a field of this number.

    Raises
    ------
    InputError
        If the number of layers is none, the shape is plane, or they would take too many elements.
    """
    points, triangles = _skin(gmsh, shape)
    scale = EDGE_OF_LAYER
    for repeat in range(_REPEATS + 1):
        wall = np.minimum(scale * wall_thickness(points, triangles) / layers, size)
        _check_count(points[triangles], wall, layers, most)
        field = _field(gmsh, points, triangles, wall)
        gmsh.model.mesh.clear()
        mesh = meshed(field)
        counted = walls(mesh)
        assert counted is not None, "a mesh of tetrahedra"
        found = float(np.percentile(counted.elements, FEWEST))
        if found >= layers:
            break
        points, triangles = mesh.points, boundary_faces(mesh.cells)[:, :3]
        # The first skin is coarse and misses where thin walls begin: only what the second still lacks is the sizes'.
        scale *= found / layers if repeat else 1.0
    else:
        LOG.warning(
            "behind %d %% of the skin walls have fewer than %.2g elements; %d were asked for", FEWEST, found, layers
        )
    return mesh


def check_layers(layers: int, dimension: int) -> None:
    """Raise InputError if layers are asked for that cannot be."""
    if dimension != 3:
        raise InputError("walls are measured in space only", key="layers", value=layers, expected="sizes instead")
    if not (isinstance(layers, int) and layers >= 1):
        raise InputError("the number of layers must be at least 1", key="layers", value=layers)


def _field(gmsh: ModuleType, points: FloatArray, triangles: IntArray, size: FloatArray) -> int:
    """Return a field of the `size` at each triangle of the skin; inside the body that of the nearest holds."""
    view = gmsh.view.add("walls")
    # A facet that reaches over to a thinner wall takes its size.
    at_node = np.full(len(points), np.inf)
    np.minimum.at(at_node, triangles, size[:, None])
    corners = points[triangles].transpose(0, 2, 1).reshape(len(triangles), 9)
    gmsh.view.addListData(view, "ST", len(triangles), np.hstack([corners, at_node[triangles]]).ravel())
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    return int(field)


def _skin(gmsh: ModuleType, shape: Shape) -> tuple[FloatArray, IntArray]:
    """Return points and outward triangles of the skin's mesh."""
    pairs = [(3, tag) for tags in shape.regions.values() for tag in tags]
    skin = gmsh.model.getBoundary(pairs, combined=True, oriented=False)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int32)
    place[tags] = np.arange(len(tags))
    triangles = np.vstack([gmsh.model.mesh.getElementsByType(_TRI3, tag)[1].reshape(-1, 3) for _, tag in skin])
    points = coordinates.reshape(-1, 3)
    return points, outward(points, place[triangles])


def outward(points: FloatArray, triangles: IntArray) -> IntArray:
    """Turn the triangles ``(k, 3)`` of closed shells so that their normals leave the solid between the shells.

    The sense in which gmsh lists the faces of a hollow volume does not tell the outside from a cavity.
    """
    turned = agreeing(points, triangles).astype(np.int32)
    sides = turned[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(sides)), sides.T), shape=(len(points), len(points)))
    shell = connected_components(graph, directed=False)[1][turned[:, 0]]
    for number in np.unique(shell):
        own, others = turned[shell == number], turned[shell != number]
        corners = points[own]
        volume = np.linalg.det(corners - corners[0, 0]).sum()
        # Inside an odd number of other shells there is a cavity.
        hollow = round(_turns(points[others] - corners[0, 0])) % 2 == 1
        if (volume < 0.0) != hollow:
            turned[shell == number] = own[:, ::-1]
    return turned


def _turns(corners: FloatArray) -> float:
    """Return how often triangles ``(k, 3, 3)`` surround the origin (solid angles: van Oosterom and Strackee, 1983)."""
    length = np.linalg.norm(corners, axis=2)
    one, two, three = (np.einsum("ki,ki->k", corners[:, i - 2], corners[:, i - 1]) * length[:, i] for i in range(3))
    angle = 2.0 * np.arctan2(np.linalg.det(corners), length.prod(axis=1) + one + two + three)
    return float(np.abs(angle.sum())) / (4.0 * np.pi)


def _check_count(corners: FloatArray, size: FloatArray, layers: int, most: int) -> None:
    """Refuse layers that would fill the memory: half of each wall belongs to the facets of either side."""
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    count = 8.5 * float((area * 0.5 * layers * size / size**3).sum())
    if count > most:
        problem = f"so many layers need about {count:.1g} elements"
        raise InputError(problem, key="layers", value=layers, expected=f"fewer: at most {most:.0g} elements")
