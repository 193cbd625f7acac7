"""What every term of the potential energy offers, and the few operations that terms share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.kernels import jit, parallel
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

    def lagged_at(self, state: State) -> Floats:
        """Return the lagged quantities that belong to the displacement and the loads of a state."""
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

    def lagged_at(self, state: State) -> Floats:
        """Return nothing."""
        del state
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


class Mixed(ABC):
    """A term whose force is linear in what lags, the stresses: ``Bᵀ(u) s``.

    With the stiffness of an earlier state, the mixed problem can then be solved again: eliminating the change of the
    stresses leaves ``Bᵀ(u) s + B₀ᵀ (ŝ(u) − s)`` as the force out of balance, ŝ the stresses that belong to u and
    B₀ those directions that the stiffness was made with. With the stiffness of the state itself that is the force.
    """

    @abstractmethod
    def lagged_at(self, state: State) -> Floats:
        """Return the lagged quantities that belong to the displacement and the loads of a state."""

    @abstractmethod
    def lagged_change(self, state: State, du: Floats) -> Floats:
        """Return the change of the lagged quantities along `du`, linearised at the state."""

    @abstractmethod
    def force_of(self, u: Floats, lagged: Floats, out: Floats) -> None:
        """Add the force of given lagged quantities at displacement `u`, N."""

    def force(self, state: State, out: Floats) -> None:
        """Add the force, N."""
        self.force_of(state.u, self.lagged_at(state), out)

    def lagged_after(self, state: State, du: Floats, base: State | None = None) -> Floats:
        """Return the lagged quantities after the step `du`, linearised at the state, or with the slopes of `base`."""
        return self.allowed(self.lagged_at(state) + self.lagged_change(base or state, du))

    def allowed(self, lagged: Floats) -> Floats:
        """Return the lagged quantities as far as the term can bear them."""
        return lagged

    def mixed_force(self, state: State, lagged: Floats, base: State, kept: Floats, out: Floats) -> None:
        """Add the force out of balance of the mixed problem with the stiffness of `base`, N.

        `lagged` and `kept` are the term's lagged quantities in the two states.
        """
        del kept
        self.force_of(state.u, lagged, out)
        self.force_of(base.u, self.lagged_at(state) - lagged, out)


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
    _add(nodes, np.ascontiguousarray(values), out)


@jit
def _add(nodes, values, out):  # type: ignore[no-untyped-def]
    for block in range(len(nodes)):
        for a in range(nodes.shape[1]):
            for i in range(out.shape[1]):
                out[nodes[block, a], i] += values[block, a, i]


def pack_symmetric(blocks: Floats, out: Floats, factor: float = 1.0) -> None:
    """Write the upper triangles of ``blocks (n_blocks, n, n)``, times a factor, into ``out (n_blocks, packed)``."""
    _pack(np.ascontiguousarray(blocks), factor, out)


@parallel
def _pack(blocks, factor, out):  # type: ignore[no-untyped-def]
    n = blocks.shape[1]
    for block in nb.prange(len(blocks)):
        at = 0
        for row in range(n):
            for column in range(row, n):
                out[block, at] = factor * blocks[block, row, column]
                at += 1


def resultants(push: Floats, arm: Floats, *, turned: bool, across: Floats | None = None) -> tuple[Triple, Triple]:
    """Return force and torque of the pushes ``(n, 3)`` with arms ``(n, 3)``.

    `turned`: the model is a body of revolution, around whose axis y all forces across it cancel. `across`: directions
    ``(k, 3)``, orthonormal, along which the forces on the mirror images of a half or quarter model cancel.
    """
    force, torque = push.sum(axis=0), np.cross(arm, push).sum(axis=0)
    if across is not None:
        force = force - across.T @ (across @ force)
    if turned:
        force[0] = torque[2] = 0.0
    return triple(force), triple(torque)


def triple(vector: Floats) -> Triple:
    """Return the three components of a vector."""
    return float(vector[0]), float(vector[1]), float(vector[2])
