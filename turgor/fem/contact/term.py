"""What the terms of contact share, and what they tell about a state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.skin import Skin
from turgor.fem.state import State
from turgor.fem.term import Term, Triple

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

LARGEST_OVERLAP = 0.01
"""An equilibrium counts only where no overlap is more than this part of the wall behind it."""

WIDEST_MARGIN = 2.0 * LARGEST_OVERLAP
"""Surfaces press on each other at a gap of at most this part of the thinnest wall that does (``State.margin``)."""

GROWTH_OF_OVERLAP = 1.0 / 3.0
"""Part of the depth that the search sees by which an overlap may grow in one step of Newton's method."""

TRIALS = 6


@dataclass(frozen=True)
class Touch:
    """How one contact stands in a state.

    Attributes
    ----------
    name
        Of the contact.
    area
        Reference area in contact, mm²; of surfaces that touch each other, half the area of both.
    overlap
        The largest overlap, mm.
    overlap_per_wall
        The largest overlap over the thickness of the wall there.
    wall
        Thickness of the thinnest wall that presses on another part of the body, mm.
    force, torque
        What a rigid body feels, N and N mm, the torque about its reference point; ``None`` for contact of the
        body with itself.
    displacement
        Of a rigid body that moves or is on a spring, mm.
    gap, gap_per_wall
        By a barrier nothing ever overlaps: the smallest gap, mm, and over the thinnest wall; ``None`` by a penalty,
        and where nothing is within the barrier's reach.
    barrier
        Whether a barrier keeps the surfaces apart.
    """

    name: str
    area: float
    overlap: float
    overlap_per_wall: float
    force: Triple | None = None
    torque: Triple | None = None
    displacement: Triple | None = None
    gap: float | None = None
    gap_per_wall: float | None = None
    barrier: bool = False
    wall: float = np.inf


class Contact(Term, Protocol):
    """A term whose stiffness couples other nodes in every state."""

    name: str
    friction: float
    skin: Skin

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the nodes ``(n_blocks, nodes_per_block)`` coupled now and their packed stiffnesses."""
        ...

    def couplings(self, u: Floats) -> Ints:
        """Return blocks of nodes that may come to be coupled near the displacement `u`."""
        ...

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du`, at most 1, up to which no overlap grows too much to be seen."""
        ...

    def touch(self, state: State) -> Touch:
        """Return how the contact stands."""
        ...

    def intersects(self, state: State) -> bool | None:
        """Say whether surfaces intersect, by an independent look where there is one and it is installed."""
        ...

    def gripped(self, state: State, *, dragged: bool) -> Floats:
        """Return what friction remembers if it goes by the forces, normals and places of this state.

        With `dragged`, what slides has dragged along what it holds on to: a new step begins.
        """
        ...
