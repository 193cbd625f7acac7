"""One message for whatever goes wrong in a command, and the exit code that belongs to it."""

from __future__ import annotations

import contextlib
import errno
import logging
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperGroup

import turgor as tg
from turgor.cli.output import leave_standard_output
from turgor.cli.signals import exit_code_of, heeding_in_errors
from turgor.common.log import LOGGER_NAME, Relay

_CommandLineError: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises, and words itself, for a command line that is not well formed."""

_OF_THE_SYSTEM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM)
"""No room and no right are the machine's to say, wherever it says so."""

EXIT_UNEXPECTED = 1


class Commands(TyperGroup):
    """The group of commands; turns every exception into one message on standard error and an exit code."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Read the command line, and print help or version where it asks for them."""
        with _telling_failure():
            return super().make_context(*arguments, **options)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was asked for."""
        with _telling_failure():
            return super().invoke(ctx)


@contextlib.contextmanager
def _telling_failure() -> Iterator[None]:
    try:
        with heeding_in_errors():
            yield
    except tg.TurgorError as error:
        tell(str(error))
        raise typer.Exit(error.exit_code) from error
    except KeyboardInterrupt as error:
        tell(str(error) or "interrupted")
        raise typer.Exit(exit_code_of(error)) from error
    except (typer.Exit, typer.Abort, BrokenPipeError, _CommandLineError):
        raise
    except Exception as error:  # the last line of defence: no user ever sees a traceback
        if isinstance(error, OSError) and error.errno in _OF_THE_SYSTEM:
            leave_standard_output()  # help is printed without a look at whether there is room
            tell(f"the system refuses to go on: {_one_line(error)}")
            raise typer.Exit(tg.InputError.exit_code) from error
        tell(f"unexpected {type(error).__name__}: {_one_line(error)}; please report it with {_keep(error)}")
        raise typer.Exit(EXIT_UNEXPECTED) from error


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
    handler = Relay(tell)
    log = logging.getLogger(LOGGER_NAME)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


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
