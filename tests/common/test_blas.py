"""Dense products beside the kernels."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from threadpoolctl import ThreadpoolController

from turgor.common.blas import dense_products_on_one_thread


def test_openblas_works_on_one_thread_and_then_on_as_many_as_before() -> None:
    assert scipy.linalg.det(np.eye(2)) == np.linalg.det(np.eye(2)) == 1.0  # both libraries are loaded
    openblas = ThreadpoolController().select(internal_api="openblas")
    if not openblas.info():
        pytest.skip("NumPy and SciPy have another BLAS here")

    def threads() -> list[int]:
        return [pool["num_threads"] for pool in openblas.info()]

    before = threads()
    with dense_products_on_one_thread():
        assert threads() == [1] * len(before)
    assert threads() == before
