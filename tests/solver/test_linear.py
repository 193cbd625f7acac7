"""The linear solvers agree with dense algebra and with each other."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import scipy.sparse as sp
from samples import neo_hookean, printed

from turgor.common.optional import is_available
from turgor.fem.supports import Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box
from turgor.solver import linear
from turgor.solver.linear import Mumps, Pardiso, SingularMatrixError, SuperLU, solver_in_use
from turgor.solver.newton import NewtonOptions, find_equilibrium


def upper_pattern(matrix):
    upper = sp.csr_matrix(np.triu(matrix) + 0.0)
    upper.sort_indices()
    return upper.indptr.astype(np.int32), upper.indices.astype(np.int32), upper.data


@pytest.fixture(params=["blocks", "entries"])
def matrix(request):
    # As of nodes with three unknowns each, which PARDISO takes together, or without any such order.
    rng = np.random.default_rng(0)
    blocks = np.kron(rng.random((20, 20)) < 0.1, np.ones((3, 3)))
    dense = rng.standard_normal((60, 60)) * (blocks if request.param == "blocks" else rng.random((60, 60)) < 0.1)
    return dense + dense.T + np.diag(rng.uniform(5, 10, 60))


KINDS = [
    SuperLU,
    pytest.param(Mumps, marks=pytest.mark.skipif(not is_available("mumps"), reason="MUMPS is not installed")),
    pytest.param(Pardiso, marks=pytest.mark.skipif(solver_in_use() is not Pardiso, reason="MKL is not installed")),
]


@pytest.mark.parametrize("kind", KINDS)
def test_solution(kind, matrix):
    start, column, values = upper_pattern(matrix)
    solver = kind(start, column)
    right = np.arange(60.0)
    for scale in (1.0, 3.0):  # the pattern is analysed once, the values change
        solver.release_factors()
        solver.factorise(scale * values)
        np.testing.assert_allclose(solver.solve(right), np.linalg.solve(scale * matrix, right), rtol=1e-9)


def test_a_large_model_keeps_neither_factors_nor_blocks_and_finds_the_same(monkeypatch):
    # The displacement that is imposed asks for the elements' stiffnesses after the factorisation.
    held = [Sliding("x0"), Sliding("y0"), Sliding("z0"), Prescribed("x1", (0.3, None, None))]
    system = System(box((1.0, 1.0, 1.0), (2, 2, 2)), {"body": neo_hookean(ratio=100)}, held)
    released = []

    class Watched(solver_in_use()):
        def release_factors(self):
            released.append(self.n)
            super().release_factors()

    ends = []
    for large in (system.n_dofs + 1, system.n_dofs):
        monkeypatch.setattr(linear, "LARGE", large)
        solver = Watched(system.pattern.row_start, system.pattern.column)
        end = find_equilibrium(system, solver, system.reference_state(), 1.0, NewtonOptions())
        ends.append(end.state.u)
        assert len(released) == (0 if large > system.n_dofs else end.factorisations)
    assert np.abs(ends[0]).max() > 0.29
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("kind", KINDS)
def test_inertia(kind, matrix):
    shifted = matrix - 8.0 * np.eye(60)
    expected = int((np.linalg.eigvalsh(shifted) < 0).sum())
    assert 0 < expected < 60
    start, column, values = upper_pattern(shifted)
    solver = kind(start, column)
    solver.factorise(values)
    assert solver.negative_pivots == (None if kind is SuperLU else expected)


def test_the_fastest_solver_that_is_installed_is_chosen(monkeypatch):
    monkeypatch.setattr(linear, "_mkl", lambda: None)
    for mumps, expected in ((True, Mumps), (False, SuperLU)):
        monkeypatch.setattr(linear, "is_available", lambda name, answer=mumps: answer and name == "mumps")
        assert solver_in_use() is expected


def test_singular_matrix_is_reported_by_superlu():
    start, column, values = upper_pattern(np.array([[1.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(SingularMatrixError, match="singular"):
        SuperLU(start, column).factorise(values)


@pytest.mark.skipif(solver_in_use() is not Pardiso, reason="only PARDISO tells beforehand")
def test_memory_is_known_before_it_is_taken_and_a_lack_of_it_said(monkeypatch, caplog):
    def membrane(n: int) -> Pardiso:
        line = sp.diags([2.0, -1.0], [0, 1], (n, n))
        upper = (sp.kron(sp.identity(n), line) + sp.kron(line, sp.identity(n))).tocsr()
        solver = Pardiso(upper.indptr.astype(np.int32), upper.indices.astype(np.int32))
        solver.factorise(upper.data)
        return solver

    # Nested dissection of an n × n grid leaves factors of about 31/4 n² log2 n entries (George 1973).
    factors_mb = 8 * 7.75 * 200**2 * np.log2(200) / 2**20
    assert 0.5 * factors_mb < membrane(200).memory_mb < 5 * factors_mb
    assert not caplog.records
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=2**20))
    membrane(200)
    assert "1 MB are free" in caplog.text


# gmsh brings GNU's OpenMP, which MKL takes if it is left to itself.
THREADS = """
import gmsh
import numpy as np
from threadpoolctl import threadpool_info
from turgor.solver.linear import Pardiso
solver = Pardiso(np.arange(4, dtype=np.int32), np.arange(3, dtype=np.int32))
solver.factorise(np.ones(3))
print([pool["threading_layer"] for pool in threadpool_info() if pool["internal_api"] == "mkl"])
"""


@pytest.mark.skipif(solver_in_use() is not Pardiso, reason="MKL is not installed")
@pytest.mark.parametrize(("chosen", "layer"), [({}, "intel"), ({"MKL_THREADING_LAYER": "SEQUENTIAL"}, "sequential")])
def test_mkl_has_the_same_threads_whatever_was_loaded_first_unless_the_user_chose_others(chosen, layer):
    assert printed(THREADS, "MKL_THREADING_LAYER", **chosen) == f"['{layer}']"
