"""The package's logger; a command attaches handlers, a library user decides for himself."""

from __future__ import annotations

import logging
from collections.abc import Callable

LOGGER_NAME = "turgor"


def logger(room: str) -> logging.Logger:
    """Return the logger of one room (``logger("solver")``); silent unless somebody listens."""
    root = logging.getLogger(LOGGER_NAME)
    if not root.handlers:
        root.addHandler(logging.NullHandler())
    return root.getChild(room)


class Relay(logging.Handler):
    """Tells somebody each warning of the package, but for those of some rooms."""

    def __init__(self, tell: Callable[[str], None], *, but: tuple[str, ...] = ()) -> None:
        super().__init__(logging.WARNING)
        self._tell = tell
        silent = {f"{LOGGER_NAME}.{room}" for room in but}
        self.addFilter(lambda record: record.name not in silent)

    def emit(self, record: logging.LogRecord) -> None:
        """Tell the message."""
        self._tell(record.getMessage())
