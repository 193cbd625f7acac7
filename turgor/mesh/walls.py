"""Whether the walls of a body are resolved: how many elements lie between one side and the other."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from turgor.mesh.faces import boundary_faces, host_cells
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import FloatArray
from turgor.mesh.thickness import wall_thickness

_HEIGHT = sqrt(2.0 / 3.0)
"""Height of a regular tetrahedron with edges of length 1."""


@dataclass(frozen=True, eq=False)
class Walls:
    """The wall behind each face of the skin.

    Attributes
    ----------
    thickness
        ``(k,)``, mm: straight inward to the opposite side.
    elements
        ``(k,)``: that over the height of a regular tetrahedron whose edges are as long as the mean edge of the element
        at the face. Where walls are thick it is large; what counts is where it is small.
    places
        ``(k, 3)``: middles of the faces, mm.
    """

    thickness: FloatArray
    elements: FloatArray
    places: FloatArray

    def summary(self) -> dict[str, float | list[float]]:
        """Return the thinnest wall, how many elements walls have, and where they have fewest."""
        fewest = int(np.argmin(self.elements))
        return {
            "thinnest_mm": float(self.thickness.min()),
            "elements_through_min": float(self.elements.min()),
            "elements_through_5_percent": float(np.percentile(self.elements, 5)),
            "elements_through_median": float(np.median(self.elements)),
            "fewest_place_mm": [round(float(x), 3) for x in self.places[fewest]],
        }


def walls(mesh: Mesh) -> Walls | None:
    """Measure the walls of a mesh of tetrahedra; of another mesh return None."""
    if mesh.cell_type != "tet10":
        return None
    skin = boundary_faces(mesh.cells)
    thickness = wall_thickness(mesh.points, skin[:, :3])
    met = np.isfinite(thickness)
    corners = mesh.points[mesh.cells[host_cells(mesh.cells, skin[met]), :4]]
    first, second = np.triu_indices(4, 1)
    edge = np.linalg.norm(corners[:, first] - corners[:, second], axis=2).mean(axis=1)
    places = mesh.points[skin[met, :3]].mean(axis=1)
    return Walls(thickness[met], thickness[met] / (_HEIGHT * edge), places)
