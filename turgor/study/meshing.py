"""From a case to its mesh: for a run every name must be on it; who only looks at the mesh is told which are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.geometry.imported.mesh_file import MeshFile
from turgor.geometry.imported.solid import ImportedSolid
from turgor.geometry.imported.surface import BrokenSurfaceError
from turgor.mesh import Mesh
from turgor.mesh.generate import generate
from turgor.mesh.imported import read_actuator
from turgor.mesh.named_parts import save_fault, save_named_parts
from turgor.mesh.partition import partition
from turgor.study.build import check_names, faults_of_names
from turgor.study.case import Case, Draft, MeshCase
from turgor.study.validation import under

log = logger("study")

USUAL_EXTENT = (1.0, 5000.0)
"""Largest extent in mm of the actuators that people make, from a valve on a chip to an arm; a slip of the unit, which
few files tell, leads out of it."""


def mesh_case(case: Draft, picture: str | Path | None = None) -> Mesh:
    """Return the mesh of a case, and warn of what a run of it would refuse.

    That is every name in its materials, supports and loads that the mesh does not have, and every plane of symmetry
    that no support holds: what is left behind when another `model` of the same shape is meshed.

    Parameters
    ----------
    case
        What to mesh; of a draft only what it says so far is looked at.
    picture
        A .png file that shows which parts have which names, or, where there is no mesh because the surface of an STL
        file is broken, where it is.

    Raises
    ------
    InputError
        If there is no valid mesh.
    """
    try:
        mesh = _divided(case)
    except BrokenSurfaceError as error:
        if picture:
            save_fault(error.points, error.triangles, error.wrong, picture)
        raise
    if picture:
        save_named_parts(mesh, picture)
    for fault in faults_of_names(case, mesh):
        log.warning("%s", fault)
    held = {support.surface for support in case.supports}
    for name in mesh.symmetry_planes:
        if held and name not in held:
            log.warning("supports: nothing holds the cut '%s'; a run needs {type: sliding, surface: %s}", name, name)
    return mesh


def checked_mesh(case: Case) -> Mesh:
    """Return the mesh of a case.

    Raises
    ------
    InputError
        If there is no valid mesh, or a region, surface or cavity of the case is not on it.
    """
    mesh = _divided(case)
    check_names(case, mesh)
    return mesh


def _divided(case: Draft) -> Mesh:
    """Return the mesh of a case with its regions."""
    how = case.mesh
    try:
        if isinstance(case.geometry, MeshFile):
            mesh = read_actuator(case.geometry)
        else:
            mesh = generate(
                case.geometry, how.size, sizes=how.sizes, per_circle=how.per_circle, cells=how.cells, layers=how.layers
            )
    except InputError as error:
        field = (error.key or "").split(".")[0]
        if field in MeshCase.model_fields:
            raise under(error, "mesh") from error
        raise (under(error, "geometry") if field in type(case.geometry).model_fields else error) from error
    _doubt_unit(case, mesh)
    if case.regions:
        spaces = {name: region.where for name, region in case.regions.items()}
        least = {name: region.at_least for name, region in case.regions.items()}
        mesh = partition(mesh, spaces, at_least=least)
    return mesh


def _doubt_unit(case: Draft, mesh: Mesh) -> None:
    """Warn where a body is so small or large that a unit is likely to be another one.

    A template is held against the size of its elements only: its lengths carry their units where they are given.
    """
    extent = np.ptp(mesh.points, axis=0)
    largest, size = float(extent.max()), case.mesh.size
    is_read = isinstance(case.geometry, (ImportedSolid, MeshFile))
    if size is not None and largest < size:
        doubt = f"smaller than an element of mesh.size, {size:g} mm, in all directions"
    elif is_read and not USUAL_EXTENT[0] <= largest <= USUAL_EXTENT[1]:
        doubt = f"{'smaller' if largest < USUAL_EXTENT[0] else 'larger'} than actuators are"
    else:
        return
    unit = case.geometry.model_dump(mode="json").get("unit")
    if not is_read:
        key, check = "mesh.size", "check the unit"
    elif unit:
        key, check = "geometry.unit", f"is '{unit}' its unit?"
    else:
        key, check = "geometry.file", "check the unit of the file"
    log.warning("%s: the body is %s mm, %s; %s", key, " × ".join(f"{x:.5g}" for x in extent), doubt, check)
