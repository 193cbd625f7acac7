"""The templates by name, found in this package: one file each, none listed by hand."""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
from types import MappingProxyType
from typing import Any

from turgor import geometry
from turgor.common.errors import InputError
from turgor.geometry.actuator import Actuator


@functools.cache
def templates() -> MappingProxyType[str, type[Actuator]]:
    """Return every actuator template of the package by its name, in alphabetical order."""
    found: dict[str, type[Actuator]] = {}
    for module in pkgutil.iter_modules(geometry.__path__, f"{geometry.__name__}."):
        for _, kind in inspect.getmembers(importlib.import_module(module.name), inspect.isclass):
            if issubclass(kind, Actuator) and not inspect.isabstract(kind):
                found[kind.template] = kind
    return MappingProxyType(dict(sorted(found.items())))


def template(name: str) -> type[Actuator]:
    """Return the template called `name`; raise InputError listing the names if there is none."""
    if name not in templates():
        raise InputError("there is no such template", value=name, expected="one of: " + ", ".join(templates()))
    return templates()[name]


def actuator(name: str, **parameters: Any) -> Actuator:
    """Return the actuator of template `name` with the given `parameters`; raise InputError as its constructor does."""
    return template(name)(**parameters)
