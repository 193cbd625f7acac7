"""The iterative path finds what the factorisation finds, at any bulk modulus and mesh, and says where it cannot."""

from __future__ import annotations

import numba
import numpy as np
import pytest
import scipy.sparse as sp
from samples import neo_hookean, random_state, sphere, tube

from turgor.common.optional import is_available
from turgor.fem.loads import Force
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.cells import body_cell
from turgor.mesh.structured import box
from turgor.solver import coarse, iterative
from turgor.solver.blocks import BlockMatrix
from turgor.solver.iterative import AUGMENTATION, Iterative
from turgor.solver.krylov import Room, gmres, softest
from turgor.solver.linear import LinearSolver, make_linear_solver
from turgor.solver.multigrid import TwoLevels, corner_interpolation
from turgor.solver.newton import NewtonOptions, find_equilibrium
from turgor.solver.path import LimitPressureError, PathOptions, solve_path

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]


def direct(system):
    return make_linear_solver(system.pattern.row_start, system.pattern.column)


def full(upper):
    return upper + np.triu(upper, 1).T


def dense(system, values):
    n = system.n_dofs
    return full(sp.csr_matrix((values, system.pattern.column, system.pattern.row_start), shape=(n, n)).toarray())


def split(system, state, order=None):
    """Return the volume equations, and A in double precision, its nodes as they are or in an order."""
    matrix = BlockMatrix(system.pattern)
    layout, values = matrix.layout, np.zeros(len(matrix.values))
    equations = system.split_stiffness(state, AUGMENTATION, layout, values)
    graph = sp.triu(system.pattern.graph(), format="coo")
    n = len(matrix.order)
    whole = np.zeros((n, 3, n, 3))
    for a, b, name in zip(graph.row, graph.col, graph.data, strict=True):
        to, width = layout.place[name - 1], layout.width[name - 1]
        block = np.array([values[to + i * width : to + i * width + 3] for i in range(3)])
        whole[a, :, b] = block.T if layout.turned[name - 1] else block
        whole[b, :, a] = whole[a, :, b].T
    if order is not None:
        whole = whole[order][:, :, order]
    return equations, whole.reshape(3 * n, 3 * n)


@pytest.mark.parametrize("ratio", [1e3, 1e5])
@pytest.mark.parametrize("build", [lambda r: tube(3.0, r), lambda r: sphere("hex27", 2, r)], ids=["tet10", "hex27"])
def test_it_finds_the_same_equilibrium_as_the_factorisation(build, ratio, monkeypatch):
    # Newton's method with exact steps
    monkeypatch.setattr(LinearSolver, "solution_again", lambda *_: None)
    system = build(ratio)
    solver = Iterative(system)
    rest, options = system.reference_state(), NewtonOptions()
    expected = find_equilibrium(system, direct(system), rest, 1.0, options)
    found = find_equilibrium(system, solver, rest, 1.0, options)
    largest = np.abs(expected.state.u).max()
    assert largest > 0.05
    assert np.abs(found.state.u - expected.state.u).max() <= 1e-6 * largest
    assert found.residuals[-1] <= options.tolerance
    assert found.iterations <= expected.iterations + 2
    assert len(solver.iterations) == found.iterations
    assert max(solver.iterations) <= 40
    assert found.stable
    assert not solver._factorised


@pytest.mark.parametrize("ratio", [1e7, 1e8])
def test_volumes_are_met_where_rounding_hides_them(ratio):
    """The bulk modulus makes forces of volumes that are far below what rounding leaves of the mixed problem."""
    system, options = sphere("tet10", 2, ratio), NewtonOptions(tolerance=1e-6)
    rest = system.reference_state()
    expected = find_equilibrium(system, direct(system), rest, 1.0, options)
    found = find_equilibrium(system, Iterative(system), rest, 1.0, options)
    assert found.residuals[-1] <= options.tolerance
    assert found.iterations <= expected.iterations + 3
    assert np.abs(found.state.u - expected.state.u).max() <= 1e-6 * np.abs(expected.state.u).max()


def test_inner_iterations_do_not_depend_on_the_mesh():
    counts, unknowns = [], []
    for system in (sphere("tet10", 2), sphere("tet10", 4), tube(4.0), tube(2.0)):
        solver = Iterative(system)
        find_equilibrium(system, solver, system.reference_state(), 1.0, NewtonOptions())
        counts.append(np.mean(solver.iterations))
        unknowns.append(system.n_dofs)
    assert unknowns[1] > 6 * unknowns[0]
    assert unknowns[3] > 3 * unknowns[2]
    assert counts[1] <= 1.3 * counts[0]
    assert counts[3] <= 1.3 * counts[2]
    assert max(counts) < 20


@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
def test_the_split_stiffness_is_the_stiffness(cell_type):
    system = sphere(cell_type, 1)
    state = random_state(system, 0.005)
    whole = dense(system, system.stiffness(state))
    (equations,), softer = split(system, state)
    rest = np.zeros((system.mesh.points.size,) * 2)
    for nodes, gradient, bulk in zip(equations.nodes, equations.gradient, equations.bulk, strict=True):
        places = 3 * nodes + np.arange(3)[:, None]
        flat = gradient.reshape(len(gradient), -1)
        rest[np.ix_(places.ravel(), places.ravel())] += flat.T @ bulk @ flat
    free = system.pattern.free
    softer = softer[np.ix_(free, free)]
    np.testing.assert_allclose(softer + rest[np.ix_(free, free)], whole, atol=1e-11 * np.abs(whole).max())
    assert np.abs(softer).max() < 0.1 * np.abs(whole).max()


@pytest.mark.parametrize("indefinite", [False, True])
def test_the_sweep_is_that_of_the_matrix(indefinite):
    system = sphere("tet10", 2)
    state = system.reference_state()
    matrix = BlockMatrix(system.pattern)
    system.split_stiffness(state, AUGMENTATION, matrix.layout, matrix.values)
    _, whole = split(system, state, matrix.order)
    n, some = len(matrix.order), [3, 11]
    if indefinite:
        matrix.diagonal[some] -= 2.0 * np.abs(matrix.diagonal).max() * np.eye(3)
        for a in some:
            whole[3 * a : 3 * a + 3, 3 * a : 3 * a + 3] = matrix.diagonal[a]
    matrix.update()
    diagonal = matrix.diagonal.astype(float)
    if indefinite:
        diagonal[some] = np.eye(3) * np.abs(diagonal[some])
    x = np.random.default_rng(0).standard_normal(3 * n)
    node = np.arange(3 * n) // 3
    lower = whole * (node[:, None] > node)
    for a in range(n):
        lower[3 * a : 3 * a + 3, 3 * a : 3 * a + 3] = diagonal[a]
    right = np.random.default_rng(1).standard_normal(3 * n)
    found, product = matrix.sweep(right, x)
    np.testing.assert_allclose(found, x + np.linalg.solve(lower, right - whole @ x), atol=1e-5 * np.abs(found).max())
    np.testing.assert_allclose(product, whole @ found, atol=1e-5 * np.abs(whole @ found).max())


@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
def test_a_cycle_lessens_every_error(cell_type):
    system = System(box((1.0, 1.0, 6.0), (1, 1, 6), cell_type), {"body": neo_hookean()}, PLANES)
    levels = TwoLevels(system.pattern, system.mesh.points, system.mesh.cells)
    assert len(levels.fine._bounds) > 2  # or else no portion has a neighbour
    state = system.reference_state()
    system.split_stiffness(state, AUGMENTATION, levels.fine.layout, levels.fine.values)
    levels.update()
    free = levels.free.ravel()
    columns = []
    for k in np.flatnonzero(free):
        unit = np.zeros(len(free))
        unit[k] = 1.0
        columns.append(levels.apply(unit)[0][free])
    cycle = np.array(columns).T
    _, whole = split(system, state, levels.fine.order)
    root = np.linalg.cholesky(whole[np.ix_(free, free)])
    # What is left of an error, measured by its energy.
    left = np.eye(len(root)) - root.T @ cycle @ root
    assert np.linalg.norm(left, 2) < 0.95
    assert np.abs(np.linalg.eigvals(left)).max() < 0.9


@pytest.mark.parametrize("cell_type", ["tet10", "hex27"])
def test_interpolation_from_the_corners_reproduces_linear_fields(cell_type):
    mesh = box((1.0, 2.0, 3.0), (2, 1, 2), cell_type)
    nodes, up = corner_interpolation(mesh.cells)
    corners = np.unique(mesh.cells[:, : body_cell(mesh.cells).n_corners])
    np.testing.assert_array_equal(nodes, corners)
    assert up.shape == (mesh.n_points, len(corners))
    np.testing.assert_allclose(up @ mesh.points[corners], mesh.points, atol=1e-12)


@pytest.mark.skipif(not is_available("pyamg"), reason="PyAMG is not installed")
def test_the_coarse_level_may_be_solved_by_algebraic_multigrid(monkeypatch):
    system = tube(2.0)
    rest, options = system.reference_state(), NewtonOptions()
    factorised = Iterative(system)
    expected = find_equilibrium(system, factorised, rest, 1.0, options)
    monkeypatch.setattr(coarse, "FACTORISED", 0)
    solver = Iterative(system)
    assert isinstance(solver._levels._solver, coarse.SmoothedAggregation)
    found = find_equilibrium(system, solver, rest, 1.0, options)
    assert np.abs(found.state.u - expected.state.u).max() <= 1e-6 * np.abs(expected.state.u).max()
    assert max(solver.iterations) <= 40
    assert solver.iterations[0] > factorised.iterations[0]


def test_rigid_body_modes_do_no_work():
    mesh = box((1.0, 2.0, 3.0), (1, 1, 1))
    system = System(mesh, {"body": neo_hookean()}, [Clamped("x0")])
    state = system.reference_state()
    system.stiffness(state)
    for mode in coarse.rigid_body_modes(mesh.points).T:
        force = system.stiffness_times(mode.reshape(-1, 3))
        assert np.abs(mode).max() > 0.1
        assert np.abs(force).max() < 1e-9 * np.abs(system.stiffness_times(mesh.points)).max()


def test_what_it_cannot_solve_is_factorised(monkeypatch, caplog):
    system = sphere("tet10")
    monkeypatch.setattr(iterative, "MOST_ITERATIONS", 2)
    monkeypatch.setattr(iterative, "FAILURES", 2)
    solver = Iterative(system)
    rest, options = system.reference_state(), NewtonOptions()
    found = find_equilibrium(system, solver, rest, 1.0, options)
    expected = find_equilibrium(system, direct(system), rest, 1.0, options)
    np.testing.assert_allclose(found.state.u, expected.state.u, atol=1e-7 * np.abs(expected.state.u).max())
    assert found.stable
    assert caplog.text.count("has not converged within 2 iterations") == iterative.FAILURES
    assert len(solver.iterations) == iterative.FAILURES


def test_it_follows_the_path_by_volume_to_the_same_limit():
    limits = []
    for path in ("direct", "iterative"):
        with pytest.raises(LimitPressureError) as caught:
            solve_path(sphere("hex27", 1, pressure=0.1), [1.0], options=PathOptions(NewtonOptions(linear=path)))
        limits.append(caught.value.limit.equilibrium.fraction)
    assert limits[0] < 1.0
    assert limits[1] == pytest.approx(limits[0], rel=1e-5)


@pytest.mark.parametrize(
    ("length", "part", "pivots", "factorised"),
    [(40.0, 0.9, 0, False), (40.0, 0.95, 0, True), (40.0, 1.0, 1, True), (40.0, 5.0, 2, True), (160.0, 0.97, 1, True)],
    ids=["definite", "definite by its volumes alone", "buckled", "buckled twice", "lost in single precision"],
)
def test_it_tells_the_inertia_of_a_straight_column(length, part, pivots, factorised):
    # Euler's load of a column that is clamped at one end, with E = 3 μ.
    second_moment = 5.2 * 4.0**3 / 12.0
    load = np.pi**2 * 0.3 * second_moment / (4.0 * length**2)
    mesh = box((length, 4.0, 5.2), (round(length / 2.0), 2, 2))
    system = System(mesh, {"body": neo_hookean(0.1)}, [Clamped("x0")], [Force("x1", (-part * load, 0.0, 0.0))])
    solver, exact = Iterative(system), direct(system)
    straight = find_equilibrium(system, exact, system.reference_state(), 1.0, NewtonOptions())
    assert straight.negative_pivots == pivots
    solver.take_stiffness(system, straight.state)
    assert solver.negative_pivots is None
    assert solver.inertia() == pivots
    assert solver._factorised is factorised


def test_it_does_not_tell_the_inertia_where_it_takes_factors_that_do_not_fit(monkeypatch, caplog):
    system = sphere("tet10", 1)
    solver = Iterative(system)
    solver.take_stiffness(system, system.reference_state())
    monkeypatch.setattr(iterative, "MOST_FOR_INERTIA", 1)
    assert solver.inertia() == 0
    assert solver._factorised
    solver.take_stiffness(system, system.reference_state())
    monkeypatch.setattr(iterative, "factors_fit", lambda _: False)
    assert solver.inertia() is None
    assert "does not fit into the memory" in caplog.text


def test_the_softest_direction():
    rng = np.random.default_rng(1)
    frame = np.linalg.qr(rng.standard_normal((90, 90)))[0]
    values = np.concatenate([[1e-3], np.linspace(0.2, 1.0, 89)])
    matrix = frame @ np.diag(values) @ frame.T
    direction, energy = softest(improving(matrix, np.eye(90)), 90, 60, Room())
    assert energy == pytest.approx(direction @ matrix @ direction)
    assert abs(direction @ frame[:, 0]) == pytest.approx(np.linalg.norm(direction), rel=1e-3)
    assert softest(improving(matrix, np.eye(90)), 90, 4, Room()) is None
    assert softest(improving(matrix - 0.002 * np.eye(90), np.eye(90)), 90, 60, Room()) is None


def test_gmres():
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((90, 90)) + 12.0 * np.diag(np.sign(rng.standard_normal(90)))
    right = rng.standard_normal(90)
    exact = np.linalg.solve(matrix, right)
    for inverse in (np.eye(90), np.diag(1.0 / np.diag(matrix))):
        found, iterations, converged = gmres(improving(matrix, inverse), right, 1e-8, 400, Room())
        assert converged
        assert 10 < iterations < 200
        np.testing.assert_allclose(found, exact, atol=1e-5)
    *_, converged = gmres(improving(matrix, np.eye(90)), right, 1e-8, 5, Room())
    assert not converged
    found, iterations, converged = gmres(improving(matrix, np.eye(90)), np.zeros(90), 1e-8, 5, Room())
    assert converged
    assert iterations == 0
    assert not found.any()


def improving(matrix, inverse):
    return lambda x: (inverse @ x, matrix @ (inverse @ x))


@pytest.mark.parametrize("accuracy", [2e-3, 1e-9])
def test_solutions_are_as_accurate_as_asked_for(accuracy):
    system = tube(3.0)
    solver, exact = Iterative(system), direct(system)
    # The system keeps the matrix that was asked of it last.
    for kind in (exact, solver):
        kind.take_stiffness(system, system.reference_state())
    right = np.random.default_rng(0).standard_normal(system.n_dofs)
    solution = system.nodal(exact.solve(right))
    error = np.linalg.norm(solver.solution(system, right, accuracy).u - solution)
    assert not solver._factorised
    assert 0.0 < error < 30.0 * accuracy * np.linalg.norm(solution)


def test_the_sweeps_do_not_depend_on_the_threads():
    threads = numba.get_num_threads()
    system = System(box((1.0, 1.0, 30.0), (1, 1, 30)), {"body": neo_hookean()}, PLANES)
    matrix = BlockMatrix(system.pattern)
    assert len(matrix._bounds) > 5
    system.split_stiffness(system.reference_state(), AUGMENTATION, matrix.layout, matrix.values)
    matrix.update()
    right = np.random.default_rng(0).standard_normal(3 * len(matrix.order))
    found = []
    try:
        for number in (1, threads):
            numba.set_num_threads(number)
            found.append(np.concatenate(matrix.sweep(right, right)))
    finally:
        numba.set_num_threads(threads)
    assert np.linalg.norm(found[0]) > 0.0
    np.testing.assert_array_equal(found[0], found[1])
