"""Sheets that hardly stretch, such as paper or fabric, on the faces of the body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.state import State
from turgor.fem.term import Mixed, add_at_nodes, pack_symmetric
from turgor.mesh.cells import Cell, body_cell
from turgor.mesh.faces import all_faces, places_of_faces, shared_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.symmetry import planes_of_symmetry

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Membrane:
    """A thin sheet (paper, fabric, foil) without bending stiffness of its own, bonded to the body all over.

    Attributes
    ----------
    surface
        Name of a surface, or of two regions between which it lies.
    youngs_modulus
        E in MPa.
    thickness
        In mm.
    poissons_ratio
        ν, from −1 to below 1 (plane stress).
    """

    surface: str | tuple[str, str]
    youngs_modulus: float
    thickness: float
    poissons_ratio: float = 0.3

    @property
    def name(self) -> str:
        """The surface, or the two regions."""
        return self.surface if isinstance(self.surface, str) else "/".join(self.surface)


class BondedMembrane(Mixed):
    """½ ∫ S : E dA over second-order faces, E the Green–Lagrange strain in their plane, S = D : E.

    D is Hooke's law in plane stress times the thickness (the membrane of St. Venant and Kirchhoff: a sheet that
    hardly stretches needs no other law at large rotations). The stress resultants S are what lags
    (:class:`turgor.fem.term.Term`). The quadrature has the fewest points that leave a flat face no motion without
    strain but the rigid ones: more would ask a stiff sheet to be free of strain at more points than it can.
    Of a sheet in a plane of symmetry, which cuts it lengthwise, only half of the thickness belongs to the body.

    Parameters
    ----------
    mesh
        The body; it holds the surface.
    membrane
        What lies on it.

    Raises
    ------
    InputError
        If there is no such surface, the two regions do not touch, a property is out of bounds, or the sheet lies in a
        plane of symmetry through which the body reaches.
    """

    def __init__(self, mesh: Mesh, membrane: Membrane) -> None:
        self.membrane = membrane
        self.nodes = np.ascontiguousarray(_faces(mesh, membrane), dtype=np.int32)
        self._positions = mesh.points[self.nodes]
        self._gradient, self.dA = _reference(self._positions, body_cell(self.nodes))
        self.dA[_in_planes_of_symmetry(mesh, self.nodes, f"membranes.{membrane.name}")] *= 0.5
        self._law = _plane_stress(membrane)
        # Strain is measured against the metric that rounding leaves at rest, so that rest is free of stress.
        self._metric = _metric(self._tangents(np.zeros_like(mesh.points)))

    def strain(self, u: Floats) -> Floats:
        """Return the Green–Lagrange strains E11, E22, 2 E12 in the plane at the quadrature points, ``(k, q, 3)``.

        The first direction is that from the first reference coordinate of each face.
        """
        return self._strain(self._tangents(u))

    def stress(self, u: Floats) -> Floats:
        """Return the second Piola–Kirchhoff stress resultants S11, S22, S12, ``(k, q, 3)``, N/mm."""
        return self.strain(u) @ self._law

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        strain = self.strain(state.u)
        return 0.5 * float(np.einsum("fqr,fqr,fq->", strain @ self._law, strain, self.dA))

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the work of the lagged stress resultants, N mm."""
        stress = lagged.reshape(*self.dA.shape, 3)
        return float(np.einsum("fqr,fqr,fq->", stress, self.strain(state.u), self.dA))

    def force_of(self, u: Floats, lagged: Floats, out: Floats) -> None:
        """Add the forces of given stress resultants, N."""
        stress = lagged.reshape(*self.dA.shape, 3)
        operator = self._strain_operator(self._tangents(u))
        force = np.einsum("fqraj,fqr,fq->faj", operator, stress, self.dA, optimize=True)
        add_at_nodes(self.nodes, force, out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the membrane's stiffness, its geometric part from the lagged stress resultants, N/mm."""
        operator = self._strain_operator(self._tangents(state.u)).reshape(*self.dA.shape, 3, -1)
        weighted = (self._law @ operator) * self.dA[:, :, None, None]
        blocks = np.einsum("fqri,fqrj->fij", operator, weighted, optimize=True)
        S = lagged.reshape(*self.dA.shape, 3)[:, :, [[0, 2], [2, 1]]] * self.dA[:, :, None, None]
        B = self._gradient
        scalar = np.einsum("fqar,fqrs,fqbs->fab", B, S, B, optimize=True)
        blocks += np.einsum("fab,ij->faibj", scalar, np.eye(3)).reshape(blocks.shape)
        pack_symmetric(blocks, out)

    def lagged_at(self, state: State) -> Floats:
        """Return the stress resultants of a state, flat, N/mm."""
        return self.stress(state.u).ravel()

    def lagged_change(self, state: State, du: Floats) -> Floats:
        """Return the change of the stress resultants along the step `du`, linearised at the state, flat, N/mm."""
        operator = self._strain_operator(self._tangents(state.u))
        return np.asarray(np.einsum("fqraj,faj->fqr", operator, du[self.nodes], optimize=True) @ self._law).ravel()

    def _tangents(self, u: Floats) -> Floats:
        """Return the deformed images of the two unit directions, ``(k, q, 2, 3)``."""
        return np.asarray(np.einsum("fqar,faj->fqrj", self._gradient, self._positions + u[self.nodes], optimize=True))

    def _strain(self, tangents: Floats) -> Floats:
        return np.asarray((_metric(tangents) - self._metric) * np.array([0.5, 0.5, 1.0]))

    def _strain_operator(self, tangents: Floats) -> Floats:
        """Return the derivative of the strains with respect to the nodes, ``(k, q, 3, n, 3)``."""
        first, second = self._gradient[..., 0, None], self._gradient[..., 1, None]
        along, across = tangents[:, :, None, 0], tangents[:, :, None, 1]
        return np.stack([first * along, second * across, first * across + second * along], axis=2)


def _metric(tangents: Floats) -> Floats:
    first, second = tangents[:, :, 0], tangents[:, :, 1]
    return np.stack([(a * b).sum(axis=-1) for a, b in ((first, first), (second, second), (first, second))], axis=-1)


def _reference(positions: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return the gradients along two unit directions in the face ``(k, q, n, 2)`` and the areas ``(k, q)``."""
    tangents = np.einsum("qar,faj->fqrj", cell.gradient_at_quadrature, positions)
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    size = np.linalg.norm(normal, axis=2)
    first = tangents[:, :, 0] / np.linalg.norm(tangents[:, :, 0], axis=2, keepdims=True)
    second = np.cross(normal / size[:, :, None], first)
    jacobian = np.einsum("fqrj,fqsj->fqrs", tangents, np.stack([first, second], axis=2))
    gradient = np.einsum("qar,fqsr->fqas", cell.gradient_at_quadrature, np.linalg.inv(jacobian))
    return gradient, size * cell.weights


def _plane_stress(membrane: Membrane) -> Floats:
    key = f"membranes.{membrane.name}"
    for name in ("youngs_modulus", "thickness"):
        value = getattr(membrane, name)
        if not (np.isfinite(value) and value > 0.0):
            raise InputError("this must be positive", key=f"{key}.{name}", value=value)
    ratio = membrane.poissons_ratio
    if not -1.0 < ratio < 1.0:
        raise InputError(
            "no material has this ratio in plane stress",
            key=f"{key}.poissons_ratio",
            value=ratio,
            expected="-1 < ν < 1",
        )
    scale = membrane.youngs_modulus * membrane.thickness / (1.0 - ratio**2)
    return scale * np.array([[1.0, ratio, 0.0], [ratio, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - ratio)]])


def _faces(mesh: Mesh, membrane: Membrane) -> Ints:
    if isinstance(membrane.surface, str):
        return mesh.surface(membrane.surface)
    first, second = (mesh.cells[mesh.region(name)] for name in membrane.surface)
    shared = shared_faces(first, second)
    if len(shared) == 0:
        raise InputError("the two regions have no face in common", key="membranes.surface", value=membrane.name)
    return np.asarray(all_faces(first)[shared])


def _in_planes_of_symmetry(mesh: Mesh, faces: Ints, key: str) -> NDArray[np.bool_]:
    """Return which of the faces ``(k, n)`` lie in the cut of a plane of symmetry, ``(k,)``."""
    found, corners = np.zeros(len(faces), bool), faces[:, : body_cell(faces).n_corners]
    for plane in planes_of_symmetry(mesh):
        inside = places_of_faces(plane.faces, corners) >= 0
        if inside.any():
            plane.check_behind(mesh, "it does not halve a sheet", key)
        found |= inside
    return found
