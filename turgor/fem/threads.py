"""The threads that the element kernels run on."""

from __future__ import annotations

import os

import numba


def prefer_light_threads() -> None:
    """Choose numba's own thread pool unless the user has chosen one.

    Its parallel regions start in a tenth of a millisecond; those of OpenMP took eight on a busy machine, as long
    as an assembly. Without effect once a parallel kernel has run.
    """
    if "NUMBA_THREADING_LAYER" not in os.environ:
        numba.config.THREADING_LAYER = "workqueue"
