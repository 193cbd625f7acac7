"""How much a body's free surface is compressed: beyond a certain measure it folds into creases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from turgor.fem.section import Axisymmetric, PlaneStrain, Section
from turgor.mesh.cells import face_cell

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def surface_stretches(points: Floats, u: Floats, faces: Ints, section: Section | None) -> tuple[Floats, Floats]:
    """Return the principal stretches of a surface at the quadrature points of its faces, and these points.

    Parameters
    ----------
    points, u
        Nodes at rest and their displacement, ``(n_points, d)``, mm.
    faces
        ``(k, nodes_per_face)``.
    section
        What a plane mesh stands for.

    Returns
    -------
    stretches
        ``(k, q, 3)``: the smaller and the larger one in the surface, and the one along its normal, which is what
        these leave of an unchanged volume.
    places
        At rest, ``(k, q, d)``.
    """
    cell = face_cell(faces)
    # The tangents' metric now, measured by that at rest: its eigenvalues are the squares of the stretches.
    tangents = [np.einsum("kad,qai->kqdi", x[faces], cell.gradient_at_quadrature) for x in (points, points + u)]
    before, after = (np.einsum("kqdi,kqdj->kqij", t, t) for t in tangents)
    squares = np.linalg.eigvals(np.linalg.solve(before, after)).real
    within = np.sqrt(np.sort(squares, axis=-1))
    places = np.einsum("qa,kad->kqd", cell.shape_at_quadrature, points[faces])
    if section is not None:
        within = np.concatenate([within, _out_of_plane(places, u, faces, section, within)], axis=-1)
        within = np.sort(within, axis=-1)
    normal = 1.0 / within.prod(axis=-1, keepdims=True)
    return np.concatenate([within, normal], axis=-1), places


def _out_of_plane(places: Floats, u: Floats, faces: Ints, section: Section, along: Floats) -> Floats:
    """Return the stretch across the plane, ``(k, q, 1)``; that of a free sheet is the one along its normal too."""
    if isinstance(section, PlaneStrain):
        return np.ones_like(along)
    if isinstance(section, Axisymmetric):
        moved = np.einsum("qa,ka->kq", face_cell(faces).shape_at_quadrature, u[faces][:, :, 0])
        return np.asarray(1.0 + moved / places[:, :, 0])[:, :, None]
    return np.asarray(along**-0.5)
