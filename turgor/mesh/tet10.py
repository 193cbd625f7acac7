"""Bounds on the Jacobian of curved ten-node tetrahedra and six-node triangles, and their exact volumes."""

from __future__ import annotations

import functools
import itertools

import numpy as np
import numpy.typing as npt

from turgor.mesh.cells import CELLS, determinants, jacobians

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

EDGES = CELLS["tet10"].edges
"""Corners of the edge on whose middle each of the nodes 4 to 9 sits."""

FACES = CELLS["tet10"].faces
"""The four faces as six-node triangles whose normals point out of the tetrahedron."""


def jacobian_determinants(nodes: FloatArray, points: FloatArray) -> FloatArray:
    """Return det ∂x/∂ξ ``(m, q)`` of elements with `nodes` ``(m, n_nodes, d)`` at reference `points` ``(q, d)``."""
    return determinants(jacobians(nodes, CELLS["tet10" if nodes.shape[1] == 10 else "tri6"], points))


@functools.cache
def _bernstein(dimension: int) -> tuple[FloatArray, FloatArray]:
    """Lattice points of the simplex whose order is its dimension, and the map from values there to coefficients."""
    powers = itertools.product(range(dimension + 1), repeat=dimension + 1)
    exponents = np.array([e for e in powers if sum(e) == dimension])
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    multinomial = factorial[dimension] / factorial[exponents].prod(axis=1)
    lattice = exponents / dimension
    values = multinomial * np.prod(lattice[:, None, :] ** exponents[None, :, :], axis=2)
    return lattice[:, 1:], np.linalg.inv(values)


def jacobian_coefficients(nodes: FloatArray) -> FloatArray:
    """Return the Bézier coefficients of det ∂x/∂ξ of each element.

    The determinant is a polynomial, cubic in a tetrahedron and quadratic in a triangle, and everywhere in the element a
    convex combination of these coefficients: their minimum bounds it from below (Johnen, Remacle and Geuzaine, 2013),
    and their mean is six times the volume or twice the area.

    Parameters
    ----------
    nodes
        Shape ``(m, 10, 3)`` or ``(m, 6, 2)``.

    Returns
    -------
    ndarray
        Shape ``(m, 20)`` or ``(m, 6)``.
    """
    lattice, to_bezier = _bernstein(nodes.shape[2])
    return jacobian_determinants(nodes, lattice) @ to_bezier.T


def cell_volumes(nodes: FloatArray) -> FloatArray:
    """Return the exact volume of each curved element, shape ``(m,)``, from `nodes` ``(m, 10, 3)``."""
    volumes: FloatArray = jacobian_coefficients(nodes).mean(axis=1) / 6.0
    return volumes
