"""Ctrl-C and `kill`, heeded whatever is going on when they come.

Python tells of Ctrl-C by an exception wherever the main thread happens to be. In a callback from C (as numba's and
llvmlite's) or a ``__del__`` nobody gets to see it: it is printed or dropped, and the command goes on. What came is
therefore remembered too, and raised again where a command reports its progress.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143
"""What shells report for a command that Ctrl-C or `kill` ended (128 + SIGINT, 128 + SIGTERM)."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C.

    A kind of its own: where ``exec``, as in the making of a dataclass, is left by a plain KeyboardInterrupt, Python
    ends the process by the signal whatever comes of the exception (bpo-1054041), and the exit code is lost.
    """


class Terminated(KeyboardInterrupt):
    """Somebody, such as a queue of jobs, asks the process to end: as Ctrl-C, with a word and nothing lost."""


_KINDS: dict[int, type[KeyboardInterrupt]] = {signal.SIGINT: Interrupted, signal.SIGTERM: Terminated}
_came: list[type[KeyboardInterrupt]] = []


@contextlib.contextmanager
def heeding_signals() -> Iterator[None]:
    """Raise what belongs to a signal when it comes, and again in :func:`heed`, while this lasts."""
    before = {number: signal.signal(number, _end) for number in _KINDS}
    _came.clear()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _came.clear()


def _end(number: int, frame: FrameType | None) -> None:
    del frame
    _came.append(_KINDS[number])
    raise _KINDS[number]


def heed() -> None:
    """Raise what has come since :func:`heeding_signals` began, should it have been lost."""
    if _came:
        raise _came[-1]


@contextlib.contextmanager
def heeding_in_errors() -> Iterator[None]:
    """Raise what has come instead of an error: libraries make one of it, as pydantic does of a schema cut short."""
    try:
        yield
    except Exception:
        heed()
        raise


def exit_code_of(interrupt: KeyboardInterrupt) -> int:
    """Return the exit code of a command that was ended so."""
    return EXIT_TERMINATED if isinstance(interrupt, Terminated) else EXIT_INTERRUPTED
