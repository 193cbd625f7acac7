"""YAML as case files use it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from turgor.common.errors import InputError
from turgor.study.reading import override, parse, read_mapping


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-9", 1e-9),  # text in YAML 1.1
        ("1:3", "1:3"),  # 63 in YAML 1.1
        ("on", "on"),  # True in YAML 1.1
        ("2024-01-01", "2024-01-01"),  # a date in YAML 1.1
        ("010", 10),  # 8 in YAML 1.1
        ("1_000", "1_000"),  # 1000 in YAML 1.1
        ("3", 3),
        ("-.5", -0.5),
        ("'3'", "3"),
        ("3 mm", "3 mm"),
        ("true", True),
        ("~", None),
        ("", None),
    ],
)
def test_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    found = parse(text)
    assert found == value
    assert type(found) is type(value)


def test_keys_are_text() -> None:
    assert parse("{1: a, b: {2: c}}") == {"1": "a", "b": {"2": "c"}}


def test_a_key_twice_is_refused_also_when_written_differently() -> None:
    with pytest.raises(InputError, match="'1' is given twice"):
        parse("{1: a, '1': b}")


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    file = tmp_path / "case.yaml"
    file.write_bytes("a: 1\n".encode("utf-8-sig"))
    assert read_mapping(file) == {"a": 1}


def data() -> dict[str, Any]:
    return {"mesh": {"size": "1 mm"}, "loads": [{"value": "1 kPa"}, {"value": "2 kPa"}], "name": "x", "solver": None}


@pytest.mark.parametrize(
    ("assignment", "path", "value"),
    [
        ("mesh.size=3 mm", ("mesh", "size"), "3 mm"),
        ("loads.1.value=5 kPa", ("loads", 1, "value"), "5 kPa"),
        ("loads.0={type: gravity}", ("loads", 0), {"type": "gravity"}),
        ("solver.steps=4", ("solver", "steps"), 4),
        ("new.inner.key=[1, 2]", ("new", "inner", "key"), [1, 2]),
        ("name=a=b", ("name",), "a=b"),
    ],
)
def test_an_assignment_reaches_its_key_and_nothing_else(assignment: str, path: tuple[Any, ...], value: object) -> None:
    changed = data()
    override(changed, assignment)
    here: Any = changed
    for part in path:
        here = here[part]
    assert here == value
    for key, entry in data().items():
        if key != path[0]:
            assert changed[key] == entry


def test_an_assignment_reports_its_own_yaml() -> None:
    with pytest.raises(InputError, match=r"--set: mesh.size: line 1: this is not YAML"):
        override(data(), "mesh.size=[3")
