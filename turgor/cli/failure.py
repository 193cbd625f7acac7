"""One message for whatever goes wrong in a command, and the exit code that belongs to it."""

from __future__ import annotations

import contextlib
import logging
import signal
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperGroup

import turgor as tg

_CommandLineError: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises, and words itself, for a command line that is not well formed."""

EXIT_UNEXPECTED = 1
EXIT_INTERRUPTED = 130
EXIT_TERMINATED = 143
"""What shells report for a command that Ctrl-C or `kill` ended (128 + SIGINT, 128 + SIGTERM)."""


class Terminated(KeyboardInterrupt):
    """Somebody, such as a queue of jobs, asks the process to end: as Ctrl-C, with a word and nothing lost."""


class Commands(TyperGroup):
    """The group of commands; turns every exception into one message on standard error and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        try:
            with _heeding_termination():
                return super().invoke(ctx)
        except tg.TurgorError as error:
            tell(str(error))
            raise typer.Exit(error.exit_code) from error
        except KeyboardInterrupt as error:
            tell(str(error) or "interrupted")
            raise typer.Exit(EXIT_TERMINATED if isinstance(error, Terminated) else EXIT_INTERRUPTED) from error
        except (typer.Exit, typer.Abort, BrokenPipeError, _CommandLineError):
            raise
        except Exception as error:  # the last line of defence: no user ever sees a traceback
            tell(f"unexpected {type(error).__name__}: {_one_line(error)}; please report it with {_keep(error)}")
            raise typer.Exit(EXIT_UNEXPECTED) from error


@contextlib.contextmanager
def _heeding_termination() -> Iterator[None]:
    def end(number: int, frame: object) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def naming(file: Path, changes: Iterable[str] = ()) -> Iterator[None]:
    """Let an InputError that knows no file name this one, or the option that changed the key."""
    try:
        yield
    except tg.InputError as error:
        raise error.read_from(file, changes) from error


@contextlib.contextmanager
def telling_warnings() -> Iterator[None]:
    """Print the package's warnings on standard error while this lasts."""
    handler = _Teller(logging.WARNING)
    log = logging.getLogger("turgor")
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


class _Teller(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        tell(record.getMessage())


def tell(message: str) -> None:
    """Print one message for a person on standard error."""
    Console(stderr=True, soft_wrap=True).print(f"turgor: {message}", highlight=False, markup=False)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or "no message"


def _keep(error: Exception) -> Path:
    """Write the traceback into a file of its own and return where."""
    with tempfile.NamedTemporaryFile("w", prefix="turgor-", suffix=".log", delete=False, encoding="utf-8") as stream:
        stream.write("".join(traceback.format_exception(error)))
    return Path(stream.name)
