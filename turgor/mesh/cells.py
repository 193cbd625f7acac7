"""The kinds of cells: nodes, shape functions, faces and quadrature rules of their reference shapes.

Second-order cells with node order as in VTK: corners, then the middles of the edges, then those of the faces, then
the centre. Every reference coordinate runs from 0 to 1. A cell's faces (in two dimensions: its edges) are cells
themselves, whose nodes turn such that their normals point out of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Rule:
    """A quadrature rule: ``points (q, dimension)`` and ``weights (q,)`` that add up to the reference volume."""

    points: Floats
    weights: Floats


@dataclass(frozen=True, eq=False)
class Cell:
    """A Lagrange cell of second order with one quadrature rule.

    Parameters
    ----------
    name
        ``line3``, ``tri6``, ``quad9``, ``tet10`` or ``hex27``.
    nodes
        Reference coordinates of the nodes, ``(n_nodes, dimension)``.
    simplex
        Whether the shape functions are the polynomials of degree two in all coordinates together (line, triangle,
        tetrahedron) rather than in each of them (quadrilateral, hexahedron).
    n_corners
        How many of the nodes, the first ones, are corners.
    edges
        The two corners of each edge; the nodes after the corners are the middles of the edges in this order.
    faces
        Nodes of each face, ``(n_faces, nodes_per_face)``.
    rule
        The rule that the integrals over such a cell are evaluated with.
    """

    name: str
    nodes: Floats
    simplex: bool
    n_corners: int
    edges: tuple[tuple[int, int], ...]
    faces: Ints
    rule: Rule

    @property
    def dimension(self) -> int:
        """Number of reference coordinates."""
        return int(self.nodes.shape[1])

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def points(self) -> Floats:
        """Quadrature points ``(q, dimension)``."""
        return self.rule.points

    @property
    def weights(self) -> Floats:
        """Quadrature weights ``(q,)``."""
        return self.rule.weights

    @cached_property
    def shape_at_quadrature(self) -> Floats:
        """Shape functions at the quadrature points, ``(q, n_nodes)``."""
        return np.ascontiguousarray(self.shape(self.points))

    @cached_property
    def gradient_at_quadrature(self) -> Floats:
        """Their derivatives there, ``(q, n_nodes, dimension)``."""
        return np.ascontiguousarray(self.gradient(self.points))

    @cached_property
    def mirrored(self) -> Ints:
        """Places of the nodes ``(n_nodes,)`` of the same cell seen in a mirror, which turns the other way round."""
        swapped = 1.0 - self.nodes if self.dimension == 1 else self.nodes[:, [1, 0, *range(2, self.dimension)]]
        places: Ints = np.argmax((swapped[:, None, :] == self.nodes).all(axis=2), axis=1).astype(np.int32)
        return places

    @cached_property
    def corner_shape_at_nodes(self) -> Floats:
        """Shape functions of the first-order cell of the same corners at all nodes, ``(n_nodes, n_corners)``."""
        corners, places = self.nodes[: self.n_corners], self.nodes[:, None]
        if self.simplex:
            weight = np.concatenate([1.0 - self.nodes.sum(axis=1, keepdims=True), self.nodes], axis=1)
            return np.asarray(weight @ np.linalg.inv(weight[: self.n_corners]))
        return np.asarray(np.prod(np.where(corners == 1.0, places, 1.0 - places), axis=2))

    def shape(self, points: Floats) -> Floats:
        """Return the shape functions ``(p, n_nodes)`` at reference `points` ``(p, dimension)``."""
        return np.asarray(self._monomials(points) @ self._coefficients)

    def gradient(self, points: Floats) -> Floats:
        """Return their derivatives by the reference coordinates, ``(p, n_nodes, dimension)``."""
        slopes = [self._monomials(points, along) @ self._coefficients for along in range(self.dimension)]
        return np.stack(slopes, axis=-1)

    @cached_property
    def _exponents(self) -> Ints:
        powers = itertools.product(range(3), repeat=self.dimension)
        return np.array([p for p in powers if not self.simplex or sum(p) <= 2], dtype=np.int32)

    @cached_property
    def _coefficients(self) -> Floats:
        # All coefficients of these shape functions are integers.
        return np.asarray(np.rint(np.linalg.inv(self._monomials(self.nodes))))

    def _monomials(self, points: Floats, along: int | None = None) -> Floats:
        """Return the monomials, or their derivatives along one coordinate, at `points`: ``(p, n_nodes)``."""
        powers, factor = self._exponents, np.ones(len(self._exponents))
        if along is not None:
            factor = powers[:, along].astype(float)
            powers = powers.copy()
            powers[:, along] = np.maximum(powers[:, along] - 1, 0)
        return np.asarray(factor * np.prod(np.atleast_2d(points)[:, None, :] ** powers, axis=2))


def _gauss(dimension: int) -> Rule:
    # Three points each way, exact to degree 5 in each coordinate.
    points, weights = np.polynomial.legendre.leggauss(3)
    grid = itertools.product((points + 1) / 2, repeat=dimension)
    products = itertools.product(weights / 2, repeat=dimension)
    return Rule(np.array(list(grid)), np.array([np.prod(p) for p in products]))


def _four_point_rule() -> Rule:
    # Exact to degree 2 (Hammer, Marlowe and Stroud 1956): with ten nodes, the fewest points that leave
    # no zero-energy mode beyond the six rigid ones.
    near, far = (5 - 5**0.5) / 20, (5 + 3 * 5**0.5) / 20
    points = np.full((4, 3), near)
    points[1:][np.diag_indices(3)] = far
    return Rule(points, np.full(4, 1 / 24))


def _three_point_rule() -> Rule:
    # Exact to degree 2 (Hammer, Marlowe and Stroud 1956): with six nodes, again the fewest without a zero-energy mode.
    return Rule(np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]]), np.full(3, 1 / 6))


def _six_point_rule() -> Rule:
    # Exact to degree 4 (Cowper 1973): the volume enclosed by a quadratic face is of degree 4.
    root = (38 - 44 * (2 / 5) ** 0.5) ** 0.5
    heavy, light = (8 - 10**0.5 - root) / 18, (8 - 10**0.5 + root) / 18
    spread = (213125 - 53320 * 10**0.5) ** 0.5
    points, weights = [], []
    for a, w in ((light, (620 + spread) / 3720), (heavy, (620 - spread) / 3720)):
        points += [(a, a), (1 - 2 * a, a), (a, 1 - 2 * a)]
        weights += [w / 2] * 3
    return Rule(np.array(points), np.array(weights))


def _with_middles(corners: Iterable[tuple[float, ...]], groups: Iterable[tuple[int, ...]]) -> Floats:
    """Return the `corners` and the mean of each group of them."""
    points = np.array(list(corners), dtype=float)
    return np.vstack([points, *[points[list(group)].mean(axis=0) for group in groups]])


_TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))
_TET_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_SQUARE_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_CUBE_EDGES = (*_SQUARE_EDGES, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
_CUBE_SIDES = ((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7))
_TET_SIDES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_UNIT_TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_CUBE = (*((x, y, 0) for x, y in _SQUARE), *((x, y, 1) for x, y in _SQUARE))


def _sides(corners: tuple[tuple[int, ...], ...], nodes: Floats) -> Ints:
    """Return all nodes of each side, whose corners are given: corners, middles of its edges, centre of a square."""
    sides = []
    for side in corners:
        groups: list[tuple[int, ...]] = [side] if len(side) == 2 else list(itertools.pairwise((*side, side[0])))
        groups += [side] if len(side) == 4 else []
        middles = [int(np.argmax((nodes == nodes[list(group)].mean(axis=0)).all(axis=1))) for group in groups]
        sides.append([*side, *middles])
    return np.array(sides, dtype=np.int32)


def _cells() -> dict[str, Cell]:
    line = _with_middles([(0,), (1,)], [(0, 1)])
    triangle = _with_middles([(0, 0), (1, 0), (0, 1)], _TRIANGLE_EDGES)
    square = _with_middles(_SQUARE, [*_SQUARE_EDGES, (0, 1, 2, 3)])
    tetrahedron = _with_middles(_UNIT_TETRAHEDRON, _TET_EDGES)
    cube = _with_middles(_CUBE, [*_CUBE_EDGES, *_CUBE_SIDES, tuple(range(8))])
    cells = (
        Cell("line3", line, True, 2, ((0, 1),), np.array([[0], [1]], np.int32), _gauss(1)),
        Cell("tri6", triangle, True, 3, _TRIANGLE_EDGES, _sides(_TRIANGLE_EDGES, triangle), _three_point_rule()),
        Cell("quad9", square, False, 4, _SQUARE_EDGES, _sides(_SQUARE_EDGES, square), _gauss(2)),
        Cell(
            "tet10",
            tetrahedron,
            True,
            4,
            _TET_EDGES,
            _sides(_TET_SIDES, tetrahedron),
            _four_point_rule(),
        ),
        Cell("hex27", cube, False, 8, _CUBE_EDGES, _sides(_CUBE_SIDES, cube), _gauss(3)),
    )
    return {cell.name: cell for cell in cells}


CELLS = _cells()
"""Every kind of cell by name, with the rule for a body made of such cells."""

_FACE_TRIANGLE = replace(CELLS["tri6"], rule=_six_point_rule())

_BODY = {cell.n_nodes: cell for cell in CELLS.values() if cell.dimension > 1}
_FACE = {cell.n_nodes: cell for cell in (CELLS["line3"], _FACE_TRIANGLE, CELLS["quad9"])}


def body_cell(cells: Ints) -> Cell:
    """Return the kind of the `cells` ``(m, n_nodes)`` of a body."""
    return _BODY[cells.shape[1]]


def face_cell(faces: Ints) -> Cell:
    """Return the kind of the `faces` ``(k, n_nodes)`` of a body: its rule is exact for the volume that they enclose."""
    return _FACE[faces.shape[1]]


def is_body_cell(n_nodes: int) -> bool:
    """Say whether there is a kind of body cell with so many nodes."""
    return n_nodes in _BODY


def cells_of_corners(cells: Ints) -> tuple[Ints, Ints]:
    """Return the nodes at the corners of cells, ascending, and the cells of these alone, numbered in that order."""
    n_corners = body_cell(cells).n_corners
    corners, number = np.unique(cells[:, :n_corners], return_inverse=True)
    return corners, number.reshape(-1, n_corners).astype(np.int32)


def jacobians(nodes: Floats, cell: Cell, points: Floats | None = None) -> Floats:
    """Return ∂x/∂ξ of cells with `nodes` ``(m, n_nodes, d)``: ``(m, q, d, dimension)``.

    At reference `points` ``(q, dimension)``, or at the quadrature points where they are left out.
    """
    gradient = cell.gradient_at_quadrature if points is None else cell.gradient(points)
    return np.asarray(np.einsum("mai,qaj->mqij", nodes, gradient, optimize=True))


def determinants(matrices: Floats) -> Floats:
    """Return the determinants ``(...)`` of 2 × 2 or 3 × 3 matrices ``(..., d, d)``."""
    columns = np.moveaxis(matrices, -1, 0)
    if len(columns) == 2:
        return np.asarray(columns[0][..., 0] * columns[1][..., 1] - columns[0][..., 1] * columns[1][..., 0])
    return np.asarray(np.einsum("...i,...i->...", columns[0], np.cross(columns[1], columns[2])))


def face_frames(nodes: Floats) -> tuple[Floats, Floats]:
    """Return places and normals (their length is area per reference area) of faces at the quadrature points.

    Parameters
    ----------
    nodes
        ``(k, n_nodes, d)`` with d = 3, or d = 2 where the faces are edges, whose normals point to their right.

    Returns
    -------
    places, normals
        Each ``(k, q, d)``.
    """
    cell = _FACE[nodes.shape[1]]
    places = np.einsum("qa,kai->kqi", cell.shape_at_quadrature, nodes)
    tangents = jacobians(nodes, cell)
    if nodes.shape[2] == 2:
        return places, np.stack([tangents[..., 1, 0], -tangents[..., 0, 0]], axis=-1)
    return places, np.cross(tangents[..., 0], tangents[..., 1])


def face_fluxes(nodes: Floats, axes: Floats | float = 1.0) -> tuple[Floats, Floats]:
    """Return ``∫ M x·n dA`` ``(k,)`` and ``∫ n dA`` ``(k, d)`` over faces with `nodes` ``(k, n_nodes, d)``, exactly.

    M is the diagonal matrix of the `axes`.
    """
    places, normals = face_frames(nodes)
    weights = _FACE[nodes.shape[1]].weights
    flux: Floats = np.einsum("q,kqi,kqi->k", weights, axes * places, normals)
    return flux, np.einsum("q,kqi->ki", weights, normals)


def face_areas(nodes: Floats) -> Floats:
    """Return the area (of edges: the length) of each curved face, ``(k,)``, from `nodes` ``(k, n_nodes, d)``."""
    _, normals = face_frames(nodes)
    areas: Floats = np.linalg.norm(normals, axis=2) @ _FACE[nodes.shape[1]].weights
    return areas
