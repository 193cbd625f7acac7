"""The factorisations of the states that a walk delivers are those that were made."""

from __future__ import annotations

import numpy as np
import pytest
from samples import arch

from turgor.solver.control import Volume
from turgor.solver.follow import follow, follow_arc
from turgor.solver.linear import solver_in_use
from turgor.solver.path import PathOptions, solve_path

ONE = np.ones(1)


def to_post_snap(system):
    return solve_path(system, [0.5, 1.0], options=PathOptions(post_snap=True))


def by_volume(system):
    rest = system.conjugate(system.reference_state(), ONE)
    return follow(system, Volume(ONE), [1.05 * rest, 1.1 * rest])


def along_the_arc(system):
    rest = system.conjugate(system.reference_state(), ONE)
    return follow_arc(system, Volume(ONE), 1.1 * rest, 0.2)


@pytest.mark.parametrize("walk", [to_post_snap, by_volume, along_the_arc])
def test_attempts_that_fail_limits_and_modes_count_too(walk, monkeypatch):
    kind, made = solver_in_use(), []
    factorise = kind.factorise

    def counted(self, values):
        made.append(1)
        factorise(self, values)

    monkeypatch.setattr(kind, "factorise", counted)
    found = walk(arch(3e-4, rise=0.9))
    assert sum(e.event is not None for e in found) >= 2
    assert sum(e.factorisations for e in found) == len(made)
    # an iteration has a factorisation each: what is more were attempts in vain, limits and modes
    assert len(made) > sum(e.iterations for e in found)
