"""Symmetric linear solvers behind one class: analyse a pattern once, factorise values, solve.

MKL's PARDISO where it is installed; else MUMPS if its Python package is; else SuperLU from SciPy.
"""

from __future__ import annotations

import ctypes
import functools
import os
import weakref
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
import psutil
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from turgor.common.errors import SolverError
from turgor.common.log import logger
from turgor.common.optional import is_available, require, shared_library
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.solver.stiffness import FORCING, Solution, StiffnessSolver

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

log = logger("solver")


class SingularMatrixError(SolverError):
    """The matrix could not be factorised."""


LARGE = 200_000
"""Unknowns from which the memory counts more than the time in which the system hands it out anew."""


class LinearSolver(StiffnessSolver):
    """A direct solver for symmetric, possibly indefinite matrices of one fixed pattern.

    Parameters
    ----------
    row_start, column
        The upper triangle in compressed rows, zero-based, with every diagonal entry stored.
    """

    def __init__(self, row_start: Ints, column: Ints) -> None:
        self._entries: Floats | None = None
        self.take(row_start, column)

    def take(self, row_start: Ints, column: Ints) -> None:
        """Begin anew with another pattern; the factors are lost."""
        self.row_start = row_start
        self.column = column
        self.n = len(row_start) - 1

    def _take_stiffness(self, system: System, state: State) -> None:
        """Factorise the stiffness of a state; its pattern is a new one where surfaces have come close to each other.

        Of a large model neither the last factors are kept during the assembly, nor the elements' stiffnesses after it.
        """
        is_large = self.n >= LARGE
        if is_large:
            self.release_factors()
        self._entries = system.stiffness(state, self._entries)
        if self.column is not system.pattern.column:
            self.take(system.pattern.row_start, system.pattern.column)
        if is_large:
            system.forget_blocks()
        self.factorise(self._entries)

    def solution(self, system: System, right: Floats, accuracy: float = FORCING) -> Solution:
        """Return the step for a right-hand side, exact but for rounding."""
        del accuracy
        return Solution(system.nodal(self.solve(right)))

    def release_factors(self) -> None:
        """Give back the memory of the factors, where the library can do so and keep its analysis."""

    @abstractmethod
    def factorise(self, values: Floats) -> None:
        """Factorise the matrix with these stored values.

        Raises
        ------
        SingularMatrixError
            If it cannot be done.
        """


def make_linear_solver(row_start: Ints, column: Ints) -> LinearSolver:
    """Return the best solver that is installed, and say in the log which."""
    kind = solver_in_use()
    log.info("linear solver: %s", kind.name)
    return kind(row_start, column)


def solver_in_use() -> type[LinearSolver]:
    """Return the class of the solver that :func:`make_linear_solver` chooses on this machine."""
    if _mkl() is not None:
        return Pardiso
    return Mumps if is_available("mumps") else SuperLU


def free_memory_mb() -> float:
    """Return how much memory the machine has free, MB."""
    return float(psutil.virtual_memory().available) / 2**20


FACTORS_KB = 14.0
"""Memory that a factorisation takes for an unknown, kB, in space at the sizes that fill a machine's memory."""


def factors_fit(n_dofs: int) -> bool:
    """Whether the factors of a body in space are expected to fit into the memory that is free."""
    return n_dofs * FACTORS_KB <= 2**10 * free_memory_mb()


def warn_of_memory(needed_mb: float) -> None:
    """Say in the log before a factorisation that it takes more memory, MB, than the machine has free."""
    if needed_mb > (free_mb := free_memory_mb()):
        log.warning(
            "the factorisation needs about %.0f MB of memory and %.0f MB are free: the run may be slow or be ended by "
            "the system; a coarser mesh or a symmetric half needs less",
            needed_mb,
            free_mb,
        )


BLOCKS = 80
"""Percent of their entries that rows must have in common to be one block: those of a node have all of them."""

_SYMMETRIC_INDEFINITE = -2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE_FACTORS, _RELEASE = 11, 22, 33, 0, -1


class Pardiso(LinearSolver):
    """MKL PARDISO for real symmetric indefinite matrices (Schenk and Gärtner 2004).

    The ordering and the symbolic factorisation are made once; Bunch–Kaufman pivoting gives the inertia for nothing.

    Parameters
    ----------
    row_start, column
        As for :class:`LinearSolver`.
    single
        Whether factors and solutions are in single precision, in half of the memory.
    """

    name = "MKL PARDISO"

    def __init__(self, row_start: Ints, column: Ints, *, single: bool = False) -> None:
        library = _mkl()
        assert library is not None
        self._pardiso = library.pardiso
        self._precision: type[np.floating] = np.float32 if single else np.float64
        self._release: Callable[[], object] = _nothing
        super().__init__(row_start, column)

    def take(self, row_start: Ints, column: Ints) -> None:
        """Begin anew with another pattern; the memory of the factors is set free."""
        self._release()
        self._release = _nothing
        super().take(row_start, column)
        self._handle = np.zeros(64, np.int64)
        self._values: NDArray[np.floating] = np.zeros(len(column), self._precision)
        self._analysed = False
        # Numbered from zero as in MKL's manual for C; what is not set here is left at zero.
        # Left at zero, iterative refinement runs after perturbed pivots only.
        control = np.zeros(64, np.int32)
        control[0] = 1  # the entries below, not the defaults
        control[1] = 3  # nested dissection, in parallel
        control[9] = 10  # pivots below 1e-10 of the norm are perturbed
        control[17] = -1  # the entries of the factors are counted
        control[20] = 1  # Bunch–Kaufman pivots
        control[23] = 1  # in two levels, whose threads hardly wait for each other
        control[27] = self._precision is np.float32  # single precision
        control[34] = 1  # indices from zero
        control[36] = -BLOCKS  # blocks are found in the pattern: far less of it to order and to analyse
        self._control = control

    def factorise(self, values: Floats) -> None:
        """Factorise; the first call also orders and analyses the pattern."""
        self._values = np.asarray(values, self._precision)
        if not self._analysed:
            self.analyse()
            warn_of_memory(self.memory_mb)
        self._call(_FACTORISE)

    def analyse(self) -> None:
        """Order the pattern and find that of the factors."""
        self._call(_ANALYSE)
        self._analysed = True
        matrix = (_EMPTY, self.row_start, self.column)
        self._release = weakref.finalize(
            self, _pardiso_call, self._pardiso, _RELEASE, self._handle, self._control, matrix, (_EMPTY, _EMPTY)
        )

    def release_factors(self) -> None:
        """Give back the memory of the factors; the analysis is kept."""
        if self._analysed:
            self._call(_RELEASE_FACTORS)

    def solve(self, right: Floats) -> Floats:
        """Solve with the newest factors."""
        solution: NDArray[np.floating] = np.empty(len(right), self._precision)
        self._call(_SOLVE, np.ascontiguousarray(right, self._precision), solution)
        return np.asarray(solution, float)

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._control[22])

    @property
    def entries(self) -> int:
        """Number of entries of the factors, known once the pattern is analysed."""
        return int(self._control[17])

    @property
    def memory_mb(self) -> float:
        """Most memory, MB, that ordering, factors and solution take together; known once the pattern is analysed."""
        ordering, kept, factors = (float(kilobytes) for kilobytes in self._control[14:17])
        return max(ordering, kept + factors) / 2**10

    def _call(
        self, phase: int, right: NDArray[np.floating] | None = None, solution: NDArray[np.floating] | None = None
    ) -> None:
        error = _pardiso_call(
            self._pardiso,
            phase,
            self._handle,
            self._control,
            (self._values, self.row_start, self.column),
            (_EMPTY if right is None else right, _EMPTY if solution is None else solution),
        )
        if error == -2:
            raise SolverError("not enough memory for the factorisation", advice="A coarser mesh needs less")
        if error == -4:
            raise SingularMatrixError("the stiffness matrix is singular")
        if error:
            raise SolverError(f"PARDISO stopped with error {error} in phase {phase}")


_EMPTY = np.zeros(1)


def _nothing() -> None:
    """Release nothing."""


def _pardiso_call(
    function: Any,
    phase: int,
    handle: NDArray[np.int64],
    control: Ints,
    matrix: tuple[NDArray[np.floating], Ints, Ints],
    vectors: tuple[NDArray[np.floating], NDArray[np.floating]],
) -> int:
    """Call PARDISO for one symmetric indefinite matrix and one right-hand side; return its error code."""
    values, row_start, column = matrix
    one, error = ctypes.c_int32(1), ctypes.c_int32(0)
    function(
        _pointer(handle),
        ctypes.byref(one),
        ctypes.byref(one),
        ctypes.byref(ctypes.c_int32(_SYMMETRIC_INDEFINITE)),
        ctypes.byref(ctypes.c_int32(phase)),
        ctypes.byref(ctypes.c_int32(len(row_start) - 1)),
        _pointer(values),
        _pointer(row_start),
        _pointer(column),
        _pointer(np.zeros(1, np.int32)),
        ctypes.byref(one),
        _pointer(control),
        ctypes.byref(ctypes.c_int32(0)),
        _pointer(vectors[0]),
        _pointer(vectors[1]),
        ctypes.byref(error),
    )
    return error.value


class Mumps(LinearSolver):
    """MUMPS for symmetric indefinite matrices (Amestoy et al. 2001): for processors that MKL is not made for.

    The ordering is made once. How fast it is depends on the BLAS that it was built with.
    """

    name = "MUMPS"

    def take(self, row_start: Ints, column: Ints) -> None:
        """Begin anew with another pattern."""
        super().take(row_start, column)
        self._row = np.repeat(np.arange(self.n, dtype=np.int32), np.diff(row_start))
        self._mumps: Any = require("mumps", "the factorisation without MKL")
        self._context = self._mumps.Context()

    def factorise(self, values: Floats) -> None:
        """Factorise; the first call also orders and analyses the pattern."""
        upper = sp.coo_array((values, (self._row, self.column)), shape=(self.n, self.n))
        self._context.set_matrix(upper, symmetric=True)
        try:
            self._context.factor(reuse_analysis=self._context.analyzed)
        except self._mumps.MUMPSError as error:
            raise SingularMatrixError(f"the stiffness matrix could not be factorised ({error})") from error

    def solve(self, right: Floats) -> Floats:
        """Solve with the newest factors."""
        return np.asarray(self._context.solve(right))

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._context.mumps_instance.infog[12])


class SuperLU(LinearSolver):
    """SuperLU (Li 2005) as SciPy carries it: unsymmetric, on one thread, without inertia."""

    name = "SuperLU"
    tells_inertia = False

    def take(self, row_start: Ints, column: Ints) -> None:
        """Begin anew with another pattern."""
        super().take(row_start, column)
        row = np.repeat(np.arange(self.n), np.diff(row_start))
        self._row, self._off = row, row != column

    def factorise(self, values: Floats) -> None:
        """Factorise the full matrix."""
        rows = np.concatenate([self._row, self.column[self._off]])
        cols = np.concatenate([self.column, self._row[self._off]])
        full = sp.csc_matrix((np.concatenate([values, values[self._off]]), (rows, cols)), shape=(self.n, self.n))
        try:
            self._factors = scipy.sparse.linalg.splu(full, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SingularMatrixError("the stiffness matrix is singular") from error

    def solve(self, right: Floats) -> Floats:
        """Solve with the newest factors."""
        return np.asarray(self._factors.solve(right))

    @property
    def negative_pivots(self) -> None:
        """Unknown: row exchanges hide the signs."""
        return None


_INTEL_OPENMP = 0


@functools.cache
def _mkl() -> Any | None:
    """Load MKL's runtime library from its Python package, or return ``None`` where there is none.

    It runs on the threads of Intel's OpenMP, also where those of GNU's are in the process before it (gmsh brings them):
    these spin for long after a factorisation, on the processors that the element kernels need.
    """
    library = shared_library("mkl", "libmkl_rt.so", "mkl_rt.")
    if library is None:
        return None
    # In ms. Without a spin the threads would have to be woken in each of the short parallel regions of a solution.
    os.environ.setdefault("KMP_BLOCKTIME", "1")
    openmp = shared_library("intel-openmp", "libiomp5.so", "libiomp5md.dll")
    if openmp is not None and "MKL_THREADING_LAYER" not in os.environ:
        library.MKL_Set_Threading_Layer(_INTEL_OPENMP)
    library.pardiso.restype = None
    return library


def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
