"""Families of fibres spread through a region: an energy of the stretch along a field of directions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.constitutive import COL, ROW
from turgor.fem.directions import Direction
from turgor.fem.kernels import parallel
from turgor.fem.solid import Solid
from turgor.fem.state import State
from turgor.fem.term import Mixed, add_at_nodes
from turgor.mesh.cells import body_cell
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class FibreLaw(Protocol):
    """Energy ψ per reference volume, MPa, of the fibre strain E = I4 − 1 (twice the Green–Lagrange strain along it)."""

    def derivatives(self, E: Floats) -> tuple[Floats, Floats, Floats]:
        """Return ψ, dψ/dE and d²ψ/dE², each of the shape of `E`."""
        ...


@dataclass(frozen=True)
class QuadraticFibres:
    """ψ = ½ k E², the standard reinforcing model (Qiu and Pence 1997).

    At small strain Young's modulus along the fibres grows by 4 k.

    Attributes
    ----------
    k
        In MPa.
    """

    k: float

    def __post_init__(self) -> None:
        _check_positive("k", self.k)

    def derivatives(self, E: Floats) -> tuple[Floats, Floats, Floats]:
        """Return ψ, dψ/dE and d²ψ/dE²."""
        return 0.5 * self.k * E**2, self.k * E, np.full_like(E, self.k)


@dataclass(frozen=True)
class ExponentialFibres:
    """ψ = k1/(2 k2) (exp(k2 E²) − 1) (Holzapfel, Gasser and Ogden 2000, eq. 59).

    At small strain Young's modulus along the fibres grows by 4 k1.

    Attributes
    ----------
    k1
        In MPa.
    k2
        Without unit; the larger, the sooner the fibres stiffen.
    """

    k1: float
    k2: float

    def __post_init__(self) -> None:
        _check_positive("k1", self.k1)
        _check_positive("k2", self.k2)

    def derivatives(self, E: Floats) -> tuple[Floats, Floats, Floats]:
        """Return ψ, dψ/dE and d²ψ/dE²."""
        square = self.k2 * E**2
        grown = self.k1 * np.exp(square)
        return 0.5 * self.k1 / self.k2 * np.expm1(square), grown * E, grown * (1.0 + 2.0 * square)


def _check_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError("this must be positive", key=name, value=value)


@dataclass(frozen=True)
class FibreFamily:
    """Fibres of one direction field, spread evenly through a region and bonded to it.

    Attributes
    ----------
    region
        Name of the region.
    law
        Their energy.
    direction
        The field of directions in the reference state.
    tension_only
        Whether they carry nothing where E < 0.
    dispersion
        κ of Gasser, Ogden and Holzapfel (2006): 0 for parallel fibres, 1/3 for fibres in all directions alike.
    """

    region: str
    law: FibreLaw
    direction: Direction
    tension_only: bool = False
    dispersion: float = 0.0


class SpreadFibres(Mixed):
    """∫ ψ(E) dV with E = H : (C − 1), H = κ 1 + (1 − 3κ) a ⊗ a, a the unit direction (Gasser et al. 2006, eq. 17).

    C is the whole right Cauchy–Green tensor, not its isochoric part: with the latter, fibres under tension would
    swell a body that is not quite incompressible (Sansour 2008; Helfenstein et al. 2010). What lags is the fibre
    stress 2 dψ/dE (:class:`turgor.fem.term.Term`).

    Parameters
    ----------
    mesh
        The body.
    solid
        The term of the family's region, whose quadrature points are used.
    family
        What runs through it.

    Raises
    ------
    InputError
        If the mesh is plane, the dispersion is out of bounds, or the direction is not defined everywhere.
    """

    def __init__(self, mesh: Mesh, solid: Solid, family: FibreFamily) -> None:
        key = f"fibre-families.{family.region}"
        if mesh.dimension != 3:
            raise InputError("fibre families need a body in space, not a plane section", key=key)
        if not 0.0 <= family.dispersion <= 1.0 / 3.0:
            raise InputError("the dispersion is out of bounds", key=key, value=family.dispersion, expected="0 to 1/3")
        self.family = family
        self.solid = solid
        self.nodes = solid.nodes
        self.direction = _directions(mesh.points[solid.nodes], body_cell(solid.nodes).shape_at_quadrature, family)
        self._G, self._dV = solid.G, solid.dV
        kappa = family.dispersion
        dyad = self.direction[..., :, None] * self.direction[..., None, :]
        self._H = kappa * np.eye(3) + (1.0 - 3.0 * kappa) * dyad

    @property
    def modulus(self) -> float:
        """What they add to Young's modulus along their direction at small strain, 4 (1 − 3κ)² d²ψ/dE², MPa."""
        _, _, second = self.family.law.derivatives(np.zeros(1))
        return 4.0 * (1.0 - 3.0 * self.family.dispersion) ** 2 * float(second[0])

    def stretch(self, u: Floats) -> Floats:
        """Return the stretch along the direction at the quadrature points, ``(m, q)``."""
        return np.asarray(np.linalg.norm(np.einsum("eqij,eqj->eqi", self._deformation(u), self.direction), axis=2))

    def stress(self, u: Floats) -> Floats:
        """Return the second Piola–Kirchhoff stress along the fibres, 2 dψ/dE, ``(m, q)``, MPa."""
        return 2.0 * self._law(self._strain(self._deformation(u)))[1]

    def cauchy_stress(self, state: State) -> Floats:
        """Return their share of the Cauchy stress, 2 dψ/dE F H Fᵀ / J, as the solid does: ``(m, q, 6)``, MPa."""
        F = self._deformation(state.u)
        _, first, _ = self._law(self._strain(F))
        pushed = F @ self._H @ F.swapaxes(-1, -2)
        return np.asarray((2.0 * first / np.linalg.det(F))[..., None] * pushed[..., ROW, COL])

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        density, _, _ = self._law(self._strain(self._deformation(state.u)))
        return float(np.sum(density * self._dV))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the work of the lagged fibre stress, N mm."""
        return 0.5 * float(np.sum(lagged * self._strain(self._deformation(state.u)) * self._dV))

    def force_of(self, u: Floats, lagged: Floats, out: Floats) -> None:
        """Add the forces of a given fibre stress, N."""
        stress = (lagged * self._dV)[:, :, None, None] * (self._deformation(u) @ self._H)
        add_at_nodes(self.nodes, np.einsum("eqij,eqja->eai", stress, self._G, optimize=True), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the fibres' stiffness, its geometric part from the lagged fibre stress, N/mm."""
        F = self._deformation(state.u)
        _, _, second = self._law(self._strain(F))
        _fill_stiffness(F @ self._H, self._H, self._G, lagged * self._dV, 4.0 * second * self._dV, out)

    def lagged_at(self, state: State) -> Floats:
        """Return the fibre stress of a state, ``(m, q)``, MPa."""
        return self.stress(state.u)

    def lagged_change(self, state: State, du: Floats) -> Floats:
        """Return the change of the fibre stress along the step `du`, linearised at the state, ``(m, q)``, MPa."""
        F = self._deformation(state.u)
        _, _, second = self._law(self._strain(F))
        return np.asarray(4.0 * second * np.einsum("eqij,eqij->eq", F @ self._H, self._gradient(du)))

    def allowed(self, lagged: Floats) -> Floats:
        """Return the stress without what fibres that go slack cannot bear."""
        return np.maximum(lagged, 0.0) if self.family.tension_only else lagged

    def _gradient(self, field: Floats) -> Floats:
        """Return the gradient ∂field_i/∂X_j of a nodal field at the quadrature points, ``(m, q, 3, 3)``."""
        return np.asarray((self._G @ field[self.nodes][:, None]).swapaxes(-1, -2))

    def _deformation(self, u: Floats) -> Floats:
        return np.eye(3) + self._gradient(u)

    def _strain(self, F: Floats) -> Floats:
        return np.asarray(np.einsum("eqij,eqij->eq", F @ self._H, F) - np.trace(self._H, axis1=-2, axis2=-1))

    def _law(self, E: Floats) -> tuple[Floats, Floats, Floats]:
        if not self.family.tension_only:
            return self.family.law.derivatives(E)
        energy, first, second = self.family.law.derivatives(np.maximum(E, 0.0))
        return energy, first, np.where(E < 0.0, 0.0, second)


def _directions(nodes: Floats, shape: Floats, family: FibreFamily) -> Floats:
    """Return the unit directions at the quadrature points of cells with `nodes` ``(m, n, 3)``, ``(m, q, 3)``."""
    places = shape @ nodes
    directions = family.direction.at(places.reshape(-1, 3)).reshape(places.shape)
    length = np.linalg.norm(directions, axis=2, keepdims=True)
    undefined = ~(length[..., 0] > 0.0)
    if undefined.any():
        where = ", ".join(f"{x:.4g}" for x in places[undefined][0])
        problem = f"the direction of the fibres is not defined at ({where}) mm"
        raise InputError(problem, key=f"fibre-families.{family.region}", expected="a field defined all over the region")
    return np.asarray(directions / length)


@parallel
def _fill_stiffness(FH, H, G, stress, tangent, out):  # type: ignore[no-untyped-def]
    """Fill ``out (m, packed)`` with ``∫ S (g_a · H g_b) 1 + T (F H g_a) ⊗ (F H g_b) dV``.

    ``FH, H (m, q, 3, 3)``, gradients ``G (m, q, 3, n)``; ``stress, tangent (m, q)`` hold S dV and T dV.
    """
    n_nodes = G.shape[3]
    n_quad = G.shape[1]
    for e in nb.prange(len(G)):
        spatial = np.zeros((n_nodes, 3, n_quad))
        scalar = np.zeros((n_nodes, n_nodes))
        for q in range(n_quad):
            for a in range(n_nodes):
                for i in range(3):
                    for j in range(3):
                        spatial[a, i, q] += FH[e, q, i, j] * G[e, q, j, a]
                for i in range(3):
                    turned = stress[e, q] * (
                        H[e, q, i, 0] * G[e, q, 0, a] + H[e, q, i, 1] * G[e, q, 1, a] + H[e, q, i, 2] * G[e, q, 2, a]
                    )
                    for b in range(n_nodes):
                        scalar[a, b] += turned * G[e, q, i, b]
        at = 0
        for a in range(n_nodes):
            for i in range(3):
                for b in range(a, n_nodes):
                    for k in range(i if a == b else 0, 3):
                        value = scalar[a, b] if i == k else 0.0
                        for q in range(n_quad):
                            value += tangent[e, q] * spatial[a, i, q] * spatial[b, k, q]
                        out[e, at] = value
                        at += 1
