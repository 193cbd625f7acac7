"""What factorising a stiffness is worth in iterations, foretold from the mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.incidence import Incidence, coupled
from turgor.fem.system import System
from turgor.mesh.cells import cells_of_corners
from turgor.solver.linear import Pardiso, solver_in_use

Ints = NDArray[np.int32]


def affordable_iterations(system: System) -> float:
    """Return how many inner iterations for each tangent cost as much as factorising.

    The costs for each unknown, µs, were measured on two threads (benchmarks/linear_choice.py). What one of factorising
    costs goes by the mean length of the factor's columns, or its square. It is about 6.8 times that of the factor of
    the graph of the corners alone, which is soon found. An iteration goes by the matrix itself, and so does what goes
    with more tangents, as factors serve again. The number is infinite where there is no PARDISO: the other solvers
    take much longer.
    """
    if solver_in_use() is not Pardiso:
        return np.inf
    in_factor = length_of_columns(*corner_graph(system.mesh.cells))
    in_matrix = 3.0 * system.pattern.blocks_per_node - 1.0
    factorising = 1.7e-3 * in_factor**2 + 0.018 * in_factor
    more_tangents, iteration = 0.022 * in_matrix, 0.096 + 0.0012 * in_matrix
    return (factorising - more_tangents) / iteration


def length_of_columns(row_start: Ints, column: Ints) -> float:
    """Return how many entries a column has on average in PARDISO's factor of an upper triangle's pattern."""
    solver = Pardiso(row_start, column)
    solver.analyse()
    return solver.entries / solver.n


def corner_graph(cells: Ints) -> tuple[Ints, Ints]:
    """Return which corners share a cell, as the upper triangle of a matrix in compressed rows: starts and columns."""
    corners, cells = cells_of_corners(cells)
    start, column = coupled(Incidence.of(len(corners), [cells]))
    return start.astype(np.int32), column
