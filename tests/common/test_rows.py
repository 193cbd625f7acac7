"""Numbers of rows: equal where rows are, in their order, however long and large they are."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.rows import row_numbers


@pytest.mark.parametrize(("width", "largest"), [(1, 5), (3, 9), (4, 1_000_000), (12, 2_000_000), (3, 2**31 - 1)])
def test_numbers_sort_as_rows_do(width, largest):
    rng = np.random.default_rng(width)
    rows = rng.integers(0, largest, (500, width), dtype=np.int32, endpoint=True)
    rows = np.vstack([rows, rows[rng.integers(0, 500, 300)]])
    rows[::7, 0] = largest  # so that some rows differ in later columns only
    wanted, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    found, first_found, inverse_found = np.unique(row_numbers(rows), return_index=True, return_inverse=True)
    assert len(found) == len(wanted)
    np.testing.assert_array_equal(first_found, first)
    np.testing.assert_array_equal(inverse_found, inverse.ravel())


def test_there_may_be_no_rows():
    assert row_numbers(np.zeros((0, 3), np.int32)).shape == (0,)
