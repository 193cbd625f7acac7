"""The elastic body: curved ten-node tetrahedra with one mean pressure each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem import constitutive, kernels
from turgor.fem.elements import TET10
from turgor.fem.pattern import packed_size
from turgor.fem.state import State
from turgor.fem.term import add_at_nodes
from turgor.materials.hyperelastic import Hyperelastic, InvariantModel, StretchModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

TANGENT_SIZE = 21


class Solid:
    """∫ W(F̄) dV + Σ_e U(θ_e) V_e over one material region, θ_e the element's ratio of volumes.

    The mean dilatation (Nagtegaal, Parks and Rice 1974; Simo, Taylor and Pister 1985) makes the ten-node
    tetrahedron free of volumetric locking. The dilatations are what lags (:class:`turgor.fem.term.Term`): the
    geometric stiffness uses the pressure U'(θ) of the lagged ones, so that the iteration sees the volume
    constraint as linear and converges in long steps at any bulk modulus.

    Parameters
    ----------
    points, cells
        The mesh: ``(n_points, 3)`` and the region's tetrahedra ``(m, 10)``.
    index
        Places of these tetrahedra among all cells of the mesh, ``(m,)``.
    material
        The hyperelastic law of the region.
    """

    def __init__(self, points: Floats, cells: Ints, index: NDArray[np.intp], material: Hyperelastic) -> None:
        self.nodes = np.ascontiguousarray(cells, dtype=np.int32)
        self.index = index
        self.material = material
        m, q, n = len(cells), len(TET10.weights), cells.shape[1]
        self.G = np.empty((m, q, 3, n))
        self.dV = np.empty((m, q))
        kernels.reference_gradients(points, self.nodes, TET10.gradient_at_quadrature, TET10.weights, self.G, self.dV)
        self.volume = self.dV.sum(axis=1)
        self._F = np.empty((m, q, 3, 3))
        self._J = np.empty((m, q))
        self._dilatation = np.empty(m)
        self._tau = np.empty((m, q, 6))
        self._tangent = np.empty((m, q, TANGENT_SIZE))
        self._force = np.empty((m, n, 3))

    def lagged_at(self, u: Floats) -> Floats:
        """Return each element's ratio of deformed to reference volume at displacement `u`, ``(m,)``."""
        self._deform(u)
        return self._dilatation.copy()

    def worst_jacobian(self, u: Floats) -> tuple[float, int]:
        """Return the smallest det F over the quadrature points and the mesh cell where it is."""
        self._deform(u)
        at = int(np.argmin(self._J.min(axis=1)))
        return float(self._J[at].min()), int(self.index[at])

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        self._deform(state.u)
        density = self._law()[0].reshape(self.dV.shape)
        volumetric = self.material.volumetric.energy(self._dilatation)
        return float(np.sum(density * self.dV) + np.sum(volumetric * self.volume))

    def force(self, state: State, out: Floats) -> None:
        """Add the internal forces, N."""
        self._deform(state.u)
        self._respond()
        pressure = self.material.volumetric.pressure(self._dilatation)
        kernels.element_forces(self._F, self.G, self.dV, self._tau, pressure, self._force)
        add_at_nodes(self.nodes, self._force, out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the element stiffnesses, the pressure condensed."""
        self._deform(state.u)
        self._respond()
        pressure = self.material.volumetric.pressure(lagged)
        bulk = self.material.volumetric.stiffness(lagged)
        assert out.shape[1] == packed_size(3 * self.nodes.shape[1])
        kernels.element_stiffness(self._F, self.G, self.dV, self._tau, self._tangent, pressure, bulk, out)

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return the dilatations that the step `du` (n_points, 3) predicts, linearised at the state, ``(m,)``."""
        self._deform(state.u)
        kernels.volume_gradients(self._F, self.G, self.dV, self._force)
        change = np.einsum("ean,ean->e", self._force, du[self.nodes])
        return np.asarray(self._dilatation + change / self.volume)

    def cauchy_stress(self, state: State) -> Floats:
        """Return the Cauchy stress at the quadrature points in the stored symmetric order, ``(m, q, 6)``, MPa."""
        self._deform(state.u)
        self._respond()
        pressure = self.material.volumetric.pressure(self._dilatation)
        stress = self._tau / self._J[:, :, None]
        stress[:, :, :3] += pressure[:, None, None]
        return np.asarray(stress)

    def _deform(self, u: Floats) -> None:
        kernels.deformation(u, self.nodes, self.G, self.dV, self._F, self._J, self._dilatation)

    def _law(self) -> tuple[Floats, ...]:
        # Evaluate the material; for a law in stretches, the principal directions come last.
        F, J = self._F.reshape(-1, 3, 3), self._J.ravel()
        if isinstance(self.material, InvariantModel):
            I1, I2 = np.empty_like(J), np.empty_like(J)
            constitutive.isochoric_invariants(F, J, I1, I2)
            return self.material.derivatives(I1, I2)
        assert isinstance(self.material, StretchModel)
        stretches, directions = np.empty((len(J), 3)), np.empty_like(F)
        constitutive.isochoric_stretches(F, J, stretches, directions)
        return *self.material.derivatives(stretches), stretches, directions

    def _respond(self) -> None:
        # Isochoric Kirchhoff stress and tangent at every quadrature point.
        F, J = self._F.reshape(-1, 3, 3), self._J.ravel()
        tau, tangent = self._tau.reshape(-1, 6), self._tangent.reshape(-1, TANGENT_SIZE)
        if isinstance(self.material, InvariantModel):
            _, *derivatives = self._law()
            constitutive.invariant_response(F, J, *derivatives, tau, tangent)
        else:
            _, dW, d2W, stretches, directions = self._law()
            constitutive.stretch_response(stretches, directions, dW, d2W, tau, tangent)
