"""The state of a body: everything that an equilibrium consists of, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """One state of a system.

    Attributes
    ----------
    u
        Displacement of the nodes, then of rigid bodies on springs, ``(n_points + n_bodies, d)``, mm.
    lagged
        For each term, the quantities that Newton's iteration treats as unknowns of their own: dilatation and stress of
        every element of a solid, nothing for most terms. At an equilibrium they follow from the displacement; on the
        way they lag behind it, and the tangent uses the forces that belong to them.
    loads
        Value of every load ``(n_loads,)``: a cavity's pressure in MPa, a factor for the others.
    penalty
        Factor on the stiffness of contact: raised where surfaces would overlap too much, else one.
    grips
        For each contact, what its points hold on to by friction (:mod:`turgor.fem.contact.friction`): the one thing
        that remembers how a state was reached. Empty where nothing rubs.
    margin
        Surfaces of the body press on each other where the gap between them is below this, mm: zero, or more where they
        were seen to overlap too much between the points at which contact acts.
    """

    u: Floats
    lagged: tuple[Floats, ...]
    loads: Floats
    penalty: float = 1.0
    grips: tuple[Floats, ...] = ()
    margin: float = 0.0

    def with_loads(self, loads: Floats) -> State:
        """Return a copy under other loads."""
        return replace(self, loads=loads)

    def moved(self, du: Floats) -> State:
        """Return a copy displaced by `du` ``(n_points, 3)``, nothing else changed."""
        return replace(self, u=self.u + du)

    def beyond(self, before: State, reach: float) -> State:
        """Return the state `reach` times the way from `before` to this one further on, in a straight line."""
        return self.mixed((-reach, 1.0 + reach), (before, self))

    def mixed(self, weights: Sequence[float], states: Sequence[State]) -> State:
        """Return this state with displacement and what lags replaced by the weighted sum of those of other states."""

        def total(values: Iterable[Floats]) -> Floats:
            return np.asarray(sum(weight * value for weight, value in zip(weights, values, strict=True)))

        lagged = tuple(total(values) for values in zip(*(state.lagged for state in states), strict=True))
        return replace(self, u=total(state.u for state in states), lagged=lagged)
