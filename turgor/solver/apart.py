"""Equilibria whose surfaces do not overlap too far, at the points at which contact acts or between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from turgor.common.log import logger
from turgor.fem.contact.term import LARGEST_OVERLAP, WIDEST_MARGIN
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.tally import Tally

log = logger("solver")

STIFFER = 6
"""How often contact is made stiffer before one equilibrium is given up."""

FIRST_MARGIN = 0.125 * WIDEST_MARGIN
"""Where only the independent look sees surfaces overlap, the margin begins with this part of the wall, and doubles."""


def kept_apart(system: System, find: Callable[[State], Equilibrium], guess: State) -> Equilibrium:
    """Return an equilibrium whose surfaces overlap by no more than is allowed, with all the work that led to it.

    Where they overlap more at the points at which contact acts, it is made stiffer and the equilibrium found again.
    Between the points, on the ridges between coarse faces, stiffness does not help: they are seen by the independent
    look only, and the surfaces then press on each other a little before they meet. Both stay for the rest of the path.

    Parameters
    ----------
    system
        The actuator.
    find
        Finds the equilibrium from a state.
    guess
        The state to begin with.

    Raises
    ------
    NotConvergedError
        If there is no equilibrium, or surfaces overlap too much however stiff their contact is.
    """
    tally = Tally()
    found, stiffer = find(guess), 0
    while True:
        tally.count(found)
        state = found.state
        touches = system.touches(state)
        overlap = max((touch.overlap_per_wall for touch in touches), default=0.0)
        wall = min((touch.wall for touch in touches), default=0.0)
        if overlap > LARGEST_OVERLAP:
            if stiffer == STIFFER:
                reason = "surfaces overlap too much however stiff their contact is"
                raise NotConvergedError(reason, facts={"overlap_per_wall": overlap})
            stiffer += 1
            state = replace(state, penalty=state.penalty * max(2.0, 2.0 * overlap / LARGEST_OVERLAP))
            log.info("overlap of %.2g of the wall: contact made stiffer, factor %.3g", overlap, state.penalty)
        elif not system.seen_to_overlap(state):
            return tally.closed(found)
        elif state.margin < WIDEST_MARGIN * wall:
            margin = max(2.0 * state.margin, FIRST_MARGIN * wall)
            state = replace(state, margin=min(margin, WIDEST_MARGIN * wall))
            log.info("surfaces overlap between the points of contact: margin %.3g mm", state.margin)
        else:
            log.warning("surfaces are still seen to overlap by more than %.2g of the wall", LARGEST_OVERLAP)
            return tally.closed(found)
        found = find(state)
