"""YAML as case files use it: plain data, YAML 1.2 numbers, no tags, no aliases, no key twice.

PyYAML's safe loader is narrowed rather than configured, for three reasons: it keeps the last of two equal
keys in silence, it reads ``1e-9`` as text and ``1:3`` as the number 63 (YAML 1.1), and its aliases let a
short file stand for an enormous one.
"""

from __future__ import annotations

import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from turgor.common.errors import InputError

MAX_BYTES = 1_000_000
"""Largest case file that is read; a case is a page of text, not a data set."""

_CORE_RESOLVERS = (
    ("tag:yaml.org,2002:null", r"~|null|Null|NULL|", "~nN\0"),
    ("tag:yaml.org,2002:bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("tag:yaml.org,2002:int", r"[-+]?[0-9]+", "-+0123456789"),
    (
        "tag:yaml.org,2002:float",
        r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
        "-+0123456789.",
    ),
)


class _CaseLoader(yaml.SafeLoader):
    """A safe loader of YAML 1.2's core schema without tags, aliases and repeated keys."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 (PyYAML's own attribute)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise _RefusedError("an alias (*name) is not allowed here", event.start_mark, "the value itself")
        tag = getattr(event, "tag", None)
        if tag not in (None, "!"):
            raise _RefusedError(f"the tag {tag} is not allowed here", event.start_mark, "a plain value")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        mapping: dict[Hashable, Any] = {}
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, (str, int)) or isinstance(key, bool):
                raise _RefusedError(f"{key!r} cannot be a key", key_node.start_mark, "a word")
            name = str(key)  # `1:` under a list of names means the name "1"
            if name in mapping:
                raise _RefusedError(f"the key '{name}' is given twice", key_node.start_mark, "every key once")
            mapping[name] = self.construct_object(value_node, deep=deep)
        return mapping


for _tag, _pattern, _first in _CORE_RESOLVERS:
    _starts = ["" if character == "\0" else character for character in _first]
    _CaseLoader.add_implicit_resolver(_tag, re.compile(rf"^(?:{_pattern})$"), _starts)


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    return int(loader.construct_scalar(node))  # PyYAML would read 010 as octal


_CaseLoader.add_constructor("tag:yaml.org,2002:int", _integer)


class _RefusedError(Exception):
    """Well-formed YAML that a case file may not hold."""

    def __init__(self, problem: str, mark: Any, expected: str) -> None:
        super().__init__(problem)
        self.line, self.expected = mark.line + 1 if mark else 0, expected


def read_mapping(path: str | Path) -> dict[str, Any]:
    """Read a YAML file whose top is a mapping.

    Raises
    ------
    InputError
        If the file is missing, too long, not UTF-8 text, not YAML, empty, or not a mapping.
    """
    path = Path(path)
    text = _read_text(path)
    try:
        data = parse(text)
    except InputError as error:
        raise error.at(file=path) from error
    if data is None:
        raise InputError("the file is empty", file=path, expected="a case: geometry, materials, mesh, supports, loads")
    if not isinstance(data, dict):
        raise InputError("the file holds no keys", file=path, value=data, expected="'key: value' lines")
    return data


def parse(text: str) -> Any:
    """Turn YAML `text` into dictionaries with text keys, lists, text, numbers, booleans and ``None``.

    Raises
    ------
    InputError
        If the text is not YAML, or holds a tag, an alias, a repeated key or nesting beyond measure.
    """
    try:
        return yaml.load(text, Loader=_CaseLoader)
    except _RefusedError as error:
        raise InputError(f"line {error.line}: {error}", expected=error.expected) from error
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(f"{line}this is not YAML: {error.problem or error.context}") from error
    except yaml.YAMLError as error:
        raise InputError(f"this is not YAML: {' '.join(str(error).split())}") from error
    except (RecursionError, ValueError) as error:  # nested too deep; an integer of thousands of digits
        reason = "nested too deeply" if isinstance(error, RecursionError) else "a number that cannot be read"
        raise InputError(f"this is not a case: {reason}") from error


def _read_text(path: Path) -> str:
    if not path.exists():
        raise InputError("there is no such file", file=path)
    if not path.is_file():
        raise InputError("this is not a file", file=path, expected="a YAML file")
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"the file cannot be read ({error.strerror})", file=path) from error
    if len(data) > MAX_BYTES:
        raise InputError("the file is too long for a case", file=path, expected=f"at most {MAX_BYTES} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"byte {error.start + 1} is not UTF-8 text", file=path, expected="a text file") from error


def override(data: dict[str, Any], assignment: str) -> None:
    """Set one key of `data` in place from ``key.path=value``.

    List items are numbered from 0 (``loads.0.value``); mappings that are absent are made; the value is YAML.

    Raises
    ------
    InputError
        If the assignment has no ``=``, or its path meets a value that holds no keys or no such item.
    """
    path, equals, text = assignment.partition("=")
    path = path.strip()
    parts = path.split(".")
    if not equals or not all(parts):
        raise InputError(
            "this is not an assignment",
            file="--set",
            value=assignment,
            expected="key.path=value, as in mesh.size='3 mm'",
        )
    try:
        value = parse(text)
    except InputError as error:
        raise error.at(file="--set", key=path) from error
    here: Any = data
    for depth, part in enumerate(parts):
        is_last = depth == len(parts) - 1
        if isinstance(here, dict):
            if is_last:
                here[part] = value
            elif here.get(part) is None:
                here[part] = {}
            here = here[part]
        elif isinstance(here, list):
            index = _list_index(part, here, path)
            if is_last:
                here[index] = value
            here = here[index]
        else:
            parent = ".".join(parts[:depth])
            raise InputError(
                f"'{parent}' holds no keys", file="--set", key=path, value=here, expected="a mapping or list"
            )


def _list_index(part: str, items: list[Any], path: str) -> int:
    if not part.isdecimal() or int(part) >= len(items):
        last = len(items) - 1
        expected = f"an item number from 0 to {last}" if items else "a list that is not empty"
        raise InputError("there is no such item in the list", file="--set", key=path, value=part, expected=expected)
    return int(part)
