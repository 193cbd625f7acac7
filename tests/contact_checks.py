"""Comparisons of contact terms with differences, for bodies in space and in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from samples import differences, shifted

from turgor.fem.frames import block_products


def force_of(term, state):
    out = np.zeros_like(state.u)
    term.force(state, out)
    return out


def check_contact(term, state):
    """Compare force and stiffness with differences, as for other terms; the blocks are those of this state."""
    direction = np.random.default_rng(7).standard_normal(state.u.shape)
    slope = np.vdot(force_of(term, state), direction)
    assert term.touch(state).overlap > 1e-3
    assert slope == pytest.approx(differences(term.energy, state, direction), rel=1e-6)
    nodes, packed = term.blocks(state, term.lagged_at(state))
    assert len(nodes) > 1
    product = np.zeros_like(state.u)
    block_products(nodes, packed, direction, product)
    step = 1e-6
    more, less = (force_of(term, shifted(state, direction, h)) for h in (step, -step))
    expected = (more - less) / (2 * step)
    np.testing.assert_allclose(product, expected, atol=1e-6 * np.abs(expected).max())


def check_obstacle(term, state, motion):
    """The same of a rigid body; and the force on it is minus the derivative by its place, and so for its factor."""
    check_contact(term, state)
    more, less = (state.with_loads(state.loads + h) for h in (1e-5, -1e-5))
    assert term.conjugate(state) == pytest.approx(-(term.energy(more) - term.energy(less)) / 2e-5, rel=1e-6)
    assert np.dot(term.touch(state).force, motion) == pytest.approx(term.conjugate(state), rel=1e-12)
    gradient = np.zeros_like(state.u)
    term.load_gradient(state, gradient)
    expected = (force_of(term, more) - force_of(term, less)) / 2e-5
    np.testing.assert_allclose(gradient, expected, atol=1e-6 * np.abs(expected).max())
