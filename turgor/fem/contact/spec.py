"""Contacts as the user names them, and the terms that they become on a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.rows import row_numbers
from turgor.fem.contact.barrier import REACH, Barrier
from turgor.fem.contact.hull import hull
from turgor.fem.contact.mirror import cut_across
from turgor.fem.contact.obstacle import Obstacle
from turgor.fem.contact.skin import Skin
from turgor.fem.contact.surfaces import SurfaceContact
from turgor.fem.contact.term import Contact
from turgor.fem.rigid import RigidBody, Sectioned, Vector
from turgor.fem.section import Axisymmetric, Section, in_section, on_axis
from turgor.materials.hyperelastic import Hyperelastic
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh

log = logger("fem")

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


Method = Literal["penalty", "barrier"]
"""A penalty on overlaps, or a barrier that keeps surfaces apart (IPC Toolkit)."""

PARTS_OF_REACH = 0.25
"""The pieces of a round rigid body may be off it by this part of the barrier's reach."""


@dataclass(frozen=True)
class SelfContact:
    """Any part of the skin may meet any other; which ones do is found on the way.

    Attributes
    ----------
    friction
        Coefficient of friction, 0 or more.
    method
        ``penalty`` on overlaps or ``barrier`` before them.
    """

    friction: float = 0.0
    method: Method = "penalty"

    def __post_init__(self) -> None:
        _check(self)

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return "self"


@dataclass(frozen=True)
class PairContact:
    """Two surfaces of the mesh, or one and itself, may meet; friction and method as for :class:`SelfContact`."""

    first: str
    second: str
    friction: float = 0.0
    method: Method = "penalty"

    def __post_init__(self) -> None:
        _check(self)

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return f"{self.first}:{self.second}"

    @property
    def is_of_one(self) -> bool:
        """Whether a surface may meet itself."""
        return self.first == self.second


@dataclass(frozen=True)
class Spring:
    """What a rigid body is on: it moves along `direction` only, held by `stiffness`, N/mm."""

    stiffness: float
    direction: Vector

    def __post_init__(self) -> None:
        if not 0.0 < self.stiffness < np.inf:
            raise InputError("a spring's stiffness must be positive", key="contact.spring", value=self.stiffness)
        if not np.linalg.norm(self.direction) > 0.0:
            raise InputError("this direction has no length", key="contact.spring.direction", value=self.direction)


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
        Its displacement at load fraction one, mm, in proportion before; ``None``: it stands still. With a spring, that
        of the spring's far end.
    label
        What the body is called in results.
    friction
        Coefficient of friction, 0 or more.
    method
        ``penalty`` on overlaps or ``barrier`` before them.
    spring
        What the body is on: the force on it is the spring's stiffness times its displacement.
    """

    body: RigidBody
    surface: str | None = None
    motion: Vector | None = None
    label: str = "body"
    friction: float = 0.0
    method: Method = "penalty"
    spring: Spring | None = None

    def __post_init__(self) -> None:
        _check(self)

    @property
    def name(self) -> str:
        """What the contact is called in results."""
        return self.label

    @property
    def is_load(self) -> bool:
        """Whether its motion is a load; a barrier's body is led like a support, so that no step takes it too far."""
        return self.motion is not None and self.method == "penalty"

    @property
    def is_unknown(self) -> bool:
        """Whether its displacement is a row of ``State.u``."""
        return self.spring is not None or (self.motion is not None and any(self.motion) and not self.is_load)


ContactCase = SelfContact | PairContact | RigidContact


def make_contact(
    mesh: Mesh,
    materials: Mapping[str, Hyperelastic],
    case: ContactCase,
    pressure: float,
    channel: int | None,
    section: Section | None = None,
    number: int = 0,
    node: int | None = None,
) -> Contact:
    """Return the term of a contact; of a surface with itself without what it does at planes of symmetry
    (:func:`turgor.fem.contact.mirror.mirrors`).

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
    section
        What a plane mesh stands for.
    number
        Place of what friction remembers in ``State.grips``.
    node
        Row of ``State.u`` that is the displacement of a rigid body on a spring.

    Raises
    ------
    InputError
        If the mesh has no such surface, or a rigid body does not fit the section.
    """
    barrier = case.method == "barrier"
    if isinstance(case, RigidContact):
        faces = _whole(mesh, section) if case.surface is None else mesh.surface(case.surface)
        body, motion = _fitting(case, mesh, section)
        _tell_what_it_stands_for(case, section)
        turned, (across, _) = isinstance(section, Axisymmetric), cut_across(body, _ways(case, motion), mesh)
        skin = Skin(mesh, faces, materials, pressure, section)
        if barrier:
            error = PARTS_OF_REACH * REACH * float(skin.wall.min())
            around = hull(body, mesh.points, error, f"contact.{case.name}")
            return Barrier(skin, None, case.name, section, around, node, across)
        return Obstacle(skin, body, motion, channel, case.name, turned, case.friction, number, node, across)
    faces, group = _meeting(mesh, case, section)
    skin = Skin(mesh, faces, materials, pressure, section)
    if barrier:
        return Barrier(skin, group, case.name, section)
    return SurfaceContact(skin, group, case.name, case.friction, number)


def led(case: RigidContact, mesh: Mesh, section: Section | None) -> tuple[Floats, bool]:
    """Return what a body whose displacement is a row of ``State.u`` is led by ``(d,)``, and whether it is free in it.

    That is the direction of its spring, or its motion. InputError is raised if it does not fit the model.
    """
    if case.spring is not None:
        return in_section(case.spring.direction, mesh, section, f"contact.{case.name}.spring", total=True), True
    assert case.motion is not None
    return in_section(case.motion, mesh, section, f"contact.{case.name}.motion", total=True), False


def spring_stiffness(case: RigidContact, mesh: Mesh, section: Section | None) -> float:
    """Return the stiffness of the part of a body's spring that is in the model, N/mm.

    A plane of symmetry that halves the body halves the spring as well: the other half is held by the other.
    """
    assert case.spring is not None
    body, motion = _fitting(case, mesh, section)
    return case.spring.stiffness * cut_across(body, _ways(case, motion), mesh)[1]


def _ways(case: RigidContact, motion: Floats) -> Floats:
    """Return along what a body may move, ``(n, d)``."""
    return np.array([motion] if case.spring is None else [motion, case.spring.direction[: len(motion)]])


def _check(case: ContactCase) -> None:
    """Refuse what a contact cannot be asked for."""
    if not 0.0 <= case.friction < np.inf:
        raise InputError("a coefficient of friction is not negative", key="contact.friction", value=case.friction)
    if case.method not in get_args(Method):
        raise InputError(
            "there is no such method of contact",
            key="contact.method",
            value=case.method,
            expected=" or ".join(get_args(Method)),
        )
    if case.method == "barrier" and case.friction > 0.0:
        raise InputError(
            "the barrier knows no friction",
            key="contact.friction",
            value=case.friction,
            expected="0, or method: penalty",
        )
    if case.method == "barrier" and isinstance(case, RigidContact) and case.motion is not None and case.spring:
        raise InputError(
            "by the barrier a spring has no far end that moves",
            key=f"contact.{case.name}",
            value=case.motion,
            expected="a motion or a spring, or method: penalty",
        )


def _meeting(mesh: Mesh, case: SelfContact | PairContact, section: Section | None) -> tuple[Ints, Ints | None]:
    """Return the faces that may meet and the group of each; without groups any may meet any."""
    if isinstance(case, SelfContact):
        return _whole(mesh, section), None
    if case.is_of_one:
        return mesh.surface(case.first), None
    both = [mesh.surface(name) for name in (case.first, case.second)]
    faces = np.vstack(both)
    if len(np.unique(row_numbers(np.sort(faces, axis=1)))) < len(faces):
        raise InputError(
            "two surfaces that may touch each other share faces",
            key="contact.pairs",
            value=case.name,
            expected="surfaces apart from each other, a surface with itself, or self: true",
        )
    return faces, np.repeat(np.array([0, 1], np.int32), [len(part) for part in both])


def _whole(mesh: Mesh, section: Section | None) -> Ints:
    """Return all faces of the skin; what lies on the axis of revolution is none."""
    faces = boundary_faces(mesh.cells)
    return faces[~np.isin(faces, on_axis(mesh, section)).all(axis=1)]


def _fitting(case: RigidContact, mesh: Mesh, section: Section | None) -> tuple[RigidBody, Floats]:
    """Return body and motion as the model sees them; raise InputError if they do not fit it."""
    key = f"contact.{case.name}"
    motion = np.zeros(mesh.dimension)
    if case.motion is not None:
        motion = in_section(case.motion, mesh, section, f"{key}.motion", total=True)
    body = case.body
    if section is not None:
        if not isinstance(body, Sectioned):
            raise InputError("this body has no place in a plane model", key=key, value=type(body).__name__)
        body = _section(body, section, key)
    if len(body.reference_point) != mesh.dimension:
        raise InputError(
            "the body does not fit the model",
            key=key,
            value=f"{len(body.reference_point)} coordinates",
            expected=f"{mesh.dimension} coordinates",
        )
    return body, motion


def _section(body: Sectioned, section: Section, key: str) -> Sectioned:
    """Return what a plane model meets of a body."""
    try:
        _stands_for(body, section)
        return body.section()
    except InputError as error:
        raise InputError(error.problem, key=f"{key}.{error.key}", value=error.value, expected=error.expected) from None


def _stands_for(body: Sectioned, section: Section) -> str:
    """Return what another body one in space becomes in a body of revolution, else nothing."""
    in_space = len(body.reference_point) > body.section().reference_point.size
    return body.turned() if in_space and isinstance(section, Axisymmetric) else ""


def _tell_what_it_stands_for(case: RigidContact, section: Section | None) -> None:
    other = "" if section is None or not isinstance(case.body, Sectioned) else _stands_for(case.body, section)
    if other:
        what = type(case.body).__name__.lower()
        log.warning("contact.%s: this %s stands for a %s about the axis of the model", case.name, what, other)
