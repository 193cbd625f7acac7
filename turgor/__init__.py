"""Turgor: from a tensile test and a shape to the motion of a soft pneumatic actuator.

The names below are the public ones. Each is loaded when first used, so that ``import turgor`` is quick and loads no
heavy package. All that it does is to tell numba where the compiled kernels of these sources are.

>>> import turgor as tg
>>> tg.CappedTube(length="90 mm").length
90.0
"""

from __future__ import annotations

import importlib
import pathlib
from typing import TYPE_CHECKING, Any

from turgor.common.compiled import keep_kernels_by_source

keep_kernels_by_source(pathlib.Path(__file__).parent)

if TYPE_CHECKING:
    from turgor.common.errors import InputError, MissingPackageError, SolverError, TurgorError
    from turgor.geometry.catalogue import template, templates
    from turgor.materials.assessment import assess
    from turgor.materials.fit import fit
    from turgor.materials.library import find as find_material
    from turgor.materials.library import library
    from turgor.materials.registry import create as material
    from turgor.materials.registry import models
    from turgor.mesh.files import check_name as check_mesh_name
    from turgor.mesh.files import read as read_mesh
    from turgor.mesh.files import write as write_mesh
    from turgor.mesh.mesh import Mesh
    from turgor.mesh.picture import check_png
    from turgor.mesh.picture import save_picture as draw_mesh
    from turgor.mesh.quality import quality as mesh_quality
    from turgor.mesh.walls import walls as mesh_walls
    from turgor.results.files import check_targets
    from turgor.study.api import Model
    from turgor.study.case import Case, Draft, load_case, load_draft
    from turgor.study.environment import environment
    from turgor.study.export.write import export_case
    from turgor.study.fitting import fit_document, fit_report_files, write_fit_report, write_material
    from turgor.study.meshing import mesh_case
    from turgor.study.path import Path
    from turgor.study.run import Run, run
    from turgor.study.shapes import (
        Bellows,
        CappedTube,
        FibreTube,
        Honeycomb,
        Membrane,
        PneuNet,
        ReinforcedTube,
        StepFile,
        StlFile,
        preview,
    )
    from turgor.study.specimen import read_tests

__all__ = [
    "Bellows",
    "CappedTube",
    "Case",
    "Draft",
    "FibreTube",
    "Honeycomb",
    "InputError",
    "Membrane",
    "Mesh",
    "MissingPackageError",
    "Model",
    "Path",
    "PneuNet",
    "ReinforcedTube",
    "Run",
    "SolverError",
    "StepFile",
    "StlFile",
    "TurgorError",
    "assess",
    "check_mesh_name",
    "check_png",
    "check_targets",
    "draw_mesh",
    "environment",
    "export_case",
    "find_material",
    "fit",
    "fit_document",
    "fit_report_files",
    "library",
    "load_case",
    "load_draft",
    "material",
    "mesh_case",
    "mesh_quality",
    "mesh_walls",
    "models",
    "preview",
    "read_mesh",
    "read_tests",
    "run",
    "template",
    "templates",
    "write_fit_report",
    "write_material",
    "write_mesh",
]

_HOMES = {
    "turgor.common.errors": ("InputError", "MissingPackageError", "SolverError", "TurgorError"),
    "turgor.geometry.catalogue": ("template", "templates"),
    "turgor.materials.assessment": ("assess",),
    "turgor.materials.fit": ("fit",),
    "turgor.materials.library": ("find_material", "library"),
    "turgor.materials.registry": ("material", "models"),
    "turgor.mesh.files": ("check_mesh_name", "read_mesh", "write_mesh"),
    "turgor.mesh.mesh": ("Mesh",),
    "turgor.mesh.picture": ("check_png", "draw_mesh"),
    "turgor.mesh.quality": ("mesh_quality",),
    "turgor.mesh.walls": ("mesh_walls",),
    "turgor.results.files": ("check_targets",),
    "turgor.study.api": ("Model",),
    "turgor.study.case": ("Case", "Draft", "load_case", "load_draft"),
    "turgor.study.environment": ("environment",),
    "turgor.study.export.write": ("export_case",),
    "turgor.study.fitting": ("fit_document", "fit_report_files", "write_fit_report", "write_material"),
    "turgor.study.path": ("Path",),
    "turgor.study.meshing": ("mesh_case",),
    "turgor.study.run": ("Run", "run"),
    "turgor.study.shapes": (
        "Bellows",
        "CappedTube",
        "FibreTube",
        "Honeycomb",
        "Membrane",
        "PneuNet",
        "ReinforcedTube",
        "StepFile",
        "StlFile",
        "preview",
    ),
    "turgor.study.specimen": ("read_tests",),
}
"""Module → the public names that it defines."""

_RENAMED = {
    "check_mesh_name": "check_name",
    "draw_mesh": "save_picture",
    "find_material": "find",
    "material": "create",
    "mesh_quality": "quality",
    "mesh_walls": "walls",
    "read_mesh": "read",
    "write_mesh": "write",
}
"""Public name → its name at home, where the two differ."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        # Not before it is asked for: it is most of what the import would take, and Ctrl-C is heeded only behind that.
        value = importlib.import_module("importlib.metadata").version("turgor")
    else:
        value = _imported(name)
    globals()[name] = value  # the next access does not come here
    return value


def _imported(name: str) -> Any:
    home = next((module for module, names in _HOMES.items() if name in names), None)
    if home is None:
        raise AttributeError(f"module 'turgor' has no attribute '{name}'")
    return getattr(importlib.import_module(home), _RENAMED.get(name, name))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
