"""How a run tells where it is: a bar on a terminal, plain lines elsewhere, always on standard error.

Where it tells, it also looks whether somebody wants it to end.
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from turgor.cli.signals import heed


class TerminalProgress:
    """A rich progress bar from 0 to 1 with the stage before it and the last note behind it."""

    def __init__(self, console: Console) -> None:
        self._bar = Progress(
            TextColumn("{task.description:<9}", markup=False),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}", markup=False),
            console=console,
        )
        self._task = self._bar.add_task("", total=1.0, note="")

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def stage(self, name: str) -> None:
        """Name what begins now."""
        heed()
        self._bar.update(self._task, description=name, note="")

    def note(self, text: str) -> None:
        """Show a detail behind the bar."""
        heed()
        self._bar.update(self._task, note=text)

    def tell(self, text: str) -> None:
        """Print a line above the bar."""
        self._bar.console.print(f"turgor: {text}", highlight=False, markup=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print a warning above the bar."""
        self.tell(f"warning: {text}")

    def advance(self, fraction: float, text: str) -> None:
        """Set the part of the load that is reached, 0 to 1."""
        self._bar.update(self._task, completed=fraction, note=text)
        heed()


class LineProgress:
    """One line a stage and a step, for log files and pipes."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass

    def stage(self, name: str) -> None:
        """Name what begins now."""
        heed()
        self._console.print(name, highlight=False, markup=False)

    def note(self, text: str) -> None:
        """Leave out what the next line would repeat."""
        heed()

    def tell(self, text: str) -> None:
        """Print a line."""
        self._console.print(f"turgor: {text}", highlight=False, markup=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Print a warning."""
        self.tell(f"warning: {text}")

    def advance(self, fraction: float, text: str) -> None:
        """Say the part of the load that is reached, 0 to 1."""
        self._console.print(f"{100.0 * fraction:5.1f} %  {text}", highlight=False, markup=False)
        heed()


def progress_on(console: Console) -> TerminalProgress | LineProgress:
    """Return the progress display that suits `console`."""
    return TerminalProgress(console) if console.is_terminal else LineProgress(console)
