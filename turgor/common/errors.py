"""The exceptions of Turgor and the exit code that each one ends a command with.

Bad input raises :class:`InputError`; a solver that stops short of its target raises a
:class:`SolverError`; broken internals assert. Nothing else reaches the user.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

EXIT_BAD_INPUT = 2
EXIT_STOPPED_SHORT = 3


class TurgorError(Exception):
    """Base of every exception that Turgor raises on purpose."""

    exit_code = EXIT_BAD_INPUT


class InputError(TurgorError):
    """Something the user gave is wrong; the message says what, where, and what would be right.

    Parameters
    ----------
    problem
        What is wrong, as a sentence without the final full stop.
    file
        The file that holds the value, if any.
    key
        Dotted path of the key in that file (``mesh.size``), a column or a command-line option.
    value
        The value that was found; left out when it is ``None``.
    expected
        What would be right.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        key: str | None = None,
        value: object = None,
        expected: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = None if file is None else str(file)
        self.key = key
        self.value = value
        self.expected = expected
        super().__init__(self._message())

    def _message(self) -> str:
        place = ": ".join(part for part in (self.file, self.key) if part)
        found = "" if self.value is None else f" (found {_short(self.value)})"
        right = "" if self.expected is None else f"; expected {self.expected}"
        return f"{place}: {self.problem}{found}{right}" if place else f"{self.problem}{found}{right}"

    def at(self, *, file: str | Path | None = None, key: str | None = None) -> InputError:
        """Return a copy that also names the `file` and `key`, where this error did not know them."""
        return InputError(
            self.problem,
            file=self.file or file,
            key=self.key or key,
            value=self.value,
            expected=self.expected,
        )

    def read_from(self, file: str | Path, changes: Iterable[str]) -> InputError:
        """Return a copy that also names the `file`, or ``--set`` where one of its `changes` KEY=VALUE gave the key."""
        key = self.key or ""
        changed = [change.partition("=")[0].strip() for change in changes]
        is_changed = any(key == path or key.startswith(f"{path}.") for path in changed)
        return self.at(file="--set" if is_changed else file)


class MissingPackageError(TurgorError):
    """An optional package or a system library is absent; the message says how to install it."""


class SolverError(TurgorError):
    """The solver stopped before its target; what was reached until then is kept.

    ``facts`` holds what is known of the stop (last good pressure, residual history, worst element
    and its place), in plain numbers and strings with units in their keys.
    """

    exit_code = EXIT_STOPPED_SHORT

    def __init__(self, reason: str, *, advice: str = "", facts: dict[str, object] | None = None) -> None:
        self.reason = reason
        self.advice = advice
        self.facts = dict(facts or {})
        super().__init__(f"{reason}. {advice}".strip() if advice else reason)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
