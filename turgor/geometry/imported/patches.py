"""Facets of a repaired surface handed to gmsh, divided at their edges into patches that can be meshed anew."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from turgor.common.errors import InputError
from turgor.geometry import cad
from turgor.geometry.actuator import FloatArray
from turgor.geometry.imported.parts import Patch
from turgor.geometry.imported.surface import Surface, edges_of

Ints = NDArray[np.int64]


def draw_patches(surface: Surface, angle: float) -> list[list[Patch]]:
    """Draw the surface into the current model and return the patches of each shell.

    Parameters
    ----------
    surface
        Closed shells.
    angle
        Radians by which facets turn, at least, where one patch ends and the next begins.

    Raises
    ------
    InputError
        If gmsh cannot make a geometry of the facets.
    """
    model = cad.kernel().model
    for number, shell in enumerate(surface.shells, start=1):
        nodes = np.unique(shell.triangles)
        model.addDiscreteEntity(2, number)
        model.mesh.addNodes(2, number, nodes + 1, surface.points[nodes].ravel())
        model.mesh.addElementsByType(number, 2, [], shell.triangles.ravel() + 1)
    try:
        model.mesh.classifySurfaces(angle, True, True, math.pi)
        model.mesh.createGeometry()
    except Exception as error:  # gmsh raises bare Exceptions that carry its own text
        expected = "another feature_angle, or a surface with better facets"
        raise InputError(
            f"gmsh cannot divide the surface into faces: {error}", key="file", expected=expected
        ) from error
    first_facet = {}
    for _, tag in model.getEntities(2):
        nodes = model.mesh.getElementsByType(2, tag)[1][:3].astype(np.int64) - 1
        first_facet[tuple(sorted(nodes.tolist()))] = int(tag)
    return [_joined(surface.points, shell.triangles, first_facet, angle) for shell in surface.shells]


def _joined(points: FloatArray, triangles: Ints, first_facet: dict[tuple[int, ...], int], angle: float) -> list[Patch]:
    """Return the smooth parts of a shell, each with the tags of the faces whose first facet lies in it."""
    part = _smooth_parts(points, triangles, angle)
    tags: dict[int, list[int]] = {}
    for facet, number in zip(map(tuple, np.sort(triangles, axis=1).tolist()), part.tolist(), strict=True):
        if facet in first_facet:
            tags.setdefault(number, []).append(first_facet[facet])
    return [Patch(tuple(own), points[triangles[part == number]]) for number, own in sorted(tags.items())]


def _smooth_parts(points: FloatArray, triangles: Ints, angle: float) -> Ints:
    """Number the parts of a shell whose facets turn by less than `angle` from one to the next, ``(k,)``."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edge, _ = edges_of(triangles)
    first, second = (np.arange(len(triangles)).repeat(3)[np.argsort(edge.ravel(), kind="stable")].reshape(-1, 2)).T
    smooth = np.einsum("ei,ei->e", normals[first], normals[second]) > math.cos(angle)
    graph = coo_matrix((np.ones(smooth.sum()), (first[smooth], second[smooth])), shape=(len(triangles),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
