"""Closed cavities under air pressure."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.elements import TRI6
from turgor.fem.kernels import FASTMATH
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes, pack_symmetric
from turgor.mesh.opening import volume_field

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Cavity(Unlagged):
    """−p V(u): the air in a closed cavity of volume V at pressure p.

    V is a flux through the deformed wall, ∫ x · n/3 dA where nothing cuts it, so that force and stiffness are its exact
    derivatives: the pressure follows the surface, and because the cavity is closed its stiffness is symmetric (Rumpel
    and Schweizerhof 2003). Symmetry planes may close it (:func:`turgor.mesh.opening.volume_field`).

    Parameters
    ----------
    points
        Reference positions ``(n_points, 3)``.
    faces
        The wall's six-node triangles ``(k, 6)`` with normals out of the solid, that is, into the air.
    channel
        Place of the pressure (MPa) in ``State.loads``.
    name
        Name of the surface.

    Raises
    ------
    InputError
        If the cavity leaks.
    """

    def __init__(self, points: Floats, faces: Ints, channel: int, name: str) -> None:
        self.name = name
        self.channel = channel
        self.field = volume_field(points, faces, name)
        self.points = points - self.field.origin
        # Reversed, so that the normals point out of the air and the enclosed volume is positive.
        self.nodes = np.ascontiguousarray(faces[:, [0, 2, 1, 5, 4, 3]], dtype=np.int32)

    def volume(self, u: Floats) -> float:
        """Return the enclosed volume at displacement `u`, mm³."""
        return float(_volumes(self.points + u, self.nodes, *_RULE, self.field.axes).sum())

    def energy(self, state: State) -> float:
        """Return −p V, N mm."""
        return -float(state.loads[self.channel]) * self.volume(state.u)

    def force(self, state: State, out: Floats) -> None:
        """Add −p ∂V/∂u, N."""
        pressure = state.loads[self.channel]
        if pressure != 0.0:
            add_at_nodes(self.nodes, -pressure * self._gradient(state.u), out)

    def conjugate(self, state: State) -> float:
        """Return V, mm³."""
        return self.volume(state.u)

    def load_gradient(self, state: State, out: Floats) -> None:
        """Add −∂V/∂u, mm²."""
        add_at_nodes(self.nodes, -self._gradient(state.u), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill −p ∂²V/∂u², N/mm."""
        del lagged
        hessian = np.empty((len(self.nodes), 18, 18))
        _hessians(self.points + state.u, self.nodes, *_RULE, self.field.axes, hessian)
        hessian *= -state.loads[self.channel]
        pack_symmetric(hessian, out)

    def _gradient(self, u: Floats) -> Floats:
        return np.asarray(_gradients(self.points + u, self.nodes, *_RULE, self.field.axes))


_RULE = (TRI6.shape_at_quadrature, TRI6.gradient_at_quadrature, TRI6.weights)


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
