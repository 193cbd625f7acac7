"""Contact of the skin with its mirror image behind a plane of symmetry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.friction import WIDTH
from turgor.fem.contact.skin import STIFFNESS, Skin
from turgor.fem.contact.term import GROWTH_OF_OVERLAP, Contact, Touch
from turgor.fem.pattern import packed_size
from turgor.fem.rigid import RigidBody
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, Unlagged, add_at_nodes, pack_symmetric
from turgor.mesh.mesh import Mesh, in_space
from turgor.mesh.symmetry import SymmetryPlane, part_in_front, planes_of_symmetry

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SAMPLES = 200
ALIKE = 1e-6
"""A rigid body is halved by a plane if the distances from it of some places and of their images differ by less than
this part of the actuator's extent."""


class Mirror(Unlagged):
    """Σ ε w min(0, h)² over the quadrature points of the skin, h their height in front of a plane of symmetry.

    The image pushes as another wall would that the skin overlaps by 2 h, ½ of ½ ε w (2 h)² being the skin's own
    (:class:`turgor.fem.contact.surfaces.SurfaceContact`). It slides along with the skin: there is no friction.

    Parameters
    ----------
    skin
        The skin.
    front
        Those of its faces that may touch their image, ``(k,)``; none in the plane.
    plane
        The plane of symmetry.
    name
        Of the contact.
    """

    nodes = NO_NODES
    friction = 0.0

    def __init__(self, skin: Skin, front: Ints, plane: SymmetryPlane, name: str) -> None:
        self.skin = skin
        self.name = name
        self.faces, self._area = skin.faces[front], skin.area[front]
        self._wall, self._depth = skin.wall[front, None], skin.depth[front, None]
        self._hardness = STIFFNESS * (skin.load / skin.grip)[front, None] * self._area
        self._inward = -plane.normal
        self._height = plane.height(skin.points[:, : skin.dimension])

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        return 0.5 * float(np.sum(self._stiffness(state) * np.minimum(self._heights(state.u), 0.0) ** 2))

    def force(self, state: State, out: Floats) -> None:
        """Add the contact forces, N."""
        force = (self._stiffness(state) * np.minimum(self._heights(state.u), 0.0)) @ self.skin.shape
        touching = np.flatnonzero(force.any(axis=1))
        add_at_nodes(self.faces[touching], force[touching][:, :, None] * self._inward, out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: all of the stiffness is in :meth:`blocks`."""

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the nodes of each face that is behind the plane and the packed stiffnesses."""
        del lagged
        height, shape, n = self._heights(state.u), self.skin.shape, self._inward
        touching = np.flatnonzero((height < 0.0).any(axis=1))
        stiffness = self._stiffness(state)[touching] * (height[touching] < 0.0)
        full = np.einsum("fq,qa,qb,i,j->faibj", stiffness, shape, shape, n, n, optimize=True)
        rows = full.shape[1] * full.shape[2]
        packed = np.empty((len(touching), packed_size(rows)))
        pack_symmetric(full.reshape(len(touching), rows, rows), packed)
        return self.faces[touching], packed

    def couplings(self, u: Floats) -> Ints:
        """Return nothing: the nodes of a face are coupled anyway."""
        del u
        return self.faces[:0]

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du` up to which no overlap grows too much."""
        room = np.maximum(self._heights(state.u), 0.0) + 0.5 * GROWTH_OF_OVERLAP * self._depth
        rate = self._at_points((du @ self._inward)[: len(self._height)])
        return 1.0 / max(1.0, float((-rate / room).max()))

    def touch(self, state: State) -> Touch:
        """Return area and overlaps."""
        height = self._heights(state.u)
        overlap = 2.0 * np.maximum(-height, 0.0)
        return Touch(
            self.name,
            area=float(self._area[height < 0.0].sum()),
            overlap=float(overlap.max()),
            overlap_per_wall=float((overlap / self._wall).max()),
        )

    def intersects(self, state: State) -> None:
        """Say nothing: there is no independent look at overlaps with a plane."""
        del state

    def gripped(self, state: State, *, dragged: bool) -> Floats:
        """Return nothing: the image slides along with the skin."""
        del state, dragged
        return np.empty((0, WIDTH))

    def _heights(self, u: Floats) -> Floats:
        """Return the heights of the quadrature points ``(k, q)``, mm."""
        return self._at_points(self._height + (u @ self._inward)[: len(self._height)])

    def _at_points(self, at_nodes: Floats) -> Floats:
        return np.asarray(at_nodes[self.faces] @ self.skin.shape.T)

    def _stiffness(self, state: State) -> Floats:
        return np.asarray(2.0 * state.penalty * self._hardness)


def mirrors(mesh: Mesh, contact: Contact) -> list[Mirror]:
    """Return what a body or surface that may meet itself does at the planes of symmetry, also by the barrier a penalty.

    Points in such a plane are at no distance from it, which a barrier cannot hold.

    Raises
    ------
    InputError
        If the body reaches through one of the planes, so that behind it is no mirror image.
    """
    found = []
    for k, plane in enumerate(planes_of_symmetry(mesh), 1):
        plane.check_behind(mesh, "it cannot meet its mirror image", "contact")
        height = plane.height(mesh.points)
        front = np.flatnonzero((height[contact.skin.faces] > plane.off).any(axis=1)).astype(np.int32)
        found.append(Mirror(contact.skin, front, plane, f"{contact.name}:mirror" + (f"-{k}" if k > 1 else "")))
    return found


def cut_across(body: RigidBody, ways: Floats, mesh: Mesh) -> tuple[Floats, float]:
    """Return what the planes of symmetry do to a rigid body that halve it.

    Its other halves feel the forces that the mirror images of the actuator exert. A body beside a plane has a whole
    image of its own behind it.

    Parameters
    ----------
    body
        The body.
    ways
        Along which it may move, ``(n, d)``; one that leads out of a plane has its image move the other way.
    mesh
        The actuator.

    Returns
    -------
    across, part
        The normals of these planes, orthonormal ``(k, 3)``, and what part of the body is in front of all of them.
    """
    places = mesh.points[:: 1 + len(mesh.points) // SAMPLES]
    distance = body.distance(places)[0]
    halving = []
    for plane in planes_of_symmetry(mesh):
        mirrored = places + 2.0 * plane.height(places)[:, None] * plane.normal
        alike = np.allclose(body.distance(mirrored)[0], distance, rtol=0.0, atol=ALIKE * float(np.ptp(places)))
        if alike and (np.abs(ways @ plane.normal) <= ALIKE * np.linalg.norm(ways, axis=1)).all():
            halving.append(plane)
    normals = [plane.normal for plane in halving]
    spanned = np.linalg.qr(np.array(normals).T)[0].T if normals else np.empty((0, mesh.dimension))
    return in_space(spanned), part_in_front(halving)
