"""What a measure is: a function of a stored state under a name that case files know, with its keys and what it needs.

A function that :func:`measure` registers gives numbers, which become columns of ``history.csv`` and entries of
``summary.json``; one that :func:`curve` registers gives a table for each state, which goes to a file of its own. Their
keyword arguments are the parameters that a case file may give, read and checked by their annotations.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from turgor.common.errors import InputError
from turgor.common.findings import what_fits, what_is_missing
from turgor.results.stored import Body, ModelKind, StoredState

FloatArray = npt.NDArray[np.float64]
Function = Callable[..., Any]

ANYWHERE: tuple[ModelKind, ...] = ("space", "plane", "axisymmetric")
_KINDS = {"space": "a body in space", "plane": "a plane section", "axisymmetric": "a body of revolution"}


@dataclass(frozen=True)
class Measure:
    """A registered measure.

    Parameters
    ----------
    name
        As a case file says it.
    keys
        Keys of its numbers, or columns of its table, each ending in its unit. ``{surface}`` stands for the value of
        the parameter `surface`, and for nothing where that is left out.
    surfaces, markers
        What the mesh must have.
    models
        The kinds of models that it has a meaning in.
    function
        ``(state, *, …parameters) → number or array``, in mm, N, MPa and rad.
    parameters
        The parameters with their types and defaults.
    by_default
        Whether a run has it that does not say which measures it wants.
    is_curve
        Whether it gives a table instead of numbers.
    states
        Of a measure that has numbers in some states only: says, by its parameters, in which.
    """

    name: str
    keys: tuple[str, ...]
    surfaces: tuple[str, ...]
    markers: tuple[str, ...]
    models: tuple[ModelKind, ...]
    function: Function
    parameters: type[BaseModel]
    by_default: bool
    is_curve: bool
    states: Callable[..., str] | None = None

    def missing(self, body: Body) -> list[str]:
        """Return what the measure needs and the body lacks."""
        surfaces = [f"surface '{name}'" for name in self.surfaces if name not in body.mesh.surfaces]
        return surfaces + [f"marker '{name}'" for name in self.markers if name not in body.mesh.markers]


MEASURES: dict[str, Measure] = {}
"""Every registered measure by its name."""


@dataclass(frozen=True)
class Choice:
    """A measure that a run asks for, with its parameters."""

    entry: Measure
    parameters: BaseModel

    @classmethod
    def read(cls, value: object, folder: Path | None = None) -> Choice:
        """Return the choice that a case file makes: ``twist``, or ``{displacement: {at: [0 mm, 0 mm, 9 mm]}}``.

        Parameters
        ----------
        value
            The name, a mapping from it to its parameters, or a choice, which passes.
        folder
            What the paths of files are relative to.

        Raises
        ------
        InputError
            If there is no such measure, or a parameter is unknown, missing or does not fit.
        """
        if isinstance(value, Choice):
            return value
        if isinstance(value, Mapping) and len(value) == 1:
            ((name, given),) = value.items()
        else:
            name, given = value, None
        known = str(name).replace("-", "_")
        if not isinstance(name, str) or known not in MEASURES:
            expected = f"the name of one, or '{{name: {{parameter: value}}}}'; {_one_of(MEASURES)}"
            raise InputError("there is no such measure", key="measures", value=name, expected=expected)
        entry = MEASURES[known]
        try:
            return cls(entry, entry.parameters.model_validate(given or {}, context={"folder": folder or Path()}))
        except ValidationError as error:
            raise _input_error(entry, error) from None

    def plain(self, files: Mapping[Path, str] | None = None) -> str | dict[str, Any]:
        """Return the choice as a case file makes it, `files` giving the names to write for paths of files."""
        given = self.parameters.model_dump(mode="json", exclude_defaults=True)
        for key, value in self.parameters:
            if isinstance(value, Path) and key in given:
                given[key] = (files or {}).get(value, str(value))
        return {self.entry.name: given} if given else self.entry.name

    @property
    def files(self) -> list[Path]:
        """The files that the parameters name."""
        return [value for _, value in self.parameters if isinstance(value, Path)]

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the numbers, or columns of the table."""
        return tuple(self._filled(key) for key in self.entry.keys)

    @property
    def title(self) -> str:
        """Name of a table: that of the measure and, where it has one, its own."""
        return self._filled(f"{self.entry.name}_{{name}}".replace("_", "-"))

    def of(self, state: StoredState) -> FloatArray:
        """Return the numbers ``(keys,)`` or the table ``(rows, keys)``, in the units that the keys end in."""
        values = np.atleast_1d(np.asarray(self.entry.function(state, **dict(self.parameters)), dtype=float))
        angles = [key.endswith("_deg") for key in self.entry.keys]
        return np.asarray(values * np.where(angles, math.degrees(1.0), 1.0))

    def _filled(self, key: str) -> str:
        given = dict(self.parameters)

        def value(match: re.Match[str]) -> str:
            found = given.get(match[2])
            return f"{match[1]}{found}" if found else ""

        return re.sub(r"([_-]?)\{(\w+)\}", value, key)


def measure(
    *keys: str,
    surfaces: tuple[str, ...] = (),
    markers: tuple[str, ...] = (),
    models: tuple[ModelKind, ...] = ANYWHERE,
    by_default: bool = False,
    states: Callable[..., str] | None = None,
) -> Callable[[Function], Function]:
    """Register the decorated function as the measure of its own name; `states` as of :class:`Measure`."""

    def register(function: Function) -> Function:
        _register(function, keys, surfaces, markers, models, by_default=by_default, is_curve=False, states=states)
        return function

    return register


def curve(
    *columns: str, surfaces: tuple[str, ...] = (), models: tuple[ModelKind, ...] = ANYWHERE
) -> Callable[[Function], Function]:
    """Register the decorated function as a measure that gives a table with these columns."""

    def register(function: Function) -> Function:
        _register(function, columns, surfaces, (), models, by_default=False, is_curve=True)
        return function

    return register


def available(body: Body) -> tuple[Choice, ...]:
    """Return the measures that a run has which does not say what it wants, as far as the body's names allow."""
    entries = [entry for entry in MEASURES.values() if entry.by_default and body.kind in entry.models]
    return tuple(Choice(entry, entry.parameters()) for entry in entries if not entry.missing(body))


def check_kinds(choices: Iterable[Choice], kind: ModelKind) -> None:
    """Refuse what is wrong with measures in a kind of model whatever its mesh.

    Raises
    ------
    InputError
        If a measure has no meaning in it, or two measures have the same key.
    """
    seen: set[str] = set()
    for choice in choices:
        entry = choice.entry
        _check_kind(entry, kind)
        for key in [choice.title] if entry.is_curve else choice.keys:
            if key in seen:
                expected = "each measure once; those of a kind with a 'name' of their own"
                raise InputError(f"two measures are called '{key}'", key="measures", expected=expected)
            seen.add(key)


def check(choices: Sequence[Choice], body: Body) -> None:
    """Evaluate the measures on the body at rest, so that what cannot be measured is known before a run begins.

    Raises
    ------
    InputError
        If the body lacks what a measure needs, a parameter names nothing, or two measures have the same key.
    """
    check_kinds(choices, body.kind)
    rest = body.at_rest()
    for choice in choices:
        entry = choice.entry
        _check_there(entry, body)
        try:
            choice.of(rest)
        except InputError as error:
            key = f"measures.{entry.name}" + (f".{error.key}" if error.key else "")
            raise InputError(
                error.problem, file=error.file, key=key, value=error.value, expected=error.expected
            ) from error


def evaluate(choices: Iterable[Choice | str], state: StoredState) -> dict[str, float]:
    """Return the numbers of measures, key → value in the unit that the key ends in; curves have none.

    Raises
    ------
    InputError
        If a measure is unknown or impossible on this body.
    """
    values: dict[str, float] = {}
    for choice in map(Choice.read, choices):
        _check_kind(choice.entry, state.body.kind)
        _check_there(choice.entry, state.body)
        if not choice.entry.is_curve:
            values |= {key: float(number) for key, number in zip(choice.keys, choice.of(state), strict=True)}
    return values


def silent(choices: Iterable[Choice], history: Sequence[Mapping[str, Any]]) -> list[str]:
    """Say which of the measures that have numbers in some states only have none in a whole `history`, and why."""
    return [
        f"measures.{choice.entry.name}: {key} is empty in every step; {choice.entry.states(**dict(choice.parameters))}"
        for choice in choices
        if choice.entry.states is not None
        for key in choice.keys
        if all(row.get(key) is None for row in history)
    ]


def tables(choices: Iterable[Choice], state: StoredState) -> dict[str, list[dict[str, float]]]:
    """Return the tables of the curves among the measures: title → rows, column → value."""
    return {
        choice.title: [dict(zip(choice.keys, map(float, row), strict=True)) for row in choice.of(state)]
        for choice in choices
        if choice.entry.is_curve
    }


def _register(
    function: Function,
    keys: tuple[str, ...],
    surfaces: tuple[str, ...],
    markers: tuple[str, ...],
    models: tuple[ModelKind, ...],
    *,
    by_default: bool,
    is_curve: bool,
    states: Callable[..., str] | None = None,
) -> None:
    name = function.__name__
    hints = get_type_hints(function, include_extras=True)
    fields: dict[str, Any] = {
        key: (hints[key], ... if entry.default is entry.empty else entry.default)
        for key, entry in inspect.signature(function).parameters.items()
        if entry.kind is entry.KEYWORD_ONLY
    }
    config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    parameters = create_model(name, __config__=config, **fields)
    MEASURES[name] = Measure(name, keys, surfaces, markers, models, function, parameters, by_default, is_curve, states)


def _check_kind(entry: Measure, kind: ModelKind) -> None:
    if kind not in entry.models:
        expected = " or ".join(_KINDS[kind] for kind in entry.models)
        problem = f"the measure '{entry.name}' has no meaning in {_KINDS[kind]}"
        raise InputError(problem, key="measures", expected=expected)


def _check_there(entry: Measure, body: Body) -> None:
    missing = entry.missing(body)
    if missing:
        there = f"surfaces {_listed(body.mesh.surfaces)}; markers {_listed(body.mesh.markers)}"
        raise InputError(
            f"the measure '{entry.name}' needs the {' and the '.join(missing)}, and the mesh has {there}",
            key="measures",
            expected=_one_of(name for name, other in MEASURES.items() if not other.missing(body)),
        )


def _input_error(entry: Measure, error: ValidationError) -> InputError:
    """Make one message of pydantic's list: its first problem that is not a consequence of another."""
    found = sorted(error.errors(include_url=False), key=lambda finding: finding["type"] == "missing")[0]
    key = ".".join(str(part) for part in (entry.name, *found["loc"]))
    if found["type"] == "extra_forbidden":
        known = ", ".join(entry.parameters.model_fields) or "no parameters"
        return InputError("unknown key", key=key, expected=f"one of: {known}")
    if found["type"] == "missing":
        return InputError("this key is missing", key=key, expected=what_is_missing(entry.parameters, found["loc"]))
    cause = found.get("ctx", {}).get("error")
    refused = getattr(cause, "__cause__", None)
    if isinstance(refused, InputError):
        return InputError(refused.problem, key=key, value=refused.value, expected=refused.expected)
    if cause is not None:
        return InputError(str(cause), key=key)
    return InputError("this value does not fit", key=key, value=found["input"], expected=what_fits(found))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _one_of(names: Iterable[str]) -> str:
    listed = ", ".join(names)
    return f"one of: {listed}" if listed else "no measure: this mesh has the surfaces and markers of none"
