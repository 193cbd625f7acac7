"""The skin that may touch something: its faces, their quadrature points, the wall behind them, and who is near whom."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from turgor.fem.contact.pairs import FACING
from turgor.fem.elements import TRI6
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.faces import boundary_faces, host_cells
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.intp]

ASKEW = 0.2
"""So much farther from opposite (in cosine) may the middles of two curved faces be than the places where they touch."""

DEPTH = 0.6
"""Part of the wall, or of a face's size if that is less, up to which a point behind a face counts as overlapping it."""

STIFFNESS = 500.0
"""Contact stiffness times wall over pressure: at the pressure the overlap is 1/500 of the wall, at 2.5 times it 1/200.

Walls that press on each other carry up to about 2.5 times the air pressure (measured). Where the faces are smaller than
the wall is thick, their size counts instead: contact then has details smaller than the wall.
"""

PART_OF_MODULUS = 0.25
"""Where no pressure tells how hard surfaces press, this part of the shear modulus is taken for it."""


class Skin:
    """Six-node boundary faces with what contact needs to know of them.

    Parameters
    ----------
    mesh
        The body.
    faces
        The faces ``(k, 6)``, outward.
    materials
        The material of each region.
    pressure
        The largest air pressure in the body, MPa.

    Attributes
    ----------
    rule
        Local coordinates of the quadrature points, ``(q, 2)``.
    shape
        Shape functions there, ``(q, 6)``.
    area
        Reference area that belongs to each quadrature point, ``(k, q)``, mm².
    wall
        Thickness of the body behind each face, ``(k,)``, mm.
    load
        Scale of the contact pressure of each face, ``(k,)``, MPa.
    grip
        Thickness of the wall or size of the face, whichever is less, ``(k,)``, mm.
    depth
        How far a point may lie behind a face and still count as overlapping it, ``(k,)``, mm.
    size
        Mean edge length of the faces, mm.
    """

    def __init__(self, mesh: Mesh, faces: Ints, materials: Mapping[str, Hyperelastic], pressure: float) -> None:
        self.points = mesh.points
        self.faces = np.ascontiguousarray(faces, dtype=np.int32)
        self.rule = TRI6.points
        self.shape = TRI6.shape_at_quadrature
        tangents = np.einsum("qar,fai->fqri", TRI6.gradient_at_quadrature, mesh.points[faces])
        self.area = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=2) * TRI6.weights
        self._centre, self._normal, self._radius = _balls(mesh.points, self.faces)
        part_of_node = _parts(mesh)
        self._part = part_of_node[self.faces[:, 0]]
        self.size = float(np.sqrt(self.area.sum() / len(faces)))
        self.wall = np.empty(len(faces))
        whole = boundary_faces(mesh.cells)
        for part in np.unique(self._part):
            centre, normal, _ = _balls(mesh.points, whole[part_of_node[whole[:, 0]] == part])
            here = self._part == part
            _, same = cKDTree(centre).query(self._centre[here])
            self.wall[here] = wall_thickness(centre, normal)[same]
        self.grip = np.minimum(self.wall, np.sqrt(2.0 * self.area.sum(axis=1)))
        self.depth = DEPTH * self.grip
        modulus = np.empty(mesh.n_cells)
        for region, material in materials.items():
            modulus[mesh.region(region)] = material.shear_modulus
        self.load = np.maximum(PART_OF_MODULUS * modulus[host_cells(mesh.cells, self.faces)], abs(pressure))

    def candidates(self, x: Floats, reach: float, group: Ints | None) -> tuple[Indices, Ints]:
        """Return for each face the faces that its points may overlap, or meet within `reach`, at positions `x`.

        Faces that share a node never meet, nor do the two sides of one wall: faces of one body that lie near and
        behind one another at rest. With `group` ``(k,)``, only faces of different groups meet.

        Returns
        -------
        start, candidates
            In compressed rows: the candidates of face ``f`` are ``candidates[start[f]:start[f + 1]]``.
        """
        if not np.isfinite(x).all():
            # The iteration has gone astray, which is for the solver to say.
            return np.zeros(len(self.faces) + 1, np.intp), np.empty(0, np.int32)
        centre, normal, radius = _balls(x, self.faces)
        first, second = _opposed(centre, normal, 2.0 * radius.max() + max(reach, self.depth.max()))
        between = np.linalg.norm(centre[first] - centre[second], axis=1)
        reaches = radius[first] + radius[second] + np.maximum(reach, np.minimum(self.depth[first], self.depth[second]))
        keep = between <= reaches
        if group is not None:
            keep &= group[first] != group[second]
        first, second = first[keep], second[keep]
        keep = ~(self._neighbours(first, second) | self._one_wall(first, second))
        first, second = first[keep], second[keep]
        order = np.lexsort((second, first))
        start = np.concatenate([[0], np.cumsum(np.bincount(first, minlength=len(self.faces)))])
        return start.astype(np.intp), second[order].astype(np.int32)

    def _neighbours(self, first: Ints, second: Ints) -> NDArray[np.bool_]:
        corners = self.faces[:, :3]
        shared = corners[first][:, :, None] == corners[second][:, None, :]
        return np.asarray(shared.any(axis=(1, 2)))

    def _one_wall(self, first: Ints, second: Ints) -> NDArray[np.bool_]:
        away = self._centre[second] - self._centre[first]
        distance = np.linalg.norm(away, axis=1)
        wall = np.maximum(self.wall[first], self.wall[second])
        near = distance < 1.5 * wall + self._radius[first] + self._radius[second]
        behind = np.einsum("ni,ni->n", away, self._normal[first]) < -1e-6 * distance
        ahead = np.einsum("ni,ni->n", away, self._normal[second]) > 1e-6 * distance
        return np.asarray((self._part[first] == self._part[second]) & near & behind & ahead)


def wall_thickness(centre: Floats, normal: Floats) -> Floats:
    """Return the thickness of the body behind each of the surface points ``(k, 3)`` with unit normals outward.

    It is the diameter of the largest empty ball that touches the surface there from inside (Ma, Bae and Choi 2012),
    counted where the ball touches an opposite surface; elsewhere (near edges) the nearest such point's is taken.
    """
    tree = cKDTree(centre)
    whole = float(np.linalg.norm(np.ptp(centre, axis=0)))
    radius = np.full(len(centre), whole)
    other = np.arange(len(centre))
    active = np.arange(len(centre))
    while len(active):
        distance, nearest = tree.query(centre[active] - radius[active, None] * normal[active])
        closer = distance < radius[active] * (1.0 - 1e-9)
        active, nearest = active[closer], nearest[closer]
        away = centre[active] - centre[nearest]
        height = np.einsum("ki,ki->k", away, normal[active])
        shrunk = np.einsum("ki,ki->k", away, away) / (2.0 * np.maximum(height, 1e-12 * whole))
        progress = shrunk < radius[active] * (1.0 - 1e-6)
        radius[active] = np.minimum(shrunk, radius[active])
        other[active] = nearest
        active = active[progress]
    opposed = np.einsum("ki,ki->k", normal, normal[other]) < FACING
    if not opposed.any():
        return np.full(len(centre), float(np.ptp(centre, axis=0).min()))
    _, nearest = cKDTree(centre[opposed]).query(centre)
    return np.asarray(2.0 * radius[opposed][nearest])


def _balls(x: Floats, faces: Ints) -> tuple[Floats, Floats, Floats]:
    """Return centre ``(k, 3)``, unit normal ``(k, 3)`` and radius ``(k,)`` of balls around the faces' nodes."""
    nodes = x[faces]
    centre = nodes[:, 3:].sum(axis=1) * (4.0 / 9.0) - nodes[:, :3].sum(axis=1) / 9.0
    normal = np.cross(nodes[:, 4] - nodes[:, 3], nodes[:, 5] - nodes[:, 3])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    radius = np.linalg.norm(nodes - centre[:, None, :], axis=2).max(axis=1)
    return centre, normal, radius


def _opposed(centre: Floats, normal: Floats, distance: float) -> tuple[Indices, Indices]:
    """Return all ordered pairs of faces within a distance whose normals are about opposite.

    Normals, scaled by the distance, are three more coordinates, and each face looks for the mirror images of others:
    so the many pairs of neighbours on one surface are far from each other and never looked at.
    """
    cosine = FACING + ASKEW
    here = cKDTree(np.hstack([centre, distance * normal]))
    mirrored = cKDTree(np.hstack([centre, -distance * normal]))
    found = here.sparse_distance_matrix(mirrored, distance * np.sqrt(1.0 + 2.0 * (1.0 + cosine)), output_type="ndarray")
    first, second = found["i"], found["j"]
    keep = first != second
    return first[keep], second[keep]


def _parts(mesh: Mesh) -> Ints:
    """Return for each node the number of the connected body that it belongs to, ``(n_points,)``."""
    first = np.repeat(mesh.cells[:, 0], mesh.cells.shape[1])
    graph = sp.csr_matrix((np.ones(len(first), np.int8), (first, mesh.cells.ravel())), shape=(mesh.n_points,) * 2)
    return np.asarray(connected_components(graph, directed=False)[1])
