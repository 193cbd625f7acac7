"""A factorised tangent: Newton's step with it, further ones as long as they get on, and when to give up."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import SolverError
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.choice import LinearPath
from turgor.solver.control import Control
from turgor.solver.linear import SingularMatrixError
from turgor.solver.stiffness import ACCURATE, FORCING, FORCING_FAR, Solution, StiffnessSolver

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
        Tangents that may be factorised for one equilibrium.
    linear
        How linear problems are solved (:func:`turgor.solver.choice.make_stiffness_solver`).
    """

    tolerance: float = 1e-7
    max_iterations: int = 25
    linear: LinearPath = "auto"


class NotConvergedError(SolverError):
    """Newton's method found no equilibrium from where it started."""


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
NEARBY = 5e-3
"""A tangent at a relative residual below the first, or at a displacement that differs by less than this part of it,
speaks for the equilibrium that the iteration then reaches."""

FAR = 0.1
"""Relative residual above which an equilibrium is far."""

SHARP = 1e-2
"""Newton's last step goes far below the tolerance; steps with a tangent that is used again go on to this part of it, as
long as they get on."""

MUCH_LESS = 1e-2
"""A residual above this part of the tangent's is not just what an iterative solver left."""

KEPT_FROM = 30_000
"""Unknowns of a model in space from which factors are used again.

Three or four steps with them replace one of Newton's. With fewer unknowns, and in plane models of any size, they cost
as much as a factorisation, or more.
"""

USES = 6
SHORTER = 0.5
"""How often a tangent is used again at most, and what each step with it has to be shorter by to be taken."""


@dataclass(frozen=True, eq=False)
class Step:
    """A change of displacement and load fraction; `base`: the state of an earlier tangent that it was found with.

    `unmet` is what an iterative solver left of the equations of the dilatations (:class:`Solution`).
    """

    du: Floats
    change: float
    base: State | None = None
    unmet: tuple[Floats, ...] = ()


class Progress:
    """What an iteration has spent, and whether it is on its way to an equilibrium.

    ``residuals`` before each iteration; of each tangent that was factorised, the residual and its negative pivots;
    what the first one ``expected`` the conjugate of the load fraction, and the volumes, to change by.
    """

    def __init__(self, options: NewtonOptions) -> None:
        self.options = options
        self.residuals: list[float] = []
        self.tangents: list[tuple[float, int]] = []
        self.expected = 0.0
        self.expected_volumes: Floats | None = None

    @property
    def hopeless(self) -> str | None:
        """Why no further tangent is worth factorising, ``None`` if one is."""
        at_tangents = [*(residual for residual, _ in self.tangents), self.residuals[-1]]
        if not np.isfinite(at_tangents[-1]):
            return "the forces are not finite any more"
        if len(at_tangents) > self.options.max_iterations:
            return f"no equilibrium within {self.options.max_iterations} tangents"
        if _wanders(at_tangents, self.options.tolerance):
            return "the iteration wanders"
        if sum(pivots > LOST for _, pivots in self.tangents) >= LOSSES:
            return "the iteration lost its way among unstable states"
        return None


class Tangent:
    """The factorised stiffness of a state, with which the mixed problem is solved while that gets on."""

    def __init__(
        self,
        system: System,
        linear: StiffnessSolver,
        state: State,
        fraction: float,
        control: Control | None,
        growth: Floats,
        progress: Progress,
    ) -> None:
        self.system, self.linear = system, linear
        self.state, self.residual = state, progress.residuals[-1]
        factorise_tangent(system, linear, state, progress.residuals)
        self._control, self._fraction, self._tolerance = control, fraction, progress.options.tolerance
        self._size, self._uses = 0.0, 0
        self.compliance: float | None = None
        if control is not None:
            growing = system.free_part(-system.load_direction(state, growth))
            # The compliance of an equilibrium says where the load has its limit.
            self._response = linear.solution(system, growing, ACCURATE if self.residual <= NEAR else FORCING)
            self._measured = system.load_direction(state, control.weights)
            self.compliance = -float(np.vdot(self._measured, self._response.u))
        progress.tangents.append((self.residual, linear.negative_pivots or 0))

    def inertia(self) -> int | None:
        """Return the number of negative eigenvalues, ``None`` if the solver cannot tell; of the tangent made last."""
        return self.linear.inertia()

    def solved(self, residual: Floats, pending: Floats | None) -> Step:
        """Return Newton's step from the state of the tangent, the `pending` given displacements imposed with it."""
        if pending is not None:
            residual = residual + self.system.free_part(self.system.stiffness_times(pending))
        found = self.linear.solution(self.system, -residual, FORCING_FAR if self.residual > FAR else FORCING)
        du = found.u if pending is None else found.u + pending
        step = self._controlled(replace(found, u=du), None, self.state, self._fraction)
        self._size = float(np.linalg.norm(step.du))
        return step

    def solved_again(self, state: State, fraction: float, residual: float) -> Step | None:
        """Return the step from a later state, given its residual, to where this tangent solves its mixed problem.

        ``None`` where it is not much shorter than the last one, or surfaces touch, which meet with their actual forces:
        a new tangent will get on faster.
        """
        if self._uses == USES or not self._may_pay(residual) or self.system.contact_force(state) > 0.0:
            return None
        force = self.system.free_part(self.system.mixed_force(state, self.state))
        found = self.linear.solution_again(self.system, -force, state)
        if found is None:
            return None
        self._uses += 1
        step = self._controlled(found, self.state, state, fraction)
        size = float(np.linalg.norm(step.du))
        # Written so that what is not a number is not shorter.
        if not size < SHORTER * self._size:
            return None
        self._size = size
        return step

    def is_sharp(self, residual: float) -> bool:
        """Whether a state that meets the tolerance is as good as Newton's own last step makes one."""
        return self._uses == 0 or not self.linear.cheap_again or residual <= SHARP * self._tolerance

    def is_near(self, state: State) -> bool:
        """Whether the tangent speaks for a state, too, or has nothing to say."""
        if not self.linear.tells_inertia and self._control is None:
            return True
        away = float(np.linalg.norm(state.u - self.state.u))
        return self.residual <= NEAR or away <= NEARBY * float(np.linalg.norm(state.u))

    def _may_pay(self, residual: float) -> bool:
        """Whether it may cost less to solve with this tangent again than with a new one, at a state's residual."""
        if not self.linear.cheap_again:
            return residual <= MUCH_LESS * self.residual
        return self.system.mesh.dimension == 3 and self.system.n_dofs >= KEPT_FROM

    def _controlled(self, found: Solution, base: State | None, state: State, fraction: float) -> Step:
        """Return the step from a state with which the linearised control holds too."""
        control = self._control
        if control is None or self.compliance is None:
            return Step(found.u, 0.0, base, found.unmet)
        value, by_conjugate, by_fraction = control.gap(self.system.conjugate(state, control.weights), fraction)
        value -= by_conjugate * float(np.vdot(self._measured, found.u))
        slope = by_conjugate * self.compliance + by_fraction
        if slope == 0.0:
            # Nothing is loaded yet: a rigid body that moves has not met anything.
            raise NotConvergedError("there is no load that the control could follow")
        change = -value / slope
        found = found.plus(change, self._response)
        return Step(found.u, change, base, found.unmet)


def _wanders(residuals: list[float], tolerance: float) -> bool:
    """Whether the residual has risen again and again: the iteration is not on its way to an equilibrium.

    The guess does not count: where displacements or a volume are imposed, its residual says nothing. Nor does what is
    near the tolerance, where rounding speaks.
    """
    pairs = itertools.pairwise(residuals[1:])
    return sum(last > 10.0 * tolerance and now > RISE * last for last, now in pairs) >= RISES


def factorise_tangent(system: System, linear: StiffnessSolver, state: State, residuals: Sequence[float] = ()) -> None:
    """Make ready to solve with the stiffness of a state.

    Raises
    ------
    NotConvergedError
        If it is singular; with the `residuals` of the iteration that led there, if any.
    """
    try:
        linear.take_stiffness(system, state)
    except SingularMatrixError as error:
        raise failure("the stiffness is singular", system, state, residuals) from error


def failure(reason: str, system: System, state: State, residuals: Sequence[float]) -> NotConvergedError:
    """Return the error that says why an iteration ended, how, and which element is worst."""
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
