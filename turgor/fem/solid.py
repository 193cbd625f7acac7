"""The elastic body: curved second-order elements whose pressure is one degree lower than their strain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem import constitutive, kernels
from turgor.fem.elements import pressure_modes, reference_gradients
from turgor.fem.principal import isochoric_stretches
from turgor.fem.section import Section
from turgor.fem.state import State
from turgor.fem.term import Mixed, add_at_nodes
from turgor.fem.volumes import VolumeEquations
from turgor.materials.hyperelastic import Hyperelastic, InvariantModel, StretchModel
from turgor.mesh.cells import body_cell

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

TANGENT_SIZE = 21

PORTION = 4096
"""Points at which a law in stretches is evaluated together: what it computes on the way stays in the cache."""

AUGMENTATION = 10.0
"""Shear moduli that stand for the bulk modulus in the merit of a mixed step."""


class _Configuration:
    """Deformation and response of a region at one displacement: both are asked for again and again.

    ``F (m, q, 3, 3)``, its determinant ``J (m, q)``, the coefficients of θ ``dilatation (m, k)``, isochoric energy
    ``density (m, q)``, Kirchhoff stress ``tau (m, q, 6)`` and its spatial ``tangent (m, q, 21)``, what lags.
    """

    def __init__(self, m: int, q: int, k: int) -> None:
        self.F = np.empty((m, q, 3, 3))
        self.J = np.empty((m, q))
        self.dilatation = np.empty((m, k))
        self.density = np.empty((m, q))
        self.tau = np.empty((m, q, 6))
        self.tangent = np.empty((m, q, TANGENT_SIZE))
        self.forget()

    def forget(self) -> None:
        """Be of no displacement."""
        self.u: Floats | None = None
        self.has_responded = False
        self.lagged: Floats | None = None

    def is_at(self, u: Floats) -> bool:
        """Whether this is the configuration at `u`."""
        return self.u is not None and np.array_equal(u, self.u)


class Solid(Mixed):
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
        # As a product, for sums over so few numbers each take long.
        self._steepest = (np.abs(self.G) @ np.ones(self.G.shape[3])).reshape(len(self.G), -1).max(axis=1)
        self.modes = self._modes(points[self.nodes])
        self._share = self.modes * (self.dV / self.volume[:, None])[:, :, None]
        m, q, _, n = self.G.shape
        # The one asked for last, and that of the stiffness: iterations go to and fro between the two.
        self._now, self._other = (_Configuration(m, q, self.modes.shape[2]) for _ in range(2))
        self._turned = np.empty((m, q, 6))
        self._force = np.empty((m, n, self.cell.dimension))
        self._places = kernels.packing(n, self.cell.dimension)

    def lagged_at(self, state: State) -> Floats:
        """Return what lags at a state's displacement, ``(m, k + 6 q)``.

        The coefficients of θ, of which the first is the element's ratio of volumes, then the components of S.
        """
        self._deform(state.u)
        self._respond()
        if self._now.lagged is None:
            stress = np.empty((*self.dV.shape, 6))
            kernels.pulled_back(self._now.F, self._now.tau, stress)
            self._now.lagged = self._joined(self._now.dilatation, stress)
        return self._now.lagged

    def lagged_change(self, state: State, du: Floats) -> Floats:
        """Return the change ``(m, k + 6 q)`` of what lags along the step `du` ``(n_points, d)``, linearised."""
        self._deform(state.u)
        self._respond()
        dilatation, stress = np.empty_like(self._now.dilatation), np.empty((*self.dV.shape, 6))
        kernels.linear_changes(
            du, self.nodes, self._now.F, self.G, self.dV, self.modes, self._now.tangent, dilatation, stress
        )
        return self._joined(dilatation, stress)

    def worst_jacobian(self, u: Floats) -> tuple[float, int]:
        """Return the smallest det F over the quadrature points and the mesh cell where it is."""
        self._deform(u)
        at = int(np.argmin(self._now.J.min(axis=1)))
        return float(self._now.J[at].min()), int(self.index[at])

    def isochoric_stretches(self, u: Floats) -> Floats:
        """Return the principal stretches of the isochoric deformation at the quadrature points, ``(m, q, 3)``."""
        self._deform(u)
        stretches, directions = np.empty((self._now.J.size, 3)), np.empty((self._now.J.size, 3, 3))
        isochoric_stretches(self._now.F.reshape(-1, 3, 3), self._now.J.ravel(), stretches, directions)
        return stretches.reshape(*self._now.J.shape, 3)

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
        self._respond()
        volumetric = self.material.volumetric.energy(self._at_points(self._now.dilatation))
        return float(np.vdot(self._now.density + volumetric, self.dV))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the energy with its volumetric part linearised at the lagged θ, N mm.

        An augmented Lagrangian: a small multiple of the squared deviation from them keeps it bounded below.
        """
        self._deform(state.u)
        self._respond()
        law, expected = self.material.volumetric, self._at_points(self._lagged_dilatation(lagged))
        deviation = self._at_points(self._now.dilatation) - expected
        bulk = AUGMENTATION * self.material.shear_modulus
        volumetric = law.energy(expected) + law.pressure(expected) * deviation + 0.5 * bulk * deviation**2
        return float(np.vdot(self._now.density + volumetric, self.dV))

    def force(self, state: State, out: Floats) -> None:
        """Add the internal forces, N."""
        self._deform(state.u)
        self._respond()
        pressure = self._pressure(self._now.dilatation)
        kernels.element_forces(self._now.F, self.G, self.dV, self._now.tau, pressure, self._force)
        add_at_nodes(self.nodes, self._force, out)

    def force_of(self, u: Floats, lagged: Floats, out: Floats) -> None:
        """Add the internal forces of given dilatations and stresses, N."""
        self._add_forces(u, self._lagged_stress(lagged), self._pressure(self._lagged_dilatation(lagged)), out)

    def mixed_force(self, state: State, lagged: Floats, base: State, kept: Floats, out: Floats) -> None:
        """Add the force out of balance of the mixed problem with the stiffness of `base`, N."""
        self.force_of(state.u, lagged, out)
        missing = self.lagged_at(state) - lagged
        modes = self._bulk(self._lagged_dilatation(kept)) @ self._lagged_dilatation(missing)[:, :, None]
        pressure = self._at_points(modes[:, :, 0] * self.volume[:, None])
        self._add_forces(base.u, self._lagged_stress(missing), pressure, out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the element stiffnesses, the pressure condensed."""
        self._fill_stiffness(state, lagged, self._bulk(self._lagged_dilatation(lagged)), out, np.empty((0, 0, 0, 0)))

    def split_stiffness(self, state: State, lagged: Floats, augmentation: float, out: Floats) -> VolumeEquations:
        """Fill the element stiffnesses with a part of their bulk modulus; return the rest as equations of their own.

        What stays is at most `augmentation` times the tangent's shear modulus in each element.
        """
        dilatation = self._lagged_dilatation(lagged)
        bulk = self._bulk(dilatation)
        self._deform(state.u)
        self._respond()
        modulus = self._tangent_modulus()
        kept = augmentation * modulus
        share = kept / (kept + self.volume * bulk[:, 0, 0])
        gradient = np.empty((*dilatation.shape, self.cell.dimension, self.G.shape[3]))
        self._fill_stiffness(state, lagged, share[:, None, None] * bulk, out, gradient)
        return VolumeEquations(
            self.nodes,
            self.volume,
            gradient,
            (1.0 - share)[:, None, None] * bulk,
            (1.0 + augmentation) * modulus,
        )

    def lag(self, state: State, lagged: Floats) -> Floats:
        """Return by how much the lagged dilatations exceed those of the displacement, ``(m, k)``."""
        self._deform(state.u)
        return np.asarray(self._lagged_dilatation(lagged) - self._now.dilatation)

    def dilatation(self, state: State, lagged: Floats) -> Floats:
        """Return each element's mean lagged dilatation, at an equilibrium its ratio of volumes, ``(m,)``."""
        del state
        return lagged[:, 0]

    def cauchy_stress(self, state: State) -> Floats:
        """Return the Cauchy stress at the quadrature points in the stored symmetric order, ``(m, q, 6)``, MPa.

        Without that of fibre families, which :meth:`turgor.fem.system.System.cauchy_stress` adds.
        """
        self._deform(state.u)
        self._respond()
        stress = self._now.tau / self._now.J[:, :, None]
        stress[:, :, :3] += self._pressure(self._now.dilatation)[:, :, None]
        return np.asarray(stress)

    def _add_forces(self, u: Floats, stress: Floats, pressure: Floats, out: Floats) -> None:
        """Add the internal forces at displacement `u` of S ``(m, q, 6)`` and a pressure ``(m, q)``."""
        self._deform(u)
        kernels.transformed(self._now.F, stress, self._turned)
        kernels.element_forces(self._now.F, self.G, self.dV, self._turned, pressure, self._force)
        add_at_nodes(self.nodes, self._force, out)

    def _fill_stiffness(self, state: State, lagged: Floats, bulk: Floats, out: Floats, gradient: Floats) -> None:
        """Fill the element stiffnesses with ``bulk (m, k, k)``, that of :meth:`_bulk` or a part of it.

        And the volumes' ``gradient (m, k, d, n)``, unless it is empty.
        """
        self._deform(state.u)
        self._respond()
        kernels.transformed(self._now.F, self._lagged_stress(lagged), self._turned)
        kernels.element_stiffness(
            self._now.F,
            self.G,
            self.dV,
            self._turned,
            self._now.tangent,
            self._pressure(self._lagged_dilatation(lagged)),
            self.modes,
            bulk,
            kernels.counted(self.cell.dimension),
            kernels.counted(self.cell.n_nodes),
            self._places,
            out,
            gradient,
        )

    def _tangent_modulus(self) -> Floats:
        """Return a shear modulus of each element's tangent, not below the initial one, ``(m,)``, MPa."""
        shear = self._now.tangent[:, :, [kernels.PACK[r, r] for r in (3, 4, 5)]].mean(axis=2)
        mean = np.einsum("mq,mq->m", shear, self.dV) / self.volume
        return np.asarray(np.maximum(mean, self.material.shear_modulus))

    @staticmethod
    def _joined(dilatation: Floats, stress: Floats) -> Floats:
        return np.concatenate([dilatation, stress.reshape(len(stress), -1)], axis=1)

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
        if not self._now.is_at(u):
            self._now, self._other = self._other, self._now
        if not self._now.is_at(u):
            self._now.forget()
            self._find_deformation(u)
            self._now.u = u.copy()

    def _respond(self) -> None:
        """Bring isochoric energy, Kirchhoff stress and tangent to the deformation, unless they are there."""
        if not self._now.has_responded:
            self._find_response()
            self._now.has_responded = True

    def _find_deformation(self, u: Floats) -> None:
        kernels.deformation(u, self.nodes, self.G, self.dV, self.modes, self._now.F, self._now.J, self._now.dilatation)

    def _law(self) -> tuple[Floats, ...]:
        # Evaluate the material; for a law in stretches, the principal directions come last.
        F, J = self._now.F.reshape(-1, 3, 3), self._now.J.ravel()
        if isinstance(self.material, InvariantModel):
            I1, I2 = np.empty_like(J), np.empty_like(J)
            constitutive.isochoric_invariants(F, J, I1, I2)
            return self.material.derivatives(I1, I2)
        assert isinstance(self.material, StretchModel)
        stretches, directions = np.empty((len(J), 3)), np.empty_like(F)
        isochoric_stretches(F, J, stretches, directions)
        density, dW, d2W = np.empty(len(J)), np.empty((len(J), 3)), np.empty((len(J), 3, 3))
        for begin in range(0, len(J), PORTION):
            part = slice(begin, begin + PORTION)
            density[part], dW[part], d2W[part] = self.material.derivatives(stretches[part])
        return density, dW, d2W, stretches, directions

    def _find_response(self) -> None:
        F, J = self._now.F.reshape(-1, 3, 3), self._now.J.ravel()
        tau, tangent = self._now.tau.reshape(-1, 6), self._now.tangent.reshape(-1, TANGENT_SIZE)
        if isinstance(self.material, InvariantModel):
            density, *derivatives = self._law()
            constitutive.invariant_response(F, J, *derivatives, tau, tangent)
        else:
            density, dW, d2W, stretches, directions = self._law()
            constitutive.stretch_response(stretches, directions, dW, d2W, tau, tangent)
        self._now.density[:] = density.reshape(self.dV.shape)
