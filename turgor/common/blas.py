"""The threads of NumPy's and SciPy's dense products."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import ThreadpoolController


@contextmanager
def dense_products_on_one_thread() -> Iterator[None]:
    """Let OpenBLAS, NumPy's and SciPy's, work on the calling thread alone for a while.

    Its own threads spin for long after every product, on the processors that the kernels need;
    the products of a step are too small to gain anything by them.
    """
    with _openblas().limit(limits=1):
        yield


@functools.cache
def _openblas() -> ThreadpoolController:
    # Only what is loaded can be told: NumPy and SciPy bring a library each.
    importlib.import_module("numpy.linalg")
    importlib.import_module("scipy.linalg")
    return ThreadpoolController().select(internal_api="openblas")
