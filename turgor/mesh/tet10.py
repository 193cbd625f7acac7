"""Bounds on the Jacobian of curved ten-node tetrahedra, and their exact volumes."""

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
    """Return det ∂x/∂ξ, shape ``(m, q)``, of elements with `nodes` ``(m, 10, 3)`` at reference `points` ``(q, 3)``."""
    return determinants(jacobians(nodes, CELLS["tet10"], points))


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
