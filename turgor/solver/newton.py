"""Newton's method in which the stiff quantities (element volumes) are unknowns of their own."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import SolverError
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.control import Control
from turgor.solver.events import Event
from turgor.solver.linear import LinearSolver, SingularMatrixError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonOptions:
    """When to stop.

    Attributes
    ----------
    tolerance
        An equilibrium is reached when the norm of the out-of-balance force is below this part of the norm of the
        largest of the forces in it (internal, pressure, weight …), reactions included. It has no unit.
    max_iterations
        Linear solves allowed for one equilibrium.
    """

    tolerance: float = 1e-7
    max_iterations: int = 25


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state in equilibrium and how it was found.

    Attributes
    ----------
    state
        The state; nothing in it lags.
    fraction
        The load fraction.
    residuals
        Relative out-of-balance force before each iteration and at the end.
    factorisations
        Number of matrices factorised.
    negative_pivots
        Negative eigenvalues of the tangent at (or next to) the equilibrium; ``None`` if the linear solver cannot tell.
    compliance
        Under volume control, the derivative of the conjugate (pressure × volume) by the load fraction along the path of
        equilibria: negative where the pressure falls while the volume grows.
    event
        What makes the state special on its path ; ``None`` for most.
    mode
        The eigenmode in which the tangent loses its stiffness there, ``(n_points, d)``, if the event has one.
    """

    state: State
    fraction: float
    residuals: tuple[float, ...]
    factorisations: int
    negative_pivots: int | None
    compliance: float | None = None
    event: Event | None = None
    mode: Floats | None = None

    @property
    def iterations(self) -> int:
        """Number of linear solves."""
        return len(self.residuals) - 1

    @property
    def stable(self) -> bool | None:
        """Whether Π has a minimum here at given loads; ``None`` if the linear solver cannot tell."""
        return None if self.negative_pivots is None else self.negative_pivots == 0

    @property
    def rising(self) -> bool:
        """Whether the load grows with the volume along the path here (known under volume control only)."""
        return self.compliance is not None and self.compliance > 0.0

    @property
    def stable_at_fixed_volume(self) -> bool | None:
        """Whether Π has a minimum here among states of the same volume; ``None`` if that is not known.

        The bordered matrix has the tangent's negative eigenvalues and one more where the compliance is positive;
        exactly one belongs to the volume's own multiplier.
        """
        if self.negative_pivots is None or self.compliance is None:
            return None
        return self.negative_pivots + (self.compliance > 0.0) == 1


class NotConvergedError(SolverError):
    """Newton's method found no equilibrium from where it started."""


SMALLEST_DAMPING = 1 / 32
TRIALS = 5
"""Lengths of a step that a line search tries."""

LESS = 0.9
"""With a barrier, a step after which forces are less out of balance by this factor is taken even if the merit rises.

Near its equilibria the tangent need not be definite, and the merit would shorten every step: two boxes that meet at
20 and 30 kPa took 34 and 46 iterations in place of 23 and 34.
"""

ROUNDING = 1e-9
"""Part of the merit by which it may rise through rounding."""

RISE = 2.0
RISES = 3
"""An iteration whose residual has risen so many times by such a factor is given up.

Of 352 iterations that converged (the tests, a finger whose walls touch, random actuators) none had a single rise by
half of itself; of those that did not, a fifth had three or more, and spent a third of all factorisations behind the
third.
"""

LOST = 20
LOSSES = 2
"""So is one that has met so many tangents with more than so many negative pivots: its steps lead nowhere.

Where an iteration converges, hardly more than its first tangent, at a prediction far off, has so many.
"""

NEAR = 1e-2
"""A tangent at a relative residual below this speaks for the equilibrium that the iteration then reaches."""


def find_equilibrium(
    system: System,
    linear: LinearSolver,
    guess: State,
    fraction: float,
    options: NewtonOptions,
    on_iteration: Callable[[int, float], None] | None = None,
    *,
    control: Control | None = None,
) -> Equilibrium:
    """Find the equilibrium at a load fraction, or where a control cuts the path, from a guess.

    Each iteration solves with the tangent whose geometric part takes the pressures that the previous one predicted
    (``State.lagged``), while the right-hand side is the exact out-of-balance force. Eliminating the
    pressures from Newton's method on the mixed problem gives the same iteration, so that it needs no
    more steps at a bulk modulus of 1e5 μ than at μ.

    Parameters
    ----------
    system, linear
        What is to be in equilibrium, and the solver of its pattern.
    guess
        Where the iteration starts.
    fraction
        The load fraction; with `control`, only its first guess.
    options
        Tolerance and iteration limit.
    on_iteration
        Told the number of each iteration and the relative residual before it.
    control
        If given, the load fraction is an unknown, and this equation takes its place: a bordered system, one
        factorisation and two right-hand sides an iteration.

    Raises
    ------
    NotConvergedError
        With the residual history and the worst element, if no equilibrium is reached.
    """
    state = guess.with_loads(system.loads_at(fraction))
    pending = system.constraints.imposed(state.u, fraction) - state.u
    moving = bool(np.any(pending))
    residuals: list[float] = []
    compliance: float | None = None
    lost = 0
    while True:
        force, scale = system.forces(state)
        residual = system.free_part(force)
        # Where all forces are tiny, rounding is not to be mistaken for imbalance.
        relative = float(np.linalg.norm(residual)) / max(scale, _rounding(system, state) / options.tolerance)
        gap = 0.0 if control is None else _relative_gap(control, system.conjugate(state, control.weights), fraction)
        residuals.append(relative)
        if on_iteration is not None:
            on_iteration(len(residuals) - 1, relative)
        if not np.isfinite(relative):
            raise _failure("the forces are not finite any more", system, state, residuals)
        if max(relative, gap) <= options.tolerance and not moving:
            return _accepted(system, linear, state, fraction, residuals, compliance)
        if len(residuals) > options.max_iterations:
            raise _failure(f"no equilibrium within {options.max_iterations} iterations", system, state, residuals)
        if _wanders(residuals, options.tolerance):
            raise _failure("the iteration wanders", system, state, residuals)
        factorise_tangent(system, linear, state, residuals)
        lost += (linear.negative_pivots or 0) > LOST
        if lost >= LOSSES:
            raise _failure("the iteration lost its way among unstable states", system, state, residuals)
        if moving:
            residual = residual + system.free_part(system.stiffness_times(pending))
        du = system.nodal(linear.solve(-residual))
        if moving:
            du += pending
        change = 0.0
        if control is not None:
            du, change, compliance = _controlled(system, linear, state, du, fraction, control)
        state, damping = _advanced(system, state, du, residuals, search=control is None and not moving)
        # What a shortened step left of the given displacements is imposed by the next one.
        pending = (1.0 - damping) * pending
        moving = moving and damping < 1.0
        fraction += damping * change
        state = state.with_loads(system.loads_at(fraction))


def _wanders(residuals: list[float], tolerance: float) -> bool:
    """Whether the residual has risen again and again: the iteration is not on its way to an equilibrium.

    The guess does not count: where displacements or a volume are imposed, its residual says nothing. Nor does what is
    near the tolerance, where rounding speaks.
    """
    pairs = itertools.pairwise(residuals[1:])
    return sum(last > 10.0 * tolerance and now > RISE * last for last, now in pairs) >= RISES


def _controlled(
    system: System, linear: LinearSolver, state: State, du: Floats, fraction: float, control: Control
) -> tuple[Floats, float, float]:
    """Return the step with which the linearised control holds too, the change of the load fraction, the compliance."""
    response = system.nodal(linear.solve(-system.free_part(system.load_direction(state, system.growth(fraction)))))
    measured = system.load_direction(state, control.weights)
    compliance = -float(np.vdot(measured, response))
    value, by_conjugate, by_fraction = control.gap(system.conjugate(state, control.weights), fraction)
    value -= by_conjugate * float(np.vdot(measured, du))
    slope = by_conjugate * compliance + by_fraction
    if slope == 0.0:
        # Nothing is loaded yet: a rigid body that moves has not met anything.
        raise NotConvergedError("there is no load that the control could follow")
    change = -value / slope
    return du + change * response, change, compliance


def _relative_gap(control: Control, conjugate: float, fraction: float) -> float:
    return abs(control.gap(conjugate, fraction)[0]) / control.scale(conjugate)


def factorise_tangent(system: System, linear: LinearSolver, state: State, residuals: Sequence[float] = ()) -> None:
    """Factorise the stiffness of a state, whose pattern is a new one where surfaces have come close to each other.

    Raises
    ------
    NotConvergedError
        If it is singular; with the `residuals` of the iteration that led there, if any.
    """
    values = system.stiffness(state)
    if linear.column is not system.pattern.column:
        linear.take(system.pattern.row_start, system.pattern.column)
    try:
        linear.factorise(values)
    except SingularMatrixError as error:
        raise _failure("the stiffness is singular", system, state, residuals) from error


def _advanced(system: System, state: State, du: Floats, residuals: list[float], *, search: bool) -> tuple[State, float]:
    """Return the state after the step and the part of it that was taken.

    It is shortened where surfaces would pass into each other too far, where it would turn an element inside out,
    and, where surfaces may touch and a search is allowed, until the merit falls. What lags takes the values of
    the full step all the same: they are the solution of the linear problem, not something to be approached.
    """
    lagged = system.advanced(state, du).lagged
    damping = system.longest_step(state, du)
    smallest = SMALLEST_DAMPING * damping
    while damping >= smallest:
        worst, _ = system.worst_jacobian(state.u + damping * du)
        if worst > 0.0:
            if search and system.contacts:
                damping = _searched(system, state, du, lagged, damping)
            return replace(state, u=state.u + damping * du, lagged=lagged), damping
        damping *= 0.5
    raise _failure(
        "an element would turn inside out",
        system,
        system.consistent(state.u + du, state.loads, state.penalty),
        residuals,
    )


def _searched(system: System, state: State, du: Floats, lagged: tuple[Floats, ...], longest: float) -> float:
    """Return the longest of a few ever shorter parts of the step with which the merit falls, or else the best.

    With a barrier it is the longest too where the forces are less out of balance after it.
    """
    start = system.merit(state, lagged)
    parts, merits = [longest], [system.merit(state.moved(longest * du), lagged)]
    while merits[-1] > start + ROUNDING * abs(start) and len(parts) < TRIALS:
        parts.append(0.5 * parts[-1])
        merits.append(system.merit(state.moved(parts[-1] * du), lagged))
    best = parts[int(np.argmin(merits))]
    return longest if best < longest and system.has_barrier and _balances(system, state, longest * du) else best


def _balances(system: System, state: State, du: Floats) -> bool:
    """Whether the forces are less out of balance after a step."""
    before, after = (np.linalg.norm(system.free_part(system.forces(at)[0])) for at in (state, state.moved(du)))
    return bool(after < LESS * before)


def _accepted(
    system: System,
    linear: LinearSolver,
    state: State,
    fraction: float,
    residuals: list[float],
    compliance: float | None,
) -> Equilibrium:
    state = system.consistent(state.u, state.loads, state.penalty, state.grips)
    factorisations = len(residuals) - 1
    if factorisations == 0 or residuals[-2] > NEAR:
        factorise_tangent(system, linear, state, residuals)
        factorisations += 1
    return Equilibrium(state, fraction, tuple(residuals), factorisations, linear.negative_pivots, compliance)


def _rounding(system: System, state: State) -> float:
    """Return the size of the forces, N, that rounding alone causes."""
    return float(np.linalg.norm([solid.rounding(state.u) for solid in system.solids]))


def _failure(reason: str, system: System, state: State, residuals: Sequence[float]) -> NotConvergedError:
    facts: dict[str, object] = {"residuals": [float(f"{r:.3g}") for r in residuals]}
    if np.all(np.isfinite(state.u)):
        worst, cell = system.worst_jacobian(state.u)
        place = system.mesh.points[system.mesh.cells[cell]].mean(axis=0)
        facts |= {
            "worst_element": cell,
            "worst_element_at_mm": [round(float(x), 3) for x in place],
            "worst_det_F": worst,
        }
    return NotConvergedError(reason, facts=facts)
