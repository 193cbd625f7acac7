"""Thin sheets in plane stress: the thickness adjusts itself at every quadrature point."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.kernels import PACK
from turgor.fem.section import PlaneStress, Section
from turgor.fem.solid import TANGENT_SIZE, Solid
from turgor.fem.state import State
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]

ACROSS = 2
"""Place of the component across the sheet in the stored order."""
IN_PLANE = (0, 1, 3)

LARGEST_STEP = 0.5
MOST_STEPS = 50
CONVERGED = 1e-12

STARTS = 17
"""Thicknesses of which the one of least energy is where the search begins if it fails from the volume at rest."""


class Sheet(Solid):
    """∫ min over λ₃ of [W(F̄) + U(J)] dV: the stretch λ₃ across the sheet leaves its faces without stress.

    The minimum is found at each quadrature point by Newton's method on ln λ₃, to rounding, so that force and stiffness
    are exact derivatives of the energy. It begins at the volume at rest; where a material that locks does not go there,
    or stiffens so much that nothing is found from there, at the best of some volumes. The volume constraint is met by
    the thickness and puts none on the displacement in the plane: there is nothing to lock, and no pressure to project.
    """

    def worst_jacobian(self, u: Floats) -> tuple[float, int]:
        """Return the smallest det F in the plane over the quadrature points and the mesh cell where it is."""
        super()._find_deformation(u)
        self._now.forget()  # the thickness has not followed
        at = int(np.argmin(self._now.J.min(axis=1)))
        return float(self._now.J[at].min()), int(self.index[at])

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        self._deform(state.u)
        self._respond()
        return float(np.vdot(self._now.density + self.material.volumetric.energy(self._now.J), self.dV))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the strain energy, N mm: nothing lags."""
        del lagged
        return self.energy(state)

    def dilatation(self, state: State, lagged: Floats) -> Floats:
        """Return each element's ratio of volumes, ``(m,)``."""
        del lagged
        self._deform(state.u)
        ratio: Floats = np.einsum("mq,mq->m", self._now.J, self.dV) / self.volume
        return ratio

    def _modes(self, nodes: Floats) -> Floats:
        return np.empty((*self.dV.shape, 0))

    def _pressure(self, dilatation: Floats) -> Floats:
        # The volumetric stress is in the Kirchhoff stress already.
        return np.zeros_like(self.dV)

    def _bulk(self, dilatation: Floats) -> Floats:
        return np.zeros((len(self.dV), 0, 0))

    def _find_deformation(self, u: Floats) -> None:
        super()._find_deformation(u)
        area_ratio = self._now.J.copy()
        self._now.J[:] = 1.0
        failed = self._settle(area_ratio)
        if failed.any():
            self._now.J[failed] = self._best_start(area_ratio)[failed]
            failed = self._settle(area_ratio)
        self._now.J[failed] = np.nan
        self._now.F[:, :, 2, 2] = self._now.J / area_ratio

    def _settle(self, area_ratio: Floats) -> NDArray[np.bool_]:
        """Bring J to the minimum near it; return where that is not found, ``(m, q)``."""
        way = np.zeros_like(area_ratio)
        for _ in range(MOST_STEPS):
            self._now.F[:, :, 2, 2] = self._now.J / area_ratio
            stress, stiffness = self._across()
            locked = ~(np.isfinite(stress) & np.isfinite(stiffness))
            newton = np.clip(-stress / stiffness, -LARGEST_STEP, LARGEST_STEP)
            # From where the material does not go, back half the way.
            way = np.where(locked, 0.5 * way, newton)
            self._now.J *= np.exp(np.where(locked, -way, way))
            moving = np.abs(way) > CONVERGED
            if not moving.any():
                break
        return np.asarray(moving | locked)

    def _best_start(self, area_ratio: Floats) -> Floats:
        """Return the J of least energy, between those that make the first and the second isochoric invariant least.

        By λ₃ these are least at λ₃² = I/2 and 2 A²/I, I the sum of the squared stretches in the plane, A their product.
        """
        half = 0.5 * np.sum(self._now.F[:, :, :2, :2] ** 2, axis=(2, 3))
        first, second = 0.5 * np.log(half), np.log(np.abs(area_ratio)) - 0.5 * np.log(half)
        best, least = np.ones_like(area_ratio), np.full_like(area_ratio, np.inf)
        for part in np.linspace(0.0, 1.0, STARTS):
            self._now.F[:, :, 2, 2] = np.exp(first + part * (second - first))
            self._now.J[:] = area_ratio * self._now.F[:, :, 2, 2]
            energy = self._law()[0].reshape(area_ratio.shape) + self.material.volumetric.energy(self._now.J)
            better = energy < least
            best[better], least[better] = self._now.J[better], energy[better]
        return best

    def _across(self) -> tuple[Floats, Floats]:
        """Return the first and second derivative of the energy by ln λ₃, each ``(m, q)``, MPa."""
        self._respond_fully()
        stress = self._now.tau[:, :, ACROSS]
        curvature = self._now.tangent[:, :, PACK[ACROSS, ACROSS]] + 2.0 * stress
        # Where the energy is not convex yet, go downhill by the bulk modulus.
        return stress, np.where(curvature > 0.0, curvature, self.material.bulk_modulus)

    def _respond_fully(self) -> None:
        """Add the volumetric part to Kirchhoff stress and tangent: J U' 1 and (J² U'' + J U') 1⊗1 − 2 J U' I."""
        super()._find_response()
        pressure = self._now.J * self.material.volumetric.pressure(self._now.J)
        growth = self._now.J**2 * self.material.volumetric.stiffness(self._now.J) + pressure
        for r in range(6):
            if r < 3:
                self._now.tau[:, :, r] += pressure
                for s in range(r, 3):
                    self._now.tangent[:, :, PACK[r, s]] += growth
            self._now.tangent[:, :, PACK[r, r]] -= (2.0 if r < 3 else 1.0) * pressure

    def _find_response(self) -> None:
        """Kirchhoff stress and tangent in the plane, the stretch across it eliminated."""
        self._respond_fully()
        tangent = self._now.tangent.reshape(-1, TANGENT_SIZE)
        across = tangent[:, PACK[ACROSS, ACROSS]]
        for r in IN_PLANE:
            for s in IN_PLANE:
                if s >= r:
                    tangent[:, PACK[r, s]] -= tangent[:, PACK[r, ACROSS]] * tangent[:, PACK[s, ACROSS]] / across


def solids_of(mesh: Mesh, materials: Mapping[str, Hyperelastic], section: Section | None) -> list[Solid]:
    """Return a solid for each region of a mesh, given its material by name; in plane stress they are sheets.

    Raises
    ------
    InputError
        If a region has no material or a material no region.
    """
    for name in materials:
        mesh.region(name)
    missing = sorted(set(mesh.regions) - set(materials))
    if missing:
        raise InputError(
            f"no material is given for region '{missing[0]}'",
            key="materials",
            expected=f"one for each of {', '.join(mesh.regions)}",
        )
    kind = Sheet if isinstance(section, PlaneStress) else Solid
    return [
        kind(mesh.points, mesh.cells[mesh.region(name)], np.asarray(mesh.region(name), np.intp), material, section)
        for name, material in materials.items()
    ]
