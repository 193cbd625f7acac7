"""Reference elements: shape functions, their derivatives and quadrature.

Node order is VTK's: corners first, then the middle of each edge in the order of ``edges``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class QuadraticSimplex:
    """A second-order triangle or tetrahedron with one quadrature rule.

    Parameters
    ----------
    dimension
        2 or 3.
    edges
        Corner pairs, one for each node after the corners.
    points
        Quadrature points in reference coordinates, ``(n_quad, dimension)``.
    weights
        Quadrature weights ``(n_quad,)``, which sum up to the reference volume.
    """

    dimension: int
    edges: tuple[tuple[int, int], ...]
    points: Floats
    weights: Floats

    def shape(self, points: Floats) -> Floats:
        """Return the shape functions ``(n_points, n_nodes)`` at reference `points`."""
        bary = self._barycentric(points)
        corner = bary * (2 * bary - 1)
        middle = [4 * bary[:, a] * bary[:, b] for a, b in self.edges]
        return np.column_stack([corner, *middle])

    def gradient(self, points: Floats) -> Floats:
        """Return the derivatives ``(n_points, n_nodes, dimension)`` with respect to the reference coordinates."""
        bary = self._barycentric(points)
        slope = np.vstack([-np.ones(self.dimension), np.eye(self.dimension)])
        corner = (4 * bary - 1)[:, :, None] * slope
        middle = [4 * (bary[:, a, None] * slope[b] + bary[:, b, None] * slope[a]) for a, b in self.edges]
        return np.concatenate([corner, np.stack(middle, axis=1)], axis=1)

    @cached_property
    def shape_at_quadrature(self) -> Floats:
        """Shape functions at the quadrature points, ``(n_quad, n_nodes)``."""
        return np.ascontiguousarray(self.shape(self.points))

    @cached_property
    def gradient_at_quadrature(self) -> Floats:
        """Derivatives at the quadrature points, ``(n_quad, n_nodes, dimension)``."""
        return np.ascontiguousarray(self.gradient(self.points))

    def _barycentric(self, points: Floats) -> Floats:
        points = np.atleast_2d(points)
        return np.column_stack([1 - points.sum(axis=1), points])


def _tet10() -> QuadraticSimplex:
    # Four points, exact to degree 2 (Hammer, Marlowe and Stroud 1956): with ten nodes, the fewest that leave
    # no zero-energy mode beyond the six rigid ones.
    near, far = (5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20
    points = np.full((4, 3), near)
    points[1:][np.diag_indices(3)] = far
    return QuadraticSimplex(3, ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)), points, np.full(4, 1 / 24))


def _tri6() -> QuadraticSimplex:
    # Six points, exact to degree 4 (Cowper 1973): the volume enclosed by a quadratic face is of degree 4.
    root = (38 - 44 * (2 / 5) ** 0.5) ** 0.5
    heavy, light = (8 - 10**0.5 - root) / 18, (8 - 10**0.5 + root) / 18
    spread = (213125 - 53320 * 10**0.5) ** 0.5
    points, weights = [], []
    for a, w in ((light, (620 + spread) / 3720), (heavy, (620 - spread) / 3720)):
        points += [(a, a), (1 - 2 * a, a), (a, 1 - 2 * a)]
        weights += [w / 2] * 3
    return QuadraticSimplex(2, ((0, 1), (1, 2), (2, 0)), np.array(points), np.array(weights))


TET10 = _tet10()
TRI6 = _tri6()
