"""What Newton's method asks of a solver of its linear problems, whichever way it goes about them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.fem.state import State
from turgor.fem.system import System

Floats = NDArray[np.float64]

FORCING = 2e-3
"""Part of the linear problem's residual that one step of Newton's method may leave."""

FORCING_FAR = 1e-2
"""The same far from an equilibrium, where what the next step mends is larger."""

ACCURATE = 1e-6
"""The same where the solution counts for itself: a compliance, an eigenmode."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Of a linear problem of Newton's method.

    Attributes
    ----------
    u
        Change of the displacement, ``(n_points, d)``, mm.
    unmet
        For each solid, by how much the dilatations that belong to the pressures found fall short of those of `u`,
        ``(m, k)``; empty where they agree.
    """

    u: Floats
    unmet: tuple[Floats, ...] = ()

    def plus(self, factor: float, other: Solution) -> Solution:
        """Return this one and a multiple of another."""
        unmet = tuple(a + factor * b for a, b in zip(self.unmet, other.unmet, strict=True))
        return Solution(self.u + factor * other.u, unmet)


class StiffnessSolver(ABC):
    """Solves with the stiffness of one state after another.

    ``cheap_again`` says whether a further solution with the same stiffness costs little beside the first,
    ``tells_inertia`` whether the solver can find the signs of the eigenvalues, ``tangents`` how many stiffnesses it has
    taken so far, whatever became of them.
    """

    name: str
    cheap_again: bool = True
    tells_inertia: bool = True
    tangents: int = 0

    def take_stiffness(self, system: System, state: State) -> None:
        """Make ready to solve with the stiffness of a state, and count it.

        Raises
        ------
        SingularMatrixError
            If it cannot be done.
        """
        self.tangents += 1
        self._take_stiffness(system, state)

    @abstractmethod
    def _take_stiffness(self, system: System, state: State) -> None:
        """Make ready to solve with the stiffness of a state."""

    @abstractmethod
    def solution(self, system: System, right: Floats, accuracy: float = FORCING) -> Solution:
        """Return the solution for a right-hand side ``(n,)``, to `accuracy` at least."""

    def solution_again(self, system: System, right: Floats, state: State) -> Solution | None:
        """Return the solution for the mixed problem's out-of-balance force of a later state.

        ``None`` where a new stiffness gets on faster.
        """
        del state
        return self.solution(system, right)

    @abstractmethod
    def solve(self, right: Floats) -> Floats:
        """Return the solution ``(n,)`` for a right-hand side ``(n,)``, as accurate as can be."""

    @property
    @abstractmethod
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues of the stiffness taken last, ``None`` where it is not known by now."""

    def inertia(self) -> int | None:
        """Return the number of negative eigenvalues of the stiffness taken last, ``None`` if it cannot be found."""
        return self.negative_pivots
