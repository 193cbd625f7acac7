"""Newton's method in which the stiff quantities (element volumes) are unknowns of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turgor.fem.programme import LoadLine
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.apiece import first_changes
from turgor.solver.control import Control
from turgor.solver.events import Event
from turgor.solver.stiffness import StiffnessSolver
from turgor.solver.tangent import NewtonOptions, NotConvergedError, Progress, Step, Tangent, failure

__all__ = ["Equilibrium", "NewtonOptions", "NotConvergedError", "find_equilibrium"]

Floats = NDArray[np.float64]


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
        Number of matrices factorised for it; of one that a walk delivers, all since the one before.
    negative_pivots
        Negative eigenvalues of the tangent at (or next to) the equilibrium; ``None`` if the linear solver cannot tell.
    compliance
        Under volume control, the derivative of the conjugate (pressure × volume) by the load fraction along the path of
        equilibria: negative where the pressure falls while the volume grows.
    event
        What makes the state special on its path ; ``None`` for most.
    mode
        The eigenmode in which the tangent loses its stiffness there, ``(n_points, d)``, if the event has one.
    expected
        Change of the conjugate from the guess to here that the tangent at the guess expected.
    expected_volumes
        The same of the volume of each cavity under pressure ``(n_cavities,)``, if there are several.
    """

    state: State
    fraction: float
    residuals: tuple[float, ...]
    factorisations: int
    negative_pivots: int | None
    compliance: float | None = None
    event: Event | None = None
    mode: Floats | None = None
    expected: float = 0.0
    expected_volumes: Floats | None = None

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


SMALLEST_DAMPING = 1 / 32
TRIALS = 10
"""Lengths of a step that a line search tries."""

LESS = 0.9
"""With a barrier, a step after which forces are less out of balance by this factor is taken even if the merit rises.

Near its equilibria the tangent need not be definite, and the merit would shorten every step: two boxes that meet at
20 and 30 kPa took 34 and 46 iterations in place of 23 and 34.
"""

ENOUGH = 0.25
"""A step is halved where the merit falls by less than this part of what it falls by after half the step.

Points may then go to and fro over a groove between two faces, which the tangent on neither side knows of.
"""

RISE_ALLOWED = 2.0
SHORT = 1 / 32
"""Where no surfaces press on each other, the merit may rise by so many times what a short part of the step promises.

Bent walls overshoot on their way, and Newton's method needs its long steps. What leads astray raises it by far more.
"""

ROUNDING = 1e-9
"""Part of the merit by which it may rise through rounding."""


def find_equilibrium(
    system: System,
    linear: StiffnessSolver,
    guess: State,
    fraction: float,
    options: NewtonOptions,
    on_iteration: Callable[[int, float], None] | None = None,
    *,
    control: Control | None = None,
    line: LoadLine | None = None,
) -> Equilibrium:
    """Find the equilibrium at a load fraction, or where a control cuts the path, from a guess.

    Each iteration solves with the tangent whose geometric part takes the pressures that the previous one predicted
    (``State.lagged``), while the right-hand side is the exact out-of-balance force. Eliminating the
    pressures from Newton's method on the mixed problem gives the same iteration, so that it needs no
    more steps at a bulk modulus of 1e5 μ than at μ. As long as the steps shrink, they are taken with the same tangent,
    which then solves the mixed problem again (:class:`turgor.fem.term.Mixed`), without another factorisation.

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
    line
        The loads as the load fraction changes; left out, those of their programmes at the fraction.

    Raises
    ------
    NotConvergedError
        With the residual history and the worst element, if no equilibrium is reached.
    """
    line = line or system.loading.line_at(fraction)
    state = guess.with_loads(line.at(fraction))
    pending = system.constraints.imposed(state.u, fraction) - state.u
    moving = bool(np.any(pending))
    progress = Progress(options)
    tangent: Tangent | None = None
    while True:
        force, scale = system.forces(state)
        residual = system.free_part(force)
        # Where all forces are tiny, rounding is not to be mistaken for imbalance.
        relative = float(np.linalg.norm(residual)) / max(scale, _rounding(system, state) / options.tolerance)
        gap = 0.0 if control is None else _relative_gap(control, system.conjugate(state, control.weights), fraction)
        progress.residuals.append(relative)
        if on_iteration is not None:
            on_iteration(len(progress.residuals) - 1, relative)
        reached = max(relative, gap) <= options.tolerance and not moving
        step = None
        if tangent is not None and not moving and not (reached and tangent.is_sharp(relative)):
            step = tangent.solved_again(state, fraction, relative)
        if reached and step is None:
            return _accepted(system, linear, state, fraction, control, line, tangent, progress)
        if tangent is None or step is None:
            if reason := progress.hopeless:
                raise failure(reason, system, state, progress.residuals)
            tangent = Tangent(system, linear, state, fraction, control, line.growth, progress)
            step = tangent.solved(residual, pending if moving else None)
            if len(progress.tangents) == 1:
                progress.expected = -float(np.vdot(system.load_direction(state, line.growth), step.du))
                progress.expected_volumes = first_changes(system, state, step.du)
        state, damping = _advanced(system, state, step, progress.residuals, search=control is None and not moving)
        # What a shortened step left of the given displacements is imposed by the next one.
        pending = (1.0 - damping) * pending
        moving = moving and damping < 1.0
        if damping < 1.0:
            tangent = None
        fraction += damping * step.change
        state = state.with_loads(line.at(fraction))


def _relative_gap(control: Control, conjugate: float, fraction: float) -> float:
    return abs(control.gap(conjugate, fraction)[0]) / control.scale(conjugate)


def _advanced(system: System, state: State, step: Step, residuals: list[float], *, search: bool) -> tuple[State, float]:
    """Return the state after the step and the part of it that was taken.

    It is shortened where surfaces would pass into each other too far, where it would turn an element inside out,
    and, where a search is allowed, by the merit. What lags takes the values of the full step all the same: they are
    the solution of the linear problem, not something to be approached.
    """
    du = step.du
    lagged = system.advanced(state, du, step.base, step.unmet).lagged
    damping = system.longest_step(state, du)
    smallest = SMALLEST_DAMPING * damping
    while damping >= smallest:
        worst, _ = system.worst_jacobian(state.u + damping * du)
        if worst > 0.0:
            if search and step.base is None:
                damping = _searched(system, state, du, lagged, damping)
            return replace(state, u=state.u + damping * du, lagged=lagged), damping
        damping *= 0.5
    raise failure(
        "an element would turn inside out",
        system,
        system.consistent(state.u + du, state.loads, state.penalty),
        residuals,
    )


def _searched(system: System, state: State, du: Floats, lagged: tuple[Floats, ...], longest: float) -> float:
    """Return the part of the step to take: all of it unless the merit rises, and often even then.

    With a barrier a step that the merit would shorten is taken all the same where the forces are less out of balance
    after it.
    """

    def merit(part: float) -> float:
        return system.merit(state.moved(part * du), lagged)

    start, full = system.merit(state, lagged), merit(longest)
    rounding = ROUNDING * abs(start)
    if any(system.contact_force(at) > 0.0 for at in (state, state.moved(longest * du))):
        best = _until_it_falls(merit, longest, start, full, rounding)
        return longest if best < longest and system.has_barrier and _balances(system, state, longest * du) else best
    return longest if full <= start + rounding else _until_it_rises_little(merit, longest, start, full)


def _until_it_rises_little(merit: Callable[[float], float], longest: float, start: float, full: float) -> float:
    """Return the longest of ever shorter parts of the step with which the merit rises no more than it may.

    If it rises from the beginning, the step leads to an unstable state, or so far astray that the next one will tell.
    """
    promised = 0.5 * (start - merit(SHORT * longest)) / SHORT
    if not promised > 0.0:
        return longest
    part, now = longest, full
    # Written so that what is not a number is too much.
    while not now - start <= RISE_ALLOWED * promised and part > SHORT * longest:
        part *= 0.5
        now = merit(part)
    return part


def _until_it_falls(
    merit: Callable[[float], float], longest: float, start: float, full: float, rounding: float
) -> float:
    """Return the longest of ever shorter parts of the step with which the merit falls enough, or else the best."""
    parts, merits = [longest], [full]
    while len(parts) < TRIALS:
        parts.append(0.5 * parts[-1])
        merits.append(merit(parts[-1]))
        if merits[-2] <= start - ENOUGH * max(start - merits[-1], 0.0) + rounding:
            del parts[-1], merits[-1]
            break
    return parts[int(np.argmin(merits))]


def _balances(system: System, state: State, du: Floats) -> bool:
    """Whether the forces are less out of balance after a step."""
    before, after = (np.linalg.norm(system.free_part(system.forces(at)[0])) for at in (state, state.moved(du)))
    return bool(after < LESS * before)


def _accepted(
    system: System,
    linear: StiffnessSolver,
    state: State,
    fraction: float,
    control: Control | None,
    line: LoadLine,
    tangent: Tangent | None,
    progress: Progress,
) -> Equilibrium:
    state = system.consistent(state.u, state.loads, state.penalty, state.grips, state.margin)
    if tangent is None or not tangent.is_near(state):
        tangent = Tangent(system, linear, state, fraction, control, line.growth, progress)
    return Equilibrium(
        state,
        fraction,
        tuple(progress.residuals),
        len(progress.tangents),
        tangent.inertia(),
        tangent.compliance,
        expected=progress.expected,
        expected_volumes=progress.expected_volumes,
    )


def _rounding(system: System, state: State) -> float:
    """Return the size of the forces, N, that rounding alone causes."""
    return float(np.linalg.norm([solid.rounding(state.u) for solid in system.solids]))
