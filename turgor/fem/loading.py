"""All that acts on a system as functions of one load fraction."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.names import PRESSURE_PREFIX
from turgor.fem.contact.spec import RigidContact
from turgor.fem.loads import Gravity, Load, Pressure
from turgor.fem.programme import PROPORTIONAL, ROUNDING, LoadLine, Programme

Floats = NDArray[np.float64]


class Loading:
    """The loads of a system, each along its programme.

    Parameters
    ----------
    loads
        In the order of ``State.loads``; a rigid body that moves is one, too.

    Attributes
    ----------
    names
        One for each load.

    Raises
    ------
    InputError
        If a cavity is given two pressures.
    """

    def __init__(self, loads: Sequence[Load | RigidContact]) -> None:
        self.loads = tuple(loads)
        self.names = _names(self.loads)
        self._programmes = [_programme(load) for load in self.loads]

    def at(self, fraction: float) -> Floats:
        """Return the loads ``(n_loads,)`` at a load fraction."""
        return np.array([full * programme.at(fraction) for full, programme in self._programmes])

    def growth(self, fraction: float) -> Floats:
        """Return the derivatives of the loads ``(n_loads,)`` by the load fraction."""
        return np.array([full * programme.slope(fraction) for full, programme in self._programmes])

    def line_at(self, fraction: float) -> LoadLine:
        """Return the straight line that the loads follow at a load fraction, at a kink the later one."""
        return LoadLine(fraction, self.at(fraction), self.growth(fraction))

    def leading(self, growth: Floats) -> int:
        """Return the place of the load that `growth` ``(n_loads,)`` changes most: a pressure, if it changes one."""
        size = np.abs(growth)
        of_pressures = np.array([isinstance(load, Pressure) for load in self.loads]) * size
        return int(np.argmax(of_pressures if np.any(of_pressures) else size))

    @property
    def kinks(self) -> tuple[float, ...]:
        """The load fractions within (0, 1) at which a load's programme changes its slope, ascending and apart."""
        found = sorted(f for _, programme in self._programmes for f in programme.kinks if ROUNDING < f < 1.0 - ROUNDING)
        apart = [True, *(later - earlier > ROUNDING for earlier, later in itertools.pairwise(found))]
        return tuple(itertools.compress(found, apart))

    @property
    def acts_at_start(self) -> bool:
        """Whether something acts already at load fraction zero (weight)."""
        return bool(np.any(self.at(0.0)))


def _programme(load: Load | RigidContact) -> tuple[float, Programme]:
    """Return a load's full value and how it follows the load fraction."""
    if isinstance(load, RigidContact):
        return 1.0, PROPORTIONAL
    return load.value if isinstance(load, Pressure) else 1.0, load.programme


def _names(loads: Sequence[Load | RigidContact]) -> tuple[str, ...]:
    kinds = [_kind(load) for load in loads]
    names: list[str] = []
    for number, (load, kind) in enumerate(zip(loads, kinds, strict=True)):
        earlier = kinds[:number].count(kind)
        if earlier and isinstance(load, Pressure):
            raise InputError(
                "the cavity is given two pressures", key="loads", value=load.cavity, expected="one for each cavity"
            )
        names.append(f"{kind}#{earlier + 1}" if earlier else kind)
    return tuple(names)


def _kind(load: Load | RigidContact) -> str:
    """Return what a load is called where it is the only one of its kind there."""
    if isinstance(load, Pressure):
        return PRESSURE_PREFIX + load.cavity
    if isinstance(load, Gravity):
        return "gravity"
    if isinstance(load, RigidContact):
        return f"motion:{load.name}"
    return f"{type(load).__name__.lower()}:{load.surface}"
