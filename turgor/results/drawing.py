"""What is drawn of a body: its outside in space, the whole of a plane section, or the revolved body cut open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh, in_space
from turgor.mesh.symmetry import planes_of_symmetry
from turgor.mesh.tet10 import IntArray
from turgor.results.camera import AZIMUTH
from turgor.results.skin import compact, outside_faces, six_node_triangles
from turgor.results.stored import Body

FloatArray = npt.NDArray[np.float64]

SHOWN_TURN = 1.5 * math.pi
"""Part of the full turn of a body of revolution that is drawn; the quarter before the camera is left out."""

SEGMENTS = 18
"""Curved faces along it."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """Curved triangles in space that follow the nodes of a mesh.

    Parameters
    ----------
    faces
        Drawn points of each six-node triangle, ``(k, 6)``, turning outward.
    source
        Node of the mesh that each drawn point follows, ``(p,)``.
    cuts
        Unit vectors along the axes out of the planes that the body is cut by, ``(c, 3)``.
    turn
        Angle in rad by which each is turned about the y axis, ``(p,)``; ``None`` for a body that is not revolved.
    """

    faces: IntArray
    source: IntArray
    cuts: FloatArray
    turn: FloatArray | None = None

    def places(self, positions: FloatArray) -> FloatArray:
        """Return the places ``(p, 3)`` of the drawn points where the nodes are at `positions` ``(n, d)``."""
        here = in_space(positions[self.source])
        if self.turn is None:
            return here
        radius, height = here[:, 0], here[:, 1]
        return np.column_stack([radius * np.cos(self.turn), height, -radius * np.sin(self.turn)])


def drawing_of(body: Body) -> Drawing:
    """Return what is drawn of a body."""
    mesh = body.mesh
    if body.kind == "axisymmetric":
        return _revolved(mesh)
    faces = six_node_triangles(outside_faces(mesh) if body.kind == "space" else mesh.cells)
    nodes, compacted = compact(faces)
    return Drawing(compacted, nodes, _cuts(mesh))


def _cuts(mesh: Mesh) -> FloatArray:
    """Return the axes, with their signs, that the planes of symmetry of a body in space face most."""
    normals = [plane.normal for plane in planes_of_symmetry(mesh)] if mesh.dimension == 3 else []
    cuts = np.zeros((len(normals), 3))
    for cut, normal in zip(cuts, normals, strict=True):
        axis = int(np.argmax(np.abs(normal)))
        cut[axis] = np.sign(normal[axis])
    return cuts


def _revolved(mesh: Mesh) -> Drawing:
    """Sweep the section's boundary about the y axis and close the cuts with the section itself."""
    edges = boundary_faces(mesh.cells)
    off_axis = np.abs(mesh.points[edges, 0]) > 1e-9 * np.ptp(mesh.points, axis=0).max()
    edges, off_axis = edges[off_axis.any(axis=1)], off_axis[off_axis.any(axis=1)]
    # The quarter that is left out lies around the direction in which the camera stands.
    begin = AZIMUTH - 0.25 * math.pi
    turns = begin + np.linspace(0.0, SHOWN_TURN, 2 * SEGMENTS + 1)
    n = mesh.n_points
    a, b, middle = edges.T
    levels = 2 * n * np.arange(SEGMENTS)[:, None]
    # Along the turn first, then along the edge: so the quadrilaterals look out of the body.
    corners = (a, a + 2 * n, b + 2 * n, b)
    # A quadrilateral with a corner on the axis is only one triangle, whose second side is then a meridian too.
    centre = middle + n * np.where(off_axis[:, 1], np.where(off_axis[:, 0], 1, 2), 0)
    middles = (a + n, middle + 2 * n, b + n, middle, centre)
    swept = np.stack([(node + levels).ravel() for node in (*corners, *middles)], axis=1)
    area = np.tile(off_axis[:, :2], (SEGMENTS, 1)).ravel()
    cap = six_node_triangles(mesh.cells)
    last = cap[:, [0, 2, 1, 5, 4, 3]] + 2 * SEGMENTS * n
    faces = np.vstack([six_node_triangles(swept)[area], cap, last])
    points, compacted = compact(faces)
    level, source = np.divmod(points, n)
    # Looked at along z, the quarter that is left out lies before the camera.
    return Drawing(compacted, np.asarray(source, dtype=np.int32), np.array([[0.0, 0.0, 1.0]]), turns[level])
