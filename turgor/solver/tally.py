"""The work of several steps, told as that of the equilibrium they lead to."""

from __future__ import annotations

from dataclasses import replace

from turgor.solver.newton import Equilibrium
from turgor.solver.stiffness import StiffnessSolver


class Tally:
    """Counts iterations and factorisations between two equilibria that are delivered.

    Parameters
    ----------
    linear
        The solver of a walk, as it was made: every stiffness that it takes counts, also for attempts that fail, limits
        and modes. Left out, those that led to the equilibria do.
    """

    def __init__(self, linear: StiffnessSolver | None = None) -> None:
        self._linear, self._told = linear, 0
        self._residuals: list[float] = []
        self._factorisations = 0

    def count(self, found: Equilibrium) -> None:
        """Add the work that went into an equilibrium."""
        self._residuals += found.residuals[:-1]
        self._factorisations += found.factorisations

    @property
    def is_empty(self) -> bool:
        """Whether nothing was done since the last equilibrium that was delivered."""
        return not self._factorisations

    def closed(self, last: Equilibrium) -> Equilibrium:
        """Return the last equilibrium with the work of all since the one before, and begin anew."""
        made = self._factorisations
        if self._linear is not None:
            made, self._told = self._linear.tangents - self._told, self._linear.tangents
        whole = replace(last, residuals=(*self._residuals, last.residuals[-1]), factorisations=made)
        self._residuals, self._factorisations = [], 0
        return whole
