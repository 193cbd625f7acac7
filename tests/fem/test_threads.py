"""Threads of the kernels."""

from __future__ import annotations

from samples import printed

from turgor.common.optional import is_available, shared_library

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
    return printed(LAYER, "NUMBA_THREADING_LAYER", **environment)


def test_kernels_run_on_tbb_where_it_is_installed() -> None:
    has_tbb = is_available("numba.np.ufunc.tbbpool") and shared_library("tbb", "libtbb.so.12", "tbb12.dll")
    assert layer() == ("tbb" if has_tbb else "workqueue")


def test_the_user_may_choose_other_threads() -> None:
    assert layer(NUMBA_THREADING_LAYER="workqueue") == "workqueue"
