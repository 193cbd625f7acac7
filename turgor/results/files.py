"""Files that are either whole or absent, whenever the process dies; and a lock against two writers."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from turgor.common.errors import InputError
from turgor.common.writing import UnwritableError, writing

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LOCK = ".lock"
PARTIAL = ".part"
"""Suffix of a file that is still being written."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it takes the name `path` once its bytes are on the disk.

    Raises
    ------
    UnwritableError
        If the system does not let it be written: no room, no right.
    """
    partial = path.with_name(path.name + PARTIAL)
    try:
        with writing(path):
            yield partial
            with partial.open("rb+") as stream:
                os.fsync(stream.fileno())
            partial.replace(path)
            _sync_folder(path.parent)
    except UnwritableError:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file in one piece."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")


def remove(path: Path) -> None:
    """Remove a file that may not be there; raise UnwritableError if the system does not let it be removed."""
    with writing(path):
        path.unlink(missing_ok=True)


def read_text(path: Path) -> str:
    """Read a UTF-8 text file; raise InputError if it is missing or damaged."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("the file is missing or damaged", file=path) from error


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON file that holds an object; raise InputError if it is missing or damaged."""
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"the file is damaged: {error}", file=path) from error
    if not isinstance(content, dict):
        raise InputError("the file is damaged", file=path, expected="a JSON object")
    return content


def json_text(content: Any) -> str:
    """Return plain data as strict JSON text, numbers that are not finite as ``null``."""
    return json.dumps(_finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _sync_folder(folder: Path) -> None:
    # The new name itself is only safe once the folder is flushed; Windows cannot open a folder for that.
    if sys.platform != "win32":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def is_same_file(copy: Path, path: Path) -> bool:
    """Say whether a place that may be empty holds the very file at `path`."""
    return copy.exists() and path.exists() and copy.samefile(path)


def check_targets(
    targets: Iterable[str | Path | None], read: Iterable[str | Path], *, makes_folder: bool = False
) -> None:
    """Refuse targets that cannot be written, or lie where a file is read; to be called before anything is computed.

    Parameters
    ----------
    targets
        The files to be written; ``None`` stands for one that nobody asked for.
    read
        The files that are read: the case, its data, tests.
    makes_folder
        Whether the folder of a target is made where it is missing.

    Raises
    ------
    InputError
        If a target is one of the files that are read, under whatever name, is a folder, lies in none, may not be
        written, or stands twice.
    """
    sources = [Path(path) for path in read]
    seen: set[Path] = set()
    for target in (Path(path) for path in targets if path is not None):
        if any(is_same_file(target, source) for source in sources):
            problem = "this file is read here, and what is to be written would replace it"
            raise InputError(problem, file=target, expected="another name for what is written")
        with writing(target):
            if target.is_dir():
                raise InputError("this is a folder", file=target, expected="the name of a file")
            if target.exists():
                if not os.access(target, os.W_OK):
                    raise UnwritableError("the file cannot be written: there is no right to", file=target)
            elif makes_folder or target.parent.is_dir():
                check_folder(target.parent)
            else:
                raise InputError("there is no such folder", file=target, value=str(target.parent))
            if target.resolve() in seen:
                raise InputError("two things are to be written into this file", file=target, expected="a name for each")
            seen.add(target.resolve())


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made, or written into; nothing is made there yet.

    Raises
    ------
    InputError
        If it is a file or in one, or may not be written.
    """
    with writing(folder, "the folder cannot be made"):
        there = next(path for path in (folder, *folder.parents) if path.exists())
        if not there.is_dir():
            raise InputError("the folder cannot be made here: this is a file", file=there, expected="a folder")
        if not os.access(there, os.W_OK | os.X_OK):
            problem = "the folder cannot be written: there is no right to"
            raise UnwritableError(problem, file=there, expected="another folder")


class FolderLock:
    """The right to write into a folder; the system gives it back when the process ends, however it ends.

    Raises
    ------
    InputError
        If another writer holds the folder, or the system does not let it be written.
    """

    def __init__(self, folder: Path) -> None:
        with writing(folder / LOCK):
            self._stream = (folder / LOCK).open("a+b")
        try:
            if sys.platform == "win32":
                msvcrt.locking(self._stream.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._stream.close()
            raise InputError(
                "another run is writing into this folder", file=folder, expected="another folder, or that run to end"
            ) from error

    def release(self) -> None:
        """Let another writer have the folder; a second call does nothing."""
        self._stream.close()
