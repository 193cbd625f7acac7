"""Fibres: bars along curves that run through the cells without belonging to their nodes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numba as nb
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from turgor.common.errors import InputError
from turgor.fem.kernels import parallel
from turgor.fem.locate import locate
from turgor.fem.state import State
from turgor.fem.term import Mixed, add_at_nodes
from turgor.mesh.mesh import Mesh
from turgor.mesh.symmetry import part_in_front, planes_of_symmetry

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

BARS_PER_EDGE = 2.0
"""Default number of bars along the mean edge of the cells that a fibre passes."""

CORNER = np.cos(np.radians(20.0))
"""A curve that turns more at one of its points has a corner there, which stays a joint of two bars."""


@dataclass(frozen=True)
class Fibre:
    """A thread along a named curve of the mesh, bonded to the body along its whole length.

    Attributes
    ----------
    curve
        Name of the curve.
    youngs_modulus
        E in MPa.
    diameter
        Of its round section, mm.
    tension_only
        Whether it goes slack instead of carrying compression, as a thread does.
    bar_length
        Longest bar, mm; ``None`` for half the mean edge of the cells that the fibre passes.
    bending_stiffness
        E I in N mm²; ``None`` for a fibre that bends freely. :func:`solid_bending_stiffness` gives that of a wire.
    """

    curve: str
    youngs_modulus: float
    diameter: float
    tension_only: bool = True
    bar_length: float | None = None
    bending_stiffness: float | None = None

    @property
    def axial_stiffness(self) -> float:
        """E A in N."""
        return 0.25 * np.pi * self.youngs_modulus * self.diameter**2


def solid_bending_stiffness(youngs_modulus: float, diameter: float) -> float:
    """Return E I of a solid round section, I = π d⁴/64, in N mm²."""
    return np.pi / 64.0 * youngs_modulus * diameter**4


class EmbeddedFibre(Mixed):
    """½ E A Σ ε² L over straight bars, ε = l/L − 1, whose ends move with the cells that they lie in.

    How the bars resist bending against each other is a term of its own, :class:`turgor.fem.bending.FibreBending`.

    The ends' displacement is interpolated by the shape functions of their host cells (Phillips and Zienkiewicz 1976;
    Elwi and Hrudey 1989), so that the mesh need not know of the fibre. What lags is the axial force of every
    bar (:class:`turgor.fem.term.Term`): the length constraint of a fibre that is a million times stiffer than the
    body is then linear to the iteration, which converges in long steps.

    Of a bar in a plane of symmetry, which cuts it lengthwise, only a part of E A belongs to the body. Axial forces are
    always those of the whole section.

    Parameters
    ----------
    mesh
        The body; it holds the curve.
    fibre
        What runs along it.

    Raises
    ------
    InputError
        If the mesh is plane or has no such curve, the curve leaves the body, a property is not positive, or the curve
        runs in a plane of symmetry through which the body reaches.

    Attributes
    ----------
    part
        What part of each bar's section belongs to the body, ``(n_bars,)``: one but in planes of symmetry.
    """

    def __init__(self, mesh: Mesh, fibre: Fibre) -> None:
        if mesh.dimension != 3:
            raise InputError("fibres need a body in space, not a plane section", key=f"fibres.{fibre.curve}")
        self.fibre = fibre
        self.ends = _bar_ends(mesh, fibre)
        self.hosts, self.local = locate(mesh.points, mesh.cells, self.ends, f"curves.{fibre.curve}")
        ends = nodal_shares(mesh.cells[self.hosts], mesh.cell.shape(self.local), mesh.n_points)
        self.bars = (ends[1:] - ends[:-1]).tocsr()
        self.nodes, (self._share,) = in_blocks(self.bars)
        self._span = self._difference(mesh.points)
        self.length = np.linalg.norm(self._span, axis=1)
        self.part = _parts_in_body(mesh, self.ends, f"fibres.{fibre.curve}")

    @property
    def resists_bending(self) -> bool:
        """Whether it has bending stiffness, and a joint where that acts: a single bar has none."""
        return self.fibre.bending_stiffness is not None and len(self.length) > 1

    def strain(self, u: Floats) -> Floats:
        """Return the engineering strain l/L − 1 of every bar at displacement `u`, ``(n_bars,)``."""
        _, length = self._direction(u)
        return np.asarray(length / self.length - 1.0)

    def tension(self, u: Floats) -> Floats:
        """Return the axial force of every bar at displacement `u`, ``(n_bars,)``, N."""
        force = self.fibre.axial_stiffness * self.strain(u)
        return self.allowed(force)

    def energy(self, state: State) -> float:
        """Return the strain energy, N mm."""
        square = float(np.sum(self.part * self.tension(state.u) ** 2 * self.length))
        return 0.5 * square / self.fibre.axial_stiffness

    def merit(self, state: State, lagged: Floats) -> float:
        """Return the work of the lagged axial forces, N mm."""
        _, length = self._direction(state.u)
        return float(np.vdot(self.part * lagged, length - self.length))

    def force_of(self, u: Floats, lagged: Floats, out: Floats) -> None:
        """Add the forces of bars with given axial forces, N."""
        direction, _ = self._direction(u)
        pull = (self.part * lagged)[:, None] * direction
        add_at_nodes(self.nodes, self._share[:, :, None] * pull[:, None, :], out)

    def stiffness(self, state: State, lagged: Floats, out: Floats) -> None:
        """Fill E A/L n ⊗ n of the taut bars and the geometric part of the lagged axial forces, N/mm."""
        direction, length = self._direction(state.u)
        _fill_stiffness(self._share, direction, self.part * self._axial(state.u), self.part * lagged / length, out)

    def lagged_at(self, state: State) -> Floats:
        """Return the axial forces of a state, ``(n_bars,)``, N."""
        return self.tension(state.u)

    def lagged_change(self, state: State, du: Floats) -> Floats:
        """Return the change of the axial forces along the step `du`, linearised at the state, ``(n_bars,)``, N."""
        direction, _ = self._direction(state.u)
        return np.asarray(self._axial(state.u) * np.einsum("bi,bi->b", direction, self._difference(du)))

    def allowed(self, lagged: Floats) -> Floats:
        """Return the axial forces without those that a thread cannot bear."""
        return np.maximum(lagged, 0.0) if self.fibre.tension_only else lagged

    def _difference(self, field: Floats) -> Floats:
        """Return the difference of a nodal field between the two ends of every bar, ``(n_bars, 3)``."""
        return np.asarray(np.einsum("ba,bai->bi", self._share, field[self.nodes]))

    def _direction(self, u: Floats) -> tuple[Floats, Floats]:
        span = self._span + self._difference(u)
        length = np.linalg.norm(span, axis=1)
        return span / length[:, None], length

    def _axial(self, u: Floats) -> Floats:
        """Return the slope of axial force by length, ``(n_bars,)``, N/mm: none where a bar is slack."""
        slope = self.fibre.axial_stiffness / self.length
        # A bar at rest counts as taut.
        return np.where(self.strain(u) < 0.0, 0.0, slope) if self.fibre.tension_only else slope


def _bar_ends(mesh: Mesh, fibre: Fibre) -> Floats:
    """Return the ends of the bars ``(n_bars + 1, 3)``: along the curve at equal distances, corners kept."""
    for key in ("youngs_modulus", "diameter", "bar_length", "bending_stiffness"):
        value = getattr(fibre, key)
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError("this must be positive", key=f"fibres.{fibre.curve}.{key}", value=value)
    curve = mesh.curve(fibre.curve)
    step = np.diff(curve, axis=0)
    length = np.linalg.norm(step, axis=1)
    if len(curve) < 2 or not length.all():
        raise InputError("the curve has fewer than two points, or two in the same place", key=f"curves.{fibre.curve}")
    bar = fibre.bar_length or _mean_edge(mesh, curve, fibre.curve) / BARS_PER_EDGE
    turning = np.einsum("ki,ki->k", step[:-1], step[1:]) / (length[:-1] * length[1:])
    corners = [0, *(np.flatnonzero(turning < CORNER) + 1), len(curve) - 1]
    at = np.concatenate([[0.0], np.cumsum(length)])
    stations = [np.zeros(1)]
    for first, last in itertools.pairwise(corners):
        count = max(1, int(np.ceil((at[last] - at[first]) / bar - 1e-9)))
        stations.append(np.linspace(at[first], at[last], count + 1)[1:])
    wanted = np.concatenate(stations)
    return np.column_stack([np.interp(wanted, at, curve[:, i]) for i in range(3)])


def _parts_in_body(mesh: Mesh, ends: Floats, key: str) -> Floats:
    """Return what part of the round section of each bar lies on the body's side of all planes of symmetry."""
    bars, part = np.stack([ends[:-1], ends[1:]], axis=1), np.ones(len(ends) - 1)
    planes = list(planes_of_symmetry(mesh))
    inside = np.array([plane.holds(bars) for plane in planes], bool).reshape(len(planes), len(bars))
    for plane, holds in zip(planes, inside, strict=True):
        if holds.any():
            plane.check_behind(mesh, "it does not halve a fibre", key)
    for cut in np.unique(inside, axis=1).T:
        part[(cut == inside.T).all(axis=1)] = part_in_front(list(itertools.compress(planes, cut)))
    return part


def _mean_edge(mesh: Mesh, curve: Floats, name: str) -> float:
    cell, _ = locate(mesh.points, mesh.cells, curve, f"curves.{name}")
    nodes = mesh.points[mesh.cells[np.unique(cell)]]
    edges = [nodes[:, a] - nodes[:, b] for a, b in mesh.cell.edges]
    return float(np.linalg.norm(edges, axis=2).mean())


def nodal_shares(cells: Ints, shares: Floats, n_points: int) -> sp.csr_matrix:
    """Return the matrix ``(n, n_points)`` of quantities of which each node of ``cells (n, m)`` has its share."""
    start = np.arange(0, cells.size + 1, cells.shape[1])
    return sp.csr_matrix((shares.ravel(), cells.ravel(), start), shape=(len(cells), n_points))


def in_blocks(*quantities: sp.csr_matrix) -> tuple[Ints, Floats]:
    """Return the nodes that move any of some quantities, and their shares in each of them.

    Parameters
    ----------
    quantities
        Matrices ``(n, n_points)`` of shares; row i of all of them makes block i.

    Returns
    -------
    nodes, shares
        ``(n, width)`` and ``(n_quantities, n, width)``; blocks of fewer nodes repeat one of them with shares zero.
    """
    kept = []
    for quantity in quantities:
        # A node of the face, edge or corner opposite to which an end lies has no share in it but rounding.
        entries = quantity.tocoo()
        large = np.abs(entries.data) >= 1e-10 * np.abs(entries.data).max()
        kept.append((entries.row[large], entries.col[large], entries.data[large]))
    n, n_points = quantities[0].shape
    keys = [row.astype(np.int64) * n_points + col for row, col, _ in kept]
    places = np.unique(np.concatenate(keys))
    row = places // n_points
    count = np.bincount(row, minlength=n)
    first = np.cumsum(count) - count
    nodes = np.repeat((places[first] % n_points)[:, None], count.max(), axis=1).astype(np.int32)
    nodes[row, np.arange(len(places)) - first[row]] = places % n_points
    shares = np.zeros((len(quantities), *nodes.shape))
    for share, key, (at, _, values) in zip(shares, keys, kept, strict=True):
        share[at, np.searchsorted(places, key) - first[at]] = values
    return nodes, shares


@parallel
def _fill_stiffness(share, direction, axial, lateral, out):  # type: ignore[no-untyped-def]
    """Fill ``out (n_bars, packed)``, blocks ``c_a c_b (axial n ⊗ n + lateral (1 − n ⊗ n))``, c the shares."""
    width = share.shape[1]
    for bar in nb.prange(len(share)):
        n = direction[bar]
        at = 0
        for a in range(width):
            for i in range(3):
                for b in range(a, width):
                    weight = share[bar, a] * share[bar, b]
                    for k in range(i if a == b else 0, 3):
                        value = (axial[bar] - lateral[bar]) * n[i] * n[k]
                        if i == k:
                            value += lateral[bar]
                        out[bar, at] = weight * value
                        at += 1
