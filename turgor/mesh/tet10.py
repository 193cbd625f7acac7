"""Geometry of curved ten-node tetrahedra and six-node triangles: Jacobians, volumes, bounds.

Node order as in VTK: corners 0 1 2 3, then the middles of the edges 01 12 02 03 13 23; triangles have corners 0 1 2,
then the middles of 01 12 20. The reference tetrahedron has its corners at the origin and the three unit vectors.
"""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
"""Corners of the edge on whose middle each of the nodes 4 to 9 sits."""

FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]], dtype=np.int32)
"""The four faces as six-node triangles whose normals point out of the tetrahedron."""

_A, _B = (5 + 3 * math.sqrt(5)) / 20, (5 - math.sqrt(5)) / 20
QUADRATURE_POINTS = np.array([[_B, _B, _B], [_A, _B, _B], [_B, _A, _B], [_B, _B, _A]])
"""Four-point rule of degree 2, equal weights 1/24 (Hammer, Marlowe and Stroud, 1956)."""


def shape_gradients(points: FloatArray) -> FloatArray:
    """Return the gradients of the ten shape functions.

    Parameters
    ----------
    points
        Reference coordinates, shape ``(q, 3)``.

    Returns
    -------
    ndarray
        ``∂N_a/∂ξ_i``, shape ``(q, 10, 3)``.
    """
    barycentric = np.column_stack([1.0 - points.sum(axis=1), points])
    slopes = np.vstack([-np.ones(3), np.eye(3)])
    corners = (4.0 * barycentric - 1.0)[:, :, None] * slopes
    first, second = np.array(EDGES).T
    middles = 4.0 * (barycentric[:, first, None] * slopes[second] + barycentric[:, second, None] * slopes[first])
    return np.concatenate([corners, middles], axis=1)


def jacobian_determinants(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Return det ∂x/∂ξ, shape ``(m, q)``, of elements with `nodes` ``(m, 10, 3)`` at reference `points` ``(q, 3)``."""
    jacobians = np.einsum("mai,qaj->mqij", nodes, shape_gradients(points), optimize=True)
    columns = np.moveaxis(jacobians, -1, 0)
    determinants: FloatArray = np.einsum("mqi,mqi->mq", columns[0], np.cross(columns[1], columns[2]))
    return determinants


@functools.cache
def _bernstein() -> tuple[FloatArray, FloatArray]:
    """Lattice points of the cubic tetrahedron ``(20, 3)`` and the map from values there to Bézier coefficients."""
    exponents = np.array([e for e in itertools.product(range(4), repeat=4) if sum(e) == 3])
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    multinomial = 6.0 / factorial[exponents].prod(axis=1)
    lattice = exponents / 3.0
    values = multinomial * np.prod(lattice[:, None, :] ** exponents[None, :, :], axis=2)
    return lattice[:, 1:], np.linalg.inv(values)


def jacobian_coefficients(nodes: FloatArray) -> FloatArray:
    """Return the 20 Bézier coefficients of det ∂x/∂ξ of each element.

    The determinant is a cubic polynomial, a convex combination of these coefficients everywhere in the element: their
    minimum bounds it from below (Johnen, Remacle and Geuzaine, 2013), and their mean is six times the volume.

    Parameters
    ----------
    nodes
        Shape ``(m, 10, 3)``.

    Returns
    -------
    ndarray
        Shape ``(m, 20)``.
    """
    lattice, to_bezier = _bernstein()
    return jacobian_determinants(nodes, lattice) @ to_bezier.T


def cell_volumes(nodes: FloatArray) -> FloatArray:
    """Return the exact volume of each curved element, shape ``(m,)``, from `nodes` ``(m, 10, 3)``."""
    volumes: FloatArray = jacobian_coefficients(nodes).mean(axis=1) / 6.0
    return volumes


_S, _T = 0.445948490915965, 0.091576213509771
_TRIANGLE_POINTS = np.array(
    [[_S, _S], [1 - 2 * _S, _S], [_S, 1 - 2 * _S], [_T, _T], [1 - 2 * _T, _T], [_T, 1 - 2 * _T]]
)
_TRIANGLE_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2.0


def face_fluxes(nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ``∫ x·n dA`` and ``∫ n dA`` over each curved triangle.

    Both integrands are polynomials of at most degree 4, for which the six-point rule (Dunavant, 1985) is exact.

    Parameters
    ----------
    nodes
        Shape ``(k, 6, 3)``.

    Returns
    -------
    flux, area_vector
        Shapes ``(k,)`` and ``(k, 3)``.
    """
    position, along, across = _triangle_frame(nodes)
    normal = np.cross(along, across)
    flux: FloatArray = np.einsum("q,kqi,kqi->k", _TRIANGLE_WEIGHTS, position, normal)
    return flux, np.einsum("q,kqi->ki", _TRIANGLE_WEIGHTS, normal)


def face_areas(nodes: FloatArray) -> FloatArray:
    """Return the area of each curved triangle, shape ``(k,)``, from `nodes` ``(k, 6, 3)`` (six-point rule)."""
    _, along, across = _triangle_frame(nodes)
    areas: FloatArray = np.linalg.norm(np.cross(along, across), axis=2) @ _TRIANGLE_WEIGHTS
    return areas


def _triangle_frame(nodes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and the two tangents at the six quadrature points, each ``(k, 6, 3)``."""
    r, s = _TRIANGLE_POINTS.T
    t = 1.0 - r - s
    zero = np.zeros_like(r)
    shape = np.array([t * (2 * t - 1), r * (2 * r - 1), s * (2 * s - 1), 4 * t * r, 4 * r * s, 4 * s * t])
    along = np.array([1 - 4 * t, 4 * r - 1, zero, 4 * (t - r), 4 * s, -4 * s])
    across = np.array([1 - 4 * t, zero, 4 * s - 1, -4 * r, 4 * r, 4 * (t - s)])
    position, first, second = (np.einsum("aq,kai->kqi", table, nodes) for table in (shape, along, across))
    return position, first, second
