"""How good the elements of a mesh are, and where the worst one is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turgor.common.errors import InputError
from turgor.mesh.cells import CELLS, jacobians
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray, jacobian_coefficients

_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
# The three other corners as seen from each corner, so ordered that a valid element gives a positive product.
_NEIGHBOURS = np.array([[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 2, 1]])


@dataclass(frozen=True, eq=False)
class Quality:
    """Measures of every element; 1 is a regular tetrahedron with straight edges.

    Parameters
    ----------
    scaled_jacobian
        Shape ``(m,)``: the smallest, over the corners, of √2 times the triple product of the unit tangents of the
        three edges that meet there (Knupp, 2000, on the curved edges); from −√2 to 1.
    aspect
        Shape ``(m,)``: longest edge over 2√6 times the radius of the inscribed sphere, of the straight-edged element
        (Parthasarathy, Graichen and Hathaway, 1994); 1 is best, larger is worse.
    distortion
        Shape ``(m,)``: lower bound of det ∂x/∂ξ over its upper bound, by Bézier coefficients; positive where the
        element is proved valid, 1 where its edges are straight.
    centres
        Shape ``(m, 3)``: mean of the four corners in mm.
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
    """Measure every element of a mesh of tetrahedra; raise InputError for another one."""
    if mesh.cell_type != "tet10":
        raise InputError("the quality of these cells is not measured", value=mesh.cell_type, expected="tet10")
    nodes = mesh.points[mesh.cells]
    corners = nodes[:, :4]
    coefficients = jacobian_coefficients(nodes)
    return Quality(
        scaled_jacobian=_scaled_jacobian(nodes),
        aspect=_aspect(corners),
        distortion=coefficients.min(axis=1) / coefficients.max(axis=1),
        centres=corners.mean(axis=1),
    )


def _scaled_jacobian(nodes: FloatArray) -> FloatArray:
    at_corners = jacobians(nodes, CELLS["tet10"], _CORNERS)
    directions = _CORNERS[_NEIGHBOURS] - _CORNERS[:, None, :]
    tangents = np.einsum("mqij,qej->mqei", at_corners, directions)
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    worst: FloatArray = np.sqrt(2.0) * np.linalg.det(tangents).min(axis=1)
    return worst


def _aspect(corners: FloatArray) -> FloatArray:
    first, second = np.triu_indices(4, 1)
    longest = np.linalg.norm(corners[:, first] - corners[:, second], axis=2).max(axis=1)
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    faces = corners[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]]
    normals = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    surface = 0.5 * np.linalg.norm(normals, axis=2).sum(axis=1)
    aspect: FloatArray = longest * surface / (6.0 * np.sqrt(6.0) * volume)
    return aspect
