"""Whoever presses Ctrl-C is heeded, whatever is going on: no traceback, exit code 130, and no run that goes on."""

from __future__ import annotations

import contextlib
import io
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from turgor.cli import main
from turgor.cli.progress import progress_on
from turgor.cli.signals import Interrupted, Terminated, heed, heeding_signals
from turgor.mesh.mesh import Mesh
from turgor.study.case import Case
from turgor.study.meshing import checked_mesh

SMALL = Path(__file__).parents[1] / "study" / "small.yaml"

INTERRUPTED_AT_AN_IMPORT = """
import signal, sys
from turgor.cli import main

target, turned = sys.argv.pop(1), sys.argv.pop(1) == "turned"

class Finder:
    def find_spec(self, name, *others):
        if name == target:
            try:
                exec("signal.raise_signal(signal.SIGINT)")  # as in the making of a dataclass
            except KeyboardInterrupt as error:
                if turned:
                    raise ValueError("a schema cannot be built") from error
                raise

sys.meta_path.insert(0, Finder())
main()
"""


def lost(number: int) -> None:
    """A signal whose exception nobody gets to see, as in a callback from C."""
    with contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(number)


@pytest.mark.parametrize("terminal", [True, False])
@pytest.mark.parametrize(("number", "kind"), [(signal.SIGINT, Interrupted), (signal.SIGTERM, Terminated)])
def test_a_signal_that_was_lost_is_raised_where_progress_is_told(
    terminal: bool, number: int, kind: type[KeyboardInterrupt]
) -> None:
    told = [("stage", "mesh"), ("note", "iteration 1"), ("advance", 0.5, "10 kPa")]
    with progress_on(Console(file=io.StringIO(), force_terminal=terminal)) as progress:
        for name, *arguments in told:
            with heeding_signals():
                getattr(progress, str(name))(*arguments)
                lost(number)
                with pytest.raises(kind):
                    getattr(progress, str(name))(*arguments)


def test_a_second_interrupt_comes_at_once_and_nothing_is_left_behind() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with heeding_signals():
        lost(signal.SIGINT)
        with pytest.raises(Interrupted):
            signal.raise_signal(signal.SIGINT)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    heed()


def test_a_run_that_loses_an_interrupt_ends_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def meshed(case: Case) -> Mesh:
        lost(signal.SIGINT)
        return checked_mesh(case)

    monkeypatch.setattr("turgor.study.run.checked_mesh", meshed)
    monkeypatch.setattr(sys, "argv", ["turgor", "run", str(SMALL), "--out", str(tmp_path / "run")])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert capsys.readouterr().err.endswith("turgor: interrupted\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize("module", ["typer", "turgor.study.case"])
@pytest.mark.parametrize("kept", ["kept", "turned"])
def test_an_interrupt_of_imports_leaves_no_traceback(module: str, kept: str) -> None:
    command = [sys.executable, "-c", INTERRUPTED_AT_AN_IMPORT, module, kept, "run", str(SMALL)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.stderr == "turgor: interrupted\n"
    assert done.returncode == 130
