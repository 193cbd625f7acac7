"""Faces that may meet by more than one contact press on each other once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.fem.contact.spec import ContactCase, PairContact, RigidContact, SelfContact
from turgor.mesh.cells import face_cell
from turgor.mesh.faces import places_of_faces
from turgor.mesh.mesh import Mesh

log = logger("fem")


def each_pair_once(mesh: Mesh, cases: Sequence[ContactCase]) -> list[ContactCase]:
    """Return the contacts without those whose faces may all meet by another one already.

    What would be left of a contact by taking pairs of faces out of it is no substitute: near the rim of what is left,
    points would meet that rim besides the faces beyond it.

    Raises
    ------
    InputError
        If contacts share some pairs of faces but not all, or differ in friction or method.
    """
    kept: list[SelfContact | PairContact] = []
    among_faces = [case for case in cases if not isinstance(case, RigidContact)]
    for case in sorted(among_faces, key=lambda case: isinstance(case, PairContact)):
        other = next((one for one in kept if _shared(mesh, one, case).any()), None)
        if other is None:
            kept.append(case)
            continue
        _check_alike(mesh, other, case)
        log.warning("contact: '%s' counts once, with '%s', by which its faces may meet already", case.name, other.name)
    return [case for case in cases if isinstance(case, RigidContact) or any(case is one for one in kept)]


def _check_alike(mesh: Mesh, other: SelfContact | PairContact, case: SelfContact | PairContact) -> None:
    problem = ""
    if (other.friction, other.method) != (case.friction, case.method):
        problem = f"of these surfaces also '{other.name}' says how they meet, and says otherwise"
    elif not _shared(mesh, other, case).all():
        problem = f"some faces of these surfaces may meet by '{other.name}' already, others not"
    if problem:
        expected = "surfaces that share no faces in two pairs, or self: true alone"
        raise InputError(problem, key="contact.pairs", value=case.name, expected=expected)


def _shared(mesh: Mesh, other: SelfContact | PairContact, case: SelfContact | PairContact) -> NDArray[np.bool_]:
    """Return whether some and whether all pairs of faces of a contact may meet by another one, ``(2,)``."""
    if isinstance(other, SelfContact) or isinstance(case, SelfContact):
        return np.ones(2, bool)
    ways = ((other.first, other.second), (other.second, other.first))
    found = [_inside(mesh, a, case.first) & _inside(mesh, b, case.second) for a, b in ways]
    return np.asarray(found[0] | found[1])


def _inside(mesh: Mesh, surface: str, part: str) -> NDArray[np.bool_]:
    """Return whether some and whether all faces of one surface are faces of another, ``(2,)``."""
    faces = mesh.surface(part)
    inside = places_of_faces(mesh.surface(surface), faces[:, : face_cell(faces).n_corners]) >= 0
    return np.array([inside.any(), inside.all()])
