"""The mesh: second-order cells with named regions, surfaces, markers and curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from turgor.common.blas import dense_products_on_one_thread
from turgor.common.errors import InputError
from turgor.mesh.cells import (
    CELLS,
    Cell,
    body_cell,
    determinants,
    face_areas,
    is_body_cell,
    jacobians,
)
from turgor.mesh.faces import host_cells
from turgor.mesh.opening import volume_field
from turgor.mesh.tet10 import FloatArray, IntArray, cell_volumes

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A body cut into curved cells of one kind, in mm; it does not change after construction.

    The kind follows from the number of nodes of a cell: ``tet10`` or ``hex27`` in space, ``tri6`` or ``quad9`` in the
    plane, where areas take the place of volumes and three-node edges that of faces.

    Parameters
    ----------
    points
        Shape ``(n, d)``, float64; d = 3 or 2.
    cells
        Shape ``(m, 10)``, ``(m, 27)``, ``(m, 6)`` or ``(m, 9)``, int32: node indices in VTK order (corners, then the
        middles of the edges, for a tetrahedron 01 12 02 03 13 23, then those of the faces, then the centre).
    regions
        Name → cell indices. Every cell is in exactly one region; left out, all cells are in ``body``.
    surfaces
        Name → faces, of a ``tet10`` ``(k, 6)`` node indices of six-node triangles (corners, then the middles of 01 12
        20), of a ``hex27`` ``(k, 9)``, of plane cells ``(k, 3)`` (two ends, middle). Each is the face of a cell and
        oriented outward from it (an edge has its cell on the left), so that on a cavity the normal points into the air.
    markers
        Name → node indices: a point, or points in order along a line.
    curves
        Name → ``(j, d)`` points of a polyline that runs through the cells without belonging to them.
    caps
        Name → edges ``(e, 3)`` (two ends, middle) of the rim of an opening that no air passes.

    Raises
    ------
    InputError
        If a shape, an index, an orientation or a Jacobian is wrong.
    """

    points: FloatArray
    cells: IntArray
    regions: Mapping[str, IntArray] = field(default_factory=dict)
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)
    markers: Mapping[str, IntArray] = field(default_factory=dict)
    curves: Mapping[str, FloatArray] = field(default_factory=dict)
    caps: Mapping[str, IntArray] = field(default_factory=dict)

    @dense_products_on_one_thread()
    def __post_init__(self) -> None:
        self._set("cells", _frozen_cells(self.cells, np.shape(self.points)[-1:]))
        d, face_nodes = self.dimension, self.cell.faces.shape[1]
        self._set("points", _frozen(self.points, np.float64, (None, d), "points"))
        regions = self.regions or {"body": np.arange(len(self.cells), dtype=np.int32)}
        self._set("regions", _frozen_map(regions, np.int32, (None,), "regions"))
        self._set("surfaces", _frozen_map(self.surfaces, np.int32, (None, face_nodes), "surfaces"))
        self._set("markers", _frozen_map(self.markers, np.int32, (None,), "markers"))
        self._set("curves", _frozen_map(self.curves, np.float64, (None, d), "curves"))
        self._set("caps", _frozen_map(self.caps, np.int32, (None, 3), "caps"))
        self._check_points_and_cells()
        self._check_regions()
        for name, nodes in self.markers.items():
            _check_indices(nodes, self.n_points, f"markers.{name}", "nodes")
        for name, edges in self.caps.items():
            _check_indices(edges, self.n_points, f"caps.{name}", "nodes")
        for name, faces in self.surfaces.items():
            self._check_surface(name, faces)

    @property
    def cell(self) -> Cell:
        """The reference cell of the mesh's kind."""
        return body_cell(self.cells)

    @property
    def cell_type(self) -> str:
        """Name of the kind of the cells: ``tet10``, ``hex27``, ``tri6`` or ``quad9``."""
        return self.cell.name

    @property
    def dimension(self) -> int:
        """Number of coordinates of a point, 3 or 2."""
        return self.cell.dimension

    @property
    def n_points(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @property
    def symmetry_planes(self) -> tuple[str, ...]:
        """Names of the surfaces, ``symmetry…``, behind which the body goes on as its mirror image."""
        return tuple(name for name in self.surfaces if name.startswith("symmetry"))

    def region(self, name: str) -> IntArray:
        """Return the cell indices of a region; raise InputError if there is none of that name."""
        return _named(self.regions, name, "region")

    def region_nodes(self, name: str) -> IntArray:
        """Return the nodes of a region's cells, each once, in ascending order; raise InputError for an unknown name."""
        return _named(self._region_nodes, name, "region")

    def surface(self, name: str) -> IntArray:
        """Return the faces ``(k, nodes_per_face)`` of a surface; raise InputError if there is none of that name."""
        return _named(self.surfaces, name, "surface")

    def marker(self, name: str) -> IntArray:
        """Return the node indices of a marker; raise InputError if there is none of that name."""
        return _named(self.markers, name, "marker")

    def curve(self, name: str) -> FloatArray:
        """Return the ``(j, d)`` points of a curve; raise InputError if there is none of that name."""
        return _named(self.curves, name, "curve")

    def surface_nodes(self, name: str) -> IntArray:
        """Return the nodes of a surface, each once, in ascending order; raise InputError for an unknown name."""
        return np.unique(self.surface(name))

    def surface_hosts(self, name: str) -> IntArray:
        """Return the cell that each face of a surface belongs to, shape ``(k,)``."""
        return host_cells(self.cells, self.surface(name))

    def surface_area(self, name: str) -> float:
        """Return the area of a surface in mm² (in the plane: its length in mm); raise InputError if unknown."""
        return float(face_areas(self.points[self.surface(name)]).sum())

    def volume(self, region: str | None = None) -> float:
        """Return the volume in mm³ (area in mm²) of one region, or of the whole mesh: exact for curved cells."""
        cells = self.cells if region is None else self.cells[self.region(region)]
        nodes = self.points[cells]
        if self.cell_type == "tet10":
            return float(cell_volumes(nodes).sum())
        return float((determinants(jacobians(nodes, self.cell)) @ self.cell.weights).sum())

    def enclosed_volume(self, surface: str, displacement: FloatArray | None = None) -> float:
        """Return the volume in mm³ of the air that a surface encloses, in the plane the area in mm².

        It is the flux of a field of unit divergence through the curved faces (:mod:`turgor.mesh.opening`). The surface
        must be closed, or be closed by symmetry planes across the axes at the ends of the mesh, or by caps.

        Parameters
        ----------
        surface
            Its normals point out of the solid, so a cavity's volume is positive.
        displacement
            Of the nodes, ``(n, d)`` in mm; left out, none.

        Raises
        ------
        InputError
            For an unknown name, or a surface that leaks.
        """
        faces = self.surface(surface)
        field = volume_field(self.points, faces, surface, caps=self.caps)
        return field.enclosed(self.points if displacement is None else self.points + displacement, faces)

    @cached_property
    def _region_nodes(self) -> dict[str, IntArray]:
        return {name: np.unique(self.cells[cells]) for name, cells in self.regions.items()}

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _check_points_and_cells(self) -> None:
        if not np.isfinite(self.points).all():
            node = int(np.argmin(np.isfinite(self.points).all(axis=1)))
            raise InputError("a node has a coordinate that is not finite", key="points", value=node)
        if self.n_cells == 0:
            raise InputError("the mesh has no cells", key="cells")
        _check_indices(self.cells, self.n_points, "cells", "nodes")
        used = np.bincount(self.cells.ravel(), minlength=self.n_points)
        if (used == 0).any():
            raise InputError("a node belongs to no cell", key="points", value=int(np.argmax(used == 0)))
        smallest = determinants(jacobians(self.points[self.cells], self.cell)).min(axis=1)
        if (smallest <= 0.0).any():
            cell = int(np.argmin(smallest))
            place = self.points[self.cells[cell, : self.cell.n_corners]].mean(axis=0).round(3).tolist()
            raise InputError(f"a cell is turned inside out near {place} mm", key="cells", value=cell)

    def _check_regions(self) -> None:
        count = np.zeros(self.n_cells, dtype=np.int64)
        for name, cells in self.regions.items():
            _check_indices(cells, self.n_cells, f"regions.{name}", "cells")
            np.add.at(count, cells, 1)
        if (count != 1).any():
            cell = int(np.argmax(count != 1))
            problem = "a cell is in no region" if count[cell] == 0 else "a cell is in two regions"
            raise InputError(problem, key="regions", value=cell)

    def _check_surface(self, name: str, faces: IntArray) -> None:
        _check_indices(faces, self.n_points, f"surfaces.{name}", "nodes")
        hosts = host_cells(self.cells, faces)
        if (hosts < 0).any():
            face = faces[np.argmin(hosts)].tolist()
            problem = "a face is not the outward face of a cell"
            expected = f"{len(face)} nodes, turning outward"
            raise InputError(problem, key=f"surfaces.{name}", value=face, expected=expected)


def _frozen_cells(cells: Any, dimension: tuple[int, ...]) -> IntArray:
    """Return a read-only copy of the cells, of a kind that there is."""
    width = np.shape(cells)[-1] if np.ndim(cells) == 2 else 0
    if not is_body_cell(width):
        kinds = [cell for cell in CELLS.values() if cell.dimension > 1]
        kinds = [cell for cell in kinds if (cell.dimension,) == dimension] or kinds
        raise InputError(
            f"the array has shape {np.shape(cells)}",
            key="cells",
            expected=" or ".join(f"shape (n, {cell.n_nodes})" for cell in kinds) + " of integers",
        )
    frozen: IntArray = _frozen(cells, np.int32, (None, width), "cells")
    return frozen


def _frozen(values: Any, kind: npt.DTypeLike, shape: tuple[int | None, ...], key: str) -> Any:
    """Return a read-only copy of the wanted type and shape (None: any length)."""
    array = np.asarray(values)
    if array.size == 0:
        array = array.reshape(tuple(length or 0 for length in shape))
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits or (kind is np.int32 and array.size and array.dtype.kind not in "iu"):
        wanted = str(tuple("n" if length is None else length for length in shape)).replace("'", "")
        raise InputError(
            f"the array has shape {array.shape} and type {array.dtype}",
            key=key,
            expected=f"shape {wanted} of {'integers' if kind is np.int32 else 'numbers'}",
        )
    copy = np.array(array, dtype=kind, order="C")
    copy.setflags(write=False)
    return copy


def _frozen_map(arrays: Mapping[str, Any], kind: npt.DTypeLike, shape: tuple[int | None, ...], key: str) -> Any:
    return MappingProxyType({name: _frozen(array, kind, shape, f"{key}.{name}") for name, array in arrays.items()})


def _check_indices(indices: IntArray, count: int, key: str, what: str) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= count):
        wrong = int(indices.min()) if indices.min() < 0 else int(indices.max())
        raise InputError("an index points outside the mesh", key=key, value=wrong, expected=f"{what} 0 to {count - 1}")


def _named(things: Mapping[str, npt.NDArray[Scalar]], name: str, kind: str) -> npt.NDArray[Scalar]:
    if name not in things:
        available = ", ".join(sorted(things)) or f"no {kind} at all"
        raise InputError(f"the mesh has no {kind} of this name", value=name, expected=f"one of: {available}")
    return things[name]


def in_space(vectors: FloatArray) -> FloatArray:
    """Return vectors or places ``(..., d)`` with three components, the third of a plane model 0."""
    missing = 3 - vectors.shape[-1]
    return np.concatenate([vectors, np.zeros((*vectors.shape[:-1], missing))], axis=-1) if missing else vectors
