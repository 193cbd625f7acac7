"""The threads that the element kernels run on."""

from __future__ import annotations

import functools
import os

import numba

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
