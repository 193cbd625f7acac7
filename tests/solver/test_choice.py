"""Linear problems are factorised or solved by iteration, whichever costs less, and either leads to the same states."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from samples import neo_hookean, sphere, tube

from turgor.common.errors import InputError
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle, shell_octant
from turgor.solver import choice, linear, worth
from turgor.solver.choice import WhileCheaper, make_stiffness_solver
from turgor.solver.iterative import Iterative
from turgor.solver.linear import LinearSolver, Pardiso, SuperLU, solver_in_use
from turgor.solver.newton import NewtonOptions, find_equilibrium
from turgor.solver.path import PathOptions, output_fractions, solve_path
from turgor.solver.worth import affordable_iterations, corner_graph, length_of_columns

RUBBER = {"body": neo_hookean(ratio=1e3)}
needs_pardiso = pytest.mark.skipif(solver_in_use() is not Pardiso, reason="MKL is not installed")


def block(sides, n, cell_type):
    return System(box(sides, n, cell_type), RUBBER, [Clamped("x0")])


def test_small_models_are_factorised(monkeypatch):
    monkeypatch.setattr(choice, "affordable_iterations", lambda _: 100.0)
    system = sphere("tet10", 1)
    assert isinstance(make_stiffness_solver(system), LinearSolver)
    assert isinstance(make_stiffness_solver(system, "iterative"), Iterative)
    monkeypatch.setattr(choice, "ITERATIVE_FROM", system.n_dofs)
    assert isinstance(make_stiffness_solver(system), WhileCheaper)
    assert isinstance(make_stiffness_solver(system, "direct"), LinearSolver)


@needs_pardiso
@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
def test_thick_bodies_are_iterated_and_thin_ones_factorised(cell_type):
    thick = block((1.0, 1.0, 1.0), (10, 10, 10), cell_type)
    thin = block((120.0, 6.0, 1.0), (120, 6, 1), cell_type)
    assert min(thick.n_dofs, thin.n_dofs) > choice.ITERATIVE_FROM
    assert isinstance(make_stiffness_solver(thick), WhileCheaper)
    assert isinstance(make_stiffness_solver(thin), LinearSolver)


@needs_pardiso
@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
@pytest.mark.parametrize("n", [(6, 6, 6), (20, 12, 1), (60, 3, 3)], ids=str)
def test_the_corners_foretell_the_factors(n, cell_type):
    """Within a fifth: the time, which goes by the square, is then foretold to within a half."""
    system = block(tuple(map(float, n)), n, cell_type)
    whole = length_of_columns(system.pattern.row_start, system.pattern.column)
    assert whole == pytest.approx(6.8 * length_of_columns(*corner_graph(system.mesh.cells)), rel=0.2)


def test_the_graph_of_the_corners():
    cells = shell_octant(1.0, 1.5, 1, "tet10").cells
    corners = np.unique(cells[:, :4])
    together = {(a, b) for cell in cells[:, :4] for a in cell for b in cell if a <= b}
    row_start, column = corner_graph(cells)
    row = np.repeat(np.arange(len(corners)), np.diff(row_start))
    assert list(zip(corners[row], corners[column], strict=True)) == sorted(together)


def test_without_pardiso_iterations_are_always_cheaper(monkeypatch):
    monkeypatch.setattr(worth, "solver_in_use", lambda: SuperLU)
    monkeypatch.setattr(choice, "ITERATIVE_FROM", 0)
    assert affordable_iterations(sphere("tet10", 1)) == np.inf
    assert isinstance(make_stiffness_solver(sphere("tet10", 1)), Iterative)


@pytest.mark.parametrize(("affordable", "stays"), [(1.0, False), (1e3, True)])
def test_it_factorises_where_iterations_cost_more_and_finds_the_same(affordable, stays, monkeypatch, caplog):
    system = tube(3.0)
    monkeypatch.setattr(choice, "ITERATIVE_FROM", 0)
    monkeypatch.setattr(choice, "affordable_iterations", lambda _: affordable)
    monkeypatch.setattr(choice, "USUAL", 0.0)
    solver = make_stiffness_solver(system)
    assert solver.name == Iterative.name
    assert not solver.cheap_again
    with caplog.at_level(logging.INFO):
        found = find_equilibrium(system, solver, system.reference_state(), 1.0, NewtonOptions())
    assert (solver.name == Iterative.name) is stays
    assert ("factorising costs less than 1 iterations" in caplog.text) is not stays
    direct = make_stiffness_solver(system, "direct")
    assert solver.cheap_again is (not stays and direct.cheap_again)
    expected = find_equilibrium(system, direct, system.reference_state(), 1.0, NewtonOptions())
    largest = np.abs(expected.state.u).max()
    assert largest > 0.05
    assert np.abs(found.state.u - expected.state.u).max() <= 1e-6 * largest
    assert found.negative_pivots == expected.negative_pivots == 0


def test_the_choice_is_the_same_every_time(monkeypatch):
    monkeypatch.setattr(choice, "ITERATIVE_FROM", 0)
    monkeypatch.setattr(choice, "affordable_iterations", lambda _: 12.0)
    monkeypatch.setattr(choice, "USUAL", 0.0)
    paths = [solve_path(tube(3.0), output_fractions(3), options=PathOptions()) for _ in range(2)]
    work = [[(end.factorisations, end.iterations) for end in path] for path in paths]
    assert work[0] == work[1]
    # Two threads of MKL's need not add in the same order.
    np.testing.assert_allclose(paths[0][-1].state.u, paths[1][-1].state.u, rtol=0.0, atol=1e-9)


def test_what_the_iterative_path_does_not_know_is_factorised_and_said(caplog):
    cube = box((1.0, 1.0, 1.0), (1, 1, 1))
    cases = {
        "given displacements": System(cube, RUBBER, [Clamped("x0"), Prescribed("x1", (0.1, None, None))]),
        "oblique": System(shell_octant(1.0, 1.5, 1), RUBBER, [Sliding("outer"), Clamped("x0")]),
        "plane models": System(rectangle((1.0, 1.0), (1, 1)), RUBBER, [Clamped("x0")], section=PlaneStrain(1.0)),
    }
    with caplog.at_level(logging.INFO):
        for reason, system in cases.items():
            caplog.clear()
            assert isinstance(make_stiffness_solver(system, "iterative"), LinearSolver)
            assert reason in caplog.text


def test_iteration_is_chosen_where_factors_would_not_fit(monkeypatch):
    system = sphere("tet10", 1)
    for free_mb, expected in ((1e3, LinearSolver), (0.1, Iterative)):
        monkeypatch.setattr(linear, "free_memory_mb", lambda free=free_mb: free)
        assert isinstance(make_stiffness_solver(system), expected)


def test_an_unknown_path_is_refused():
    with pytest.raises(InputError, match="iterative"):
        make_stiffness_solver(sphere("tet10", 1), "krylov")
