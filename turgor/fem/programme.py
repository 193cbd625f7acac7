"""How a load follows the load parameter: in proportion, constant, or along a table."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError

Floats = NDArray[np.float64]

ROUNDING = 1e-12
"""Load fractions that differ by no more are one: 700 ms and 0.7 s are not the same number."""


@dataclass(frozen=True)
class Programme:
    """A load's factor over the load fraction: straight lines from point to point, the first and last one going on.

    Its derivative is known everywhere, which volume control and the prediction of a step need; where two lines meet it
    is that of the later one.

    Attributes
    ----------
    fractions
        Load fractions of the points, ascending.
    factors
        The factor of the load's value at each of them.

    Raises
    ------
    InputError
        If there are not as many factors as fractions, fewer than two of them, or the fractions do not ascend.
    """

    fractions: tuple[float, ...]
    factors: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.fractions) != len(self.factors) or len(self.fractions) < 2:
            expected = "two or more points, a factor for each fraction"
            raise InputError("this is no programme", key="programme", value=self.fractions, expected=expected)
        if any(not later > earlier for earlier, later in itertools.pairwise(self.fractions)):
            raise InputError("a programme's fractions must ascend", key="programme", value=self.fractions)

    def at(self, fraction: float) -> float:
        """Return the factor at a load fraction."""
        k = self._line(fraction)
        return self.factors[k] + self.slope(fraction) * (fraction - self.fractions[k])

    def slope(self, fraction: float) -> float:
        """Return the derivative of the factor by the load fraction."""
        k = self._line(fraction)
        return (self.factors[k + 1] - self.factors[k]) / (self.fractions[k + 1] - self.fractions[k])

    @property
    def kinks(self) -> tuple[float, ...]:
        """The load fractions at which the slope changes."""
        inner = self.fractions[1:-1]
        before = (self.slope(f) for f in self.fractions[:-2])
        return tuple(f for f, slope in zip(inner, before, strict=True) if slope != self.slope(f))

    def _line(self, fraction: float) -> int:
        last = len(self.fractions) - 2
        return int(np.clip(np.searchsorted(self.fractions, fraction + ROUNDING, side="right") - 1, 0, last))


@dataclass(frozen=True, eq=False)
class LoadLine:
    """All loads along a straight line: what a walk whose load fraction is an unknown follows, also beyond a kink.

    Attributes
    ----------
    fraction
        Load fraction of a point of the line.
    loads
        The loads there ``(n_loads,)``.
    growth
        Their derivatives by the load fraction ``(n_loads,)``.
    """

    fraction: float
    loads: Floats
    growth: Floats

    def at(self, fraction: float) -> Floats:
        """Return the loads ``(n_loads,)`` at a load fraction."""
        return np.asarray(self.loads + (fraction - self.fraction) * self.growth)


PROPORTIONAL = Programme((0.0, 1.0), (0.0, 1.0))
CONSTANT = Programme((0.0, 1.0), (1.0, 1.0))
