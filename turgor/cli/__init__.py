"""The ``turgor`` command: one thin typed command a study, on top of the public names of :mod:`turgor`."""

from turgor.cli.app import app


def main() -> None:
    """Run the command line; the entry point of the ``turgor`` script."""
    app(prog_name="turgor")
