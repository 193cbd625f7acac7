"""Which way the linear problems of a system are solved."""

from __future__ import annotations

from typing import Literal, get_args

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.fem.system import System
from turgor.solver.iterative import Iterative
from turgor.solver.linear import factors_fit, make_linear_solver
from turgor.solver.stiffness import StiffnessSolver

log = logger("solver")

LinearPath = Literal["auto", "direct", "iterative"]

ITERATIVE_FROM = 100_000
"""Unknowns from which the iterative path is chosen by itself.

With thick walls it is faster from a fifth of that on, with thin ones about from there.
"""


def make_stiffness_solver(system: System, path: LinearPath = "auto") -> StiffnessSolver:
    """Return what solves the linear problems of a system, and say in the log what and why.

    Parameters
    ----------
    system
        The actuator.
    path
        ``direct``: factorise; ``iterative``: a Krylov method where it is able to; ``auto``: the latter from
        :data:`ITERATIVE_FROM` unknowns on, and where the factors would not fit into the memory that is free.

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
    large = system.n_dofs >= ITERATIVE_FROM or not factors_fit(system.n_dofs)
    wanted = path == "iterative" or (path == "auto" and large)
    reason = not_iterative(system)
    if wanted and reason is None:
        log.info("linear solver: %s", Iterative.name)
        return Iterative(system)
    if wanted:
        tell = log.warning if path == "iterative" else log.info
        tell("the linear problems are factorised, as the iterative path does not know %s", reason)
    return make_linear_solver(system.pattern.row_start, system.pattern.column)


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
