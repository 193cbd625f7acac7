"""What the energy tells of a step along a path: the area between path and chord in the plane of volume and load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.system import System
from turgor.solver.newton import Equilibrium

SAME = 1e-9

ROUNDING = 1e-9
"""Part of volume times load that an area has to exceed to say anything."""


def area_to_chord(
    system: System,
    weights: NDArray[np.float64] | None,
    growth: NDArray[np.float64],
    ends: tuple[Equilibrium, Equilibrium],
) -> float:
    """Return the size of the area between path and chord from one state to another, in units of Q times f.

    The potential falls along the path by the conjugate of all that grows, so it tells the area below the path. Zero
    where it does not: in the plane of another Q, of other `weights` than the loads' `growth`, and where contact has
    been made stiffer on the way.
    """
    first, second = ends
    (start, penalty, margin), (end, *same) = ((e.state, e.state.penalty, e.state.margin) for e in ends)
    weights = growth if weights is None else weights
    times = float(growth @ weights) / float(weights @ weights)
    if not times or same != [penalty, margin] or not np.allclose(growth, times * weights, rtol=SAME, atol=0.0):
        return 0.0
    mean = 0.5 * (system.conjugate(start, growth) + system.conjugate(end, growth))
    area = abs(system.energy(start) - system.energy(end) - mean * (second.fraction - first.fraction))
    rounding = ROUNDING * abs(mean) * max(abs(first.fraction), abs(second.fraction))
    return 0.0 if area <= rounding else area / abs(times)
