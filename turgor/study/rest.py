"""How rigid bodies stand to the actuator before anything moves: what overlaps then was seldom meant to."""

from __future__ import annotations

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.fem.contact.obstacle import Obstacle
from turgor.fem.contact.term import Touch
from turgor.fem.system import System
from turgor.study.contact import ContactCase, PlaneCase, RigidCase

log = logger("study")

DEEPEST = 1.0
"""Overlap at rest over the thickness of the wall there beyond which no solver finds the way out."""

TOLD = 0.01
"""Such an overlap from which on it is told of; contact itself leaves smaller ones."""


def check_rest(contact: ContactCase, system: System) -> None:
    """Refuse rigid bodies that the actuator lies deep inside at rest, and warn of those that press from the start.

    Bodies of a barrier are left to it: it lets nothing overlap.

    Raises
    ------
    InputError
        Naming the body, how deep the overlap is, and what would be right.
    """
    if not contact.bodies:
        return
    state = system.reference_state()
    obstacles = {term.name: term for term in system.contacts if isinstance(term, Obstacle)}
    for number, (body, label) in enumerate(zip(contact.bodies, contact.labels, strict=True)):
        if label not in obstacles:
            continue
        key, touch = f"contact.bodies.{number}", obstacles[label].touch(state)
        if touch.overlap_per_wall > DEEPEST:
            problem = f"the actuator at rest is up to {touch.overlap:.3g} mm inside this body"
            raise InputError(problem, key=key, value=label, expected=_remedy(body, obstacles[label], touch, system))
        if touch.overlap_per_wall > TOLD:
            wall = f"{touch.overlap_per_wall:.0%} of the wall"
            log.warning("%s: at rest '%s' presses already, %.3g mm deep (%s)", key, label, touch.overlap, wall)


def _remedy(body: RigidCase, obstacle: Obstacle, touch: Touch, system: System) -> str:
    """Say what would be right: the other normal, if that leaves the actuator outside."""
    if isinstance(body, PlaneCase):
        height, _, _ = obstacle.body.distance(system.mesh.points[obstacle.skin.faces.ravel()])
        if height.max() < touch.overlap / touch.overlap_per_wall:
            other = ", ".join(f"{-x + 0.0:g}" for x in body.normal)
            return f"the other normal, [{other}]: it points to where the actuator is"
    return "a place that leaves the actuator outside"
