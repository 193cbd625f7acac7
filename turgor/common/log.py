"""The package's logger; a command attaches handlers, a library user decides for himself."""

from __future__ import annotations

import logging

LOGGER_NAME = "turgor"


def logger(room: str) -> logging.Logger:
    """Return the logger of one room (``logger("solver")``); silent unless somebody listens."""
    root = logging.getLogger(LOGGER_NAME)
    if not root.handlers:
        root.addHandler(logging.NullHandler())
    return root.getChild(room)
