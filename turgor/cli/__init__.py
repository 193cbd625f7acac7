"""The ``turgor`` command: one thin typed command a study, on top of the public names of :mod:`turgor`."""

from __future__ import annotations

import pkgutil
import sys

from turgor.cli.signals import exit_code_of, heed, heeding_in_errors, heeding_signals


def main() -> None:
    """Run the command line; the entry point of the ``turgor`` script."""
    with heeding_signals():
        try:
            # By its name: what it imports takes a while, in which Ctrl-C is heeded already.
            with heeding_in_errors():
                command = pkgutil.resolve_name("turgor.cli.app:app")
            heed()
        except KeyboardInterrupt as interrupt:
            sys.stderr.write("turgor: interrupted\n")
            sys.exit(exit_code_of(interrupt))
        command(prog_name="turgor")
