"""From pydantic's findings to one message that names the key, the value and what would be right."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from turgor.common.errors import InputError
from turgor.common.findings import what_fits, what_is_missing, what_types


class StrictModel(BaseModel):
    """A part of a case: unknown keys are refused by name, values do not change after construction."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys_only(cls, data: object) -> object:
        # Done here and not left to pydantic, which does not tell the keys that are known at that place.
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    context = {"key": str(key), "expected": suggestion(str(key), cls.model_fields)}
                    raise PydanticCustomError("unknown_key", "unknown key", context)
        return data


def inlined(schema: Any, parts: Mapping[str, Any]) -> Any:
    """Return a JSON Schema with each reference replaced by the part that it names, inside itself by any object."""
    if isinstance(schema, list):
        return [inlined(item, parts) for item in schema]
    if not isinstance(schema, dict):
        return schema
    rest = {key: inlined(value, parts) for key, value in schema.items() if key != "$ref"}
    if "$ref" not in schema:
        return rest
    name = schema["$ref"].rsplit("/", 1)[1]
    return {**inlined(parts[name], {**parts, name: {"type": "object"}}), **rest}


def suggestion(name: str, known: Iterable[str]) -> str:
    """Say which of the `known` names was probably meant, or list them all."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names, n=max(1, len(names)))
    nearest = sorted(other for other in close if _likeness(name, other) == _likeness(name, close[0]))
    listing = ", ".join(names) if names else "nothing"
    if not 1 <= len(nearest) <= _MOST_NAMED:
        return f"one of: {listing}"
    return f"{' or '.join(repr(other) for other in nearest)} (of: {listing})"


_MOST_NAMED = 3
"""Of names that are as near to the one that is wrong; more of them are only listed."""


def _likeness(name: str, other: str) -> float:
    return difflib.SequenceMatcher(None, other, name).ratio()


def explain(error: ValidationError, data: object, model: type[BaseModel]) -> InputError:
    """Turn the first of pydantic's findings about `data`, read as a `model`, into an InputError without its file."""
    findings = error.errors(include_url=False)
    # A misspelt key is also a missing one, and a list whose item is wrong is also too short: the cause comes first.
    findings.sort(key=lambda finding: finding["type"] in {"missing", "too_short"})
    finding = findings[0]
    key = ".".join(_path(finding, data))
    cause = finding.get("ctx", {}).get("error")
    original = getattr(cause, "__cause__", None) or cause
    if isinstance(original, InputError):
        return under(original, key) if key else original
    problem, value, expected = _words(finding)
    if finding["type"] == "missing":
        expected = what_is_missing(model, finding["loc"])
    elif finding["type"] == "union_tag_not_found":
        expected = what_types(model, finding["loc"]) or expected
    return InputError(problem, key=key or None, value=value, expected=expected)


def under(error: InputError, prefix: str) -> InputError:
    """Return a copy of `error` whose key lies under `prefix`."""
    key = f"{prefix}.{error.key}" if error.key else prefix
    return InputError(error.problem, file=error.file, key=key, value=error.value, expected=error.expected)


def invalid(problem: str, *, key: str | None = None, value: object = None, expected: str | None = None) -> ValueError:
    """Return the error that a validator raises, for pydantic to add the place and :func:`explain` to word."""
    error = ValueError(problem)
    error.__cause__ = InputError(problem, key=key, value=value, expected=expected)
    return error


@contextlib.contextmanager
def collected(key: str | None = None) -> Iterator[None]:
    """Hand an InputError of a room below to pydantic, which adds the place; :func:`explain` words it.

    `key` is the part of the place that pydantic does not know, where a validator looks at several keys.
    """
    try:
        yield
    except InputError as error:
        # Without its key, which names the argument of a function rather than the place in the case.
        placed = InputError(error.problem, key=key, value=error.value, expected=error.expected)
        raise ValueError(error.problem) from placed


def _words(finding: ErrorDetails) -> tuple[str, object, str | None]:
    """Return the problem, the value to show (``None``: nothing) and what would be right."""
    context = finding.get("ctx", {})
    kind, value = finding["type"], finding["input"]
    if kind == "unknown_key":
        return "unknown key", None, context["expected"]
    if kind == "extra_forbidden":
        return "unknown key", None, None
    if kind == "missing":
        return "this key is missing", None, None
    if kind == "union_tag_invalid":
        tags = [tag.strip(" '") for tag in context["expected_tags"].split(", ")]
        return f"unknown {_tag_key(finding)}", context["tag"], suggestion(context["tag"], tags)
    if kind == "union_tag_not_found" and isinstance(value, dict):
        return "this key is missing", None, f"the {_tag_key(finding)}"
    if kind == "too_short":
        least, found = context["min_length"], context["actual_length"]
        problem = f"this has {found} of at least {least} entries" if found else "this is empty"
        return problem, None, f"at least {'one entry' if least == 1 else f'{least} entries'}"
    problem = "this key has no value" if value is None else "this value does not fit"
    return problem, value, what_fits(finding)


def _tag_key(finding: ErrorDetails) -> str:
    return str(finding.get("ctx", {}).get("discriminator", "kind")).strip("'()_").replace("_", " ")


def _path(finding: ErrorDetails, data: object) -> list[str]:
    """Return the keys as the user wrote them, without the union tags that pydantic puts between them."""
    path: list[str] = []
    here: Any = data
    location = finding["loc"]
    for depth, part in enumerate(location):
        inside = (isinstance(here, dict) and part in here) or (
            isinstance(here, list) and isinstance(part, int) and part < len(here)
        )
        if inside:
            path.append(str(part))
            here = here[part]
        elif finding["type"] == "missing" and depth == len(location) - 1:
            path.append(str(part))
    if finding["type"] == "unknown_key":
        path.append(finding["ctx"]["key"])
    if finding["type"].startswith("union_tag") and isinstance(here, dict):
        path.append(_tag_key(finding))
    return path
