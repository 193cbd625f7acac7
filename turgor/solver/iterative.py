"""Large systems in space: displacements and pressures by a Krylov method with a block preconditioner.

The stiffness with condensed pressures is A + Bᵀ E B, whose condition number grows with the bulk modulus. With the
pressures as unknowns the same step solves

    [ A   Bᵀ  ] [δu]   [r]
    [ B  −E⁻¹ ] [q ] = [0],

which the preconditioner [M Bᵀ; 0 −S]⁻¹ turns into one whose eigenvalues gather around one, at any bulk modulus and
size of mesh (Elman, Silvester and Wathen 2014, ch. 4). M⁻¹ is one cycle of multigrid for A
(:mod:`turgor.solver.multigrid`), S = E⁻¹ + V/((1 + γ) μ) stands for the Schur complement. A keeps γ shear moduli of the
bulk modulus: an augmented Lagrangian (Benzi and Olshanskii 2006), which holds it definite where pressures are of the
order of μ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.log import logger
from turgor.fem.pattern import SparsePattern
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.krylov import Room, gmres, softest
from turgor.solver.linear import LinearSolver, factors_fit, make_linear_solver
from turgor.solver.multigrid import TwoLevels
from turgor.solver.pressures import Pressures
from turgor.solver.stiffness import ACCURATE, FORCING, Solution, StiffnessSolver

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

log = logger("solver")

AUGMENTATION = 5.0
"""γ: shear moduli of the bulk modulus that stay in A.

With less, the pressures are harder to find; with more, A is harder to smooth.
"""

MOST_ITERATIONS = 180
"""Of one linear problem; then it is factorised."""

MOST_FOR_INERTIA = 60
"""Iterations in which A is seen to be definite; else the tangent is factorised to tell its inertia."""

ROUNDED = 0.5
"""Part of A's least energy by which single precision may change it, if it is to speak for the energy's sign."""

MASKED = 1e-2
VOLUMES_LEFT = 0.01
"""Where the pressures that lag balance all but such a part of the condensed out-of-balance force, no more than such a
part of it may be left in volumes, whose error K amplifies: at 10⁷ μ rounding in the forces hides volumes that matter.
"""

FAILURES = 3
"""Tangents on which the method has failed, after which all are factorised."""


class Iterative(StiffnessSolver):
    """GMRES for the mixed problem of one system; what it does not solve is factorised.

    Attributes
    ----------
    iterations
        Those of each linear problem so far.
    """

    name = "GMRES with multigrid"
    cheap_again = False

    def __init__(self, system: System) -> None:
        self.iterations: list[int] = []
        self._levels = TwoLevels(system.pattern, system.mesh.points, system.mesh.cells)
        fine = self._levels.fine
        self._pressures = Pressures([solid.nodes for solid in system.solids], fine.rank, self._levels.free)
        self._system = system
        # Of each free component, in the order of the rows, its number among the unknowns.
        number = np.cumsum(system.pattern.free, dtype=np.int32).reshape(-1, 3)[fine.order] - 1
        self._number: Ints = number[self._levels.free]
        self._room = Room()
        self._direct: LinearSolver | None = None
        self._factorised = False
        self._failures = 0
        self._left = 0.0

    def _take_stiffness(self, system: System, state: State) -> None:
        """Set up the mixed problem and its preconditioner."""
        assert system is self._system
        self._factorised = False
        self._state = state
        if self._failures >= FAILURES:
            self._factors()
            return
        equations = system.split_stiffness(state, AUGMENTATION, self._levels.fine.layout, self._levels.fine.values)
        self._levels.update()
        self._pressures.take(equations)

    def solution(self, system: System, right: Floats, accuracy: float = FORCING) -> Solution:
        """Return the step for a right-hand side ``(n,)``, with what it leaves of the volume equations."""
        return self._solution(system, right, self._problem(right, self._state), accuracy)

    def solution_again(self, system: System, right: Floats, state: State) -> Solution | None:
        """Return the step from a later state, unless more is out of balance there than the last step left."""
        problem = self._problem(right, state)
        if problem is not None and not np.linalg.norm(problem.residual) <= self._left:
            return None
        return self._solution(system, right, problem, FORCING)

    def solve(self, right: Floats) -> Floats:
        """Return the displacements ``(n,)``."""
        found = self._found(self._problem(right, self._state), ACCURATE)
        return self._factors().solve(right) if found is None else self._free_part(found[0])

    @property
    def negative_pivots(self) -> int | None:
        """Unknown, unless the stiffness had to be factorised; :meth:`inertia` finds it."""
        return self._factors().negative_pivots if self._factorised else None

    def inertia(self) -> int | None:
        """Return the number of negative eigenvalues; ``None`` where only factors that do not fit would tell.

        There is none if A has none, for what is condensed into it adds energy. A holds enough of the bulk modulus to be
        definite at nearly all stable states; where it is not seen to be, the stiffness is factorised.
        """
        if self._factorised:
            return self.negative_pivots
        if self._is_definite():
            return 0
        if not factors_fit(self._system.n_dofs):
            log.warning(
                "whether the state is stable only a factorisation could tell, which does not fit into the memory"
            )
            return None
        return self._factors().inertia()

    def _is_definite(self) -> bool:
        """Whether A is seen to be positive definite, also in double precision where it is softest."""
        found = softest(self._levels.apply, 3 * len(self._levels.free), MOST_FOR_INERTIA, self._room)
        if found is None:
            return False
        direction, energy = found
        exact = float(np.vdot(direction, self._forces(direction)))
        return abs(exact - energy) <= ROUNDED * energy

    def direct(self) -> LinearSolver:
        """Return the direct solver that helps out, as it is: what it has analysed serves on."""
        if self._direct is None:
            pattern: SparsePattern = self._system.pattern
            self._direct = make_linear_solver(pattern.row_start, pattern.column)
        return self._direct

    def _solution(self, system: System, right: Floats, problem: _Problem | None, accuracy: float) -> Solution:
        found = self._found(problem, accuracy)
        if found is None:
            u = system.nodal(self._factors().solve(right))
            return Solution(u, tuple(np.zeros((len(s.nodes), s.modes.shape[2])) for s in system.solids))
        u, q = found
        return Solution(system.nodal(self._free_part(u)), self._pressures.unmet(u, q))

    def _problem(self, right: Floats, state: State) -> _Problem | None:
        """Return the mixed problem for a right-hand side, begun at the pressures that lag at a state.

        ``None`` where the stiffness is factorised.
        """
        if self._factorised:
            return None
        pressures, n = self._pressures, 3 * len(self._levels.free)
        load = np.zeros(n)
        load[self._levels.free.ravel()] = right[self._number]
        # At the out-of-balance force, what the lagging pressures leave of it is much less than all.
        lagging = pressures.of_lag(self._system.dilatation_lag(state))
        left = load - pressures.forces(lagging)
        if np.linalg.norm(left) > np.linalg.norm(load):
            lagging, left = np.zeros_like(lagging), load
        x = np.concatenate([np.zeros(n), lagging])
        return _Problem(load, x, np.concatenate([left, -pressures.residual(x[:n], lagging)]))

    def _found(self, problem: _Problem | None, accuracy: float) -> tuple[Floats, Floats] | None:
        """Return displacements and pressures in the order of the levels, ``None`` if they are not found or asked for.

        The method works with a matrix in single precision; a solution that is to be more accurate than that, or leaves
        too much in volumes, is corrected by what it leaves of the residual in double precision.
        """
        if problem is None:
            return None
        n, x, residual = len(problem.load), problem.start, problem.residual
        if not np.any(residual):
            return x[:n], x[n:]
        goal = accuracy * float(np.linalg.norm(residual))
        count = 0
        while True:
            size = float(np.linalg.norm(residual))
            most, reached = MOST_ITERATIONS - count, max(goal / size, FORCING)
            change, iterations, converged = gmres(self._precondition, residual, reached, most, self._room)
            count += iterations
            x = x + change
            if not converged or (accuracy >= FORCING and self._meets_volumes(problem, x)):
                break
            if accuracy >= FORCING:
                goal *= VOLUMES_LEFT
            residual = self._residual(problem.load, x)
            if float(np.linalg.norm(residual)) <= goal:
                break
            converged = float(np.linalg.norm(residual)) < 0.5 * size
            if not converged:
                break
        self.iterations.append(count)
        log.debug("%d iterations of %s", count, self.name)
        if converged:
            self._left = goal
            return x[:n], x[n:]
        self._failures += 1
        log.warning("%s has not converged within %d iterations: factorising", self.name, count)
        return None

    def _meets_volumes(self, problem: _Problem, x: Floats) -> bool:
        """Whether little of the condensed out-of-balance force is left in volumes, or the mixed problem tells it."""
        n, size = len(problem.load), np.linalg.norm(problem.load)
        if np.linalg.norm(problem.residual) > MASKED * size:
            return True
        left = self._pressures.forces(self._pressures.of_lag(self._pressures.unmet(x[:n], x[n:])))
        return bool(np.linalg.norm(left) <= VOLUMES_LEFT * size)

    def _residual(self, load: Floats, x: Floats) -> Floats:
        """Return what displacements and pressures leave of the mixed problem, in double precision."""
        n = len(load)
        forces = self._forces(x[:n]) + self._pressures.forces(x[n:])
        return np.concatenate([load - forces, -self._pressures.residual(x[:n], x[n:])])

    def _forces(self, u: Floats) -> Floats:
        """Return A u in double precision, zero where nothing is unknown."""
        order, free = self._levels.fine.order, self._levels.free
        nodal = np.empty((len(order), 3))
        nodal[order] = u.reshape(-1, 3) * free
        return (self._system.stiffness_times(nodal)[order] * free).ravel()

    def _precondition(self, x: Floats) -> tuple[Floats, Floats]:
        """Return what the preconditioner makes of a residual, and the product of the matrix with it."""
        n = 3 * len(self._levels.free)
        q = self._pressures.pressures(x[n:])
        forces = self._pressures.forces(q)
        u, product = self._levels.apply(x[:n] - forces)
        return np.concatenate([u, q]), np.concatenate([product + forces, self._pressures.residual(u, q)])

    def _free_part(self, u: Floats) -> Floats:
        part = np.empty(self._system.n_dofs)
        part[self._number] = u.reshape(-1, 3)[self._levels.free]
        return part

    def _factors(self) -> LinearSolver:
        """Return the direct solver with the stiffness factorised."""
        direct = self.direct()
        if not self._factorised:
            direct.take_stiffness(self._system, self._state)
            self._factorised = True
        return direct


@dataclass(frozen=True, eq=False)
class _Problem:
    """The loads ``(3 n_nodes,)`` of a mixed problem, where its iteration starts, and what is out of balance there."""

    load: Floats
    start: Floats
    residual: Floats
