"""The volume that a wall encloses, as a flux through its faces, with its first and second derivatives.

A wall is closed, or closed by symmetry planes (:func:`turgor.mesh.opening.volume_field`) or an axis. Because nothing
is linearised and the quadrature is exact, force and stiffness of a pressure in it are exact derivatives.
"""

from __future__ import annotations

import functools
import math
from typing import Protocol

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.kernels import FASTMATH
from turgor.mesh.cells import CELLS, face_cell
from turgor.mesh.opening import Cap, VolumeField

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class EnclosedVolume(Protocol):
    """A volume as a function of the nodes of its wall, whose faces ``nodes (k, n)`` look out of it."""

    nodes: Ints

    def volume(self, x: Floats) -> float:
        """Return the volume at nodal positions `x` ``(n_points, d)``, mm³."""
        ...

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative of each face's share by its nodes, ``(k, n, d)``, mm²."""
        ...

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure on each face pushes its nodes with, ``(k, n, d)``, mm².

        All together it is the gradient, but for the rim of an opening across the plane that closes it: the gradient
        holds for a rim that stays in its plane.
        """
        ...

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives of each face's share, ``(k, n d, n d)``, mm; good until the next call."""
        ...


class FaceVolume:
    """V = ∫ M x · n dA over faces in space, M = diag(axes)/Σ axes (Rumpel and Schweizerhof 2003 for M = 1/3)."""

    def __init__(self, nodes: Ints, field: VolumeField) -> None:
        self.nodes = nodes
        cell = face_cell(nodes)
        self._origin = field.origin
        self._rule = (cell.shape_at_quadrature, cell.gradient_at_quadrature, cell.weights, field.axes)

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        return float(_volumes(x - self._origin, self.nodes, *self._rule).sum())

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes, ``(k, n, 3)``."""
        return np.asarray(_gradients(x - self._origin, self.nodes, *self._rule))

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the nodes with, ``(k, n, 3)``."""
        return _tractions(x[self.nodes], *self._rule[:3])

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(k, 3 n, 3 n)``."""
        _hessians(x - self._origin, self.nodes, *self._rule, self._hessian)
        return self._hessian

    @functools.cached_property
    def _hessian(self) -> Floats:
        n_dofs = 3 * self.nodes.shape[1]
        return np.empty((len(self.nodes), n_dofs, n_dofs))


class CapVolume:
    """The share of a cap, whose faces hang on the nodes of a rim: V(T x), T linear, and so are its derivatives."""

    def __init__(self, cap: Cap, field: VolumeField) -> None:
        self.nodes = cap.nodes[None]
        self._cap = cap
        self._origin = field.origin
        cell = face_cell(cap.faces)
        self._rule = (cell.shape_at_quadrature, cell.gradient_at_quadrature, cell.weights, field.axes)

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        return float(_volumes(self._places(x), self._cap.faces, *self._rule).sum())

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes of the rim, ``(1, n, 3)``."""
        return self._on_rim(_gradients(self._places(x), self._cap.faces, *self._rule))

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the rim with, ``(1, n, 3)``."""
        return self._on_rim(_tractions(self._places(x)[self._cap.faces], *self._rule[:3]))

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(1, 3 n, 3 n)``."""
        faces, weights, n = self._cap.faces, self._cap.weights, self.nodes.shape[1]
        blocks = np.empty((len(faces), 18, 18))
        _hessians(self._places(x), faces, *self._rule, blocks)
        blocks = blocks.reshape(len(faces), 6, 3, 6, 3)
        row, column = np.broadcast_arrays(faces[:, :, None], faces[:, None, :])
        size = weights[0].shape[0]
        out = np.zeros((n, 3, n, 3))
        for i in range(3):
            for j in range(3):
                whole = sp.coo_matrix((blocks[:, :, i, :, j].ravel(), (row.ravel(), column.ravel())), (size, size))
                out[:, i, :, j] = (weights[i].T @ whole.tocsr() @ weights[j]).toarray()
        return out.reshape(1, 3 * n, 3 * n)

    def _on_rim(self, shares: Floats) -> Floats:
        """Return by the nodes of the rim ``(1, n, 3)`` what is given by those of the faces ``(k, 6, 3)``."""
        faces = self._cap.faces.ravel()
        columns = [
            matrix.T @ np.bincount(faces, shares[:, :, axis].ravel(), minlength=matrix.shape[0])
            for axis, matrix in enumerate(self._cap.weights)
        ]
        return np.stack(columns, axis=1)[None]

    def _places(self, x: Floats) -> Floats:
        return self._cap.places(x - self._origin)


_EDGE = CELLS["line3"]
_N, _D = _EDGE.shape_at_quadrature, _EDGE.gradient_at_quadrature[:, :, 0]
_ND = np.einsum("q,qa,qb->ab", _EDGE.weights, _N, _D)
_NND = np.einsum("q,qa,qb,qc->abc", _EDGE.weights, _N, _N, _D)
_RRY, _RYR = _NND.reshape(9, 3), _NND.reshape(3, 9).T


class EdgeVolume:
    """V = t ∫ (m_x x dy − m_y y dx)/(m_x + m_y) along edges in the plane, t the thickness."""

    def __init__(self, nodes: Ints, field: VolumeField, thickness: float) -> None:
        self.nodes = nodes
        self._origin, self._thickness = field.origin, thickness
        along_x, along_y = thickness * field.axes / field.axes.sum()
        # The share of an edge is the bilinear form x · B y of its nodal coordinates.
        self._form = along_x * _ND - along_y * _ND.T

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        places = (x - self._origin)[self.nodes]
        return float(np.sum(places[:, :, 0] * (places[:, :, 1] @ self._form.T)))

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes, ``(k, 3, 2)``."""
        places = (x - self._origin)[self.nodes]
        return np.stack([places[:, :, 1] @ self._form.T, places[:, :, 0] @ self._form], axis=2)

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the nodes with, ``(k, 3, 2)``."""
        places = self._thickness * x[self.nodes]
        return np.stack([places[:, :, 1] @ _ND.T, -places[:, :, 0] @ _ND.T], axis=2)

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(k, 6, 6)``: the same for every edge and position."""
        del x
        one = np.zeros((3, 2, 3, 2))
        one[:, 0, :, 1], one[:, 1, :, 0] = self._form, self._form.T
        return np.broadcast_to(one.reshape(6, 6), (len(self.nodes), 6, 6)).copy()


class RevolvedVolume:
    """V = π ∫ r² dy along edges turned about the y axis; the axis and planes across it close it without flux."""

    def __init__(self, nodes: Ints) -> None:
        self.nodes = nodes

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        r, y = self._places(x)
        return math.pi * float(np.vdot(_products(r, r) @ _RRY, y))

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes, ``(k, 3, 2)``."""
        r, y = self._places(x)
        gradient = np.empty((*self.nodes.shape, 2))
        gradient[:, :, 0] = 2.0 * math.pi * (_products(r, y) @ _RYR)
        gradient[:, :, 1] = math.pi * (_products(r, r) @ _RRY)
        return gradient

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the nodes with, ``(k, 3, 2)``."""
        r = x[self.nodes][:, :, 0]
        sideways = 2.0 * math.pi * np.einsum("kb,kci,abc->kai", r, x[self.nodes], _NND, optimize=True)
        return np.stack([sideways[:, :, 1], -sideways[:, :, 0]], axis=2)

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(k, 6, 6)``."""
        r, y = self._places(x)
        hessian = np.zeros((len(self.nodes), 3, 2, 3, 2))
        hessian[:, :, 0, :, 0] = 2.0 * math.pi * (y @ _RRY.T).reshape(-1, 3, 3)
        mixed = 2.0 * math.pi * (r @ _NND.swapaxes(0, 1).reshape(3, 9)).reshape(-1, 3, 3)
        hessian[:, :, 0, :, 1], hessian[:, :, 1, :, 0] = mixed, mixed.swapaxes(1, 2)
        return hessian.reshape(-1, 6, 6)

    def _places(self, x: Floats) -> tuple[Floats, Floats]:
        """Return radii and heights of each edge's nodes, ``(k, 3)``."""
        places = x[self.nodes]
        return places[:, :, 0], places[:, :, 1]


def _products(a: Floats, b: Floats) -> Floats:
    """Return ``a_i b_j`` of each edge, ``(k, 9)``."""
    return (a[:, :, None] * b[:, None, :]).reshape(-1, 9)


def _tractions(places: Floats, shape: Floats, gradient: Floats, weights: Floats) -> Floats:
    """Return ∫ N n dA over faces with nodes at `places` ``(k, n, 3)``, by their nodes, ``(k, n, 3)``."""
    first, second = np.einsum("qar,kai->rkqi", gradient, places)
    return np.asarray(np.einsum("q,qa,kqi->kai", weights, shape, np.cross(first, second)))


@nb.njit(cache=True, fastmath=FASTMATH, inline="always")
def _frame(x, nodes, N, D, axes, position, first, second):  # type: ignore[no-untyped-def]
    """Write the volume field (not yet divided by tr M) and the two tangents at one quadrature point."""
    position[:] = 0.0
    first[:] = 0.0
    second[:] = 0.0
    for a in range(len(nodes)):
        for i in range(3):
            value = x[nodes[a], i]
            position[i] += axes[i] * N[a] * value
            first[i] += D[a, 0] * value
            second[i] += D[a, 1] * value


@nb.njit(cache=True, inline="always")
def _cross(a, b, out):  # type: ignore[no-untyped-def]
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@nb.njit(cache=True, fastmath=FASTMATH, parallel=True)
def _volumes(x, faces, shape, gradient, weights, axes):  # type: ignore[no-untyped-def]
    """Return each face's share ∫ M x · (x,ξ × x,η)/tr M of the enclosed volume, ``(k,)``, M = diag(`axes`)."""
    out = np.zeros(len(faces))
    scale = 1.0 / axes.sum()
    for f in nb.prange(len(faces)):
        position, first, second, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
        for q in range(len(weights)):
            _frame(x, faces[f], shape[q], gradient[q], axes, position, first, second)
            _cross(first, second, normal)
            flux = position[0] * normal[0] + position[1] * normal[1] + position[2] * normal[2]
            out[f] += scale * weights[q] * flux
    return out


@nb.njit(cache=True, fastmath=FASTMATH, parallel=True)
def _gradients(x, faces, shape, gradient, weights, axes):  # type: ignore[no-untyped-def]
    """Return the derivative of each face's share with respect to its nodes, ``(k, 6, 3)``."""
    out = np.zeros((len(faces), faces.shape[1], 3))
    scale = 1.0 / axes.sum()
    for f in nb.prange(len(faces)):
        position, first, second = np.empty(3), np.empty(3), np.empty(3)
        normal, by_first, by_second = np.empty(3), np.empty(3), np.empty(3)
        for q in range(len(weights)):
            _frame(x, faces[f], shape[q], gradient[q], axes, position, first, second)
            _cross(first, second, normal)
            _cross(second, position, by_first)
            _cross(position, first, by_second)
            for a in range(faces.shape[1]):
                for i in range(3):
                    by_position = axes[i] * shape[q, a] * normal[i]
                    by_tangents = gradient[q, a, 0] * by_first[i] + gradient[q, a, 1] * by_second[i]
                    out[f, a, i] += scale * weights[q] * (by_position + by_tangents)
    return out


@nb.njit(cache=True, fastmath=FASTMATH, parallel=True)
def _hessians(x, faces, shape, gradient, weights, axes, out):  # type: ignore[no-untyped-def]
    """Fill the second derivative of each face's share, ``out (k, 18, 18)``: skew in the components of two nodes."""
    n_nodes = faces.shape[1]
    scale = 1.0 / axes.sum()
    for f in nb.prange(len(faces)):
        out[f] = 0.0
        position, first, second = np.empty(3), np.empty(3), np.empty(3)
        for q in range(len(weights)):
            _frame(x, faces[f], shape[q], gradient[q], axes, position, first, second)
            N, D, w = shape[q], gradient[q], weights[q] * scale
            for a in range(n_nodes):
                for b in range(n_nodes):
                    on_position = D[a, 0] * D[b, 1] - D[b, 0] * D[a, 1]
                    for i in range(3):
                        for step in (1, 2):
                            k, m = (i + step) % 3, (i + 3 - step) % 3
                            on_second = axes[i] * N[a] * D[b, 0] - axes[k] * N[b] * D[a, 0]
                            on_first = axes[i] * N[a] * D[b, 1] - axes[k] * N[b] * D[a, 1]
                            value = on_second * second[m] - on_first * first[m] + on_position * position[m]
                            out[f, 3 * a + i, 3 * b + k] += w * value if step == 1 else -w * value
