"""Contact by a barrier: surfaces that come near push each other apart, ever harder, and never pass (Li et al. 2020)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from turgor.common.errors import InputError
from turgor.common.optional import require
from turgor.fem.contact.facets import Facets
from turgor.fem.contact.friction import WIDTH
from turgor.fem.contact.hull import Hull
from turgor.fem.contact.intersection import edges_and_triangles
from turgor.fem.contact.recent import Recent
from turgor.fem.contact.skin import SOON, Skin
from turgor.fem.contact.term import Touch
from turgor.fem.pattern import packed_size
from turgor.fem.section import Axisymmetric, Section, depth
from turgor.fem.state import State
from turgor.fem.term import NO_NODES, Unlagged, pack_symmetric, resultants, triple
from turgor.mesh.mesh import in_space

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

REACH = 0.01
"""Distance at which the barrier begins to act, in parts of the thinnest wall."""

SMALLEST_REACH = 0.05
"""Where surfaces lie nearer at rest, the barrier begins later, but not below this part of that."""

BELOW_REST = 0.9
"""Part of the smallest gap at rest at which the barrier then begins."""

STIFFNESS = 1.0 / 8.0
"""Stiffness of the barrier over the air pressure: two walls under it are then half of the reach apart (measured)."""


@dataclass(frozen=True, eq=False)
class _Near:
    """The vertices of all pieces in a state, ``(n, d)``, and which pieces are within reach of each other."""

    places: Floats
    collisions: Any


class Barrier(Unlagged):
    """κ Σ a b(δ) over the pairs of pieces of the surface nearer to each other than the reach, δ their distance.

    The pieces follow the curved faces (:class:`turgor.fem.contact.facets.Facets`), their vertices being S (X + u):
    energy, gradient and Hessian by these are the IPC Toolkit's, those by the nodes follow with the constant S. The
    areas a weigh the pairs so that the sum converges with finer pieces (Li et al. 2023).

    Parameters
    ----------
    skin
        The faces.
    group
        Number of each face's group ``(k,)``: only faces of different groups meet. ``None``: any may meet any.
    name
        Of the contact.
    section
        What a plane mesh stands for.
    hull
        A rigid body; then the faces meet it, not each other.
    node
        Row of ``State.u`` that is the displacement of the body; ``None``: it stands still.
    across
        Directions ``(k, 3)`` in which the forces of the body's other halves cancel its own (:func:`resultants`).

    Raises
    ------
    InputError
        If surfaces intersect at rest or lie too near each other.
    MissingPackageError
        If the IPC Toolkit is not installed.
    """

    nodes = NO_NODES
    friction = 0.0

    def __init__(
        self,
        skin: Skin,
        group: Ints | None,
        name: str,
        section: Section | None = None,
        hull: Hull | None = None,
        node: int | None = None,
        across: Floats | None = None,
    ) -> None:
        self._ipctk = require("ipctk", "contact by the barrier method")
        self.skin, self.name, self._hull, self._node = skin, name, hull, node
        self.facets = Facets(skin)
        self._d = skin.dimension
        self._turned, self._across = isinstance(section, Axisymmetric), across
        self._rest, self._weights = self._vertices()
        self._spread = sp.kron(self._weights, sp.identity(self._d), format="csr")
        self._mesh = self._collision_mesh(group, section)
        self._near = Recent(self._look)
        wall = float(skin.wall.min())
        self._wall = wall
        self.reach = self._reach_at_rest(REACH * wall)
        stiffness = STIFFNESS * float(skin.load.min())
        self._potential = self._ipctk.BarrierPotential(self.reach, stiffness, use_physical_barrier=True)

    def energy(self, state: State) -> float:
        """Return the energy, N mm."""
        near = self._near(state.u)
        return float(self._potential(near.collisions, self._mesh, near.places))

    def force(self, state: State, out: Floats) -> None:
        """Add the contact forces, N."""
        nodal = self._weights.T @ self._pushes(state.u)
        out[: len(nodal)] += nodal

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill nothing: all of the stiffness is in :meth:`blocks`."""

    def blocks(self, state: State, lagged: Floats) -> tuple[Ints, Floats]:
        """Return the pairs of nodes coupled now ``(m, 2)``, one and the same node included, and their stiffnesses."""
        del lagged
        near, d = self._near(state.u), self._d
        hessian = self._potential.hessian(near.collisions, self._mesh, near.places)
        whole = (self._spread.T @ sp.csr_matrix(hessian) @ self._spread).tobsr((d, d))
        whole.sort_indices()
        first = np.repeat(np.arange(len(whole.indptr) - 1), np.diff(whole.indptr))
        upper = first <= whole.indices
        nodes = np.column_stack([first, whole.indices])[upper].astype(np.int32)
        values, same = whole.data[upper], nodes[:, 0] == nodes[:, 1]
        full = np.zeros((len(nodes), 2 * d, 2 * d))
        full[same, :d, :d] = 0.5 * (values[same] + values[same].transpose(0, 2, 1))
        full[~same, :d, d:] = values[~same]
        full[~same, d:, :d] = values[~same].transpose(0, 2, 1)
        packed = np.empty((len(nodes), packed_size(2 * d)))
        pack_symmetric(full, packed)
        return nodes, packed

    def couplings(self, u: Floats) -> Ints:
        """Return the nodes of all pairs of faces that face each other nearby, and those that are coupled now.

        They look at each other, each from the other's front: neighbours on one surface and the two sides of a wall
        do not.
        """
        soon = self._soon_coupled(u)
        now = self._coupled(u)
        # of one width: the last node again and again
        now = np.hstack([now, np.repeat(now[:, 1:], soon.shape[1] - 2, axis=1)])
        return np.concatenate([soon, now]).astype(np.int32)

    def _soon_coupled(self, u: Floats) -> Ints:
        faces, around = self.skin.faces, self.facets.around
        if self._hull is not None:
            # what meets a rigid body is one face, and the body's own row if it moves
            return faces[:0] if self._node is None else np.insert(faces, faces.shape[1], self._node, axis=1)
        x = in_space(self.facets.places(u))
        normal = self._vertex_normals(x)
        i, j = cKDTree(x).query_pairs(SOON * self.skin.size, output_type="ndarray").T
        away = x[j] - x[i]
        opposed = np.einsum("ni,ni->n", normal[i], normal[j]) < 0.0
        opposed &= np.einsum("ni,ni->n", away, normal[i]) > 0.0
        opposed &= np.einsum("ni,ni->n", away, normal[j]) < 0.0
        ones = np.ones(int(opposed.sum()), np.float32)
        pairs = sp.csr_matrix((ones, (i[opposed], j[opposed])), shape=(len(x),) * 2)
        facing = sp.coo_matrix(around @ pairs @ around.T)
        return np.hstack([faces[facing.row], faces[facing.col]])

    def longest_step(self, state: State, du: Floats) -> float:
        """Return the part of the step `du` up to which nothing meets anything, by continuous collision detection."""
        begin, end = (self._places(u) for u in (state.u, state.u + du))
        if not np.isfinite(end).all():
            return 1.0  # the iteration has gone astray, which is for the solver to say
        ipctk = self._ipctk
        part = ipctk.compute_collision_free_stepsize(self._mesh, begin, end, narrow_phase_ccd=ipctk.AdditiveCCD())
        return float(part)

    def touch(self, state: State) -> Touch:
        """Return the area within reach and the smallest gap, and force and torque on a rigid body."""
        near, pushes = self._near(state.u), self._pushes(state.u)
        touching = pushes[: self._n].any(axis=1)
        area = float(self._areas[: self._n][touching].sum()) * (0.5 if self._hull is None else 1.0)
        gap = self._smallest_gap(near)
        force = torque = None
        if self._hull is not None:
            push = -in_space(pushes[self._n :])
            arm = in_space(self._rest[self._n :] - self._hull.reference_point)
            force, torque = resultants(push, arm, turned=self._turned, across=self._across)
        per_wall = None if gap is None else gap / self._wall
        moved = None if self._node is None else triple(in_space(state.u[self._node]))
        return Touch(self.name, area, 0.0, 0.0, force, torque, moved, gap, per_wall, barrier=True)

    def gripped(self, state: State, *, dragged: bool) -> Floats:
        """Return nothing: there is no friction."""
        del dragged
        return np.empty((0, WIDTH))

    def intersects(self, state: State) -> bool:
        """Say whether any pieces intersect: never, by construction."""
        return bool(self._ipctk.has_intersections(self._mesh, self._places(state.u)))

    @property
    def _n(self) -> int:
        """Number of vertices that move with the body; those of a rigid one come behind."""
        return len(self.facets.face)

    def _places(self, u: Floats) -> Floats:
        return np.asfortranarray(self._rest + self._weights @ u[: self._weights.shape[1]])

    def _vertices(self) -> tuple[Floats, sp.csr_matrix]:
        """Return all vertices at rest, those of a rigid body last, and what each row of ``State.u`` counts in them."""
        weights, n = self.facets.weights, len(self.skin.points)
        rest = weights @ self.skin.points[:, : self._d]
        if self._hull is None:
            return rest, weights
        columns, vertices = n if self._node is None else self._node + 1, np.arange(len(self._hull.vertices))
        led = vertices[:0] if self._node is None else vertices
        at = (led, np.full(len(led), columns - 1))
        bodies = sp.csr_matrix((np.ones(len(led)), at), shape=(len(vertices), columns))
        own = sp.csr_matrix((weights.data, weights.indices, weights.indptr), shape=(self._n, columns))
        return np.vstack([rest, self._hull.vertices]), sp.vstack([own, bodies], format="csr")

    def _look(self, u: Floats) -> _Near:
        places = self._places(u)
        return _Near(places, self._collisions(places, self.reach))

    def _collisions(self, places: Floats, reach: float) -> Any:
        found = self._ipctk.NormalCollisions()
        found.use_area_weighting = True
        found.collision_set_type = self._ipctk.NormalCollisions.IMPROVED_MAX_APPROX
        # On several threads the IPC Toolkit (1.6.1) now and then counts a pair of edges twice or not at all.
        threads = self._ipctk.get_num_threads()
        self._ipctk.set_num_threads(1)
        try:
            found.build(self._mesh, places, reach)
        finally:
            self._ipctk.set_num_threads(threads)
        return found

    def _pushes(self, u: Floats) -> Floats:
        """Return the derivatives of the energy by the vertices, ``(n, d)``, N."""
        near = self._near(u)
        return np.asarray(self._potential.gradient(near.collisions, self._mesh, near.places)).reshape(-1, self._d)

    def _smallest_gap(self, near: _Near) -> float | None:
        if near.collisions.empty():
            return None
        return float(np.sqrt(near.collisions.compute_minimum_distance(self._mesh, near.places)))

    def _coupled(self, u: Floats) -> Ints:
        nodes, _ = self.blocks(State(u, (), np.empty(0)), np.empty(0))
        return nodes

    def _vertex_normals(self, x: Floats) -> Floats:
        normal = np.zeros_like(x)
        of_pieces = self.facets.normals(x)
        for corner in self.facets.pieces.T:
            np.add.at(normal, corner, of_pieces)
        return normal

    def _collision_mesh(self, group: Ints | None, section: Section | None) -> Any:
        """Return the IPC Toolkit's mesh at rest, with the areas of the model and of who may meet whom."""
        ipctk, facets = self._ipctk, self.facets
        rest = np.asfortranarray(self._rest)
        edges, triangles = edges_and_triangles(facets.pieces)
        patch = None if group is None else group[facets.face]
        if self._hull is not None:
            more_edges, more_triangles = edges_and_triangles(self._hull.pieces + np.int32(self._n))
            edges, triangles = np.vstack([edges, more_edges]), np.vstack([triangles, more_triangles])
            patch = (np.arange(len(rest)) >= self._n).astype(np.int32)
        mesh = ipctk.CollisionMesh(rest, np.asfortranarray(edges), np.asfortranarray(triangles))
        areas = np.array(mesh.vertex_areas)
        areas[: self._n] *= depth(section, rest[: self._n])
        # A rigid body's pieces may be large: what they count must not depend on how it is cut.
        areas[self._n :] = np.minimum(areas[self._n :], areas[: self._n].mean())
        lengths = np.array(mesh.edge_areas)
        own = (edges < self._n).all(axis=1)
        lengths[~own] = np.minimum(lengths[~own], lengths[own].mean())
        mesh.vertex_areas, mesh.edge_areas = areas, lengths
        if patch is not None:
            mesh.can_collide = ipctk.make_vertex_patches_filter(patch)
        self._areas = areas
        return mesh

    def _reach_at_rest(self, wanted: float) -> float:
        """Return the reach: as wanted, or less where surfaces lie nearer at rest, so that nothing pushes there.

        Raises
        ------
        InputError
            Where they lie too near.
        """
        rest = np.asfortranarray(self._mesh.rest_positions)
        crossing = self._ipctk.has_intersections(self._mesh, rest)
        gap = 0.0 if crossing else self._smallest_gap(_Near(rest, self._collisions(rest, wanted)))
        if gap is None:
            return wanted
        if gap < SMALLEST_REACH * wanted / BELOW_REST:
            raise InputError(
                "surfaces touch or intersect at rest"
                if crossing
                else "surfaces lie too near each other at rest for a barrier",
                key="contact",
                value=f"{self.name}: {gap:.3g} mm apart",
                expected=f"a gap of {SMALLEST_REACH * wanted / BELOW_REST:.2g} mm or more, or method: penalty",
            )
        return BELOW_REST * gap
