"""The loads one by one: where one cavity gives way and the others, larger or under more pressure, would hide it.

The conjugate of the load fraction is the sum over all loads. A small cavity that snaps hardly changes it, and where the
others change it more than the snap does it turns with the load fraction, so that neither can be followed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.state import State
from turgor.fem.system import System

Floats = NDArray[np.float64]

TAKES_PART = 0.01
"""Part of the largest work done in a mode below which a load takes no part in it."""

STEEPER = 2.0
"""A change so many times as large as expected may be a jump."""

NOTICED = 1e-3
"""Part of a cavity's volume below which a change of it is not asked about."""


def unit_weights(system: System) -> Floats:
    """Return for each cavity under pressure the weights ``(n_cavities, n_loads)`` that make its volume of them."""
    return np.eye(len(system.loading.names))[[cavity.channel for cavity in system.cavities]]


def volumes(system: System, state: State) -> Floats:
    """Return the volume of each cavity under pressure ``(n_cavities,)``, mm³."""
    return np.array([system.conjugate(state, weights) for weights in unit_weights(system)])


def changes(system: System, before: State, after: State, times: float = 1.0) -> Floats:
    """Return so many times the changes of the volumes ``(n_cavities,)`` from one state to another."""
    return times * (volumes(system, after) - volumes(system, before))


def first_changes(system: System, state: State, du: Floats) -> Floats | None:
    """Return the first-order changes of the volumes of the cavities ``(n_cavities,)`` by a displacement.

    ``None`` where there are not several, as nothing is asked about one alone.
    """
    if len(system.cavities) < 2:
        return None
    return np.array([-np.vdot(system.load_direction(state, weights), du) for weights in unit_weights(system)])


def steep_alone(system: System, here: State, found: State, expected: Floats | None) -> list[Floats]:
    """Return the weights of those cavities, of several, whose volumes have changed much more than `expected`.

    Where surfaces touch the path has corners, which say nothing.
    """
    if len(system.cavities) < 2 or any(system.contact_force(state) > 0.0 for state in (here, found)):
        return []
    change = np.abs(changes(system, here, found))
    noticed = change > NOTICED * np.abs(volumes(system, here))
    steep = noticed if expected is None else noticed & (change > STEEPER * np.abs(expected))
    return list(unit_weights(system)[steep])


def work_in(system: System, state: State, mode: Floats, growth: Floats) -> Floats:
    """Return the work that the growth of each load does in a mode ``(n_loads,)``; zero where it is next to none."""
    units = np.eye(len(growth))
    work = growth * [-np.vdot(system.load_direction(state, unit), mode) for unit in units]
    return np.where(np.abs(work) >= TAKES_PART * np.abs(work).max(), work, 0.0)


def taking_part(system: System, state: State, mode: Floats, growth: Floats) -> Floats:
    """Return the loads' growth ``(n_loads,)`` with zero for those that do no work in a mode, or all of it."""
    part = np.where(work_in(system, state, mode, growth) != 0.0, growth, 0.0)
    return part if np.any(part) else growth


def leading_in(system: System, state: State, mode: Floats, growth: Floats) -> int:
    """Return the place of the load that does most work in a mode: a pressure, if one does."""
    work = work_in(system, state, mode, growth)
    return system.loading.leading(work if np.any(work) else growth)
