"""How thick the walls of a body are: from each facet of its skin straight inward to the opposite side."""

from __future__ import annotations

import numpy as np

from turgor.common.optional import require
from turgor.mesh.tet10 import FloatArray, IntArray

_START = 1e-6
"""How far inside the facet a ray begins, as part of the body's size, so that it does not meet its own facet."""


def wall_thickness(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the distance ``(k,)`` in mm from the middle of each facet along its inward normal to the opposite side.

    Parameters
    ----------
    points
        Shape ``(n, 3)``.
    triangles
        Shape ``(k, 3)``: a closed skin, normals out of the solid. Infinity where a ray meets nothing.

    Raises
    ------
    MissingPackageError
        If VTK is absent.
    """
    data, core = require("vtkmodules.vtkCommonDataModel"), require("vtkmodules.vtkCommonCore")
    support = require("vtkmodules.util.numpy_support")
    skin, places, cells = data.vtkPolyData(), core.vtkPoints(), data.vtkCellArray()
    places.SetData(support.numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    connectivity = support.numpy_to_vtk(triangles.astype(np.int64).ravel(), deep=True, array_type=core.VTK_ID_TYPE)
    cells.SetData(3, connectivity)
    skin.SetPoints(places)
    skin.SetPolys(cells)
    locator = data.vtkStaticCellLocator()
    locator.SetDataSet(skin)
    locator.BuildLocator()
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    middles = corners.mean(axis=1)
    starts, ends = middles - _START * size * normals, middles - 1.01 * size * normals
    found = np.full(len(triangles), np.inf)
    along, place, local = core.mutable(0.0), [0.0] * 3, [0.0] * 3
    part, cell = core.mutable(0), core.mutable(0)
    for k, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        if locator.IntersectWithLine(start, end, 0.0, along, place, local, part, cell):
            found[k] = np.linalg.norm(np.array(place) - middles[k])
    return found
