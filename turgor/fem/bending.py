"""Bending stiffness of embedded fibres: a discrete elastic rod along the bars of a fibre."""

from __future__ import annotations

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.fibres import EmbeddedFibre, in_blocks, nodal_shares
from turgor.fem.kernels import parallel
from turgor.fem.state import State
from turgor.fem.term import Unlagged, add_at_nodes
from turgor.mesh.mesh import Mesh

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

STRAIGHT = 1e-9
"""Two bars that turn by less than this are straight at rest: the plane of such a turn is rounding."""

BACK = -0.9
"""Cosine of the turn between two bars at which a curve runs back on itself."""

LEVI_CIVITA = np.zeros((3, 3, 3))
LEVI_CIVITA[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
LEVI_CIVITA[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = -1.0


class FibreBending(Unlagged):
    """½ E I Σ |k − k₀|² / L over the joints of successive bars, L half the length of both.

    k = 2 a × b / (1 + a · b), a and b the directions of the two bars, is the curvature binormal of Bergou, Wardetzky,
    Robinson, Audoly and Grinspun (2008): 2 tan(φ/2) about the axis of the turn φ. The natural curvature k₀ is that at
    rest, carried along with the section of the fibre, which is bonded to the body: it keeps its size, stays across the
    tangent a + b, and is turned about it as the material line that lay along it. So each joint depends on three
    vectors, the two bars and that line, all linear in the nodes of the cells around it; of a fibre that is
    straight at rest only the bars matter. Twist is free. The ends are free of moments; where the last end lies on
    the first one the fibre is closed and has a joint there. In a plane of symmetry, as of E A, a part of E I counts.

    Parameters
    ----------
    mesh
        The body.
    embedded
        The bars; at least two, of a fibre with bending stiffness.

    Raises
    ------
    InputError
        If the fibre runs back on itself at a joint.
    """

    def __init__(self, mesh: Mesh, embedded: EmbeddedFibre) -> None:
        self.fibre = embedded.fibre
        assert self.fibre.bending_stiffness is not None
        span, length = np.diff(embedded.ends, axis=0), embedded.length
        first, second = _joints(embedded.ends, length)
        tangents = span / length[:, None]
        self.places = embedded.ends[second]
        self._natural, line = _natural_curvature(tangents[first], tangents[second], self.places, self.fibre.curve)
        hosts, local = embedded.hosts[second], embedded.local[second]
        carried = _carried_lines(mesh, mesh.cells[hosts], local, line)
        self.nodes, self._share = in_blocks(embedded.bars[first], embedded.bars[second], carried)
        self._rest = self._vectors(mesh.points)
        # Where a fibre leaves a plane of symmetry, it does so on both sides.
        self._part = np.maximum(embedded.part[first], embedded.part[second])
        self._stiffness = self._part * self.fibre.bending_stiffness / (0.5 * (length[first] + length[second]))

    def moment(self, u: Floats) -> Floats:
        """Return the size of the whole section's bending moment at every joint, ``(n_joints,)``, N mm."""
        return np.asarray(self._stiffness / self._part * np.linalg.norm(self._curvature(u), axis=1))

    def energy(self, state: State) -> float:
        """Return the bending energy, N mm."""
        return 0.5 * float(np.sum(self._stiffness * np.sum(self._curvature(state.u) ** 2, axis=1)))

    def force(self, state: State, out: Floats) -> None:
        """Add the forces of the joints, N."""
        unit, length = _units(self._rest + self._vectors(state.u))
        slope, _ = _slopes(unit, self._stiffness, self._natural)
        by_unit = np.einsum("rj,rpji->pji", slope, _gradients(unit))
        by_vector = _across(unit, by_unit) / length[:, :, None]
        add_at_nodes(self.nodes, np.einsum("pja,pji->jai", self._share, by_vector), out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill the exact stiffness of the joints, N/mm."""
        del lagged
        unit, length = _units(self._rest + self._vectors(state.u))
        _fill_stiffness(self._share, _hessian(unit, length, self._stiffness, self._natural), out)

    def _vectors(self, field: Floats) -> Floats:
        """Return the first bar, the second bar and the carried line of every joint, ``(3, n_joints, 3)``."""
        return np.asarray(np.einsum("pja,jai->pji", self._share, field[self.nodes]))

    def _curvature(self, u: Floats) -> Floats:
        """Return k − k₀ ``(n_joints, 3)``."""
        (a, b, line), _ = _units(self._rest + self._vectors(u))
        tangent = a + b
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        line = _across(tangent, line)
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        return _binormal(a, b) - self._natural[:, None] * line


def _joints(ends: Floats, length: Floats) -> tuple[Ints, Ints]:
    """Return the first and second bars of the joints; the second begins at the joint."""
    second = np.arange(1, len(length))
    if len(length) > 2 and np.linalg.norm(ends[-1] - ends[0]) < 1e-6 * length.min():
        second = np.append(second, 0)
    return second - 1, second


def _natural_curvature(a: Floats, b: Floats, places: Floats, name: str) -> tuple[Floats, Floats]:
    """Return size and direction of k at rest, ``(n,)`` and ``(n, 3)``."""
    back = np.sum(a * b, axis=1) < BACK
    if back.any():
        where = ", ".join(f"{x:.4g}" for x in places[np.argmax(back)])
        raise InputError(
            f"a fibre that resists bending runs back on itself at ({where}) mm",
            key=f"curves.{name}",
            expected="a curve without such turns, or shorter bars",
        )
    binormal = _binormal(a, b)
    size = np.linalg.norm(binormal, axis=1)
    straight = size < STRAIGHT
    # Straight bars need no direction, but any across them keeps what follows finite.
    tangent = a + b
    binormal[straight] = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent), axis=1)])[straight]
    direction = binormal / np.linalg.norm(binormal, axis=1, keepdims=True)
    return np.where(straight, 0.0, size), direction


def _binormal(a: Floats, b: Floats) -> Floats:
    return np.asarray(2.0 * np.cross(a, b) / (1.0 + np.sum(a * b, axis=1, keepdims=True)))


def _carried_lines(mesh: Mesh, cells: NDArray[np.int32], local: Floats, line: Floats) -> sp.csr_matrix:
    """Return the shares of the nodes in F · line at places in cells: the line as the body carries it."""
    gradient = mesh.cell.gradient(local)
    jacobian = np.einsum("jai,jar->jir", mesh.points[cells], gradient)
    along = np.linalg.solve(jacobian, line[:, :, None])
    return nodal_shares(cells, (gradient @ along)[:, :, 0], mesh.n_points)


def _units(vectors: Floats) -> tuple[Floats, Floats]:
    length = np.linalg.norm(vectors, axis=2)
    return vectors / length[:, :, None], length


def _across(unit: Floats, vectors: Floats) -> Floats:
    """Return the parts of vectors across unit vectors, last axis three."""
    return np.asarray(vectors - np.sum(unit * vectors, axis=-1, keepdims=True) * unit)


def _gradients(unit: Floats) -> Floats:
    """Return the derivatives of c = a · b, s = (a + b) · d and v = a × b · d by a, b and d, ``(3, 3, n_joints, 3)``.

    The energy of a joint depends on these three alone; `unit` are its unit vectors a, b, d, ``(3, n_joints, 3)``.
    """
    a, b, d = unit
    return np.array([[b, a, np.zeros_like(d)], [d, d, a + b], [np.cross(b, d), np.cross(d, a), np.cross(a, b)]])


def _slopes(unit: Floats, stiffness: Floats, natural: Floats) -> tuple[Floats, Floats]:
    """Return the derivatives of the energy by c, s and v, first ``(3, n_joints)`` and second ``(3, 3, n_joints)``.

    With p = 1 + c it is E I / L (½ k² − k₀ m + ½ k₀²), k² = 4 (2/p − 1), m = 2 v / √Q and Q = p² − ½ p s². There m is
    the part of k along the carried line: k lies across the tangent already, and of d the part across it has the
    square Q / p².
    """
    a, b, d = unit
    p, s = 1.0 + np.sum(a * b, axis=1), np.sum((a + b) * d, axis=1)
    v = np.sum(np.cross(a, b) * d, axis=1)
    zero = np.zeros_like(p)
    Q = p**2 - 0.5 * p * s**2
    first = np.array([2.0 * p - 0.5 * s**2, -p * s])
    second = np.array([[2.0 + zero, -s], [-s, -p]])
    m = 2.0 * Q**-0.5  # by v
    m_first = -0.5 * m / Q * first
    m_second = 0.75 * m / Q**2 * first[:, None] * first - 0.5 * m / Q * second
    slope = -natural * np.array([v * m_first[0], v * m_first[1], m])
    slope[0] -= 4.0 / p**2
    curvature = np.zeros((3, 3, len(p)))
    curvature[:2, :2] = -natural * v * m_second
    curvature[:2, 2] = curvature[2, :2] = -natural * m_first
    curvature[0, 0] += 8.0 / p**3
    return stiffness * slope, stiffness * curvature


def _hessian(unit: Floats, length: Floats, stiffness: Floats, natural: Floats) -> Floats:
    """Return the second derivatives of the energy by the three vectors of every joint, ``(n_joints, 3, 3, 3, 3)``."""
    slope, curvature = _slopes(unit, stiffness, natural)
    gradients = _gradients(unit)
    by_unit = np.einsum("rj,rpji->pji", slope, gradients)
    hessian = np.einsum("rtj,rpji,tqjk->jpiqk", curvature, gradients, gradients, optimize=True)
    eye = np.eye(3)
    # The invariants are linear in each of a, b and d: only two different ones have second derivatives.
    for p, q, other, weight in ((0, 1, 2, slope[0]), (0, 2, 1, slope[1]), (1, 2, 0, slope[1])):
        sign = -1.0 if q - p == 2 else 1.0
        mixed = weight[:, None, None] * eye + sign * np.einsum("j,ikl,jl->jik", slope[2], LEVI_CIVITA, unit[other])
        hessian[:, p, :, q] += mixed
        hessian[:, q, :, p] += mixed.transpose(0, 2, 1)
    across = (eye - unit[..., :, None] * unit[..., None, :]) / length[..., None, None]
    hessian = np.einsum("pjim,jpmqn,qjnk->jpiqk", across, hessian, across, optimize=True)
    for p in range(3):
        n, w = unit[p], by_unit[p]
        along = np.sum(n * w, axis=1)[:, None, None]
        dyad = n[:, :, None] * n[:, None, :]
        turned = n[:, :, None] * w[:, None, :]
        bent = along * (3.0 * dyad - eye) - turned - turned.transpose(0, 2, 1)
        hessian[:, p, :, p] += bent / length[p][:, None, None] ** 2
    return np.ascontiguousarray(hessian)


@parallel
def _fill_stiffness(share, hessian, out):  # type: ignore[no-untyped-def]
    """Fill ``out (n_joints, packed)``, blocks ``Σ_pq c_pa H_pq c_qb``, c the shares ``(3, n_joints, width)``."""
    width = share.shape[2]
    for joint in nb.prange(share.shape[1]):
        row = np.empty((3, 3, 3))
        at = 0
        for a in range(width):
            for i in range(3):
                for q in range(3):
                    for k in range(3):
                        row[i, q, k] = 0.0
                        for p in range(3):
                            row[i, q, k] += share[p, joint, a] * hessian[joint, p, i, q, k]
            for i in range(3):
                for b in range(a, width):
                    for k in range(i if a == b else 0, 3):
                        value = 0.0
                        for q in range(3):
                            value += row[i, q, k] * share[q, joint, b]
                        out[joint, at] = value
                        at += 1
