"""The threads that the element kernels run on, and those that would stand in their way."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator
from contextlib import contextmanager

import numba
from threadpoolctl import ThreadpoolController

from turgor.common.optional import is_available, shared_library


@functools.cache
def choose_threads() -> None:
    """Let the kernels run on the threads of oneTBB unless the user has chosen others.

    They begin at once, sleep between regions and share out what is left to do, so that nobody waits for a thread that
    another program keeps from its processor. Those of OpenMP spin meanwhile, which makes beside another program many
    times what it saves; numba's own begin too late for short regions. Without effect once a parallel kernel has run.
    """
    if "NUMBA_THREADING_LAYER" in os.environ:
        return
    has_tbb = is_available("numba.np.ufunc.tbbpool") and shared_library("tbb", "libtbb.so.12", "tbb12.dll") is not None
    numba.config.THREADING_LAYER = "tbb" if has_tbb else "workqueue"


@contextmanager
def dense_products_on_one_thread() -> Iterator[None]:
    """Let OpenBLAS, NumPy's and SciPy's, work on the calling thread alone for a while.

    Its own threads spin for some hundredths of a second after every product, on the processors that the kernels need;
    the products of a step are too small to gain anything by them.
    """
    with _openblas().limit(limits=1):
        yield


@functools.cache
def _openblas() -> ThreadpoolController:
    return ThreadpoolController().select(internal_api="openblas")
