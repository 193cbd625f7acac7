"""What the system does not let be written, as an error of the user's."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from turgor.common.errors import InputError


class UnwritableError(InputError):
    """The system does not let a file be written: no room, no right."""


@contextmanager
def writing(path: str | Path, problem: str = "the file cannot be written") -> Iterator[None]:
    """Name the file and the `problem` where the system refuses to write, make or remove it.

    Raises
    ------
    UnwritableError
        With what the system says.
    """
    try:
        yield
    except OSError as error:
        raise UnwritableError(f"{problem} ({error.strerror or error})", file=path) from error
