"""From a mesh file as a case names it to its mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from turgor.common.errors import InputError
from turgor.geometry.imported.mesh_file import MeshFile
from turgor.geometry.space import Space
from turgor.mesh.cells import face_cell
from turgor.mesh.faces import boundary_faces, places_of_faces
from turgor.mesh.files import read
from turgor.mesh.mesh import Mesh
from turgor.mesh.tet10 import IntArray


def read_actuator(actuator: MeshFile) -> Mesh:
    """Return the mesh of the file in mm, with the names that the case adds.

    Raises
    ------
    InputError
        If the file cannot be read, or a rule selects no face.
    """
    mesh = read(actuator.file)
    points = mesh.points * actuator.unit
    markers = dict(mesh.markers)
    for name, place in (("base", actuator.base), ("tip", actuator.tip)):
        if place is not None:
            away = np.linalg.norm(points - np.array(place)[: mesh.dimension], axis=1)
            markers[name] = np.array([np.argmin(away)], dtype=np.int32)
    curves = {name: curve * actuator.unit for name, curve in mesh.curves.items()}
    scaled = replace(mesh, points=points, markers=markers, curves=curves)
    return replace(scaled, surfaces=_named(scaled, actuator.surfaces)) if actuator.surfaces else scaled


def _named(mesh: Mesh, rules: Mapping[str, Space]) -> dict[str, IntArray]:
    """Return the surfaces with those that rules select; what they hold leaves ``outer``."""
    skin = boundary_faces(mesh.cells)
    surfaces = dict(mesh.surfaces)
    places = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dimension)))
    for name, space in rules.items():
        held = skin[space.contains(places)[skin].all(axis=1)]
        if not len(held):
            raise InputError("no face of the skin lies in this part of space", key=f"surfaces.{name}")
        if "outer" in surfaces:
            left = places_of_faces(held, surfaces["outer"][:, : face_cell(held).n_corners]) < 0
            surfaces["outer"] = surfaces["outer"][left]
            if not left.any():
                del surfaces["outer"]
        surfaces[name] = held
    return surfaces
