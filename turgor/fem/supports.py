"""Supports by the name of the surface they hold: what the user says, before it meets a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.fem.elements import TRI6
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes, pack_symmetric

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

    The displacement grows with the load fraction.
    """

    surface: str
    displacement: tuple[float | None, float | None, float | None]


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
        Reference positions ``(n_points, 3)`` and six-node triangles ``(k, 6)``.
    stiffness
        k in N/mm³.
    normal_only
        Whether the springs act along the reference normal only.
    """

    def __init__(self, points: Floats, faces: Ints, stiffness: float, normal_only: bool) -> None:
        self.nodes = np.ascontiguousarray(faces, dtype=np.int32)
        normal = face_normals(points, self.nodes)
        area = np.linalg.norm(normal, axis=2)
        unit = normal / area[:, :, None]
        direction = np.einsum("fqi,fqj->fqij", unit, unit) if normal_only else np.broadcast_to(np.eye(3), (1, 1, 3, 3))
        N = TRI6.shape_at_quadrature
        weight = stiffness * area * TRI6.weights
        blocks = np.einsum("fq,qa,qb,fqij->faibj", weight, N, N, np.broadcast_to(direction, (*area.shape, 3, 3)))
        self._blocks = np.ascontiguousarray(blocks).reshape(len(faces), 18, 18)

    def energy(self, state: State) -> float:
        """Return the energy of the springs, N mm."""
        local = state.u[self.nodes].reshape(len(self.nodes), 18)
        return 0.5 * float(np.einsum("fi,fij,fj->", local, self._blocks, local))

    def force(self, state: State, out: Floats) -> None:
        """Add the springs' force, N."""
        local = state.u[self.nodes].reshape(len(self.nodes), 18, 1)
        add_at_nodes(self.nodes, (self._blocks @ local).reshape(-1, 6, 3), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the springs' stiffness, N/mm."""
        del state, lagged
        pack_symmetric(self._blocks, out)


def face_normals(points: Floats, faces: Ints) -> Floats:
    """Return the area-weighted normals ``(k, n_quad, 3)`` of six-node faces at the quadrature points of TRI6."""
    tangents = np.einsum("qar,fai->fqri", TRI6.gradient_at_quadrature, points[faces])
    return np.asarray(np.cross(tangents[:, :, 0], tangents[:, :, 1]))
