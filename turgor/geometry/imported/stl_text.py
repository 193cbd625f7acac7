"""Facets of an STL file, binary or ASCII: what the bytes say, nothing repaired yet."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.log import logger

LOG = logger("geometry")

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_HEADER = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_EXPECTED = "an STL file as it was exported; export it again"
_WORDS = re.compile(rb"\s*solid\b")
_SOLID = re.compile(r"^\s*solid\b[ \t]*([^\n]*)$", re.MULTILINE)
_VERTEX = re.compile(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


@dataclass(frozen=True, eq=False)
class Facets:
    """What an STL file holds.

    Parameters
    ----------
    corners
        ``(k, 3, 3)``, in the unit of the file.
    solid
        Number of the solid that each facet belongs to, ``(k,)``.
    names
        Name of each solid, empty where it has none; a binary file is one solid without a name.
    """

    corners: Floats
    solid: Ints
    names: tuple[str, ...]


def read_facets(path: str | Path) -> Facets:
    """Read an STL file.

    Raises
    ------
    InputError
        If the file is missing, no STL, cut short, or holds a coordinate that is no number.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"the file cannot be read ({error.strerror})", file=path) from error
    try:
        facets = _ascii(data) if _is_ascii(data) else _binary(data, path)
    except InputError as error:
        raise error.at(file=path) from error
    if len(facets.corners) == 0:
        raise InputError("the STL file holds no facet", file=path)
    wrong = ~np.isfinite(facets.corners).all(axis=(1, 2))
    if wrong.any():
        problem = f"{_count(int(wrong.sum()), 'facet')} with a coordinate that is no number"
        raise InputError(problem, file=path, value=f"facet {int(np.argmax(wrong)) + 1}", expected=_EXPECTED)
    return facets


def _is_ascii(data: bytes) -> bool:
    # Binary files may begin with "solid" too; then their facets count what their length says.
    if not _WORDS.match(data):
        return False
    return b"\0" not in data[:_HEADER] and (b"facet" in data[:2000] or b"endsolid" in data[:2000])


def _binary(data: bytes, path: Path) -> Facets:
    promised = int.from_bytes(data[80:_HEADER], "little")
    body = data[_HEADER:]
    found, rest = divmod(len(body), _FACET.itemsize)
    # Text of any kind is no STL: its "number of facets" is four letters and has nothing to do with its length.
    if len(data) < _HEADER or (promised != found and b"\0" not in data):
        raise InputError("this is not an STL file", expected="binary STL, or ASCII that begins with 'solid'")
    if rest and promised > found:
        problem = f"the file is cut short: it promises {promised} facets and ends within facet {found + 1}"
        raise InputError(problem, expected=_EXPECTED)
    if promised != found:
        LOG.warning("%s: its header counts %d facets, the file holds %d; these are read", path, promised, found)
    table = np.frombuffer(body, _FACET, count=found)
    corners = table["corners"].astype(np.float64)
    return Facets(corners, np.zeros(len(corners), dtype=np.int32), ("",))


def _ascii(data: bytes) -> Facets:
    text = data.decode("utf-8", errors="replace")
    if text.count("endsolid") < len(_SOLID.findall(text)):
        raise InputError("the file is cut short: 'endsolid' is missing", expected=_EXPECTED)
    corners, solid, names = [], [], []
    starts = list(_SOLID.finditer(text))
    for number, start in enumerate(starts):
        end = starts[number + 1].start() if number + 1 < len(starts) else len(text)
        vertices = _VERTEX.findall(text, start.end(), end)
        if len(vertices) % 3 or len(vertices) // 3 != text.count("endfacet", start.end(), end):
            raise InputError("a facet of the file has not three vertices", expected=_EXPECTED)
        corners.append(_numbers(vertices).reshape(-1, 3, 3))
        solid.append(np.full(len(vertices) // 3, number, dtype=np.int32))
        names.append(start[1].strip())
    return Facets(np.concatenate(corners), np.concatenate(solid), tuple(names))


def _numbers(vertices: list[tuple[str, ...]]) -> Floats:
    try:
        return np.array(vertices, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(f"a coordinate of the file is no number: {error}", expected=_EXPECTED) from error


def _count(number: int, what: str) -> str:
    return f"there is a {what}" if number == 1 else f"there are {number} {what}s"
