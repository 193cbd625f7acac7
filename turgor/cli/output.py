"""What commands print on standard output: tables for people, JSON for programs."""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

import turgor as tg


def print_text(text: str) -> None:
    """Print one line; raise InputError if standard output takes none."""
    with _standard_output():
        sys.stdout.write(f"{text}\n")


def print_json(document: object) -> None:
    """Print strict JSON; numbers that are not finite become ``null``."""
    print_text(json.dumps(_finite(document), indent=2, ensure_ascii=False, allow_nan=False))


def print_table(table: Table) -> None:
    """Print a table, as wide as it needs to be where the output is not a terminal."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    with _standard_output():
        console.print(table)


@contextlib.contextmanager
def _standard_output() -> Iterator[None]:
    """Have what is printed meanwhile written at once, so that a full disk is noticed where it can be told.

    Raises
    ------
    InputError
        If it cannot be written. That nobody reads on (``| head``) passes as BrokenPipeError.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        leave_standard_output()
        raise tg.InputError(f"standard output cannot be written ({error.strerror or error})") from error


def leave_standard_output() -> None:
    """Let what standard output does not take go nowhere: at its end Python would try again, and complain."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
