"""Bodies, materials and states that several tests use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from turgor.fem.state import State
from turgor.fem.system import System
from turgor.materials.models.neo_hookean import NeoHookean
from turgor.materials.volumetric import Quadratic


def neo_hookean(mu: float = 0.1, ratio: float = 1e4, density: float | None = None) -> NeoHookean:
    """A neo-Hookean material of shear modulus `mu` (MPa) and bulk modulus `ratio` times that."""
    return NeoHookean(C10=mu / 2, volumetric=Quadratic(ratio * mu), density=density)


def random_state(system: System, size: float, seed: int = 0, fraction: float = 0.7) -> State:
    """A random displacement of a given size with the dilatations that belong to it."""
    u = size * np.random.default_rng(seed).standard_normal(system.mesh.points.shape)
    assert system.worst_jacobian(u)[0] > 0.05
    return system.consistent(u, system.loads_at(fraction))


def shifted(state: State, direction: np.ndarray, step: float) -> State:
    return replace(state, u=state.u + step * direction)
