"""How good the elements of a mesh are, and where the worst one is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turgor.mesh.cells import Cell, determinants, jacobians
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray, jacobian_coefficients

_REGULAR = {"tet10": np.sqrt(2.0), "tri6": 2.0 / np.sqrt(3.0), "hex27": 1.0, "quad9": 1.0}
"""One over the product of the unit tangents at a corner of the regular element."""


@dataclass(frozen=True, eq=False)
class Quality:
    """Measures of every element; 1 is a regular tetrahedron (triangle, cube, square) with straight edges.

    Parameters
    ----------
    scaled_jacobian
        Shape ``(m,)``: the smallest, over the corners, of the triple product of the unit tangents of the edges that
        meet there, over the regular element's (Knupp, 2000, on the curved edges): of a tetrahedron √2 times it.
    aspect
        Shape ``(m,)``: longest edge over 2√6 times the radius of the inscribed sphere, of the straight-edged element
        (Parthasarathy, Graichen and Hathaway, 1994; of a triangle over 2√3 times); 1 is best, larger is worse.
    distortion
        Shape ``(m,)``: lower bound of det ∂x/∂ξ over its upper bound, by Bézier coefficients; positive where the
        element is proved valid, 1 where its edges are straight.
    centres
        Shape ``(m, d)``: mean of the corners in mm.
    """

    scaled_jacobian: FloatArray
    aspect: FloatArray
    distortion: FloatArray
    centres: FloatArray

    @property
    def worst_cell(self) -> int:
        """Return the cell with the smallest scaled Jacobian."""
        return int(np.argmin(self.scaled_jacobian))

    def summary(self) -> dict[str, float | int | list[float]]:
        """Return the extremes, means and the worst element's place, for reports."""
        return {
            "elements": len(self.aspect),
            "scaled_jacobian_min": float(self.scaled_jacobian.min()),
            "scaled_jacobian_mean": float(self.scaled_jacobian.mean()),
            "aspect_max": float(self.aspect.max()),
            "aspect_mean": float(self.aspect.mean()),
            "distortion_min": float(self.distortion.min()),
            "worst_element": self.worst_cell,
            "worst_place_mm": [round(float(x), 3) for x in self.centres[self.worst_cell]],
        }


def quality(mesh: Mesh) -> Quality:
    """Measure every element of a mesh.

    Of cells that are no simplices the aspect is the longest over the shortest edge, and the distortion compares the
    Jacobian at the corners and quadrature points, which proves nothing between them.
    """
    nodes, cell = mesh.points[mesh.cells], mesh.cell
    corners = nodes[:, : cell.n_corners]
    if cell.simplex:
        jacobian = jacobian_coefficients(nodes)
    else:
        jacobian = determinants(jacobians(nodes, cell, np.vstack([cell.nodes[: cell.n_corners], cell.points])))
    return Quality(
        scaled_jacobian=_scaled_jacobian(nodes, cell),
        aspect=_aspect(corners, cell),
        distortion=jacobian.min(axis=1) / jacobian.max(axis=1),
        centres=corners.mean(axis=1),
    )


def _scaled_jacobian(nodes: FloatArray, cell: Cell) -> FloatArray:
    places = cell.nodes[: cell.n_corners]
    around = [[b if a == corner else a for a, b in cell.edges if corner in (a, b)] for corner in range(cell.n_corners)]
    directions = places[np.array(around)] - places[:, None, :]
    # Of each corner's edges, so ordered that a valid element gives a positive product.
    turned = np.linalg.det(directions) < 0.0
    directions[turned] = directions[turned][:, ::-1]
    tangents = np.einsum("mqij,qej->mqei", jacobians(nodes, cell, places), directions)
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    worst: FloatArray = _REGULAR[cell.name] * np.linalg.det(tangents).min(axis=1)
    return worst


def _aspect(corners: FloatArray, cell: Cell) -> FloatArray:
    first, second = np.array(cell.edges).T
    edges = np.linalg.norm(corners[:, first] - corners[:, second], axis=2)
    longest = edges.max(axis=1)
    if not cell.simplex:
        return np.asarray(longest / edges.min(axis=1))
    size = np.abs(determinants(np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2)))
    if cell.dimension == 2:
        return np.asarray(longest * edges.sum(axis=1) / (2.0 * np.sqrt(3.0) * size))
    faces = corners[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]]
    normals = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    surface = 0.5 * np.linalg.norm(normals, axis=2).sum(axis=1)
    return np.asarray(longest * surface / (np.sqrt(6.0) * size))
