"""Rows of indices as single numbers, which sort far faster than rows do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_LARGEST = np.iinfo(np.int64).max


def row_numbers(rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return a number for each of the rows ``(n, k)`` of indices from zero on, ``(n,)``.

    Equal rows have the same one, and numbers follow each other as the rows do in the order of a dictionary.
    """
    base = int(rows.max(initial=0)) + 1
    numbers, most = np.zeros(len(rows), np.int64), 1
    for column in rows.T:
        if most > _LARGEST // base:
            distinct, numbers = np.unique(numbers, return_inverse=True)
            most = len(distinct)
        numbers = numbers * base + column
        most *= base
    return numbers
