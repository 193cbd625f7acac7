"""The skin that may touch something: its faces, their quadrature points and the wall behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from turgor.fem.contact.partners import FACING, balls
from turgor.fem.incidence import parts
from turgor.fem.section import Section, depth
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.cells import CELLS, Cell, Rule, face_areas, face_cell, jacobians
from turgor.mesh.faces import boundary_faces, host_cells
from turgor.mesh.mesh import Mesh, in_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

DEPTH = 0.6
"""Part of the wall, or of a face's size if that is less, up to which a point behind a face counts as overlapping it."""

STIFFNESS = 500.0
"""Contact stiffness times wall over pressure: at the pressure the overlap is 1/500 of the wall, at 2.5 times it 1/200.

Walls that press on each other carry up to about 2.5 times the air pressure (measured). Where the faces are smaller than
the wall is thick, their size counts instead: contact then has details smaller than the wall.
"""

PART_OF_MODULUS = 0.25
"""Where no pressure tells how hard surfaces press, this part of the shear modulus is taken for it."""

SOON = 0.5
"""Faces whose gap is below so many face sizes are given room in the matrix."""


class Skin:
    """Boundary faces (in a plane model edges) with what contact needs to know of them.

    Parameters
    ----------
    mesh
        The body.
    faces
        The faces ``(k, n)``, outward.
    materials
        The material of each region.
    pressure
        The largest air pressure in the body, MPa.
    section
        What a plane mesh stands for.

    Attributes
    ----------
    cell
        Kind of the faces, with the points at which contact is looked for.
    dimension
        Number of displacement components, d.
    points
        Places of all nodes at rest, ``(n_points, 3)``: those of a plane mesh lie at z = 0.
    rule
        Local coordinates of the quadrature points, ``(q, 2)``.
    few
        Those of the fewer points from which a step is looked ahead.
    shape
        Shape functions there, ``(q, n)``.
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
    part
        Number of the connected body that each face belongs to, ``(k,)``.
    size
        Mean edge length of the faces, mm.
    """

    def __init__(
        self,
        mesh: Mesh,
        faces: Ints,
        materials: Mapping[str, Hyperelastic],
        pressure: float,
        section: Section | None = None,
    ) -> None:
        self.cell = cell = _contact_cell(faces)
        self.dimension = mesh.dimension
        self.points = np.array(in_space(mesh.points), order="C")
        self.faces = np.ascontiguousarray(faces, dtype=np.int32)
        self.rule, self.few = (_in_the_plane(points) for points in (cell.points, face_cell(faces).points))
        self.shape = cell.shape_at_quadrature
        nodes = mesh.points[self.faces]
        self.area = _measures(nodes, cell) * cell.weights * depth(section, cell.shape_at_quadrature @ nodes)
        centre_of_face, *_ = balls(self.points, self.faces)
        part_of_node = parts(mesh.cells, mesh.n_points)[1]
        self.part = part_of_node[self.faces[:, 0]]
        plain = face_areas(mesh.points[self.faces])
        extent = (plain / cell.weights.sum()) ** (1.0 / cell.dimension)
        self.size = float(np.sqrt(0.5 * np.mean(extent**2)))
        self.wall = np.empty(len(faces))
        whole = boundary_faces(mesh.cells)
        for part in np.unique(self.part):
            centre, normal, *_ = balls(self.points, whole[part_of_node[whole[:, 0]] == part])
            here = self.part == part
            _, same = cKDTree(centre).query(centre_of_face[here])
            self.wall[here] = wall_thickness(centre, normal)[same]
        self.grip = np.minimum(self.wall, extent)
        self.depth = DEPTH * self.grip
        modulus = np.empty(mesh.n_cells)
        for region, material in materials.items():
            modulus[mesh.region(region)] = material.shear_modulus
        self.load = np.maximum(PART_OF_MODULUS * modulus[host_cells(mesh.cells, self.faces)], abs(pressure))

    def space(self, u: Floats) -> Floats:
        """Return where the nodes are after the displacement `u` ``(n_points, d)``: ``(n_points, 3)``, mm."""
        x = self.points.copy()
        x[:, : self.dimension] += u[: len(x)]  # behind the nodes come rigid bodies
        return x

    def shape_at(self, local: Floats) -> Floats:
        """Return the shape functions ``(p, n)`` at local points ``(p, 2)``."""
        return self.cell.shape(local[:, : self.cell.dimension])


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
        extents = np.ptp(centre, axis=0)
        return np.full(len(centre), float(extents[extents > 0.0].min()))
    _, nearest = cKDTree(centre[opposed]).query(centre)
    return np.asarray(2.0 * radius[opposed][nearest])


def _contact_cell(faces: Ints) -> Cell:
    """Return the kind of the faces with the points at which contact is looked for.

    Three points in each of the four parts that the middles of its sides cut a triangle into, four in each of those of a
    quadrilateral: with six (nine) in the whole, faces were seen to overlap far more between the points than at them.
    """
    cell = face_cell(faces)
    if cell.dimension == 1:
        return cell
    if cell.simplex:
        part, places = CELLS["tri6"].rule, [(0.0, 0.0, 0.5), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5), (0.5, 0.5, -0.5)]
    else:
        part, places = _four_point_rule(), [(0.0, 0.0, 0.5), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5), (0.5, 0.5, 0.5)]
    points = np.vstack([np.array([a, b]) + size * part.points for a, b, size in places])
    return replace(cell, rule=Rule(points, np.tile(part.weights / 4, 4)))


def _in_the_plane(points: Floats) -> Floats:
    return np.ascontiguousarray(np.pad(points, ((0, 0), (0, 2 - points.shape[1]))))


def _four_point_rule() -> Rule:
    # Gauss, exact to degree 3 in each coordinate.
    near, far = 0.5 - 0.5 / 3**0.5, 0.5 + 0.5 / 3**0.5
    return Rule(np.array([[near, near], [far, near], [near, far], [far, far]]), np.full(4, 0.25))


def _measures(nodes: Floats, cell: Cell) -> Floats:
    """Return area (of edges: length) per reference area at the quadrature points, ``(k, q)``."""
    tangents = jacobians(nodes, cell)
    if cell.dimension == 1:
        return np.asarray(np.linalg.norm(tangents[..., 0], axis=2))
    return np.asarray(np.linalg.norm(np.cross(tangents[..., 0], tangents[..., 1]), axis=2))
