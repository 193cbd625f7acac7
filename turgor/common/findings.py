"""What would be right where pydantic finds something wrong, in the user's words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic_core import ErrorDetails

_EXPECTED = {
    "model_type": "'key: value' lines",
    "model_attributes_type": "'key: value' lines",
    "union_tag_not_found": "'key: value' lines",
    "dict_type": "'key: value' lines",
    "tuple_type": "a list",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_parsing": "true or false",
    "bool_type": "true or false",
}
"""By pydantic's kinds of findings."""

_TYPES = {
    "string": "text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "array": "a list",
    "object": "'key: value' lines",
}
"""By the types of JSON Schema."""


def what_fits(finding: ErrorDetails) -> str:
    """Return what would fit where a value does not."""
    known = _EXPECTED.get(finding["type"]) or finding.get("ctx", {}).get("expected")
    return str(known or finding["msg"].removeprefix("Input should be ").removeprefix("Value error, "))


def what_is_missing(model: type[BaseModel], place: Sequence[str | int]) -> str | None:
    """Return what belongs at a place of a model where nothing is; ``None`` if its schema does not know the place.

    Parameters
    ----------
    model
        The outermost model that was read.
    place
        As pydantic tells it: keys, numbers of items, and tags of unions.
    """
    node = next(_nodes(model, place), None)
    if node is None:
        return None
    if "enum" in node:
        return f"one of: {', '.join(map(str, node['enum']))}"
    wanted = node.get("description") or _TYPES.get(node.get("type", ""))
    if wanted == _TYPES["object"] and node.get("properties"):
        wanted += f" ({', '.join(node['properties'])})"
    example = f", such as '{node['examples'][0]}'" if node.get("examples") else ""
    return f"{wanted}{example}" if wanted else None


def what_types(model: type[BaseModel], place: Sequence[str | int]) -> str | None:
    """Return the tags that the alternatives at a place of a model are told apart by; ``None`` without any."""
    tagged = (node["discriminator"]["mapping"] for node in _nodes(model, place) if "discriminator" in node)
    tags = next(tagged, None)
    return f"one of: {', '.join(sorted(tags))}" if tags else None


def _nodes(model: type[BaseModel], place: Sequence[str | int]) -> Iterator[Any]:
    """Return what the JSON Schema of a model says at a place, one alternative after the other."""
    schema = model.model_json_schema()
    return _reached(schema, place, schema.get("$defs", {}))


def _reached(node: Mapping[str, Any], place: Sequence[str | int], parts: Mapping[str, Any]) -> Iterator[Any]:
    """Yield what a JSON Schema says at a place; alternatives that have it one after the other."""
    if "$ref" in node:
        # What describes a model is its docstring, which says what it is and not what to write.
        named = {key: value for key, value in parts[node["$ref"].rsplit("/", 1)[1]].items() if key != "description"}
        node = {**named, **{key: value for key, value in node.items() if key != "$ref"}}
    if not place:
        yield node
        return
    first, rest = place[0], place[1:]
    tagged = node.get("discriminator", {}).get("mapping", {})
    if first in tagged:
        yield from _reached({"$ref": tagged[first]}, rest, parts)
        return
    for alternative in (*node.get("oneOf", ()), *node.get("anyOf", ())):
        yield from _reached(alternative, place, parts)
    items = node.get("prefixItems", ())
    if isinstance(first, int):
        if first < len(items) or "items" in node:
            yield from _reached(items[first] if first < len(items) else node["items"], rest, parts)
    elif first in node.get("properties", {}):
        yield from _reached(node["properties"][first], rest, parts)
    elif first.startswith("("):  # a tag that is no key: what it stands for is told by the keys behind it
        yield from _reached(node, rest, parts)
    elif isinstance(node.get("additionalProperties"), dict):
        yield from _reached(node["additionalProperties"], rest, parts)
