"""The interfaces of two materials in one mesh, and what is carried across them."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from turgor.fem.constitutive import COL, ROW
from turgor.fem.fields import extrapolation, weighted_percentile
from turgor.fem.section import surface_areas
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.mesh.cells import face_cell, face_frames
from turgor.mesh.faces import all_faces, shared_faces

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def interface_name(first: str, second: str) -> str:
    """Return how the interface of two regions is called in results."""
    return f"{first}-{second}"


class Interface:
    """The faces that two regions have in common.

    The traction is σ n, n the normal of the deformed face out of the softer region and σ the Cauchy stress of that
    region with its fibre families, continued linearly from the quadrature points of each element to the face. Across
    the interface the traction is continuous; the stiffer side, whose stresses along the face are larger in the ratio of
    the moduli, would know it less precisely by that ratio.

    Parameters
    ----------
    system
        The body.
    softer, stiffer
        The names of the two regions.
    rows
        Which faces of the softer region they share, as :func:`turgor.mesh.faces.shared_faces` counts them.
    """

    def __init__(self, system: System, softer: str, stiffer: str, rows: Ints) -> None:
        self.name = interface_name(softer, stiffer)
        self._points = system.mesh.points
        self._system, self._solid = system, system.solid_of(softer)
        self.faces = np.ascontiguousarray(all_faces(self._solid.nodes)[rows])
        cell = system.mesh.cell
        self._host, side = np.divmod(rows, len(cell.faces))
        shape = face_cell(self.faces).shape_at_quadrature
        on_side = [extrapolation(cell, shape @ cell.nodes[nodes]) for nodes in cell.faces]
        self._continued = np.array(on_side)[side]
        _, self.area = surface_areas(self._points, self.faces, system.section)

    def traction(self, state: State) -> tuple[Floats, Floats]:
        """Return the traction and the unit normal at the quadrature points of the faces, each ``(k, q, d)``; MPa."""
        d = self._points.shape[1]
        stored = self._continued @ self._system.cauchy_stress(self._solid, state)[self._host]
        stress = np.empty((*stored.shape[:2], 3, 3))
        stress[:, :, ROW, COL] = stored
        stress[:, :, COL, ROW] = stored
        _, normal = face_frames((self._points + state.u[: len(self._points)])[self.faces])
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        return np.einsum("kqij,kqj->kqi", stress[:, :, :d, :d], normal), normal

    def facts(self, state: State) -> dict[str, float]:
        """Return the size of the traction, its tension and its shear in plain values, keys ending in their unit."""
        traction, normal = self.traction(state)
        size = np.linalg.norm(traction, axis=2)
        tension = np.einsum("kqi,kqi->kq", traction, normal)
        shear = np.linalg.norm(traction - tension[:, :, None] * normal, axis=2)
        return {
            "traction_max_MPa": float(size.max()),
            "traction_p99_MPa": weighted_percentile(size.ravel(), self.area.ravel(), 0.99),
            "traction_mean_MPa": float((size * self.area).sum() / self.area.sum()),
            "normal_max_MPa": float(tension.max()),
            "shear_max_MPa": float(shear.max()),
        }


def interfaces(system: System) -> list[Interface]:
    """Return the interfaces of all regions that touch."""
    found = []
    modulus = {name: _modulus(system, name) for name in system.mesh.regions}
    for pair in itertools.combinations(system.mesh.regions, 2):
        softer, stiffer = sorted(pair, key=modulus.__getitem__)
        rows = shared_faces(system.solid_of(softer).nodes, system.solid_of(stiffer).nodes)
        if len(rows):
            found.append(Interface(system, softer, stiffer, rows))
    return found


def _modulus(system: System, region: str) -> float:
    """Return Young's modulus of a region at small strain, MPa, along its fibre families if it has any."""
    solid = system.solid_of(region)
    return 3.0 * solid.material.shear_modulus + sum(family.modulus for family in system.families_in(solid))
