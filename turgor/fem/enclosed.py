"""The volume that a wall encloses, as a flux through its faces, with its first and second derivatives.

A wall is closed, or closed by symmetry planes (:func:`turgor.mesh.opening.volume_field`) or an axis. Because nothing
is linearised and the quadrature is exact, force and stiffness of a pressure in it are exact derivatives.

Faces are interpolated, so that their share is a polynomial in the positions of their nodes whose coefficients belong to
the kind of face: of edges in the plane bilinear, of faces in space trilinear in the x, y and z of the nodes. Shares and
derivatives of all faces are a few products with them.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.mesh.cells import CELLS, Cell, face_cell, face_frames
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
        self._cell = face_cell(nodes)
        self._origin = field.origin
        self._form = TrilinearForm(self._cell, field.axes)

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        return self._form.sum(self._places(x))

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes, ``(k, n, 3)``."""
        return self._form.gradient(self._places(x))

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the nodes with, ``(k, n, 3)``."""
        return _tractions(x[self.nodes], self._cell)

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(k, 3 n, 3 n)``."""
        self._form.fill_hessian(self._places(x), self._hessian)
        return self._hessian

    @functools.cached_property
    def _hessian(self) -> Floats:
        n_dofs = 3 * self.nodes.shape[1]
        return np.zeros((len(self.nodes), n_dofs, n_dofs))

    def _places(self, x: Floats) -> Floats:
        return _by_component(x, self.nodes) - self._origin[:, None, None]


class TrilinearForm:
    """The share of a face in a volume, Σ C_abc x_a y_b z_c over its nodes.

    M x · (x,ξ × x,η)/tr M is a determinant of three rows, in each product of which x, y and z come once.

    Parameters
    ----------
    cell
        The kind of face; its quadrature is exact.
    axes
        The diagonal of M.
    """

    def __init__(self, cell: Cell, axes: Floats) -> None:
        shape, (first, second) = cell.shape_at_quadrature, cell.gradient_at_quadrature.transpose(2, 0, 1)
        n = shape.shape[1]
        C = np.zeros((n, n, n))
        for i, j, k in itertools.permutations(range(3)):
            rows = {i: axes[i] / axes.sum() * shape, j: first, k: second}
            sign = (i - j) * (j - k) * (k - i) / 2
            C += sign * np.einsum("q,qa,qb,qc->abc", cell.weights, rows[0], rows[1], rows[2])
        # For each axis first the one before it, then the axis itself and the one that follows.
        self._turned = [C.transpose(np.roll(range(3), 1 - axis)).reshape(n, n * n) for axis in range(3)]

    def sum(self, places: Floats) -> float:
        """Return the shares of faces with nodes at `places` ``(3, k, n)`` together."""
        return float(np.vdot(self._along(0, places), places[0]))

    def gradient(self, places: Floats) -> Floats:
        """Return the derivatives of the shares by the nodes, ``(k, n, 3)``."""
        return np.stack([self._along(axis, places) for axis in range(3)], axis=2)

    def fill_hessian(self, places: Floats, out: Floats) -> None:
        """Fill the second derivatives ``(k, 3 n, 3 n)``, in which those by the same component are zero already."""
        _, k, n = places.shape
        blocks = out.reshape(k, n, 3, n, 3)
        for axis in range(3):
            following = (axis + 1) % 3
            across = self._across(axis, places)
            blocks[:, :, axis, :, following] = across
            blocks[:, :, following, :, axis] = across.swapaxes(1, 2)

    def _along(self, axis: int, places: Floats) -> Floats:
        """Return the derivatives by the nodes' components along an axis, ``(k, n)``."""
        return np.asarray(np.einsum("kab,kb->ka", self._across(axis, places), places[(axis + 1) % 3]))

    def _across(self, axis: int, places: Floats) -> Floats:
        """Return the derivatives by the components along an axis and the one that follows it, ``(k, n, n)``."""
        _, k, n = places.shape
        return np.asarray(places[(axis + 2) % 3] @ self._turned[axis]).reshape(k, n, n)


class CapVolume:
    """The share of a cap, whose faces hang on the nodes of a rim: V(T x), T linear, and so are its derivatives."""

    def __init__(self, cap: Cap, field: VolumeField) -> None:
        self.nodes = cap.nodes[None]
        self._cap = cap
        self._origin = field.origin
        self._cell = face_cell(cap.faces)
        self._form = TrilinearForm(self._cell, field.axes)

    def volume(self, x: Floats) -> float:
        """Return the volume, mm³."""
        return self._form.sum(self._places(x))

    def gradient(self, x: Floats) -> Floats:
        """Return the derivative by the nodes of the rim, ``(1, n, 3)``."""
        return self._on_rim(self._form.gradient(self._places(x)))

    def traction(self, x: Floats) -> Floats:
        """Return what a unit pressure pushes the rim with, ``(1, n, 3)``."""
        return self._on_rim(_tractions(self._cap.places(x - self._origin)[self._cap.faces], self._cell))

    def hessian(self, x: Floats) -> Floats:
        """Return the second derivatives, ``(1, 3 n, 3 n)``."""
        faces, weights, n = self._cap.faces, self._cap.weights, self.nodes.shape[1]
        blocks = np.zeros((len(faces), 18, 18))
        self._form.fill_hessian(self._places(x), blocks)
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
        return _by_component(self._cap.places(x - self._origin), self._cap.faces)


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


def _by_component(x: Floats, faces: Ints) -> Floats:
    """Return where the nodes of faces are, ``(3, k, n)``."""
    return np.stack([column[faces] for column in x.T])


def _tractions(places: Floats, cell: Cell) -> Floats:
    """Return ∫ N n dA over faces with nodes at `places` ``(k, n, 3)``, by their nodes, ``(k, n, 3)``."""
    _, normals = face_frames(places)
    return np.asarray(np.einsum("q,qa,kqi->kai", cell.weights, cell.shape_at_quadrature, normals))
