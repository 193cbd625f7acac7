"""Measures of stress over a surface, over a region, and across the interface of two materials."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.fem.fields import weighted_percentile
from turgor.fem.interface import interface_name
from turgor.fem.section import depth, surface_areas
from turgor.mesh.cells import determinants, face_cell, jacobians
from turgor.mesh.faces import shared_faces
from turgor.mesh.mesh import Mesh
from turgor.results.measures.registry import measure
from turgor.results.stored import StoredState

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


@measure(
    "von_mises_{surface}_{region}_max_MPa",
    "von_mises_{surface}_{region}_p99_MPa",
    "von_mises_{surface}_{region}_mean_MPa",
)
def von_mises(state: StoredState, *, surface: str | None = None, region: str | None = None) -> FloatArray:
    """Von Mises stress in MPa over a surface (by area), a region or the whole body (by volume): largest, p99, mean.

    At a sharp corner the largest value grows without bound as the mesh is refined; the 99th percentile, exceeded on one
    per cent of the area or volume only, and the mean do not. Areas and volumes are those at rest. The stress is that of
    each region alone, on a surface of the region whose cells the faces belong to, interpolated between the nodes; the
    largest is over nodes and quadrature points. NaN for several regions in a run that was stored without that of each.
    """
    if surface is not None and region is not None:
        raise InputError("a surface and a region are given", key="region", expected="only one of the two")
    if surface is not None:
        parts = [_on_faces(state, name, faces) for name, faces in _faces_by_region(state.mesh, surface)]
    else:
        parts = [_in_region(state, name) for name in (state.mesh.regions if region is None else (region,))]
    at_nodes, values, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
    if np.isnan(at_nodes).any():
        return np.full(3, np.nan)
    largest, mean = max(at_nodes.max(), values.max()), values @ weights / weights.sum()
    return np.array([largest, weighted_percentile(values, weights, 0.99), mean])


@measure(
    "interface_{first}_{second}_traction_max_MPa",
    "interface_{first}_{second}_traction_p99_MPa",
    "interface_{first}_{second}_traction_mean_MPa",
    "interface_{first}_{second}_normal_max_MPa",
    "interface_{first}_{second}_shear_max_MPa",
)
def interface_stress(state: StoredState, *, first: str, second: str) -> FloatArray:
    """Traction in MPa across the interface of two regions: largest, p99 and mean size, largest tension and shear.

    See :class:`turgor.fem.interface.Interface`, from which the state has it. At the rim of an interface the largest
    value grows as the mesh is refined, the 99th percentile by area and the mean do not.
    """
    for key, region in (("first", first), ("second", second)):
        if region not in state.mesh.regions:
            expected = f"one of: {', '.join(state.mesh.regions)}"
            raise InputError("the mesh has no such region", key=key, value=region, expected=expected)
    if not _touch(state.mesh, first, second):
        expected = "two regions that have faces in common"
        raise InputError("the two regions have no interface", key="second", value=second, expected=expected)
    found = state.record.standing.get("interfaces", {})
    facts = found.get(interface_name(first, second)) or found.get(interface_name(second, first)) or {}
    return np.array([facts.get(key, 0.0) for key in _INTERFACE])


_INTERFACE = ("traction_max_MPa", "traction_p99_MPa", "traction_mean_MPa", "normal_max_MPa", "shear_max_MPa")


@lru_cache(maxsize=32)
def _touch(mesh: Mesh, first: str, second: str) -> bool:
    cells = [mesh.cells[mesh.region(name)] for name in (first, second)]
    return first != second and len(shared_faces(*cells)) > 0


def _on_faces(state: StoredState, region: str, faces: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a region's stress at the nodes of its faces and at their quadrature points, and the areas, each flat."""
    _, areas = surface_areas(state.mesh.points, faces, state.body.mechanics)
    at_nodes = state.von_mises_in(region)[faces]
    return at_nodes.ravel(), (at_nodes @ face_cell(faces).shape_at_quadrature.T).ravel(), areas.ravel()


def _in_region(state: StoredState, region: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a region's stress at the nodes of its cells and at their quadrature points, and the volumes, each flat."""
    cells, kind = state.mesh.cells[state.mesh.region(region)], state.mesh.cell
    nodes = state.mesh.points[cells]
    places = np.einsum("qa,mai->mqi", kind.shape_at_quadrature, nodes)
    volumes = determinants(jacobians(nodes, kind)) * kind.weights * depth(state.body.mechanics, places)
    at_nodes = state.von_mises_in(region)[cells]
    return at_nodes.ravel(), (at_nodes @ kind.shape_at_quadrature.T).ravel(), volumes.ravel()


@lru_cache(maxsize=8)
def _faces_by_region(mesh: Mesh, surface: str) -> list[tuple[str, IntArray]]:
    """Return the faces of a surface that belong to cells of each region, where there are any."""
    faces = mesh.surface(surface)
    if len(mesh.regions) == 1:
        return [(name, faces) for name in mesh.regions]
    hosts = mesh.surface_hosts(surface)
    parts = ((name, faces[np.isin(hosts, cells)]) for name, cells in mesh.regions.items())
    return [(name, part) for name, part in parts if len(part)]
