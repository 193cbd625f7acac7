"""Case T: the capped tube that every code solves, and its mesh as plain arrays.

A tube of inner radius 6.35 mm, wall 3.5 mm and length 120 mm with solid caps of 17 mm, one end face clamped, of
neo-Hookean rubber W = μ/2 (Ī₁ − 3) + K/2 (J − 1)², under a follower pressure in its closed cavity. The module needs
numpy alone, so that it runs in the environment of every peer.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

MU = 0.1047
"""Shear modulus μ, MPa."""

BULK = 1000.0 * MU
"""Bulk modulus K, MPa."""

PRESSURE = 0.02
"""Pressure in the cavity, MPa: 58 % of the limit pressure."""

TOLERANCE = 1e-7
"""Norm of the out-of-balance force over the norm of the nodal forces of the pressure, at an equilibrium."""

VOLUME_TOLERANCE = 1e-9
"""Norm of the residual of the volume constraint over the norm of its parts, where pressures are unknowns."""

MOST_ITERATIONS = 30
"""Linear solves after which a run counts as failed."""


@dataclass(frozen=True)
class TubeMesh:
    """Second-order tetrahedra with straight or curved edges.

    ``points (n, 3)`` mm; ``cells (m, 10)`` in VTK order (corners, then edges 01 12 02 03 13 23); ``mount (k, 6)``
    the faces of the clamped end and ``cavity (f, 6)`` those of the cavity (corners, then edges 01 12 20), normals out
    of the solid; ``tip`` the node in the middle of the free end.
    """

    points: np.ndarray
    cells: np.ndarray
    mount: np.ndarray
    cavity: np.ndarray
    tip: int

    def save(self, path: Path) -> None:
        np.savez(path, **vars(self))

    @classmethod
    def load(cls, path: Path | str) -> TubeMesh:
        with np.load(path) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return cls(**arrays | {"tip": int(arrays["tip"])})

    @property
    def clamped(self) -> np.ndarray:
        """The nodes of the clamped end."""
        return np.unique(self.mount)

    def host_faces(self, numbering: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return for each cavity face its tetrahedron and its place in a peer's `numbering` ``(4, 3)`` of the faces."""
        n = len(self.points)
        weights = np.array([n * n, n, 1], dtype=np.int64)
        key = np.sort(self.cells[:, numbering], axis=2).reshape(-1, 3) @ weights
        target = np.sort(self.cavity[:, :3], axis=1) @ weights
        order = np.argsort(key)
        at = order[np.searchsorted(key, target, sorter=order)]
        assert np.array_equal(key[at], target)
        return at // len(numbering), at % len(numbering)
