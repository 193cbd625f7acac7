"""Is every part of the body held? A free rigid motion makes the stiffness singular, so it is refused beforehand."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.cavity import Cavity
from turgor.fem.constraints import Constraints
from turgor.fem.incidence import parts
from turgor.fem.section import Axisymmetric, Section
from turgor.fem.supports import ElasticSupport, face_normals
from turgor.mesh.cells import face_cell
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]

NEGLIGIBLE = 1e-8


def check_held(
    mesh: Mesh, constraints: Constraints, springs: Iterable[ElasticSupport], section: Section | None = None
) -> None:
    """Refuse a body, or a part of one, that can move as a whole without meeting a support.

    Raises
    ------
    InputError
        Naming a motion that nothing stops; or if nothing can move at all.
    """
    if constraints.fixed.all():
        raise InputError(
            "supports hold every node, and nothing is left to be found",
            key="supports",
            expected="supports on a part of the surface, or a finer mesh",
        )
    count, part = parts(mesh.cells, mesh.n_points)
    nodes, directions = _held_directions(mesh, constraints, springs)
    size = float(np.ptp(mesh.points, axis=0).max())
    for k in range(count):
        here = part[nodes] == k
        centre = mesh.points[part == k].mean(axis=0)
        arm = (mesh.points[nodes[here]] - centre) / size
        free = _free_motion(*_work(arm, directions[here], section))
        if free is not None:
            what = (
                "the body" if count == 1 else f"part {k + 1} of {count} of the body, which is not joined to the rest,"
            )
            raise InputError(
                f"{what} is free to {free}", key="supports", expected="supports that stop every rigid motion"
            )


def check_rim(cavity: Cavity, constraints: Constraints) -> None:
    """Refuse a cavity whose rim may leave the symmetry plane that closes it.

    Raises
    ------
    InputError
        Naming the cavity and the axis across which the plane lies.
    """
    nodes, axes = cavity.field.rim
    fixed = constraints.fixed[nodes, axes] & (constraints.value[nodes, axes] == 0.0)
    fixed &= ~np.isin(nodes, constraints.frame_nodes)
    if not fixed.all():
        axis = "xyz"[axes[np.argmin(fixed)]]
        raise InputError(
            f"the cavity leaks: it ends in a plane across {axis} that nothing holds",
            key=cavity.name,
            expected="a sliding or clamped support on the body's surface in that plane",
        )


def _held_directions(
    mesh: Mesh, constraints: Constraints, springs: Iterable[ElasticSupport]
) -> tuple[NDArray[np.integer], Floats]:
    """Return the nodes ``(k,)`` and unit directions ``(k, d)`` along which something holds them."""
    d = mesh.dimension
    frames = np.broadcast_to(np.eye(d), (mesh.n_points, d, d)).copy()
    frames[constraints.frame_nodes] = constraints.frames
    node, component = np.nonzero(constraints.fixed)
    nodes: list[NDArray[np.integer]] = [node]
    directions = [frames[node, component]]
    for support in springs:
        faces = mesh.surface(support.surface)
        if support.normal_only:
            normal = face_normals(mesh.points, faces).sum(axis=1)
            unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            corners = faces[:, : face_cell(faces).n_corners]
            nodes.append(corners.ravel())
            directions.append(np.repeat(unit, corners.shape[1], axis=0))
        else:
            corners = np.unique(faces)
            nodes.append(np.repeat(corners, d))
            directions.append(np.tile(np.eye(d), (len(corners), 1)))
    return np.concatenate(nodes), np.concatenate(directions)


def _work(arm: Floats, directions: Floats, section: Section | None) -> tuple[Floats, tuple[str, ...]]:
    """Return how far each rigid motion moves each place along its held direction ``(k, n_motions)``, and their names.

    `arm` and `directions` are ``(k, d)``. A body of revolution can only shift along its axis.
    """
    shifts = ("shift along x", "shift along y", "shift along z")
    if isinstance(section, Axisymmetric):
        return directions[:, 1:], shifts[1:2]
    if section is not None:
        turn = arm[:, 0] * directions[:, 1] - arm[:, 1] * directions[:, 0]
        return np.column_stack([directions, turn]), (*shifts[:2], "turn about z")
    turns = ("turn about x", "turn about y", "turn about z")
    return np.hstack([directions, np.cross(arm, directions)]), (*shifts, *turns)


def _free_motion(rows: Floats, motions: tuple[str, ...]) -> str | None:
    """Return the name of the rigid motion that the held directions do not stop, if there is one."""
    values, modes = np.linalg.eigh(rows.T @ rows)
    if len(rows) and values[0] > NEGLIGIBLE * values[-1]:
        return None
    return motions[int(np.argmax(np.abs(modes[:, 0])))]
