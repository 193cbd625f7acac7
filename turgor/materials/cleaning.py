"""Cleaning of a measured curve: which rows a fit should not see, and why each was dropped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.materials.kinematics import Array

BREAK_DROP = 0.8
"""A specimen has broken where the load falls below this part of its peak."""

UNLOADING_RUN = 5
"""So many rows in a row that go back are an unloading, fewer are noise."""

OUTLIER_DEVIATION = 8.0
OUTLIER_FLOOR = 0.05
"""An outlier deviates from its neighbours' line by 8 robust standard deviations and 5 % of the largest stress."""

OUTLIER_MINIMUM = 15
"""Curves with fewer rows are not searched for outliers."""

LISTED = 4
"""Rows of which all numbers are told."""


def numbered(rows: Sequence[int]) -> str:
    """Return numbers of rows in words, of many the first few and the last."""
    if len(rows) == 1:
        return f"row {rows[0]}"
    listed = ", ".join(map(str, rows if len(rows) <= LISTED else rows[: LISTED - 1]))
    return f"rows {listed}" if len(rows) <= LISTED else f"{len(rows)} rows ({listed} … {rows[-1]})"


@dataclass(frozen=True)
class Dropped:
    """Rows of a file that are not used: why, their numbers in the file, and their stretch and stress (NaN kept)."""

    reason: str
    rows: tuple[int, ...]
    stretch: Array
    stress: Array

    def __str__(self) -> str:
        return f"not used: {numbered(self.rows)} ({self.reason})"

    def as_dict(self) -> dict[str, object]:
        """Return the reason, the number of rows and their numbers."""
        return {"reason": self.reason, "count": len(self.rows), "rows": list(self.rows)}


@dataclass(frozen=True)
class Curve:
    """A curve while it is cleaned: `deformation` is zero at rest (strain, shear or J − 1), `rows` number the file."""

    rows: NDArray[np.int64]
    deformation: Array
    stress: Array
    lateral: Array | None

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> Curve:
        """Return the chosen rows only."""
        lateral = None if self.lateral is None else self.lateral[chosen]
        return Curve(self.rows[chosen], self.deformation[chosen], self.stress[chosen], lateral)

    def __len__(self) -> int:
        return len(self.rows)


def clean(curve: Curve) -> tuple[Curve, tuple[Dropped, ...], tuple[str, ...]]:
    """Drop what a fit should not see.

    Parameters
    ----------
    curve
        The rows in the order of the file.

    Returns
    -------
    tuple
        The rows kept, sorted by deformation; what was dropped; and what else was changed, in words.
    """
    dropped: list[Dropped] = []
    for reason, keep in _RULES:
        mask = keep(curve)
        if not np.all(mask):
            gone = curve.take(~mask)
            dropped.append(Dropped(reason, tuple(gone.rows.tolist()), 1.0 + gone.deformation, gone.stress))
            curve = curve.take(mask)
    order = np.argsort(curve.deformation, kind="stable")
    moved = int(np.count_nonzero(order != np.arange(len(curve))))
    changed = (f"{moved} rows were not in the order of their deformation and were sorted",) if moved else ()
    return curve.take(order), tuple(dropped), changed


def _finite(curve: Curve) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(curve.deformation) & np.isfinite(curve.stress))


def _before_break(curve: Curve) -> NDArray[np.bool_]:
    everything = np.ones(len(curve), dtype=bool)
    if len(curve) < 3 or not _is_ascending(curve):
        return everything
    load = np.abs(curve.stress)
    # The running median of three does not see single outliers, which are no peak.
    smooth = np.median(np.stack([load[:-2], load[1:-1], load[2:]]), axis=0)
    smooth = np.concatenate([[load[0]], smooth, [min(load[-1], smooth[-1])]])
    top = int(np.argmax(smooth))
    fallen = top + np.flatnonzero(smooth[top:] < BREAK_DROP * smooth[top])
    # A load that falls while the specimen is drawn back is unloading, not a break.
    if not len(fallen) or abs(curve.deformation[fallen[0]]) < 0.98 * abs(curve.deformation[top]):
        return everything
    peak = np.flatnonzero(smooth[: fallen[0]] == smooth[top])[-1]
    return np.asarray(np.arange(len(curve)) <= peak)


def _loading(curve: Curve) -> NDArray[np.bool_]:
    extent = np.abs(curve.deformation)
    keep = np.ones(len(curve), dtype=bool)
    if len(curve) < UNLOADING_RUN + 2 or not _is_ascending(curve):
        return keep
    back = np.diff(extent) < 0
    run = 0
    for i, falling in enumerate(back):
        run = run + 1 if falling else 0
        if run == UNLOADING_RUN:
            keep[i + 2 - UNLOADING_RUN :] = False
            break
    return keep


def _is_ascending(curve: Curve) -> bool:
    """Say whether the rows follow a loading, rather than being listed backwards or in no order."""
    steps = np.diff(np.abs(curve.deformation[: max(8, len(curve) // 4)]))
    return bool(np.count_nonzero(steps >= 0) >= 0.6 * len(steps))


def _new(curve: Curve) -> NDArray[np.bool_]:
    pairs = np.column_stack([curve.deformation, curve.stress])
    _, first = np.unique(pairs, axis=0, return_index=True)
    keep = np.zeros(len(curve), dtype=bool)
    keep[first] = True
    return keep


def _not_slack(curve: Curve) -> NDArray[np.bool_]:
    """Rows before the specimen is taut: the stress is against the deformation, or there is none."""
    against = curve.stress * curve.deformation < 0
    idle = (curve.stress == 0) & (np.abs(curve.deformation) > 0)
    return np.asarray(~(against | idle))


def _not_outlier(curve: Curve) -> NDArray[np.bool_]:
    keep = np.ones(len(curve), dtype=bool)
    if len(curve) < OUTLIER_MINIMUM:
        return keep
    order = np.argsort(curve.deformation, kind="stable")
    x, y = curve.deformation[order], curve.stress[order]
    width = x[2:] - x[:-2]
    share = np.divide(x[1:-1] - x[:-2], width, out=np.full_like(width, 0.5), where=width > 0)
    deviation = np.abs(y[1:-1] - (1.0 - share) * y[:-2] - share * y[2:])
    spread = 1.4826 * float(np.median(deviation))
    limit = max(OUTLIER_DEVIATION * spread, OUTLIER_FLOOR * float(np.abs(y).max()))
    # A spike of h deviates by h and its neighbours by about h/2: only the largest of three is the outlier.
    padded = np.concatenate([[0.0], deviation, [0.0]])
    largest = (deviation >= 1.5 * padded[:-2]) & (deviation >= 1.5 * padded[2:])
    keep[order[1:-1][(deviation > limit) & largest]] = False
    return keep


_RULES: tuple[tuple[str, Callable[[Curve], NDArray[np.bool_]]], ...] = (
    ("no number", _finite),
    ("after the break", _before_break),
    ("unloading", _loading),
    ("repeated row", _new),
    ("slack: no stress, or stress against the deformation", _not_slack),
    ("outlier", _not_outlier),
)
