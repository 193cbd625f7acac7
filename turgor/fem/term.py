"""What every term of the potential energy offers, and the few operations that terms share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from turgor.fem.state import State

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Triple = tuple[float, float, float]


class Term(Protocol):
    """A part of the total potential energy.

    ``nodes (n_blocks, nodes_per_block)`` are the blocks of nodes that the stiffness couples; a term that is linear in
    the displacement has none.

    A term whose force is stiff in few quantities (a volume, a fibre's length, a gap) may treat these as unknowns of
    their own: its stiffness then takes its geometric part from their lagged values, which Newton's step updates as if
    they were linear in the displacement. The force never depends on them. Eliminating them from Newton's
    method on the mixed problem gives the same iteration.
    """

    nodes: Ints

    def energy(self, state: State) -> float:
        """Return the energy in N mm."""
        ...

    def force(self, state: State, out: Floats) -> None:
        """Add the derivative of the energy with respect to the displacement to ``out (n_points, 3)``, N."""
        ...

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the packed upper triangles of the block stiffnesses, ``out (n_blocks, packed)``, N/mm."""
        ...

    def lagged_at(self, u: Floats, loads: Floats) -> Floats:
        """Return the lagged quantities that belong to the displacement `u` under the loads."""
        ...

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return the lagged quantities after the step `du`, linearised at the state."""
        ...

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy that a line search goes by, N mm.

        Where what lags is stiff, it is linearised at the lagged values: along a step of the mixed problem the energy
        itself first rises by the square of the step times that stiffness.
        """
        ...


class Unlagged(ABC):
    """A term of which nothing lags behind the displacement."""

    def lagged_at(self, u: Floats, loads: Floats) -> Floats:
        """Return nothing."""
        del u, loads
        return NOTHING

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return nothing."""
        del state, du
        return NOTHING

    @abstractmethod
    def energy(self, state: State) -> float:
        """Return the energy in N mm."""

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy, N mm."""
        del lagged
        return self.energy(state)


class Loaded(Protocol):
    """A term whose size follows a load: ``channel`` is its place in ``State.loads``."""

    channel: int

    def conjugate(self, state: State) -> float:
        """Return what the load works on, minus the derivative of the energy by its value: a cavity's volume, mm³."""
        ...

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add the derivative of :meth:`Term.force` by the load's value to ``out (n_points, 3)``."""
        ...


NOTHING = np.empty(0)
NO_NODES = np.empty((0, 1), np.int32)


def add_at_nodes(nodes: Ints, values: Floats, out: Floats) -> None:
    """Add block vectors ``values (n_blocks, nodes_per_block, d)`` to ``out (n_points, d)``."""
    flat = nodes.ravel()
    for i in range(out.shape[1]):
        out[:, i] += np.bincount(flat, values[:, :, i].ravel(), minlength=len(out))


def pack_symmetric(blocks: Floats, out: Floats) -> None:
    """Write the upper triangles of ``blocks (n_blocks, n, n)`` into ``out (n_blocks, packed)``."""
    row, col = np.triu_indices(blocks.shape[-1])
    out[:] = blocks[..., row, col]


def resultants(push: Floats, arm: Floats, *, turned: bool) -> tuple[Triple, Triple]:
    """Return force and torque of the pushes ``(n, 3)`` with arms ``(n, 3)``.

    `turned`: the model is a body of revolution, around whose axis y all forces across it cancel.
    """
    force, torque = push.sum(axis=0), np.cross(arm, push).sum(axis=0)
    if turned:
        force[0] = torque[2] = 0.0
    return triple(force), triple(torque)


def triple(vector: Floats) -> Triple:
    """Return the three components of a vector."""
    return float(vector[0]), float(vector[1]), float(vector[2])
