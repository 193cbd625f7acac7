"""A tangent that solves the mixed problem again: what it solves, and how fast that converges."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean, random_state

import turgor as tg
from turgor.fem.anisotropic import FibreFamily, QuadraticFibres
from turgor.fem.directions import Constant
from turgor.fem.fibres import Fibre
from turgor.fem.loads import Pressure
from turgor.fem.membrane import Membrane
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.solver import tangent as kept
from turgor.solver.linear import make_linear_solver
from turgor.solver.newton import NewtonOptions, find_equilibrium
from turgor.solver.tangent import Progress, Tangent


@pytest.fixture(scope="module")
def tube():
    """A capped tube in which everything lags that can: volume, stress, a thread, a sheet, a fibre family."""
    shape = tg.FibreTube(length="30 mm", cap="5 mm", fibre_length="20 mm", tilt="20 deg", pitch="8 mm", fibres=1)
    mesh = shape.mesh(size="8 mm", cells="hexahedra", per_circle=4)
    parts = [
        Fibre("fibre-1", 5.0, 0.5, tension_only=False),
        Membrane("outer", 0.5, 0.1),
        FibreFamily("outer-layer", QuadraticFibres(0.02), Constant((0.0, 0.0, 1.0))),
    ]
    materials = dict.fromkeys(mesh.regions, neo_hookean(0.1, 1e3))
    return System(mesh, materials, [Clamped("mount")], [Pressure("cavity", 0.005)], parts)


def test_out_of_balance_in_a_consistent_state_is_the_force(tube):
    state, base = random_state(tube, 0.02, seed=1), random_state(tube, 0.02, seed=2)
    consistent = tube.consistent(state.u, state.loads)
    force, scale = tube.forces(consistent)
    np.testing.assert_allclose(tube.mixed_force(consistent, base), force, atol=1e-12 * scale)


@pytest.fixture
def any_size(monkeypatch):
    monkeypatch.setattr(kept, "KEPT_FROM", 0)


@pytest.mark.usefixtures("any_size")
def test_one_more_solution_with_the_same_tangent_makes_the_third_order(tube):
    linear = make_linear_solver(tube.pattern.row_start, tube.pattern.column)
    end = find_equilibrium(tube, linear, tube.reference_state(), 1.0, NewtonOptions(tolerance=1e-11)).state
    errors = []
    for part in (0.95, 0.975, 0.9875):
        start = tube.consistent(part * end.u, end.loads)
        force, scale = tube.forces(start)
        progress = Progress(NewtonOptions())
        progress.residuals.append(float(np.linalg.norm(force)) / scale)
        tangent = Tangent(tube, linear, start, 1.0, None, tube.loading.growth(1.0), progress)
        newton = tangent.solved(tube.free_part(force), None)
        middle = tube.advanced(start, newton.du)
        again = tangent.solved_again(middle, 1.0, 1.0)
        after = middle.u + again.du
        errors.append([np.abs(u - end.u).max() for u in (middle.u, after)])
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders[-1] == pytest.approx([2.0, 3.0], abs=0.2), orders


@pytest.mark.usefixtures("any_size")
def test_steps_cost_fewer_factorisations_than_iterations(tube):
    linear = make_linear_solver(tube.pattern.row_start, tube.pattern.column)
    found = find_equilibrium(tube, linear, tube.reference_state(), 1.0, NewtonOptions())
    assert found.factorisations <= 3 < found.iterations


def test_a_factorisation_that_costs_little_is_made_anew(tube):
    linear = make_linear_solver(tube.pattern.row_start, tube.pattern.column)
    found = find_equilibrium(tube, linear, tube.reference_state(), 1.0, NewtonOptions())
    assert tube.n_dofs < kept.KEPT_FROM
    assert found.factorisations == found.iterations
