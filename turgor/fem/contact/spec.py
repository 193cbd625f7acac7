"""Contacts as the user names them, and the terms that they become on a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.contact.obstacle import Obstacle
from turgor.fem.contact.skin import Skin
from turgor.fem.contact.surfaces import SurfaceContact
from turgor.fem.contact.term import Contact
from turgor.fem.rigid import RigidBody, Vector
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class SelfContact:
    """Any part of the skin may meet any other; which ones do is found on the way."""

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return "self"


@dataclass(frozen=True)
class PairContact:
    """Two surfaces of the mesh may meet each other."""

    first: str
    second: str

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return f"{self.first}:{self.second}"


@dataclass(frozen=True)
class RigidContact:
    """The skin, or one surface of it, may meet a rigid body.

    Attributes
    ----------
    body
        Its shape and place.
    surface
        The surface that may meet it; ``None``: the whole skin.
    motion
        Its displacement at load fraction one, mm, in proportion before; ``None``: it stands still.
    label
        What the body is called in results.
    """

    body: RigidBody
    surface: str | None = None
    motion: Vector | None = None
    label: str = "body"

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return self.label


ContactCase = SelfContact | PairContact | RigidContact


def make_contact(
    mesh: Mesh, materials: Mapping[str, Hyperelastic], case: ContactCase, pressure: float, channel: int | None
) -> Contact:
    """Return the term of a contact.

    Parameters
    ----------
    mesh, materials
        The body.
    case
        What may meet what.
    pressure
        The largest air pressure, MPa: it sets the scale of the contact stiffness.
    channel
        Place of the motion's factor in ``State.loads``, for a rigid body that moves.

    Raises
    ------
    InputError
        If the mesh has no such surface, or is not of tetrahedra.
    """
    if mesh.cell_type != "tet10":
        raise InputError("contact works on meshes of tetrahedra only", key="contact", value=mesh.cell_type)
    if isinstance(case, RigidContact):
        faces = boundary_faces(mesh.cells) if case.surface is None else mesh.surface(case.surface)
        motion = np.array(case.motion or (0.0, 0.0, 0.0))
        return Obstacle(Skin(mesh, faces, materials, pressure), case.body, motion, channel, case.name)
    if isinstance(case, PairContact):
        first, second = mesh.surface(case.first), mesh.surface(case.second)
        group = np.repeat(np.array([0, 1], np.int32), [len(first), len(second)])
        return SurfaceContact(Skin(mesh, np.vstack([first, second]), materials, pressure), group, case.name)
    return SurfaceContact(Skin(mesh, boundary_faces(mesh.cells), materials, pressure), None, case.name)
