"""The volume equations of all elements as rows of the mixed problem, and the pressures that are their unknowns.

The pressures are scaled so that the approximation of the Schur complement, S = E⁻¹ + V/((1 + γ) μ), is the identity.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.fem.kernels import CHUNKS, parallel
from turgor.fem.volumes import VolumeEquations

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Pressures:
    """B and E⁻¹ of one mesh, scaled.

    Parameters
    ----------
    groups
        The nodes of the elements of each solid, ``(m, n)``.
    rank
        At which place of the displacement vectors each node stands, ``(n_nodes,)``.
    free
        Which components of the nodes are unknown, in the order of the vectors, ``(n_nodes, 3)``.
    """

    def __init__(self, groups: Sequence[Ints], rank: Ints, free: NDArray[np.bool_]) -> None:
        self._cuts = np.cumsum([len(nodes) for nodes in groups])[:-1]
        self._places: Ints = rank[np.concatenate(groups)]
        self._free = free
        # Of each node the elements that it belongs to and its number in them.
        m, n = self._places.shape
        corner = np.tile(np.arange(n, dtype=np.int32), m)
        cells = sp.csr_matrix((corner, self._places.ravel(), np.arange(0, m * n + 1, n)), shape=(m, len(rank)))
        nodes = cells.T.tocsr()
        self._start, self._elements, self._corners = nodes.indptr.astype(np.int64), nodes.indices, nodes.data

    def take(self, equations: Sequence[VolumeEquations]) -> None:
        """Take the equations of the solids at a state."""
        self._volume = np.concatenate([eq.volume for eq in equations])
        self._bulk = np.concatenate([eq.bulk for eq in equations])
        modulus = np.concatenate([eq.modulus for eq in equations])
        gradient = np.concatenate([eq.gradient for eq in equations])
        m, k, _, n = gradient.shape
        compliance = _inverses(self._bulk)
        self._factor = _roots(compliance + (self._volume / modulus)[:, None, None] * np.eye(k))
        inverse = _inverses(self._factor)
        self._compliance = inverse @ compliance @ inverse.swapaxes(1, 2)
        self._weight = np.repeat(np.sqrt(modulus * np.cbrt(self._volume)), k)
        self._gradient = np.empty((m, k, 3 * n))
        _scale(inverse, gradient, self._places, self._free, self._gradient)
        # Once more in the order of the nodes, where sums at nodes read it from end to end.
        self._of_nodes = np.empty((len(self._elements), k, 3))
        _sort(self._elements, self._corners, self._gradient, self._of_nodes)

    def of_lag(self, lags: Sequence[Floats]) -> Floats:
        """Return the pressures ``(m k,)`` that belong to dilatations ``(m, k)`` of each solid."""
        change = self._volume[:, None, None] * np.concatenate(lags)[:, :, None]
        return np.asarray((self._factor.swapaxes(1, 2) @ (self._bulk @ change)).ravel())

    def forces(self, q: Floats) -> Floats:
        """Return Bᵀ q, ``(3 n_nodes,)``."""
        out = np.empty(3 * (len(self._start) - 1))
        _sum_forces(self._start, self._elements, self._of_nodes, q, out)
        return out

    def residual(self, u: Floats, q: Floats) -> Floats:
        """Return B u − E⁻¹ q as forces."""
        return np.asarray(self._weight * self._gaps(u, q))

    def pressures(self, residual: Floats) -> Floats:
        """Return −S⁻¹ of a residual."""
        return np.asarray(-residual / self._weight)

    def unmet(self, u: Floats, q: Floats) -> tuple[Floats, ...]:
        """Return for each solid the dilatations that `u` has and `q` does not, ``(m, k)``."""
        gaps = self._gaps(u, q).reshape(len(self._volume), -1, 1)
        return tuple(np.split((self._factor @ gaps)[:, :, 0] / self._volume[:, None], self._cuts))

    def _gaps(self, u: Floats, q: Floats) -> Floats:
        out = np.empty_like(q)
        _find_gaps(self._places, self._gradient, self._compliance, u, q, out)
        return out


def _inverses(matrices: Floats) -> Floats:
    """Return the inverses of ``(m, k, k)``; most often k is 1, for which LAPACK takes far longer."""
    return np.asarray(1.0 / matrices if matrices.shape[1] == 1 else np.linalg.inv(matrices), float)


def _roots(matrices: Floats) -> Floats:
    """Return the Cholesky factors of ``(m, k, k)``."""
    return np.asarray(np.sqrt(matrices) if matrices.shape[1] == 1 else np.linalg.cholesky(matrices), float)


@parallel
def _scale(inverse, gradient, places, free, out):  # type: ignore[no-untyped-def]
    """Fill `out` ``(m, k, 3 n)``, node by node, with the gradients ``(m, k, 3, n)``, zero where nothing is unknown."""
    m, modes, _, n = gradient.shape
    for chunk in nb.prange(CHUNKS):
        for e in range(chunk * m // CHUNKS, (chunk + 1) * m // CHUNKS):
            for k in range(modes):
                for a in range(n):
                    for i in range(3):
                        total = 0.0
                        for j in range(modes):
                            total += inverse[e, k, j] * gradient[e, j, i, a]
                        out[e, k, 3 * a + i] = total if free[places[e, a], i] else 0.0


@parallel
def _sort(elements, corners, gradient, out):  # type: ignore[no-untyped-def]
    """Fill ``out (n, k, 3)`` with the gradients by the given corners of the given elements."""
    n, modes = len(elements), gradient.shape[1]
    for chunk in nb.prange(CHUNKS):
        for m in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            for k in range(modes):
                for i in range(3):
                    out[m, k, i] = gradient[elements[m], k, 3 * corners[m] + i]


@parallel
def _sum_forces(start, elements, gradient, q, out):  # type: ignore[no-untyped-def]
    """Fill ``out (3 n_nodes,)`` with the sums over the elements at each node of gradients times `q`."""
    n, modes = len(start) - 1, gradient.shape[1]
    for chunk in nb.prange(CHUNKS):
        for a in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            f0 = f1 = f2 = 0.0
            for m in range(start[a], start[a + 1]):
                for k in range(modes):
                    size = q[modes * elements[m] + k]
                    f0 += size * gradient[m, k, 0]
                    f1 += size * gradient[m, k, 1]
                    f2 += size * gradient[m, k, 2]
            out[3 * a], out[3 * a + 1], out[3 * a + 2] = f0, f1, f2


@parallel
def _find_gaps(places, gradient, compliance, u, q, out):  # type: ignore[no-untyped-def]
    """Fill ``out (m k,)`` with what the products of the gradients with `u` exceed those of `compliance` with `q` by."""
    m, modes, width = gradient.shape
    for chunk in nb.prange(CHUNKS):
        near = np.empty(width)
        for e in range(chunk * m // CHUNKS, (chunk + 1) * m // CHUNKS):
            for a in range(width // 3):
                at = 3 * places[e, a]
                near[3 * a], near[3 * a + 1], near[3 * a + 2] = u[at], u[at + 1], u[at + 2]
            for k in range(modes):
                row = gradient[e, k]
                total = 0.0
                for c in range(width):
                    total += row[c] * near[c]
                for j in range(modes):
                    total -= compliance[e, k, j] * q[modes * e + j]
                out[modes * e + k] = total
