"""What makes a state special on its path, and how a path may end."""

from __future__ import annotations

from enum import StrEnum


class Event(StrEnum):
    """A state that nobody asked for and everybody wants to know of."""

    LIMIT = "limit-pressure"
    MINIMUM = "pressure-minimum"
    AIR_LIMIT = "air-limit"
    BIFURCATION = "bifurcation"
    POST_SNAP = "post-snap"


class Outcome(StrEnum):
    """How a path ended."""

    REACHED = "target-reached"
    LIMIT = "limit-pressure"
    AIR_LIMIT = "air-limit"
    BIFURCATION = "bifurcation"
    MATERIAL = "material-unstable"
    CREASE = "surface-creased"
    MESH = "mesh-distorted"
    CONTACT = "contact"
    OUT_OF_REACH = "out-of-reach"
    UNEXPLAINED = "not-converged"
