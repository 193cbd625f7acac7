"""Which nodes blocks couple, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.fem.incidence import Incidence, both_ways, coupled, parts


@pytest.fixture
def groups():
    rng = np.random.default_rng(4)
    cells = np.array([rng.choice(40, 5, replace=False) for _ in range(30)], np.int32)
    folded = np.array([[3, 7, 3], [9, 9, 2]], np.int32)  # blocks may hold a node twice
    return [cells, folded, np.zeros((0, 4), np.int32)]


def dense(groups, n):
    together = np.zeros((n, n), bool)
    for group in groups:
        for block in group:
            together[np.ix_(block, block)] = True
    return together


def test_nodes_of_a_block_are_coupled(groups):
    start, column = coupled(Incidence.of(42, groups))
    upper = np.triu(dense(groups, 42))
    assert start.tolist() == [0, *np.cumsum(upper.sum(axis=1))]
    assert column.tolist() == np.nonzero(upper)[1].tolist()


def test_both_ways_names_each_block_from_either_side(groups):
    start, column = coupled(Incidence.of(42, groups))
    full, columns, names = both_ways(start, column)
    rows = np.repeat(np.arange(42), np.diff(full))
    assert (rows.tolist(), columns.tolist()) == tuple(x.tolist() for x in np.nonzero(dense(groups, 42)))
    assert np.array_equal(names < 0, columns < rows)
    upper_rows = np.repeat(np.arange(42), np.diff(start))
    place = np.abs(names) - 1
    assert np.array_equal(upper_rows[place], np.minimum(rows, columns))
    assert np.array_equal(column[place], np.maximum(rows, columns))


def test_parts_share_no_node():
    cells = np.array([[5, 6, 7], [0, 1, 2], [8, 3, 4], [2, 8, 9]], np.int32)
    count, part = parts(cells, 10)
    assert count == 2
    assert part.tolist() == [0, 0, 0, 0, 0, 1, 1, 1, 0, 0]
