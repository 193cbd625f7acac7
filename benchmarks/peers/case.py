"""A case that every code solves, as plain arrays: a curved second-order mesh, what holds it and what loads it.

The material is neo-Hookean, W = μ/2 (Ī₁ − 3) + K/2 (J − 1)². The module needs numpy alone, so that it runs in the
environment of every peer; `cases.py` makes the cases.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

TOLERANCE = 1e-7
"""Norm of the out-of-balance force over that of the nodal forces of the load, at an equilibrium."""

VOLUME_TOLERANCE = 1e-9
"""Norm of the residual of the volume constraint over the norm of its parts, where pressures are unknowns."""

MOST_ITERATIONS = 30
"""Linear solves after which a run counts as failed."""


@dataclass(frozen=True)
class Case:
    """One body under one load.

    ``kind`` is ``space``, ``plane-strain`` (a slice of 1 mm) or ``axisymmetric`` (x the radius, y the axis), with d = 3
    or 2 coordinates; ``mu``, ``bulk`` and ``pressure``, that in the cavity, are in MPa. ``points (n, d)`` mm; ``cells
    (m, 10)``, ``(m, 27)``, ``(m, 6)`` or ``(m, 9)`` in VTK order (corners, then edges 01 12 02 03 13 23, of triangles
    01 12 20, of quadrilaterals 01 12 23 30 and the centre, of hexahedra as in `HEX27`); ``surfaces`` the named faces
    ``(k, 6)`` (corners, then edges 01 12 20), of hexahedra ``(k, 9)``, or edges ``(k, 3)`` (ends, middle) of cells,
    normals out of the solid; ``held`` for each of those that are held the displacement ``(d,)``, mm, NaN where it is
    free; a surface ``cavity`` is what the pressure acts on; ``tip`` the node whose displacement is compared.
    """

    kind: str
    mu: float
    bulk: float
    pressure: float
    points: np.ndarray
    cells: np.ndarray
    surfaces: dict[str, np.ndarray]
    held: dict[str, np.ndarray]
    tip: int

    def save(self, path: Path) -> None:
        arrays = vars(self) | {"surfaces": list(self.surfaces), "held": list(self.held)}
        arrays |= {f"surfaces:{name}": faces for name, faces in self.surfaces.items()}
        np.savez(path, **arrays, **{f"held:{name}": value for name, value in self.held.items()})

    @classmethod
    def load(cls, path: Path | str) -> Case:
        with np.load(path) as stored:
            arrays = {name: stored[name] for name in cls.__dataclass_fields__}
            scalars = {name: value.item() for name, value in arrays.items() if not value.ndim}
            groups = {
                group: {str(name): stored[f"{group}:{name}"] for name in arrays[group]}
                for group in ("surfaces", "held")
            }
        return cls(**arrays | scalars | groups)

    @property
    def dimension(self) -> int:
        return self.points.shape[1]

    @property
    def is_of_rows(self) -> bool:
        """Whether the cells are hexahedra or quadrilaterals, which lie in rows."""
        return self.cells.shape[1] in NODES

    @property
    def is_axisymmetric(self) -> bool:
        return self.kind == "axisymmetric"

    @property
    def has_cavity(self) -> bool:
        return "cavity" in self.surfaces

    @property
    def given(self) -> np.ndarray:
        """The displacement of each node, ``(n, d)`` mm, NaN where it is free."""
        given = np.full(self.points.shape, np.nan)
        for name, value in self.held.items():
            nodes = np.unique(self.surfaces[name])
            given[nodes] = np.where(np.isnan(value), given[nodes], value)
        return given

    @property
    def travel(self) -> float:
        """The largest displacement that is given, mm."""
        return float(np.nanmax(np.abs(self.given)))

    def hosts(self, numbering: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return for each face of the cavity its cell and its place in a peer's `numbering` of a cell's faces.

        The `numbering` has a row for each face: the places of its corners in the cell.
        """
        d = self.dimension
        weights = len(self.points) ** np.arange(d, dtype=np.int64)
        # Three corners tell a four-cornered face.
        key = np.sort(self.cells[:, numbering], axis=2)[:, :, :d].reshape(-1, d) @ weights
        target = np.sort(self.surfaces["cavity"][:, : numbering.shape[1]], axis=1)[:, :d] @ weights
        order = np.argsort(key)
        at = order[np.searchsorted(key, target, sorter=order)]
        assert np.array_equal(key[at], target)
        return at // len(numbering), at % len(numbering)


OPPOSITE = {3: np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]), 2: np.array([[1, 2], [0, 2], [0, 1]])}
"""The faces of a simplex by its dimension, each opposite to its corner: how most number them."""

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
CUBE_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
CUBE_FACES = [(0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4), (3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)]
HEX27 = np.vstack([CUBE, *(CUBE[list(part)].mean(axis=0) for part in (*CUBE_EDGES, *CUBE_FACES, range(8)))])
"""The nodes of a hexahedron in the unit cube, in VTK order: corners, middles of the edges, of the faces, its own."""

NODES = {27: HEX27, 9: HEX27[[0, 1, 2, 3, 8, 9, 10, 11, 24], :2]}
"""The nodes of a cell that is a product of lines, by their number, where it is the unit cube or square."""
