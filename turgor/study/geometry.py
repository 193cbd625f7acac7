"""The shape as a case file names it: a template and its parameters, or a file."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, GetJsonSchemaHandler, PlainSerializer, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from turgor.common.errors import InputError
from turgor.geometry.actuator import Actuator
from turgor.geometry.catalogue import templates
from turgor.geometry.imported.mesh_file import MeshFile
from turgor.geometry.imported.solid import ImportedSolid
from turgor.geometry.imported.step import StepFile
from turgor.geometry.imported.stl import StlFile
from turgor.study.materials import in_case_folder
from turgor.study.validation import inlined, suggestion, under


def _known() -> dict[str, type[Actuator]]:
    """Return every kind of shape by the name that it has in a case file."""
    return {**templates(), **{kind.template: kind for kind in (StepFile, StlFile, MeshFile)}}


def _actuator(value: object, info: ValidationInfo) -> object:
    """Read ``{template: name, …its parameters}``; a template that is already built passes."""
    if not isinstance(value, dict):
        return value
    parameters = dict(value)
    name = parameters.pop("template", None)
    known = _known()
    if not isinstance(name, str) or name not in known:
        problem = "this key is missing" if name is None else "unknown template"
        raise InputError(problem, key="geometry.template", value=name, expected=suggestion(str(name), known))
    if issubclass(known[name], (ImportedSolid, MeshFile)) and "file" in parameters:
        kind = name if name == MeshFile.template else name.upper()
        parameters["file"] = str(in_case_folder(parameters["file"], info, kind, "file"))
    try:
        return known[name](**parameters)
    except InputError as error:
        raise under(error, "geometry") from error


def _template_and_parameters(actuator: Actuator) -> dict[str, Any]:
    return {"template": actuator.template, **actuator.model_dump(mode="json", exclude_none=True)}


class _GeometrySchema:
    """JSON Schema of the geometry: one alternative a template, so that an editor completes its parameters."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        alternatives = []
        for name, template in _known().items():
            schema = template.model_json_schema()
            # What pydantic refers to from here it would look for in the schema of the whole case.
            schema = inlined(schema, schema.pop("$defs", {}))
            schema["properties"] = {"template": {"const": name}, **schema["properties"]}
            schema["required"] = ["template", *schema.get("required", [])]
            alternatives.append(schema)
        return {"oneOf": alternatives}


Geometry = Annotated[Actuator, BeforeValidator(_actuator), PlainSerializer(_template_and_parameters), _GeometrySchema]
