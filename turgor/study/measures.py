"""Measures as a case file names them: by name, or with parameters as ``{displacement: {at: [0 mm, 0 mm, 9 mm]}}``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import GetJsonSchemaHandler, PlainSerializer, PlainValidator, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from turgor.common.errors import InputError
from turgor.results.measures import MEASURES, Choice
from turgor.study.validation import inlined, suggestion


def _choice(value: object, info: ValidationInfo) -> Choice:
    try:
        return Choice.read(value, (info.context or {}).get("folder"))
    except InputError as error:
        if error.key != "measures":
            raise ValueError(error.problem) from error
        # The key of the whole list is the caller's to name.
        expected = suggestion(value, MEASURES) if isinstance(value, str) else error.expected
        placed = InputError(error.problem, value=error.value, expected=expected)
        raise ValueError(error.problem) from placed


class _MeasureSchema:
    """JSON Schema of a measure: its name, or a mapping from it to its parameters."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        alternatives: list[dict[str, Any]] = [{"enum": list(MEASURES)}]
        for name, entry in MEASURES.items():
            schema = entry.parameters.model_json_schema()
            schema = inlined(schema, schema.pop("$defs", {}))
            one = {"type": "object", "properties": {name: schema}, "required": [name], "additionalProperties": False}
            alternatives.append({**one, "description": (entry.function.__doc__ or "").splitlines()[0]})
        return {"anyOf": alternatives}


MeasureChoice = Annotated[Choice, PlainValidator(_choice), PlainSerializer(Choice.plain), _MeasureSchema]
