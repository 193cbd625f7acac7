"""Supports by the name of the surface they hold: what the user says, before it meets a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.fem.section import Section, surface_areas
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes, pack_symmetric
from turgor.mesh.cells import face_cell, face_frames

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Clamped:
    """Every point of the surface stays where it is."""

    surface: str


@dataclass(frozen=True)
class Sliding:
    """The surface moves in itself only: no displacement along its normal, no friction. A symmetry plane is one."""

    surface: str


@dataclass(frozen=True)
class Prescribed:
    """The surface moves by a given amount along x, y and z, mm; ``None`` leaves a direction free.

    The displacement grows with the load fraction. In a plane model there is none along z.
    """

    surface: str
    displacement: tuple[float | None, ...]


@dataclass(frozen=True)
class ElasticSupport:
    """A bed of springs tied to the reference shape; `stiffness` in N/mm³ (pressure per displacement)."""

    surface: str
    stiffness: float
    normal_only: bool = False


Support = Clamped | Sliding | Prescribed | ElasticSupport


class SpringBed(Unlagged):
    """½ k ∫ |u|² dA, or ½ k ∫ (u · N)² dA, over a reference surface with normal N.

    Parameters
    ----------
    points, faces
        Reference positions ``(n_points, d)`` and the surface's faces ``(k, nodes_per_face)``.
    stiffness
        k in N/mm³.
    normal_only
        Whether the springs act along the reference normal only.
    section
        What a plane mesh stands for.
    """

    def __init__(
        self, points: Floats, faces: Ints, stiffness: float, normal_only: bool, section: Section | None = None
    ) -> None:
        self.nodes = np.ascontiguousarray(faces, dtype=np.int32)
        unit, area = surface_areas(points, self.nodes, section)
        d, n = points.shape[1], faces.shape[1]
        direction = np.einsum("fqi,fqj->fqij", unit, unit) if normal_only else np.eye(d)
        N = face_cell(self.nodes).shape_at_quadrature
        blocks = np.einsum(
            "fq,qa,qb,fqij->faibj", stiffness * area, N, N, np.broadcast_to(direction, (*area.shape, d, d))
        )
        self._blocks = np.ascontiguousarray(blocks).reshape(len(faces), n * d, n * d)

    def energy(self, state: State) -> float:
        """Return the energy of the springs, N mm."""
        local = state.u[self.nodes].reshape(len(self.nodes), -1)
        return 0.5 * float(np.einsum("fi,fij,fj->", local, self._blocks, local))

    def force(self, state: State, out: Floats) -> None:
        """Add the springs' force, N."""
        local = state.u[self.nodes]
        force = self._blocks @ local.reshape(len(local), -1, 1)
        add_at_nodes(self.nodes, force.reshape(local.shape), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the springs' stiffness, N/mm."""
        del state, lagged
        pack_symmetric(self._blocks, out)


def face_normals(points: Floats, faces: Ints) -> Floats:
    """Return the normals ``(k, q, d)`` of faces at their quadrature points, as long as area per reference area."""
    return face_frames(points[faces])[1]
