"""Coulomb friction with lagged normal forces: for given normal forces it has a potential.

Each point that touches holds on to the place that it touches. The slip s, tangential, from there is elastic until the
force k s reaches μ F, and drags the place along from then on: ψ = ½ k s² below, μ F (s − μ F/(2 k)) above. Normal force
F, normal and place are those of the last equilibrium found; finding it again with those that it shows itself, until
they agree, gives Coulomb's law (as in Li et al. 2020, but with elastic slip in place of creep: what sticks stays).

What a contact remembers, one row a point: face, quadrature point, F, normal (3), slip before (3), place (3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.skin import Skin
from turgor.fem.pattern import packed_size
from turgor.fem.state import State
from turgor.fem.term import add_at_nodes, pack_symmetric

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FACE, QUAD, FORCE, NORMAL, SLIP, PLACE = 0, 1, 2, slice(3, 6), slice(6, 9), slice(9, 12)
WIDTH = 12

TANGENTIAL = 0.1
"""Elastic stiffness along the surface over that across it: what sticks slips by 10 μ times the overlap at most."""


def grips_in(state: State, number: int) -> Floats:
    """Return the rows ``(n, 12)`` that contact `number` remembers in a state."""
    return state.grips[number] if state.grips else np.empty((0, WIDTH))


def renewed(rows: Floats, slip: Floats, touching: Floats) -> Floats:
    """Return the rows `touching` of the points that touch now, with the slip of those that are among `rows`.

    `touching` ``(n, 12)`` holds the forces, normals and places of now; `slip` ``(m, d)`` belongs to `rows` ``(m, 12)``.
    """
    now = touching.copy()
    keys, before = (64 * r[:, FACE].astype(np.int64) + r[:, QUAD].astype(np.int64) for r in (now, rows))
    _, here, there = np.intersect1d(keys, before, assume_unique=True, return_indices=True)
    now[here, SLIP.start : SLIP.start + slip.shape[1]] = slip[there]
    return now


@dataclass(frozen=True, eq=False)
class Rubbing:
    """The points that rub, with what they slip in a state.

    Attributes
    ----------
    nodes, weights
        The nodes of each point ``(n, m)`` and the parts ``(n, m)`` with which they make up its place, or its place
        relative to that of the face opposite.
    normal
        ``(n, d)``.
    slip
        Tangential slip, ``(n, d)``, mm.
    limit
        μ F, ``(n,)``, N.
    stiffness
        k, ``(n,)``, N/mm.
    """

    nodes: Ints
    weights: Floats
    normal: Floats
    slip: Floats
    limit: Floats
    stiffness: Floats

    @property
    def energy(self) -> float:
        """ψ of all points, N mm."""
        s, elastic = self._size, self.limit / self.stiffness
        values = np.where(s <= elastic, 0.5 * self.stiffness * s**2, self.limit * (s - 0.5 * elastic))
        return float(values.sum())

    @property
    def drag(self) -> Floats:
        """∂ψ by the place of each point, ``(n, d)``, N: what it drags the face or body opposite with."""
        return np.asarray(self._secant[:, None] * self.slip)

    @property
    def tangent(self) -> Floats:
        """∂²ψ by the place of each point, ``(n, d, d)``, N/mm."""
        flat = np.eye(self.slip.shape[1]) - np.einsum("ni,nj->nij", self.normal, self.normal)
        size = np.where(self._slides, self._size, 1.0)
        along = self.slip / size[:, None] * self._slides[:, None]
        return np.asarray(self._secant[:, None, None] * (flat - np.einsum("ni,nj->nij", along, along)))

    @property
    def elastic_slip(self) -> Floats:
        """The slip that is left when what slides has dragged along what it holds on to, ``(n, d)``, mm."""
        return np.asarray(self.drag / self.stiffness[:, None])

    def add_force(self, out: Floats) -> None:
        """Add the forces to ``out (n_points, d)``, N."""
        add_at_nodes(self.nodes, self.weights[:, :, None] * self.drag[:, None, :], out)

    def blocks(self) -> Floats:
        """Return the packed stiffnesses ``(n, …)`` of the points' nodes."""
        full = np.einsum("na,nb,nij->naibj", self.weights, self.weights, self.tangent, optimize=True)
        rows = full.shape[1] * full.shape[2]
        packed = np.empty((len(full), packed_size(rows)))
        pack_symmetric(full.reshape(len(full), rows, rows), packed)
        return packed

    @property
    def _size(self) -> Floats:
        return np.asarray(np.linalg.norm(self.slip, axis=1))

    @property
    def _slides(self) -> NDArray[np.bool_]:
        return np.asarray(self.stiffness * self._size > self.limit)

    @property
    def _secant(self) -> Floats:
        return np.where(self._slides, self.limit / np.where(self._slides, self._size, 1.0), self.stiffness)


def rubbing(
    rows: Floats, nodes: Ints, weights: Floats, apart: Floats, friction: float, stiffness: Floats, d: int
) -> Rubbing:
    """Return the points of `rows` that rub; `apart` ``(n, d)`` is how far they are from what they hold on to.

    `stiffness` is that across the surface, N/mm.
    """
    stiffness = TANGENTIAL * stiffness
    normal = rows[:, NORMAL][:, :d]
    apart = apart + rows[:, SLIP][:, :d]
    slip = apart - np.einsum("ni,ni->n", apart, normal)[:, None] * normal
    return Rubbing(nodes, weights, normal, slip, friction * rows[:, FORCE], stiffness)


def make_rows(face: NDArray[Any], quad: NDArray[Any], force: Floats, normal: Floats, place: Floats) -> Floats:
    """Return rows that have not slipped; vectors of two components are filled up with zeros."""
    vectors = [np.pad(v, ((0, 0), (0, 3 - v.shape[1]))) for v in (normal, np.zeros_like(normal), place)]
    return np.hstack([face[:, None], quad[:, None], force[:, None], *vectors])


def points_of(rows: Floats, skin: Skin) -> tuple[Ints, Ints, Ints]:
    """Return face ``(n,)``, quadrature point ``(n,)`` and nodes ``(n, nodes_per_face)`` of each row."""
    face, quad = rows[:, FACE].astype(np.int32), rows[:, QUAD].astype(np.int32)
    return face, quad, skin.faces[face]
