"""Principal stretches and their directions, of many points side by side.

Jacobi's rotations keep full relative accuracy at equal eigenvalues, where closed formulas lose half of the digits
(Demmel and Veselić 1992). One after the other they wait for a root or a quotient most of the time; points that are
rotated together, each in a lane of its own, share the wait.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from turgor.fem.constitutive import left_cauchy_green
from turgor.fem.kernels import CHUNKS, inlined, jit, parallel

LANES = 8
"""Points that are rotated together."""

VECTORS = 6
"""Row of the lanes from which on the directions stand; before it, the matrices' six components in stored order."""

SWEEPS = 10
"""Most rounds of rotations; from about the fourth on, nothing is left to rotate."""

OFF = 1e-32
"""Sum of squares off the diagonal, in parts of that on it, from which on a matrix is diagonal."""

TINY = 1e-300
"""Keeps the quotient of an angle defined where there is nothing to rotate."""


@parallel
def isochoric_stretches(F, J, stretches, directions):  # type: ignore[no-untyped-def]
    """Fill the isochoric principal ``stretches (p, 3)`` and spatial ``directions (p, 3, 3)`` (in columns)."""
    n = len(F)
    for chunk in nb.prange(CHUNKS):
        first, last = chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS
        point, lanes = np.empty(6), np.ones(15 * LANES)
        for begin in range(first, last, LANES):
            count = min(LANES, last - begin)
            for lane in range(count):
                left_cauchy_green(F[begin + lane], J[begin + lane], point)
                for r in range(6):
                    lanes[r * LANES + lane] = point[r]
            diagonalise(lanes)
            for lane in range(count):
                for i in range(3):
                    stretches[begin + lane, i] = np.sqrt(lanes[i * LANES + lane])
                    for j in range(3):
                        directions[begin + lane, i, j] = lanes[(VECTORS + 3 * i + j) * LANES + lane]


@jit
def diagonalise(lanes):  # type: ignore[no-untyped-def]
    """Bring the symmetric matrices in ``lanes (15 LANES,)`` to diagonal form in place, and fill their eigenvectors.

    That is one array, as the compiler then sees that its rows do not overlap.
    """
    for i in range(3):
        for j in range(3):
            for lane in range(LANES):
                lanes[(VECTORS + 3 * i + j) * LANES + lane] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        is_diagonal = True
        for lane in range(LANES):
            on = lanes[lane] ** 2 + lanes[LANES + lane] ** 2 + lanes[2 * LANES + lane] ** 2
            off = lanes[3 * LANES + lane] ** 2 + lanes[4 * LANES + lane] ** 2 + lanes[5 * LANES + lane] ** 2
            is_diagonal &= off <= OFF * on
        if is_diagonal:
            break
        rotate(lanes, 0, 1, 3, 5, 4)
        rotate(lanes, 1, 2, 4, 3, 5)
        rotate(lanes, 0, 2, 5, 3, 4)


@inlined
def rotate(lanes, p, q, pq, rp, rq):  # type: ignore[no-untyped-def]
    """Rotate axes p and q so that their component, row `pq`, vanishes; `rp` and `rq` are theirs with the third axis."""
    for lane in range(LANES):
        gap, twice = lanes[q * LANES + lane] - lanes[p * LANES + lane], 2.0 * lanes[pq * LANES + lane]
        size = np.abs(gap) + np.sqrt(gap * gap + twice * twice) + TINY
        t = (twice if gap >= 0.0 else -twice) / size
        c = 1.0 / np.sqrt(1.0 + t * t)
        s = t * c
        lanes[p * LANES + lane] -= 0.5 * t * twice
        lanes[q * LANES + lane] += 0.5 * t * twice
        lanes[pq * LANES + lane] = 0.0
        x, y = lanes[rp * LANES + lane], lanes[rq * LANES + lane]
        lanes[rp * LANES + lane], lanes[rq * LANES + lane] = c * x - s * y, s * x + c * y
        for i in range(3):
            v, w = (VECTORS + 3 * i + p) * LANES + lane, (VECTORS + 3 * i + q) * LANES + lane
            x, y = lanes[v], lanes[w]
            lanes[v], lanes[w] = c * x - s * y, s * x + c * y
