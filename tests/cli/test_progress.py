"""Progress is a bar on a terminal and plain lines elsewhere."""

from __future__ import annotations

import io

from rich.console import Console

from turgor.cli.progress import progress_on


def shown(*, terminal: bool) -> str:
    stream = io.StringIO()
    with progress_on(Console(file=stream, force_terminal=terminal, width=100)) as progress:
        progress.stage("load")
        progress.note("iteration 3")
        progress.advance(0.25, "5 kPa in [cavity]")
    return stream.getvalue()


def test_lines_for_a_file() -> None:
    assert shown(terminal=False) == "load\n 25.0 %  5 kPa in [cavity]\n"


def test_a_bar_for_a_terminal() -> None:
    text = shown(terminal=True)
    assert "\x1b[" in text
    assert "load" in text
    assert "25 %" in text
    assert "5 kPa in [cavity]" in text
