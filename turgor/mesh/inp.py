"""What a .inp file of Abaqus or CalculiX says of the mesh: nodes, elements, sets and surfaces, all with their numbers.

meshio's reader leaves out the surfaces and the numbers by which they name their elements, hence this one.
"""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from turgor.common.errors import InputError
from turgor.mesh.elevate import KINDS
from turgor.mesh.raw import RawMesh
from turgor.mesh.tet10 import IntArray

_KINDS = {
    (3, 4): "tetra",
    (3, 10): "tetra10",
    (3, 8): "hexahedron",
    (3, 20): "hexahedron20",
    (3, 27): "hexahedron27",
    (2, 3): "triangle",
    (2, 6): "triangle6",
    (2, 4): "quad",
    (2, 8): "quad8",
}
_SOLIDS = re.compile(r"C3D(\d+)|(?:CPE|CPS|CAX|S|STRI|M3D)(\d+)", re.IGNORECASE)
"""Elements in space, and in the plane or on a surface, with their number of nodes."""

FACES = {
    "tet10": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hex27": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    "tri6": ((0, 1), (1, 2), (2, 0)),
    "quad9": ((0, 1), (1, 2), (2, 3), (3, 0)),
}
"""Corners of the faces S1, S2, … of each kind of cell in Abaqus's count."""

_BLOCK = re.compile(r"^\*(?!\*)", re.MULTILINE)
"""What begins a block: a star, of which two are a comment."""

_INCLUDE = re.compile(r"\s*INCLUDE\s*(,|$)", re.IGNORECASE | re.MULTILINE)
"""How a block begins that includes a file: the rows of all others are taken apart only once."""

_DEEPEST = 8
"""Files that include each other, one in the other."""

_LONGEST_RANGE = 10_000_000
"""Of the numbers of a set; no mesh that can be solved has more cells or nodes."""


@dataclass
class _Deck:
    """What has been read so far, by the numbers of the file."""

    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[str, dict[int, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    regions: list[str] = field(default_factory=list)
    sections: list[str] = field(default_factory=list)
    surfaces: dict[str, list[tuple[str, int]]] = field(default_factory=dict)


def read_inp(path: Path) -> RawMesh:
    """Read the mesh of a .inp file; raise InputError where it cannot be understood."""
    deck = _Deck()
    _read_into(deck, whole_text(path))
    if not deck.elements:
        raise InputError("the file holds no elements of a kind that is known", expected="C3D10, C3D20, CPS6, …")
    place = {number: k for k, number in enumerate(deck.nodes)}
    cell_of = {number: k for k, number in enumerate(n for elements in deck.elements.values() for n in elements)}
    blocks = [
        (kind, np.array([[_known(place, n) for n in nodes] for nodes in elements.values()], np.int32))
        for kind, elements in deck.elements.items()
    ]
    regions = deck.sections or deck.regions
    return RawMesh(
        np.array(list(deck.nodes.values()), dtype=float),
        blocks,
        {n: np.array([cell_of[e] for e in _set(deck.element_sets, n) if e in cell_of], np.int32) for n in regions},
        {n: np.array([place[k] for k in ids if k in place], np.int32) for n, ids in deck.node_sets.items()},
        {n: found for n, parts in deck.surfaces.items() if len(found := _corners(deck, parts, place))},
    )


def whole_text(path: Path, depth: int = 0, found: list[Path] | None = None) -> str:
    """Return the text of a .inp file with those of the files that it includes where it does so; add all to `found`."""
    if depth > _DEEPEST:
        raise InputError("the files include each other without end")
    if found is not None:
        found.append(path)
    head, *blocks = _BLOCK.split(path.read_text(encoding="utf-8", errors="replace"))
    parts = [head]
    for block in blocks:
        if _INCLUDE.match(block):
            _, options, _ = _taken_apart(block)
            parts.append(whole_text(_included(path, options), depth + 1, found))
        else:
            parts.append(f"*{block}")
    return "".join(part if part.endswith("\n") or not part else f"{part}\n" for part in parts)


def files_of(path: Path) -> list[Path]:
    """Return a .inp file and every file that it includes, however deep, as far as they can be read."""
    found: list[Path] = [path]
    with contextlib.suppress(InputError, OSError):  # told where the mesh is read
        whole_text(path, found=found)
    return list(dict.fromkeys(found))


def _included(path: Path, options: dict[str, str]) -> Path:
    """Return the file that an ``*INCLUDE`` names; raise InputError if it names none or there is no such file."""
    name = options.get("INPUT", "")
    included = path.parent / name
    if not included.is_file():
        problem = "there is no such file to include" if name else "a file is to be included and not named"
        raise InputError(problem, key="*INCLUDE", value=name or None, expected="INPUT=FILE, beside the deck")
    return included


def _read_into(deck: _Deck, text: str) -> None:
    for keyword, options, rows in map(_taken_apart, _BLOCK.split(text)[1:]):
        if keyword == "NODE":
            deck.nodes |= {int(row[0]): [*map(float, row[1:4]), 0.0, 0.0][:3] for row in rows}
            if "NSET" in options:
                deck.node_sets.setdefault(options["NSET"], []).extend(int(row[0]) for row in rows)
        elif keyword == "ELEMENT":
            _add_elements(deck, options, rows)
        elif keyword in ("NSET", "ELSET"):
            sets = deck.node_sets if keyword == "NSET" else deck.element_sets
            sets.setdefault(options[keyword], []).extend(_members(options, rows, sets))
        elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT") == "ELEMENT":
            parts = [(row[0].upper(), int(row[1][1:])) for row in rows if len(row) > 1 and _is_face(row[1])]
            deck.surfaces[options["NAME"]] = parts
        elif keyword == "SOLID SECTION" and options["ELSET"] not in deck.sections:
            deck.sections.append(options["ELSET"])
        elif keyword == "INSTANCE" and any(float(x) for row in rows for x in row):
            raise InputError("an instance is moved or turned in the assembly", expected="a flat file of one part")


def _taken_apart(block: str) -> tuple[str, dict[str, str], list[list[str]]]:
    """Return keyword, options in capitals and rows of a block; names in options are in capitals, file names not."""
    lines = [line for line in block.splitlines() if line.strip() and not line.startswith("**")]
    while len(lines) > 1 and lines[0].rstrip().endswith(","):
        lines[0] += lines.pop(1)
    keyword, *rest = (word.strip() for word in lines[0].split(","))
    pairs = (word.partition("=") for word in rest)
    options = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
    options = {key: value if key == "INPUT" else value.upper() for key, value in options.items()}
    return keyword.upper(), options, [[w.strip() for w in ln.split(",") if w.strip()] for ln in lines[1:]]


def _add_elements(deck: _Deck, options: dict[str, str], rows: list[list[str]]) -> None:
    match = _SOLIDS.match(options["TYPE"])
    size = int(match[1] or match[2]) if match else 0
    kind = _KINDS.get((3 if match and match[1] else 2, size))
    if kind is None:
        return  # springs, trusses and such; that no element is left is told at the end
    numbers = [int(word) for row in rows for word in row]
    if len(numbers) % (size + 1):
        raise InputError("an element has too few or too many nodes", key="*ELEMENT", value=options["TYPE"])
    found = {numbers[k]: numbers[k + 1 : k + 1 + size] for k in range(0, len(numbers), size + 1)}
    deck.elements.setdefault(kind, {}).update(found)
    if "ELSET" in options:
        deck.element_sets.setdefault(options["ELSET"], []).extend(found)
        if options["ELSET"] not in deck.regions:
            deck.regions.append(options["ELSET"])


def _members(options: dict[str, str], rows: list[list[str]], sets: dict[str, list[int]]) -> list[int]:
    if "GENERATE" in options:
        return [number for row in rows for number in _range(row)]
    words = [word for row in rows for word in row]
    return [k for word in words for k in ([int(word)] if word.isdigit() else _set(sets, word.upper()))]


def _range(row: list[str]) -> range:
    first, last, step = [int(word) for word in row] + [1] * (3 - len(row))
    numbers = range(first, last + 1, max(step, 1))
    if step < 1 or len(numbers) > _LONGEST_RANGE:
        expected = f"first, last and a step of 1 or more, at most {_LONGEST_RANGE} numbers"
        raise InputError("this is no range of numbers", key="GENERATE", value=", ".join(row), expected=expected)
    return numbers


def _corners(deck: _Deck, parts: list[tuple[str, int]], place: dict[int, int]) -> IntArray:
    """Return the corners ``(k, c)`` of the faces of a surface, by the places of their nodes."""
    rows = []
    for who, side in parts:
        for number in [int(who)] if who.isdigit() else _set(deck.element_sets, who):
            for kind, elements in deck.elements.items():
                sides = FACES[KINDS[kind].cell]
                if number in elements and side <= len(sides):
                    rows.append([place[elements[number][corner]] for corner in sides[side - 1]])
    return np.array(rows, dtype=np.int32)


def _is_face(word: str) -> bool:
    return re.fullmatch(r"S\d", word, re.IGNORECASE) is not None


def _set(sets: dict[str, list[int]], name: str) -> list[int]:
    if name not in sets:
        raise InputError("a set is named that the file does not define", value=name)
    return sets[name]


def _known(place: dict[int, int], number: int) -> int:
    if number not in place:
        raise InputError("an element has a node that the file does not define", value=number)
    return place[number]
