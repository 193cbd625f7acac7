"""Principal stretches and directions against singular values, also where stretches are equal."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.fem.principal import LANES, isochoric_stretches


def decomposed(F, J=None):
    stretches, directions = np.empty((len(F), 3)), np.empty((len(F), 3, 3))
    isochoric_stretches(F, np.linalg.det(F) if J is None else J, stretches, directions)
    return stretches, directions


def check(F):
    stretches, directions = decomposed(F)
    isochoric = F / np.cbrt(np.linalg.det(F))[:, None, None]
    expected = np.linalg.svd(isochoric, compute_uv=False)
    np.testing.assert_allclose(np.sort(stretches)[:, ::-1], expected, rtol=1e-13)
    np.testing.assert_allclose(directions.swapaxes(1, 2) @ directions, np.broadcast_to(np.eye(3), F.shape), atol=1e-14)
    rebuilt = directions * stretches[:, None, :] ** 2 @ directions.swapaxes(1, 2)
    sizes = np.abs(rebuilt).max(axis=(1, 2), keepdims=True)
    assert np.abs((rebuilt - isochoric @ isochoric.swapaxes(1, 2)) / sizes).max() < 1e-14


@pytest.mark.parametrize("count", [1, LANES - 1, LANES, 1000])
def test_of_any_number_of_points(count):
    rng = np.random.default_rng(count)
    check(np.eye(3) + 0.2 * rng.uniform(-1.0, 1.0, (count, 3, 3)))


@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-9, 1e-4])
@pytest.mark.parametrize("principal", [(1.0, 1.0, 1.0), (2.0, 2.0, 0.25), (0.5, 0.5, 4.0), (3.0, 0.1, 1.0)])
def test_where_stretches_are_equal_or_nearly(principal, gap):
    rng = np.random.default_rng(1)
    turns, _ = np.linalg.qr(rng.standard_normal((40, 2, 3, 3)))
    turns[:, 0] *= np.linalg.det(turns[:, 0] @ turns[:, 1])[:, None, None]
    stretch = np.array(principal) * (1.0, 1.0 + gap, 1.0 - gap)
    check(turns[:, 0] * stretch @ turns[:, 1])


def test_points_without_meaning_do_not_spoil_their_neighbours():
    F = np.eye(3) + 0.2 * np.random.default_rng(2).uniform(-1.0, 1.0, (2 * LANES, 3, 3))
    expected, _ = decomposed(F)
    spoilt = F.copy()
    spoilt[3] = np.nan
    found, _ = decomposed(spoilt, np.linalg.det(F))
    assert np.isnan(found[3]).any()
    kept = np.arange(len(F)) != 3
    np.testing.assert_allclose(found[kept], expected[kept], rtol=1e-13)
