"""Dirichlet conditions: which degrees of freedom are given, in which frame, and their values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.section import Section, on_axis
from turgor.fem.supports import Clamped, Prescribed, Sliding, face_normals
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

Condition = tuple[Floats, float, str]
"""Unit direction ``(d,)``, displacement along it at load fraction one, mm, and the surface whose support says so."""

SAME_DIRECTION = 1e-6
"""Sine of the angle below which two constrained directions at a node count as one."""

FLAT = 1e-9
"""Component of a unit normal that counts as none, and by which the faces of a flat surface may look aside."""

CREASE = np.cos(np.radians(25.0))
"""Faces of a sliding surface that meet at a node at a larger angle constrain it each in its own direction."""


@dataclass(frozen=True, eq=False)
class Constraints:
    """The given components of displacement, node by node.

    Attributes
    ----------
    fixed
        Which components are given, ``(n_points, d)``, in the node's frame.
    value
        Their values at load fraction one, ``(n_points, d)``, mm, in the node's frame.
    frame_nodes, frames
        The nodes whose constrained directions are not the axes ``(k,)``, and their orthonormal frames ``(k, d, d)``:
        one direction a row, the constrained ones first.
    """

    fixed: NDArray[np.bool_]
    value: Floats
    frame_nodes: Ints
    frames: Floats

    def to_frames(self, vectors: Floats) -> Floats:
        """Return nodal `vectors` ``(n_points, d)`` with components in the nodes' frames."""
        return self._turned(vectors, "kij,kj->ki")

    def from_frames(self, vectors: Floats) -> Floats:
        """Return nodal `vectors` ``(n_points, d)``, given in the nodes' frames, in x, y and z."""
        return self._turned(vectors, "kji,kj->ki")

    def imposed(self, u: Floats, fraction: float) -> Floats:
        """Return `u` with the given components set to their values at a load fraction."""
        local = self.to_frames(u)
        local[self.fixed] = fraction * self.value[self.fixed]
        return self.from_frames(local)

    @property
    def moves(self) -> bool:
        """Whether any given value differs from zero."""
        return bool(np.any(self.value))

    def _turned(self, vectors: Floats, rule: str) -> Floats:
        turned = vectors.copy()
        if len(self.frame_nodes):
            turned[self.frame_nodes] = np.einsum(rule, self.frames, vectors[self.frame_nodes])
        return turned


def compile_constraints(
    mesh: Mesh, supports: Iterable[Clamped | Sliding | Prescribed], section: Section | None = None
) -> Constraints:
    """Turn supports into constraints on the nodes of `mesh`; those on an axis of revolution stay on it by themselves.

    Raises
    ------
    InputError
        If two supports prescribe different displacements of one node in one direction, or one leaves the plane.
    """
    fixed = np.zeros(mesh.points.shape, bool)
    values = np.zeros(mesh.points.shape)
    framed: list[Ints] = []
    frames: list[Floats] = []
    for nodes, conditions in conditions_at_nodes(mesh, supports, section):
        axes, given, frame = _held(*_independent(conditions, mesh.points[nodes[0]]))
        fixed[nodes[:, None], axes] = True
        values[nodes[:, None], axes] = given
        if frame is not None:
            framed.append(nodes)
            frames.append(np.broadcast_to(frame, (len(nodes), *frame.shape)))
    d = mesh.dimension
    return Constraints(
        fixed,
        values,
        np.concatenate([np.empty(0, np.int32), *framed]),
        np.concatenate([np.empty((0, d, d)), *frames]),
    )


def with_bodies(constraints: Constraints, bodies: Sequence[tuple[Floats, bool]]) -> Constraints:
    """Return the constraints with a row more for each rigid body.

    Each is led by a vector ``(d,)``: it moves freely along it, and only along it, or by it at load fraction one.
    """
    if not bodies:
        return constraints
    n, d = constraints.fixed.shape
    frames = np.array([_completed(vector[None] / np.linalg.norm(vector))[::-1] for vector, _ in bodies])
    fixed = np.ones((len(bodies), d), bool)
    fixed[:, -1] = [not free for _, free in bodies]
    value = np.zeros((len(bodies), d))
    value[:, -1] = [0.0 if free else frame[-1] @ vector for frame, (vector, free) in zip(frames, bodies, strict=True)]
    return Constraints(
        np.vstack([constraints.fixed, fixed]),
        np.vstack([constraints.value, value]),
        np.concatenate([constraints.frame_nodes, n + np.arange(len(bodies), dtype=np.int32)]),
        np.concatenate([constraints.frames, frames]),
    )


def conditions_at_nodes(
    mesh: Mesh, supports: Iterable[Clamped | Sliding | Prescribed], section: Section | None = None
) -> list[tuple[Ints, list[Condition]]]:
    """Return nodes ``(k,)`` that are held alike and by what, in the order of the supports; last of all the axis.

    Raises
    ------
    InputError
        If a displacement leaves the plane.
    """
    held = [
        (nodes, (direction, value, support.surface))
        for support in supports
        for nodes, direction, value in _conditions(mesh, support)
    ]
    if len(nodes := on_axis(mesh, section)):
        held.append((nodes, (np.array([1.0, 0.0]), 0.0, "axis")))
    return [(alike, [held[k][1] for k in conditions]) for alike, conditions in _alike([nodes for nodes, _ in held])]


def _alike(groups: Sequence[Ints]) -> Iterable[tuple[Ints, list[int]]]:
    """Yield the nodes that lie in the same ones of some groups of nodes, and the numbers of these groups, ascending."""
    if not groups:
        return
    node = np.concatenate(groups)
    group = np.repeat(np.arange(len(groups)), [len(nodes) for nodes in groups])
    found, row, count = np.unique(node, return_inverse=True, return_counts=True)
    order = np.argsort(row, kind="stable")
    lists = np.full((len(found), count.max()), -1)
    lists[row[order], np.arange(len(node)) - np.repeat(np.cumsum(count) - count, count)] = group[order]
    kinds, kind, size = np.unique(lists, axis=0, return_inverse=True, return_counts=True)
    members = np.split(found[np.argsort(kind.ravel(), kind="stable")], np.cumsum(size)[:-1])
    for nodes, numbers in zip(members, kinds, strict=True):
        yield nodes.astype(np.int32), numbers[numbers >= 0].tolist()


def _conditions(mesh: Mesh, support: Clamped | Sliding | Prescribed) -> Iterable[tuple[Ints, Floats, float]]:
    if isinstance(support, Sliding):
        for nodes, normal in _node_normals(mesh.points, mesh.surface(support.surface)):
            yield nodes, normal, 0.0
        return
    d = mesh.dimension
    given = (0.0,) * d if isinstance(support, Clamped) else support.displacement
    if len(given) < d or any(given[d:]):
        expected = f"{d} displacements" + (", none out of the plane" if d == 2 else "")
        raise InputError(
            "the displacement does not fit the model", key=f"supports.{support.surface}", value=given, expected=expected
        )
    nodes = mesh.surface_nodes(support.surface)
    for axis, component in zip(np.eye(d), given[:d], strict=True):
        if component is not None:
            yield nodes, axis, component


def _node_normals(points: Floats, faces: Ints) -> Iterable[tuple[Ints, Floats]]:
    """Yield unit normals ``(d,)`` with the nodes that have them: the faces' mean at each node, weighted by area.

    Where faces meet at a crease, a node has one for each side of it.
    """
    face_normal = face_normals(points, faces).sum(axis=1)
    largest = face_normal[np.argmax(np.linalg.norm(face_normal, axis=1))]
    common = _unit(largest)
    if np.abs(face_normal - (face_normal @ common)[:, None] * common).max() <= FLAT * np.linalg.norm(largest):
        yield np.unique(faces), common
        return
    groups: dict[int, list[Floats]] = {}
    for face, normal in zip(faces, face_normal, strict=True):
        for node in face:
            here = groups.setdefault(int(node), [])
            for k, other in enumerate(here):
                if normal @ other > CREASE * np.linalg.norm(normal) * np.linalg.norm(other):
                    here[k] = other + normal
                    break
            else:
                here.append(normal)
    for node, normals in groups.items():
        for normal in normals:
            yield np.array([node], np.int32), _unit(normal)


def _unit(normal: Floats) -> Floats:
    unit = normal / np.linalg.norm(normal)
    # A flat face that looks along an axis is to say so exactly.
    return np.asarray(np.where(np.abs(unit) < FLAT, 0.0, unit))


def _independent(conditions: list[Condition], place: Floats) -> tuple[Floats, Floats]:
    """Orthonormalise the constrained directions at one node, checking that the given values agree."""
    basis: list[Floats] = []
    given: list[float] = []
    for direction, wanted, surface in conditions:
        known = np.array([b @ direction for b in basis])
        rest = direction - sum((c * b for c, b in zip(known, basis, strict=True)), np.zeros(len(direction)))
        left = wanted - float(known @ np.array(given)) if basis else wanted
        size = float(np.linalg.norm(rest))
        if size > SAME_DIRECTION:
            basis.append(rest / size)
            given.append(left / size)
        elif abs(left) > 1e-9 * max(1.0, abs(wanted)):
            raise InputError(
                "two supports prescribe different displacements of the same node near "
                f"({', '.join(f'{x:.3g}' for x in place)}) mm",
                key=f"supports.{surface}",
                expected="supports that agree where their surfaces meet",
            )
    return np.array(basis), np.array(given)


def _held(basis: Floats, given: Floats) -> tuple[NDArray[np.intp], Floats, Floats | None]:
    """Return which components are given, their values, and the frame in which they are, ``None`` for the axes."""
    axes = np.argmax(np.abs(basis), axis=1)
    along = basis[np.arange(len(basis)), axes]
    if np.allclose(np.abs(along), 1.0, atol=1e-12):
        return axes, given * np.sign(along), None
    return np.arange(len(basis)), given, _completed(basis)


def _completed(basis: Floats) -> Floats:
    """Add directions until `basis` ``(k, d)`` is an orthonormal frame."""
    _, _, rest = np.linalg.svd(basis)
    return np.vstack([basis, rest[len(basis) :]])
