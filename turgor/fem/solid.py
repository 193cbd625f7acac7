"""The elastic body: curved second-order elements whose pressure is one degree lower than their strain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem import constitutive, kernels
from turgor.fem.elements import pressure_modes, reference_gradients
from turgor.fem.section import Section
from turgor.fem.state import State
from turgor.fem.term import add_at_nodes
from turgor.materials.hyperelastic import Hyperelastic, InvariantModel, StretchModel
from turgor.mesh.cells import body_cell

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

TANGENT_SIZE = 21

AUGMENTATION = 10.0
"""Shear moduli that stand for the bulk modulus in the merit of a mixed step."""


class Solid:
    """∫ W(F̄) + U(θ) dV over one material region, θ the projection of J on the pressure modes of each element.

    In tetrahedra and triangles θ is the element's ratio of volumes (Nagtegaal, Parks and Rice 1974), in hexahedra and
    quadrilaterals it is linear (Simo, Taylor and Pister 1985): this frees the elements of volumetric locking.

    Two things lag (:class:`turgor.fem.term.Term`): the coefficients of θ, so that the iteration sees the volume
    constraint as linear and converges in long steps at any bulk modulus; and the isochoric second Piola–Kirchhoff
    stress S at the quadrature points, so that walls which are stiff against stretching but bend easily turn far in one
    step (Magisano, Leonetti and Garcea 2017: mixed integration points). The geometric stiffness takes U'(θ) and S from
    them.

    Parameters
    ----------
    points, cells
        The mesh: ``(n_points, d)`` and the region's cells ``(m, n)``.
    index
        Places of these cells among all cells of the mesh, ``(m,)``.
    material
        The hyperelastic law of the region.
    section
        What a plane mesh stands for.
    """

    def __init__(
        self,
        points: Floats,
        cells: Ints,
        index: NDArray[np.intp],
        material: Hyperelastic,
        section: Section | None = None,
    ) -> None:
        self.nodes = np.ascontiguousarray(cells, dtype=np.int32)
        self.index = index
        self.material = material
        self.cell = body_cell(self.nodes)
        self.G, self.dV = reference_gradients(points[self.nodes], self.cell, section)
        self.volume = self.dV.sum(axis=1)
        self._surface = np.linalg.norm(np.einsum("mqsa,mq->msa", self.G, self.dV), axis=(1, 2))
        self._steepest = np.abs(self.G).sum(axis=3).max(axis=(1, 2))
        self.modes = self._modes(points[self.nodes])
        self._share = self.modes * (self.dV / self.volume[:, None])[:, :, None]
        m, q, _, n = self.G.shape
        self._F = np.empty((m, q, 3, 3))
        self._J = np.empty((m, q))
        self._dilatation = np.empty((m, self.modes.shape[2]))
        self._tau = np.empty((m, q, 6))
        self._tangent = np.empty((m, q, TANGENT_SIZE))
        self._lagged_tau = np.empty((m, q, 6))
        self._force = np.empty((m, n, self.cell.dimension))
        self._places = kernels.packing(n, self.cell.dimension)
        # Force, stiffness and what lags after a step are asked for at one displacement after another.
        self._deformed_by: Floats | None = None
        self._has_responded = False

    def lagged_at(self, u: Floats, loads: Floats) -> Floats:
        """Return what lags at displacement `u`, ``(m, k + 6 q)``.

        The coefficients of θ, of which the first is the element's ratio of volumes, then the components of S.
        """
        del loads
        return self.lagged_after(State(u, (), np.empty(0)), np.zeros_like(u))

    def lagged_after(self, state: State, du: Floats) -> Floats:
        """Return what lags ``(m, k + 6 q)`` as the step `du` ``(n_points, d)`` predicts it, linearised."""
        self._deform(state.u)
        self._respond()
        m, q, k = self.modes.shape
        after = np.empty((m, k + 6 * q))
        after[:, :k] = self._dilatation
        stress = np.empty((m, q, 6))
        kernels.linear_changes(
            du, self.nodes, self._F, self.G, self.dV, self.modes, self._tau, self._tangent, after[:, :k], stress
        )
        after[:, k:] = stress.reshape(m, 6 * q)
        return after

    def worst_jacobian(self, u: Floats) -> tuple[float, int]:
        """Return the smallest det F over the quadrature points and the mesh cell where it is."""
        self._deform(u)
        at = int(np.argmin(self._J.min(axis=1)))
        return float(self._J[at].min()), int(self.index[at])

    def isochoric_stretches(self, u: Floats) -> Floats:
        """Return the principal stretches of the isochoric deformation at the quadrature points, ``(m, q, 3)``."""
        self._deform(u)
        stretches, directions = np.empty((self._J.size, 3)), np.empty((self._J.size, 3, 3))
        constitutive.isochoric_stretches(self._F.reshape(-1, 3, 3), self._J.ravel(), stretches, directions)
        return stretches.reshape(*self._J.shape, 3)

    def rounding(self, u: Floats) -> float:
        """Return the size of the forces, N, that rounding alone causes at displacement `u`.

        A last digit of J, itself and by the last digits of the displacements of which it holds the differences, times
        the bulk modulus and what a pressure in the element acts on.
        """
        digits = np.finfo(float).eps * (10.0 + np.abs(u).max() * self._steepest)
        return self.material.bulk_modulus * float(np.linalg.norm(digits * self._surface))

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        self._deform(state.u)
        density = self._law()[0].reshape(self.dV.shape)
        volumetric = self.material.volumetric.energy(self._at_points(self._dilatation))
        return float(np.sum((density + volumetric) * self.dV))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy with its volumetric part linearised at the lagged θ, N mm.

        An augmented Lagrangian: a small multiple of the squared deviation from them keeps it bounded below.
        """
        self._deform(state.u)
        density = self._law()[0].reshape(self.dV.shape)
        law, expected = self.material.volumetric, self._at_points(self._lagged_dilatation(lagged))
        deviation = self._at_points(self._dilatation) - expected
        bulk = AUGMENTATION * self.material.shear_modulus
        volumetric = law.energy(expected) + law.pressure(expected) * deviation + 0.5 * bulk * deviation**2
        return float(np.sum((density + volumetric) * self.dV))

    def force(self, state: State, out: Floats) -> None:
        """Add the internal forces, N."""
        self._deform(state.u)
        self._respond()
        pressure = self._pressure(self._dilatation)
        kernels.element_forces(self._F, self.G, self.dV, self._tau, pressure, self._force)
        add_at_nodes(self.nodes, self._force, out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the element stiffnesses, the pressure condensed."""
        self._deform(state.u)
        self._respond()
        dilatation = self._lagged_dilatation(lagged)
        kernels.transformed(self._F, self._lagged_stress(lagged), self._lagged_tau)
        kernels.element_stiffness(
            self._F,
            self.G,
            self.dV,
            self._lagged_tau,
            self._tangent,
            self._pressure(dilatation),
            self.modes,
            self._bulk(dilatation),
            self.cell.dimension,
            self._places,
            out,
        )

    def dilatation(self, state: State, lagged: Floats) -> Floats:
        """Return each element's mean lagged dilatation, at an equilibrium its ratio of volumes, ``(m,)``."""
        del state
        return lagged[:, 0]

    def mean_pressure(self, state: State, lagged: Floats) -> Floats:
        """Return the mean of U'(θ) over each element, ``(m,)``, MPa: its mean stress, positive in tension."""
        del state
        pressure = self._pressure(self._lagged_dilatation(lagged))
        mean: Floats = np.einsum("mq,mq->m", pressure, self.dV) / self.volume
        return mean

    def cauchy_stress(self, state: State) -> Floats:
        """Return the Cauchy stress at the quadrature points in the stored symmetric order, ``(m, q, 6)``, MPa."""
        self._deform(state.u)
        self._respond()
        stress = self._tau / self._J[:, :, None]
        stress[:, :, :3] += self._pressure(self._dilatation)[:, :, None]
        return np.asarray(stress)

    def _lagged_dilatation(self, lagged: Floats) -> Floats:
        return lagged[:, : self.modes.shape[2]]

    def _lagged_stress(self, lagged: Floats) -> Floats:
        return np.ascontiguousarray(lagged[:, self.modes.shape[2] :]).reshape(*self.dV.shape, 6)

    def _modes(self, nodes: Floats) -> Floats:
        return pressure_modes(nodes, self.cell, self.dV)

    def _at_points(self, coefficients: Floats) -> Floats:
        """Evaluate a field given by its ``coefficients (m, k)`` of the modes at the quadrature points, ``(m, q)``."""
        return np.asarray((self.modes @ coefficients[:, :, None])[:, :, 0])

    def _pressure(self, dilatation: Floats) -> Floats:
        """Return U'(θ), projected on the modes, at the quadrature points, ``(m, q)``."""
        pressure = self.material.volumetric.pressure(self._at_points(dilatation))
        return self._at_points(np.einsum("mqk,mq->mk", self._share, pressure))

    def _bulk(self, dilatation: Floats) -> Floats:
        """Return ``∫ ψ_k U''(θ) ψ_l dV / V²``, ``(m, k, k)``."""
        stiffness = self.material.volumetric.stiffness(self._at_points(dilatation))
        weighted = self._share * (stiffness / self.volume[:, None])[:, :, None]
        return np.asarray(weighted.swapaxes(1, 2) @ self.modes)

    def _deform(self, u: Floats) -> None:
        """Bring deformation gradients and dilatations to a displacement, unless they are there."""
        if self._deformed_by is None or not np.array_equal(u, self._deformed_by):
            self._deformed_by, self._has_responded = u.copy(), False
            self._find_deformation(u)

    def _respond(self) -> None:
        """Bring isochoric Kirchhoff stress and tangent to the deformation, unless they are there."""
        if not self._has_responded:
            self._find_response()
            self._has_responded = True

    def _find_deformation(self, u: Floats) -> None:
        kernels.deformation(u, self.nodes, self.G, self.dV, self.modes, self._F, self._J, self._dilatation)

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

    def _find_response(self) -> None:
        F, J = self._F.reshape(-1, 3, 3), self._J.ravel()
        tau, tangent = self._tau.reshape(-1, 6), self._tangent.reshape(-1, TANGENT_SIZE)
        if isinstance(self.material, InvariantModel):
            _, *derivatives = self._law()
            constitutive.invariant_response(F, J, *derivatives, tau, tangent)
        else:
            _, dW, d2W, stretches, directions = self._law()
            constitutive.stretch_response(stretches, directions, dW, d2W, tau, tangent)
