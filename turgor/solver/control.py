"""What is prescribed instead of the load: a volume, an amount of air, a distance along the path.

Under each of these the load fraction f is an unknown. The equation that takes its place relates f to its conjugate Q
(:meth:`turgor.fem.system.System.conjugate`; for one cavity its volume times its full pressure), so that every control
is a curve in the plane of these two, and the path of equilibria is cut with it. With weights of its own, Q is another
measure of the state: a single one at a cavity is its volume, whatever the other loads do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


ATMOSPHERE = 0.101325
"""Pressure of the surroundings, MPa."""


class Control(Protocol):
    """A curve g(Q, f) = 0; `weights` ``(n_loads,)`` make Q of the loads' conjugates, ``None``: the loads' growth."""

    @property
    def weights(self) -> Floats | None:
        """The weights of Q."""
        ...

    def gap(self, conjugate: float, fraction: float) -> tuple[float, float, float]:
        """Return g and its derivatives by Q and by f."""
        ...

    def scale(self, conjugate: float) -> float:
        """Return what g is to be small against."""
        ...


@dataclass(frozen=True, eq=False)
class FixedConjugate:
    """Q has a given value: volume control."""

    target: float
    weights: Floats | None = None

    def gap(self, conjugate: float, fraction: float) -> tuple[float, float, float]:
        """Return Q − target."""
        del fraction
        return conjugate - self.target, 1.0, 0.0

    def scale(self, conjugate: float) -> float:
        """Return the target's size."""
        del conjugate
        return abs(self.target)


@dataclass(frozen=True, eq=False)
class AirAmount:
    """A closed amount of air at constant temperature: (p + p₀) V = n (Boyle), for one cavity.

    Attributes
    ----------
    amount
        n, the product of absolute pressure and volume, N mm.
    full_pressure
        Pressure of the cavity at load fraction one, MPa above the surroundings.
    surroundings
        p₀, MPa.
    weights
        The full pressure at the cavity's load, zero at the others; ``None`` where no other load grows.
    """

    amount: float
    full_pressure: float
    surroundings: float = ATMOSPHERE
    weights: Floats | None = None

    def gap(self, conjugate: float, fraction: float) -> tuple[float, float, float]:
        """Return (p + p₀) V − n."""
        volume = conjugate / self.full_pressure
        absolute = fraction * self.full_pressure + self.surroundings
        return absolute * volume - self.amount, absolute / self.full_pressure, conjugate

    def scale(self, conjugate: float) -> float:
        """Return the amount of air."""
        del conjugate
        return abs(self.amount)


@dataclass(frozen=True, eq=False)
class _FromPoint:
    """A distance from a point of the path, in the plane of Q and f.

    Attributes
    ----------
    conjugate, fraction
        The point.
    conjugate_scale
        What counts as one along Q.
    length
        The distance.
    weights
        The weights of Q.
    """

    conjugate: float
    fraction: float
    conjugate_scale: float
    length: float
    weights: Floats | None = None

    def _way(self, conjugate: float, fraction: float) -> tuple[float, float]:
        return (conjugate - self.conjugate) / self.conjugate_scale, fraction - self.fraction


class ArcLength(_FromPoint):
    """The distance has a given value (Riks 1979; Crisfield 1981).

    It passes limits of the load and, other than volume control, places where the volume turns back; not where both turn
    at once, as they do where another cavity than that of Q has its limit.
    """

    def gap(self, conjugate: float, fraction: float) -> tuple[float, float, float]:
        """Return the squared distance less the squared length."""
        x, y = self._way(conjugate, fraction)
        return x * x + y * y - self.length**2, 2 * x / self.conjugate_scale, 2 * y

    def scale(self, conjugate: float) -> float:
        """Return the squared length."""
        del conjugate
        return self.length**2


@dataclass(frozen=True, eq=False)
class AlongTangent(_FromPoint):
    """The distance along the unit `tangent` ``(2,)`` of the path at the point has a given value (Riks 1979).

    It finds where the first step begins to look: at the point itself the circle of :class:`ArcLength` has no slope.
    """

    tangent: Floats = field(kw_only=True)

    def gap(self, conjugate: float, fraction: float) -> tuple[float, float, float]:
        """Return the distance along the tangent less the length."""
        x, y = self._way(conjugate, fraction)
        a, b = (float(part) for part in self.tangent)
        return a * x + b * y - self.length, a / self.conjugate_scale, b

    def scale(self, conjugate: float) -> float:
        """Return the length."""
        del conjugate
        return self.length


class Quantity(Protocol):
    """What grows along a walk and is prescribed instead of the load; :class:`Control` fixes one value of it."""

    @property
    def weights(self) -> Floats | None:
        """The weights of Q."""
        ...

    def value(self, conjugate: float, fraction: float) -> float:
        """Return the quantity."""
        ...

    def fixed(self, value: float) -> Control:
        """Return the control under which it has a value."""
        ...


@dataclass(frozen=True, eq=False)
class Volume:
    """Q itself; with weights of one at some cavities and zero elsewhere, what these enclose, mm³."""

    weights: Floats | None = None

    def value(self, conjugate: float, fraction: float) -> float:
        """Return Q."""
        del fraction
        return conjugate

    def fixed(self, value: float) -> FixedConjugate:
        """Return the control of volume."""
        return FixedConjugate(value, self.weights)


@dataclass(frozen=True, eq=False)
class Air:
    """The amount of air in a cavity, (p + p₀) V; see :class:`AirAmount`, which fixes it."""

    full_pressure: float
    surroundings: float
    weights: Floats

    def value(self, conjugate: float, fraction: float) -> float:
        """Return (p + p₀) V, N mm."""
        return (fraction * self.full_pressure + self.surroundings) * conjugate / self.full_pressure

    def fixed(self, value: float) -> AirAmount:
        """Return the control of the amount of air."""
        return AirAmount(value, self.full_pressure, self.surroundings, self.weights)
