"""Threads of the kernels, and of OpenBLAS beside them."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from threadpoolctl import ThreadpoolController

from turgor.common.optional import is_available, shared_library
from turgor.fem.threads import dense_products_on_one_thread

LAYER = """
import numba
import numpy as np
from turgor.fem.threads import choose_threads
choose_threads()
@numba.njit(parallel=True)
def fill(x):
    for i in numba.prange(x.size):
        x[i] = i
fill(np.zeros(9))
print(numba.threading_layer())
"""


def layer(**environment: str) -> str:
    """Return the threads that a kernel runs on in a process of its own."""
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_THREADING_LAYER"}
    run = subprocess.run([sys.executable, "-c", LAYER], env=kept | environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_kernels_run_on_tbb_where_it_is_installed() -> None:
    has_tbb = is_available("numba.np.ufunc.tbbpool") and shared_library("tbb", "libtbb.so.12", "tbb12.dll")
    assert layer() == ("tbb" if has_tbb else "workqueue")


def test_the_user_may_choose_other_threads() -> None:
    assert layer(NUMBA_THREADING_LAYER="workqueue") == "workqueue"


def test_openblas_works_on_one_thread_and_then_on_as_many_as_before() -> None:
    openblas = ThreadpoolController().select(internal_api="openblas")
    if not openblas.info():
        pytest.skip("NumPy and SciPy have another BLAS here")

    def threads() -> list[int]:
        return [pool["num_threads"] for pool in openblas.info()]

    before = threads()
    with dense_products_on_one_thread():
        assert threads() == [1] * len(before)
    assert threads() == before
