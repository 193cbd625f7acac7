"""Which way the linear problems of a system are solved."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.iterative import Iterative
from turgor.solver.linear import factors_fit, make_linear_solver
from turgor.solver.stiffness import FORCING, Solution, StiffnessSolver
from turgor.solver.worth import affordable_iterations

Floats = NDArray[np.float64]

log = logger("solver")

LinearPath = Literal["auto", "direct", "iterative"]

ITERATIVE_FROM = 20_000
"""Unknowns from which the iterative path may be chosen by itself; with fewer, either way takes tenths of a second."""

USUAL = 15.0
"""Inner iterations for each tangent with thick walls; with thin ones there are twice as many."""

PATIENCE = 20.0
"""Inner iterations beyond those that factorising is worth after which it is gone over to."""


def make_stiffness_solver(system: System, path: LinearPath = "auto") -> StiffnessSolver:
    """Return what solves the linear problems of a system, and say in the log what and why.

    Parameters
    ----------
    system
        The actuator.
    path
        ``direct``: factorise; ``iterative``: a Krylov method where it is able to; ``auto``: the latter from
        :data:`ITERATIVE_FROM` unknowns on as long as it is expected to cost less, and where the factors would not fit
        into the memory that is free.

    Raises
    ------
    InputError
        If the path is none of these.
    """
    if path not in get_args(LinearPath):
        raise InputError(
            "there is no such way to solve linear problems",
            key="linear",
            value=path,
            expected="auto, direct or iterative",
        )
    too_large = not factors_fit(system.n_dofs)
    if path == "direct" or (path == "auto" and system.n_dofs < ITERATIVE_FROM and not too_large):
        return _direct(system)
    reason = not_iterative(system)
    if reason is not None:
        tell = log.warning if path == "iterative" else log.info
        tell("the linear problems are factorised, as the iterative path does not know %s", reason)
        return _direct(system)
    affordable = np.inf if path == "iterative" or too_large else affordable_iterations(system)
    if affordable < USUAL:
        log.info("factorising costs less than %.0f iterations for each tangent", USUAL)
        return _direct(system)
    log.info("linear solver: %s", Iterative.name)
    return Iterative(system) if affordable == np.inf else WhileCheaper(system, affordable)


def not_iterative(system: System) -> str | None:
    """Return what in a system the iterative path does not know; ``None`` if it knows all of it."""
    if system.mesh.dimension != 3:
        return "plane models"
    if system.contacts:
        return "contact"
    if system.fibres:
        return "embedded fibres"
    if system.constraints.moves:
        return "given displacements"
    if len(system.constraints.frame_nodes):
        return "supports oblique to the axes"
    return None


class WhileCheaper(StiffnessSolver):
    """The iterative path until it has taken more iterations than factorising is worth, then factorising.

    By counts, not by clocks, so that the same input takes the same way every time.

    Parameters
    ----------
    system
        The actuator.
    affordable
        How many inner iterations for each tangent cost as much as factorising.
    """

    def __init__(self, system: System, affordable: float) -> None:
        self._affordable = affordable
        self._use(Iterative(system))

    def _take_stiffness(self, system: System, state: State) -> None:
        """Make ready to solve with the stiffness of a state, and decide how."""
        if isinstance(self._solver, Iterative) and self._is_dearer(self._solver):
            log.info("factorising costs less than %.0f iterations for each tangent", self._affordable)
            self._use(self._solver.direct())
        self._solver.take_stiffness(system, state)

    def solution(self, system: System, right: Floats, accuracy: float = FORCING) -> Solution:
        """Return the solution for a right-hand side ``(n,)``."""
        return self._solver.solution(system, right, accuracy)

    def solution_again(self, system: System, right: Floats, state: State) -> Solution | None:
        """Return the solution for the out-of-balance force of a later state, or ``None``."""
        return self._solver.solution_again(system, right, state)

    def solve(self, right: Floats) -> Floats:
        """Return the solution ``(n,)`` for a right-hand side ``(n,)``, as accurate as can be."""
        return self._solver.solve(right)

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues of the stiffness taken last, ``None`` where it is not known by now."""
        return self._solver.negative_pivots

    def inertia(self) -> int | None:
        """Return the number of negative eigenvalues of the stiffness taken last, ``None`` if it cannot be found."""
        return self._solver.inertia()

    def _is_dearer(self, solver: Iterative) -> bool:
        return sum(solver.iterations) > self._affordable * solver.tangents + PATIENCE

    def _use(self, solver: StiffnessSolver) -> None:
        self._solver = solver
        self.name, self.cheap_again, self.tells_inertia = solver.name, solver.cheap_again, solver.tells_inertia


def _direct(system: System) -> StiffnessSolver:
    return make_linear_solver(system.pattern.row_start, system.pattern.column)
