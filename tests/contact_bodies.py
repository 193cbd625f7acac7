"""Bodies that touch: meshes in several parts, hollow boxes, graded blocks."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box


def merged(**parts: Mesh) -> Mesh:
    """Several bodies as one mesh; surfaces are called ``part-surface``."""
    offsets = np.cumsum([0, *(mesh.n_points for mesh in parts.values())])
    surfaces = {
        f"{name}-{surface}": faces + offset
        for (name, mesh), offset in zip(parts.items(), offsets, strict=False)
        for surface, faces in mesh.surfaces.items()
    }
    cells = [mesh.cells + offset for mesh, offset in zip(parts.values(), offsets, strict=False)]
    return Mesh(np.vstack([mesh.points for mesh in parts.values()]), np.vstack(cells), surfaces=surfaces)


def shifted_mesh(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    return Mesh(mesh.points + np.array([x, y, z])[: mesh.dimension], mesh.cells, surfaces=mesh.surfaces)


def graded(mesh: Mesh, axis: int, divisions: int, places: np.ndarray) -> Mesh:
    """Put the grid planes across `axis` of a unit-length box at the given places; in between, linearly."""
    points = mesh.points.copy()
    points[:, axis] = np.interp(points[:, axis] * divisions, np.arange(divisions + 1), places)
    return Mesh(points, mesh.cells, surfaces=mesh.surfaces)


def geometric(first: float, n: int, length: float) -> np.ndarray:
    """Places of n + 1 grid planes whose distances grow by a constant factor from `first` on and fill `length`."""
    factor = brentq(lambda q: first * np.sum(q ** np.arange(n)) - length, 1.0, 10.0)
    return np.concatenate([[0.0], np.cumsum(first * factor ** np.arange(n))])


def half_chamber(lengths: tuple[float, float, float], divisions: tuple[int, int, int], kind: str = "tet10") -> Mesh:
    """The half y ≥ 0 of a hollow box with walls one cell thick; surfaces ``cavity y0 z0 x0 x1``."""
    grid = box(lengths, divisions, kind)
    size = np.array(lengths) / divisions
    middle = grid.points[grid.cells[:, : grid.cell.n_corners]].mean(axis=1)
    air = (middle[:, [0, 2]] > size[[0, 2]]).all(axis=1) & (middle < np.array(lengths) - size).all(axis=1)
    used, cells = np.unique(grid.cells[~air], return_inverse=True)
    cells, points = cells.reshape(-1, grid.cells.shape[1]).astype(np.int32), grid.points[used]
    faces = boundary_faces(cells)
    ends = {f"{'xyz'[axis]}{k}": (axis, k * lengths[axis]) for axis in range(3) for k in (0, 1)}
    sides = {name: (points[faces][:, :, axis] == at).all(axis=1) for name, (axis, at) in ends.items()}
    surfaces = {name: faces[here] for name, here in sides.items()}
    return Mesh(points, cells, surfaces=surfaces | {"cavity": faces[~np.any(list(sides.values()), axis=0)]})
