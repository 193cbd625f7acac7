"""``run.log``: what every room says during a run, from its first line on."""

from __future__ import annotations

import logging
from collections.abc import Callable
from logging.handlers import MemoryHandler
from pathlib import Path
from typing import Self

from turgor.common.log import LOGGER_NAME, Relay
from turgor.common.writing import writing

_FORMAT = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"
_CAPACITY = 100_000


class RunLog:
    """Collects the package's log; :meth:`write_to` sends it, and what follows, to a file.

    The first stages of a run come before its folder may be touched, hence the detour over memory.

    Parameters
    ----------
    warn
        Told each warning, but for those of the solver on its way, whose results say what came of it.

    Attributes
    ----------
    warnings
        The same so far, for the run's folder, but for what ended the run, which its summary says.
    """

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._logger = logging.getLogger(LOGGER_NAME)
        self._relay = Relay(warn, but=("solver",))
        self.warnings: list[str] = []
        self._kept = Relay(self.warnings.append, but=("solver",))
        self._kept.addFilter(lambda record: record.levelno == logging.WARNING)
        self._memory = MemoryHandler(_CAPACITY, flushLevel=logging.CRITICAL + 1, flushOnClose=False)
        self._file: logging.FileHandler | None = None

    def __enter__(self) -> Self:
        self._level = self._logger.level
        self._logger.setLevel(logging.INFO)
        self._logger.addHandler(self._memory)
        self._logger.addHandler(self._relay)
        self._logger.addHandler(self._kept)
        return self

    def write_to(self, path: Path, *, append: bool) -> None:
        """Write everything so far, and from now on, to the file `path`, behind what is there or instead of it.

        Raises
        ------
        UnwritableError
            If the system does not let the file be written.
        """
        with writing(path):
            self._file = logging.FileHandler(path, mode="a" if append else "w", encoding="utf-8")
        self._file.setFormatter(logging.Formatter(_FORMAT))
        self._memory.setTarget(self._file)
        self._memory.flush()
        self._logger.removeHandler(self._memory)
        self._logger.addHandler(self._file)

    def __exit__(self, *failure: object) -> None:
        for handler in (self._relay, self._kept, self._memory, self._file):
            if handler is not None:
                self._logger.removeHandler(handler)
                handler.close()
        self._logger.setLevel(self._level)
