"""The course of a run: which states are asked for, how the solver gets there, and how far along each one is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from turgor.common.errors import InputError
from turgor.fem.system import System
from turgor.solver.choice import make_stiffness_solver
from turgor.solver.control import Air, Quantity, Volume
from turgor.solver.follow import follow, follow_arc, settled
from turgor.solver.newton import Equilibrium
from turgor.solver.path import PathOptions, output_fractions, solve_path
from turgor.solver.slopes import stable_while_held
from turgor.study.control import AirControl, ArcLengthControl, VolumeControl, volume_of

OnEquilibrium = Callable[[Equilibrium], None]
OnProgress = Callable[[float, int, float], None]

SAME = 1e-6
"""Two volumes that differ by less than this part are one."""


class Course(Protocol):
    """From rest to the target."""

    def walk(
        self,
        start: Equilibrium | None,
        on_equilibrium: OnEquilibrium,
        on_progress: OnProgress | None,
        before: Equilibrium | None = None,
    ) -> None:
        """Find the states, from `start` on, which came behind `before`; raises what the solver raises."""
        ...

    def parameter(self, state: Equilibrium) -> float:
        """Return how far along a state is: 0 at rest, 1 at the target."""
        ...

    def stable(self, state: Equilibrium) -> bool | None:
        """Say whether a state is stable under what the course prescribes."""
        ...

    @property
    def duration(self) -> float | None:
        """What the parameter runs over in s, if it is time."""
        ...


@dataclass(frozen=True, eq=False)
class LoadCourse:
    """Given loads; `duration` in s where they follow programmes."""

    system: System
    fractions: Sequence[float]
    options: PathOptions
    duration: float | None = None

    def walk(
        self,
        start: Equilibrium | None,
        on_equilibrium: OnEquilibrium,
        on_progress: OnProgress | None,
        before: Equilibrium | None = None,
    ) -> None:
        """See :class:`Course`; the loads tell the way themselves."""
        del before
        solve_path(
            self.system,
            self.fractions,
            options=self.options,
            start=start,
            on_equilibrium=on_equilibrium,
            on_progress=on_progress,
        )

    def parameter(self, state: Equilibrium) -> float:
        """Return the load fraction."""
        return state.fraction

    def stable(self, state: Equilibrium) -> bool | None:
        """Say whether a state is stable under its loads."""
        return state.stable


@dataclass(frozen=True, eq=False)
class QuantityCourse:
    """Given values of a volume or an amount of air; with a `length`, followed by the length of the path instead.

    `begin` is the value where nothing grows yet: at rest, or under the weight.
    """

    system: System
    quantity: Quantity
    begin: float
    targets: Sequence[float]
    options: PathOptions
    length: float | None = None
    duration: None = None

    def walk(
        self,
        start: Equilibrium | None,
        on_equilibrium: OnEquilibrium,
        on_progress: OnProgress | None,
        before: Equilibrium | None = None,
    ) -> None:
        """See :class:`Course`; `before` tells the way along an arc, which a volume tells itself."""
        if self.length is None:
            follow(
                self.system,
                self.quantity,
                self.targets,
                options=self.options,
                start=start,
                on_equilibrium=on_equilibrium,
                on_progress=on_progress,
            )
            return
        assert isinstance(self.quantity, Volume)
        follow_arc(
            self.system,
            self.quantity,
            self.targets[-1],
            self.length,
            options=self.options,
            start=start,
            before=before,
            on_equilibrium=on_equilibrium,
            on_progress=on_progress,
        )

    def parameter(self, state: Equilibrium) -> float:
        """Return the part of the way from the beginning to the target, by the quantity."""
        conjugate = self.system.conjugate(state.state, self.quantity.weights)
        part = (self.quantity.value(conjugate, state.fraction) - self.begin) / (self.targets[-1] - self.begin)
        return next((end for end in (0.0, 1.0) if abs(part - end) < SAME), part)

    def stable(self, state: Equilibrium) -> bool | None:
        """Say whether a state is stable while the quantity is held."""
        return stable_while_held(self.system, self.quantity, state)


def course_by(
    control: VolumeControl | AirControl | ArcLengthControl,
    system: System,
    outputs: Sequence[str] | None,
    steps: int,
    options: PathOptions,
) -> QuantityCourse:
    """Return the course of a control other than by the loads.

    Raises
    ------
    InputError
        If the control does not fit the system or the outputs do not lead to its target.
    StoppedShortError
        If there is no equilibrium under the weight alone.
    """
    channels = _channels(system, control.cavity)
    weights = np.zeros(len(system.loading.names))
    weights[channels] = 1.0
    rest = system.conjugate(system.reference_state(), weights)
    quantity: Quantity = Volume(weights)
    scale = 1.0
    if isinstance(control, AirControl):
        if len(channels) > 1:
            raise InputError(
                "the air of several cavities is no single amount",
                key="control.cavity",
                expected=f"one of {', '.join(cavity.name for cavity in system.cavities)}",
            )
        full = float(system.loading.growth(0.0)[channels[0]])
        quantity, scale = Air(full, control.surroundings, full * weights), control.surroundings
    target = volume_of(control.target, rest, "control.target")
    begin = _begin(system, quantity, options) / scale
    if abs(target - begin) < SAME * rest:
        where = "under the weight alone" if system.loading.acts_at_start else "at rest"
        raise InputError(f"the target is what there is {where}", key="control.target", value=control.target)
    if outputs is None:
        volumes = [float(v) for v in begin + (target - begin) * np.array(output_fractions(steps))]
    else:
        volumes = _volumes(outputs, rest, begin, target)
    length = 1.0 / steps if isinstance(control, ArcLengthControl) else None
    return QuantityCourse(system, quantity, scale * begin, [scale * volume for volume in volumes], options, length)


def _begin(system: System, quantity: Quantity, options: PathOptions) -> float:
    """Return the value of a quantity before the loads grow."""
    newton = options.newton
    state = system.reference_state()
    if system.loading.acts_at_start:
        state = settled(system, make_stiffness_solver(system, newton.linear), newton).state
    return quantity.value(system.conjugate(state, quantity.weights), 0.0)


def _volumes(outputs: Sequence[str], rest: float, begin: float, target: float) -> list[float]:
    volumes = [volume_of(text, rest, f"solver.outputs.{number}") for number, text in enumerate(outputs)]
    sign = np.sign(target - begin)
    if np.any(sign * np.diff([begin, *volumes]) <= 0.0) or abs(volumes[-1] - target) > SAME * target:
        raise InputError(
            "these volumes do not lead from rest to the target",
            key="solver.outputs",
            value=list(outputs),
            expected=f"volumes in order from {100.0 * begin / rest:.5g} %, the last equal to control.target",
        )
    return [*volumes[:-1], target]


def _channels(system: System, cavity: str | None) -> list[int]:
    pressures = {cavity.name: cavity.channel for cavity in system.cavities}
    if cavity is not None and cavity not in pressures:
        expected = f"one of {', '.join(pressures)}" if pressures else "a load of type pressure"
        raise InputError("no pressure acts in this cavity", key="control.cavity", value=cavity, expected=expected)
    if not pressures:
        raise InputError("no cavity is under pressure", key="control", expected="a load of type pressure")
    return [pressures[cavity]] if cavity is not None else list(pressures.values())
