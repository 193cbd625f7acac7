"""Measures of stress over a surface, over a region, and across the interface of two materials."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.fem.fields import weighted_percentile
from turgor.fem.interface import interface_name
from turgor.fem.section import depth, surface_areas
from turgor.mesh.cells import determinants, face_cell, jacobians
from turgor.results.measures.registry import measure
from turgor.results.stored import Body, StoredState

FloatArray = npt.NDArray[np.float64]


@measure(
    "von_mises_{surface}_{region}_max_MPa",
    "von_mises_{surface}_{region}_p99_MPa",
    "von_mises_{surface}_{region}_mean_MPa",
)
def von_mises(state: StoredState, *, surface: str | None = None, region: str | None = None) -> FloatArray:
    """Von Mises stress in MPa over a surface (by area), a region or the whole body (by volume): largest, p99, mean.

    At a sharp corner the largest value grows without bound as the mesh is refined; the 99th percentile, exceeded on one
    per cent of the area or volume only, and the mean do not. Areas and volumes are those at rest; the nodal stress of
    the state is interpolated between the nodes.
    """
    if surface is not None and region is not None:
        raise InputError("a surface and a region are given", key="region", expected="only one of the two")
    faces = state.body.mesh.surface(surface) if surface is not None else None
    values, weights = (
        _over_region(state.body, state.record.von_mises, region)
        if faces is None
        else _over_surface(state.body, state.record.von_mises, faces)
    )
    mean = float(values @ weights / weights.sum())
    nodes = np.unique(faces) if faces is not None else np.unique(_cells(state.body, region))
    return np.array([state.record.von_mises[nodes].max(), weighted_percentile(values, weights, 0.99), mean])


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
    found = state.record.standing.get("interfaces", {})
    facts = found.get(interface_name(first, second)) or found.get(interface_name(second, first)) or {}
    return np.array([facts.get(key, 0.0) for key in _INTERFACE])


_INTERFACE = ("traction_max_MPa", "traction_p99_MPa", "traction_mean_MPa", "normal_max_MPa", "shear_max_MPa")


def _over_surface(body: Body, nodal: FloatArray, faces: npt.NDArray[np.int32]) -> tuple[FloatArray, FloatArray]:
    """Return values and areas at the quadrature points of faces, each flat."""
    _, areas = surface_areas(body.mesh.points, faces, body.mechanics)
    values = nodal[faces] @ face_cell(faces).shape_at_quadrature.T
    return values.ravel(), areas.ravel()


def _over_region(body: Body, nodal: FloatArray, region: str | None) -> tuple[FloatArray, FloatArray]:
    """Return values and volumes at the quadrature points of cells, each flat."""
    cells, kind = _cells(body, region), body.mesh.cell
    nodes = body.mesh.points[cells]
    places = np.einsum("qa,mai->mqi", kind.shape_at_quadrature, nodes)
    volumes = determinants(jacobians(nodes, kind)) * kind.weights * depth(body.mechanics, places)
    return (nodal[cells] @ kind.shape_at_quadrature.T).ravel(), volumes.ravel()


def _cells(body: Body, region: str | None) -> npt.NDArray[np.int32]:
    return body.mesh.cells if region is None else body.mesh.cells[body.mesh.region(region)]
