"""Fields of an equilibrium for looking at: stress at the nodes, and its extremes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.fem.solid import Solid
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.mesh.cells import Cell

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class VonMises:
    """Von Mises stress of the Cauchy stress, MPa.

    Attributes
    ----------
    by_region
        At the nodes of each region, in the order of :meth:`turgor.mesh.mesh.Mesh.region_nodes`: extrapolated within
        each element from its quadrature points, then averaged over the elements of the region that meet at the node,
        weighted by their volume. Across an interface the stress jumps, so no mean is taken over both sides.
    nodal
        ``(n_points,)``: the same, for pictures; where regions meet, that of the region in which it is larger.
    largest
        Over the quadrature points: at a sharp corner it grows without bound as the mesh is refined.
    percentile_99
        Exceeded in one per cent of the volume only.
    """

    by_region: Mapping[str, Floats]
    nodal: Floats
    largest: float
    percentile_99: float


def von_mises(system: System, state: State) -> VonMises:
    """Return the von Mises stress of a state."""
    mesh = system.mesh
    by_region: dict[str, Floats] = {}
    nodal = np.zeros(mesh.n_points)
    points, volumes = [], []
    for name in mesh.regions:
        solid, nodes = system.solid_of(name), mesh.region_nodes(name)
        at_points = _von_mises(system.cauchy_stress(solid, state))
        by_region[name] = _smoothed(solid, at_points, mesh.n_points)[nodes]
        nodal[nodes] = np.maximum(nodal[nodes], by_region[name])
        points.append(at_points.ravel())
        volumes.append(solid.dV.ravel())
    values = np.concatenate(points)
    percentile = weighted_percentile(values, np.concatenate(volumes), 0.99)
    return VonMises(by_region, nodal, float(values.max()), percentile)


def _smoothed(solid: Solid, at_points: Floats, n_points: int) -> Floats:
    """Return the nodal field ``(n_points,)`` of positive values ``(m, q)`` of a solid, zero where it has no nodes."""
    at_nodes = np.maximum(at_points @ extrapolation(solid.cell, solid.cell.nodes).T, 0.0)
    places, share = solid.nodes.ravel(), np.broadcast_to(solid.volume[:, None], solid.nodes.shape)
    total = np.bincount(places, (share * at_nodes).ravel(), minlength=n_points)
    weight = np.bincount(places, share.ravel(), minlength=n_points)
    return total / np.where(weight > 0.0, weight, 1.0)


def _von_mises(stress: Floats) -> Floats:
    """Return √(3/2 s:s) of symmetric tensors ``(..., 6)`` stored in the order of the kernels."""
    a, b, c = stress[..., 0], stress[..., 1], stress[..., 2]
    shear = (stress[..., 3:] ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3.0 * shear))


def extrapolation(cell: Cell, places: Floats) -> Floats:
    """Return the matrix ``(p, q)`` that continues the linear function fitted to the quadrature points to other places.

    `places` are reference coordinates ``(p, dimension)``. In quadrilaterals and hexahedra the function is linear in
    each coordinate.
    """
    at_places, at_points = (_linear(where, cell.simplex) for where in (places, cell.points))
    return np.asarray(at_places @ np.linalg.pinv(at_points))


def _linear(places: Floats, simplex: bool) -> Floats:
    if simplex:
        return np.column_stack([np.ones(len(places)), places])
    powers = np.array(list(itertools.product((0, 1), repeat=places.shape[1])))
    return np.asarray(np.prod(places[:, None, :] ** powers, axis=2))


def weighted_percentile(values: Floats, weights: Floats, part: float) -> float:
    """Return the value that is exceeded in no more than 1 − `part` of the `weights`; both arrays are flat."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order]) >= part * weights.sum()
    return float(values[order][np.argmax(reached)])
