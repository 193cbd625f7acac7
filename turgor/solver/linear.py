"""Symmetric linear solvers behind one class: analyse a pattern once, factorise values, solve.

MKL's PARDISO where it is installed, SuperLU from SciPy where it is not.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import os
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg
from numpy.typing import NDArray

from turgor.common.errors import SolverError
from turgor.common.log import logger

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

log = logger("solver")


class SingularMatrixError(SolverError):
    """The matrix could not be factorised."""


class LinearSolver(ABC):
    """A direct solver for symmetric, possibly indefinite matrices of one fixed pattern.

    Parameters
    ----------
    row_start, column
        The upper triangle in compressed rows, zero-based, with every diagonal entry stored.
    """

    name: ClassVar[str]

    def __init__(self, row_start: Ints, column: Ints) -> None:
        self.row_start = row_start
        self.column = column
        self.n = len(row_start) - 1

    @abstractmethod
    def factorise(self, values: Floats) -> None:
        """Factorise the matrix with these stored values.

        Raises
        ------
        SingularMatrixError
            If it cannot be done.
        """

    @abstractmethod
    def solve(self, right: Floats) -> Floats:
        """Return the solution ``(n,)`` for a right-hand side ``(n,)`` with the newest factors."""

    @property
    @abstractmethod
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues of the matrix factorised last, ``None`` where the solver cannot tell."""


def make_linear_solver(row_start: Ints, column: Ints) -> LinearSolver:
    """Return the best solver that is installed, and say in the log which."""
    kind = solver_in_use()
    log.info("linear solver: %s", kind.name)
    return kind(row_start, column)


def solver_in_use() -> type[LinearSolver]:
    """Return the class of the solver that :func:`make_linear_solver` chooses on this machine."""
    return SuperLU if _mkl() is None else Pardiso


class Pardiso(LinearSolver):
    """MKL PARDISO for real symmetric indefinite matrices (Schenk and Gärtner 2004), nested-dissection ordering.

    The ordering and the symbolic factorisation are made once; Bunch–Kaufman pivoting gives the inertia for nothing.
    """

    name = "MKL PARDISO"

    _SYMMETRIC_INDEFINITE = -2
    _ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1

    def __init__(self, row_start: Ints, column: Ints) -> None:
        super().__init__(row_start, column)
        library = _mkl()
        assert library is not None
        self._pardiso = library.pardiso
        self._handle = np.zeros(64, np.int64)
        self._values: Floats = np.zeros(len(column))
        self._analysed = False
        # Numbered from zero as in MKL's manual for C; what is not set here is left at zero.
        control = np.zeros(64, np.int32)
        control[0] = 1  # the entries below, not the defaults
        control[1] = 3  # nested dissection, in parallel
        control[7] = 2  # at most two steps of iterative refinement, made only after perturbed pivots
        control[9] = 10  # pivots below 1e-10 of the norm are perturbed
        control[17] = -1  # report the number of factor entries
        control[20] = 1  # Bunch–Kaufman pivots
        control[34] = 1  # indices from zero
        self._control = control

    def factorise(self, values: Floats) -> None:
        """Factorise; the first call also orders and analyses the pattern."""
        self._values = values
        if not self._analysed:
            self._call(self._ANALYSE)
            self._analysed = True
        self._call(self._FACTORISE)

    def solve(self, right: Floats) -> Floats:
        """Solve with the newest factors."""
        solution = np.empty_like(right)
        self._call(self._SOLVE, np.ascontiguousarray(right), solution)
        return solution

    @property
    def negative_pivots(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._control[22])

    @property
    def factor_memory_MB(self) -> float:
        """Memory of the factors, MB, as PARDISO reports it after the analysis."""
        return float(max(self._control[14], self._control[15] + self._control[16])) / 1024

    def __del__(self) -> None:
        if getattr(self, "_analysed", False):
            self._call(self._RELEASE)

    def _call(self, phase: int, right: Floats | None = None, solution: Floats | None = None) -> None:
        empty = np.zeros(1)
        error = ctypes.c_int32(0)
        self._pardiso(
            _pointer(self._handle),
            _integer(1),
            _integer(1),
            _integer(self._SYMMETRIC_INDEFINITE),
            _integer(phase),
            _integer(self.n),
            _pointer(self._values),
            _pointer(self.row_start),
            _pointer(self.column),
            _pointer(np.zeros(1, np.int32)),
            _integer(1),
            _pointer(self._control),
            _integer(0),
            _pointer(empty if right is None else right),
            _pointer(empty if solution is None else solution),
            ctypes.byref(error),
        )
        if error.value == -2:
            raise SolverError("not enough memory for the factorisation", advice="A coarser mesh needs less")
        if error.value == -4:
            raise SingularMatrixError("the stiffness matrix is singular")
        if error.value:
            raise SolverError(f"PARDISO stopped with error {error.value} in phase {phase}")


class SuperLU(LinearSolver):
    """SuperLU (Li 2005) as SciPy carries it: unsymmetric, on one thread, without inertia."""

    name = "SuperLU"

    def __init__(self, row_start: Ints, column: Ints) -> None:
        super().__init__(row_start, column)
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


@functools.cache
def _mkl() -> Any | None:
    """Load MKL's runtime library from its Python package, or return ``None`` where there is none."""
    try:
        files = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    # Threads that spin after a factorisation would take the cores from the element kernels.
    os.environ.setdefault("KMP_BLOCKTIME", "0")
    for file in files:
        if file.name.startswith(("libmkl_rt.", "mkl_rt.")) and ".so" in file.name or file.name.endswith("rt.dll"):
            try:
                library = ctypes.CDLL(str(file.locate()))
            except OSError as error:
                log.warning("MKL is installed but does not load: %s", error)
                continue
            library.pardiso.restype = None
            return library
    return None


def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _integer(value: int) -> Any:
    return ctypes.byref(ctypes.c_int32(value))
