"""What became of an inflation, and whether it is true: written apart from the solver's own checks."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from turgor.fem.system import System
from turgor.materials.stability import drucker_margin
from turgor.solver.linear import make_linear_solver
from turgor.solver.newton import Equilibrium, NewtonOptions
from turgor.solver.path import LimitPressureError
from turgor.solver.volume import VolumeWalk

STEP = 2e-5
"""Size of the finite difference, in parts of the shortest edge."""

STATIONARY = 1e-4
"""Slope of the energy that counts as none, in parts of the pressure's own."""

DISTORTED = 0.3
"""Smallest det F at an integration point below which the mesh is to blame: in the continuum it stays near 1."""


@dataclass(frozen=True)
class Look:
    """What an equilibrium looks like.

    ``slope`` is the largest derivative of the energy along three random directions, in parts of the pressure's part of
    it. The other extremes are over the integration points; the Drucker margin is 2 in a material at rest and below 0
    where it has lost its stability.
    """

    slope: float
    smallest_jacobian: float
    largest_stretch: float
    smallest_stretch: float
    drucker_margin: float


def look(system: System, found: Equilibrium) -> Look:
    """Look at an equilibrium."""
    u = found.state.u
    gradient = deformation_gradients(system, u)
    det = np.linalg.det(gradient)
    stretches = np.linalg.svd(gradient, compute_uv=False)
    return Look(
        slope=energy_slope(system, found),
        smallest_jacobian=float(det.min()),
        largest_stretch=float(stretches.max()),
        smallest_stretch=float(stretches.min()),
        drucker_margin=smallest_margin(system, stretches, det),
    )


def deformation_gradients(system: System, u: np.ndarray) -> np.ndarray:
    """Return F ``(m, 4, 3, 3)`` at four points of every ten-node tetrahedron."""
    near, far = (5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20
    points = np.full((4, 4), near) + (far - near) * np.eye(4)
    gradient = np.array([_shape_gradients(point) for point in points])
    nodes = system.mesh.cells
    reference = np.einsum("mai,qaj->mqij", system.mesh.points[nodes], gradient)
    current = np.einsum("mai,qaj->mqij", system.mesh.points[nodes] + u[nodes], gradient)
    return current @ np.linalg.inv(reference)


def _shape_gradients(barycentric: np.ndarray) -> np.ndarray:
    """Return ∂N/∂ξ ``(10, 3)`` of the ten-node tetrahedron at barycentric coordinates ``(4,)``."""
    L = barycentric
    dL = np.vstack([-np.ones(3), np.eye(3)])
    corners = [(4 * L[a] - 1) * dL[a] for a in range(4)]
    edges = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    return np.array(corners + [4 * (L[a] * dL[b] + L[b] * dL[a]) for a, b in edges])


def smallest_margin(system: System, stretches: np.ndarray, det: np.ndarray) -> float:
    """Return the smallest Drucker margin at the isochoric part of the stretches ``(m, 4, 3)``."""
    isochoric = stretches / np.cbrt(np.maximum(det, 1e-12))[..., None]
    margins = [drucker_margin(solid.material, isochoric[solid.index]).min() for solid in system.solids]
    return float(np.min(margins))


def energy_slope(system: System, found: Equilibrium) -> float:
    """Return the largest |dΠ/dε| along random free directions, in parts of the pressures' work along them.

    Central differences of the energy alone: the forces and the stiffness, which the solver relies on, do not enter.
    """
    rng = np.random.default_rng(0)
    edge = float(np.cbrt(min(solid.volume.min() for solid in system.solids)))
    state = found.state
    worst = 0.0
    for _ in range(3):
        direction = system.nodal(rng.standard_normal(system.n_dofs))
        direction *= STEP * edge / np.abs(direction).max()
        ahead, behind = (system.energy(system.consistent(state.u + s * direction, state.loads)) for s in (1.0, -1.0))
        work = np.linalg.norm(system.load_direction(state)) * found.fraction * np.linalg.norm(direction)
        worst = max(worst, abs(ahead - behind) / (2.0 * work))
    return worst


def limit_is_confirmed(system: System, error: LimitPressureError) -> bool:
    """Say whether volume control, started afresh at the limit, finds lower pressures at larger volumes."""
    limit = error.limit.equilibrium
    linear = make_linear_solver(system.pattern.row_start, system.pattern.column)
    growth = system.conjugate(limit.state) - system.conjugate(system.reference_state())
    walk = VolumeWalk(system, linear, limit, 0.05 * growth, NewtonOptions())
    beyond = list(itertools.islice(walk, 2))
    return error.limit.maximum and bool(beyond) and all(found.fraction < limit.fraction for found in beyond)


def reached_pressure(system: System, found: Equilibrium) -> float:
    """Return the pressure in the cavities of an equilibrium, MPa."""
    values = [found.state.loads[cavity.channel] for cavity in system.cavities]
    return float(max(values))
