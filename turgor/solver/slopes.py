"""What the tangent of a state tells of the path through it: slopes, stability while something is held, softest mode."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.control import Quantity
from turgor.solver.newton import Equilibrium
from turgor.solver.stiffness import StiffnessSolver
from turgor.solver.tangent import factorise_tangent

Floats = NDArray[np.float64]

INVERSE_ITERATIONS = 12

MONOTONE = 3.0


def knows_volume(system: System, state: State) -> bool:
    """Whether the path can be followed by the conjugate of the load: what rubs and what moves have no one potential."""
    return not (system.constraints.moves or system.rubs_in(state))


def is_monotone(mean: float, at_start: float, at_end: float) -> bool:
    """Whether a smooth function is known to rise (or fall) all the way, from its mean slope and those at both ends.

    The cubic with these values and slopes does if the slopes, in parts of the mean one, lie in a circle of radius three
    (Fritsch and Carlson 1980); the slopes have one sign.
    """
    return mean * at_start > 0.0 and math.hypot(at_start, at_end) <= MONOTONE * abs(mean)


def turns_alone(mean: float, at_start: float, at_end: float) -> bool:
    """Whether what is prescribed may turn on a step, from the slopes of one cavity's volume by it.

    Other cavities may move it either way, and ever faster: that is no jump.
    """
    if min(mean * at_start, mean * at_end) <= 0.0 or abs(at_start) <= abs(mean) <= abs(at_end):
        return False
    return not is_monotone(1.0 / mean, 1.0 / at_start, 1.0 / at_end)


def stable_while_held(
    system: System, quantity: Quantity, equilibrium: Equilibrium, growth: Floats | None = None
) -> bool | None:
    """Say whether a state is stable while a quantity is held; ``None`` if that is not known.

    Holding it adds κ q qᵀ to the tangent, κ > 0, q the direction of the loads: nothing that a stable state loses by; it
    takes away a negative eigenvalue where 1 + κ qᵀK⁻¹q < 0. Loads that grow against each other have no such q. The
    loads' `growth` is that of the line that the path was found along; left out, what their programmes say.
    """
    if equilibrium.negative_pivots is None or equilibrium.compliance is None or equilibrium.negative_pivots == 0:
        return equilibrium.stable
    growth = system.loading.growth(equilibrium.fraction) if growth is None else growth
    weights = growth if quantity.weights is None else quantity.weights
    signs = np.unique(np.sign(growth[weights != 0.0] * weights[weights != 0.0]))
    if len(signs) != 1:
        return None
    conjugate = system.conjugate(equilibrium.state, quantity.weights)
    control = quantity.fixed(quantity.value(conjugate, equilibrium.fraction))
    _, by_conjugate, by_fraction = control.gap(conjugate, equilibrium.fraction)
    takes_away = signs[0] * by_conjugate * (by_fraction + by_conjugate * equilibrium.compliance) < 0.0
    return bool(equilibrium.negative_pivots == takes_away)


def compliance(system: System, linear: StiffnessSolver, state: State, weights: Floats | None, growth: Floats) -> float:
    """Return dQ/df along the path of equilibria, by the tangent that was factorised last; the loads' `growth` by f."""
    return -float(system.free_part(system.load_direction(state, weights)) @ response(system, linear, state, growth))


def response(system: System, linear: StiffnessSolver, state: State, growth: Floats) -> Floats:
    """Return du/df along the path ``(n_dofs,)``, by the tangent that was factorised last; the loads' `growth` by f."""
    return -linear.solve(system.free_part(system.load_direction(state, growth)))


def softest_mode(system: System, linear: StiffnessSolver, state: State, growth: Floats) -> Floats:
    """Return the eigenmode of the tangent's smallest eigenvalue in size, ``(n_points, d)``, largest component one.

    By inverse iteration, from the load's direction and a little of everything: at a bifurcation the load has no part
    in the mode.
    """
    factorise_tangent(system, linear, state)
    vector = system.free_part(system.load_direction(state, growth))
    noise = np.random.default_rng(0).standard_normal(len(vector))
    vector = vector + 0.1 * float(np.linalg.norm(vector)) / np.sqrt(len(vector)) * noise
    if not np.any(vector):
        vector = noise
    for _ in range(INVERSE_ITERATIONS):
        vector = linear.solve(vector)
        vector /= np.linalg.norm(vector)
    return scaled(system.nodal(vector))


def slope_of(quantity: Quantity, system: System, equilibrium: Equilibrium) -> float:
    """Return the derivative of a quantity by its conjugate along the path: zero at a limit of it."""
    conjugate, fraction = system.conjugate(equilibrium.state, quantity.weights), equilibrium.fraction
    control = quantity.fixed(quantity.value(conjugate, fraction))
    _, by_conjugate, by_fraction = control.gap(conjugate, fraction)
    return by_conjugate + by_fraction * slope_of_load(equilibrium)


def slope_of_load(equilibrium: Equilibrium) -> float:
    """Return the derivative of the load fraction by its conjugate along the path, where the compliance is known."""
    assert equilibrium.compliance is not None
    return 1.0 / equilibrium.compliance


def scaled(mode: Floats) -> Floats:
    """Return a mode whose largest component is one."""
    return np.asarray(mode / mode.ravel()[np.argmax(np.abs(mode))])
