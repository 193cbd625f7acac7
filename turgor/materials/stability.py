"""Material stability of the incompressible solid: where Drucker's (Hill's) inequality holds.

An increment of logarithmic strain must be met by an increment of Kirchhoff stress that does positive work,
dτ : dε > 0 for every isochoric dε. With the energy as a function of two log strains, Ŵ(ε₁, ε₂), ε₃ = −ε₁ − ε₂, this
says that the 2×2 matrix ∂²Ŵ/∂ε∂ε is positive definite; it is the matrix that Abaqus checks (Abaqus Theory Guide,
"Hyperelastic material behavior"; Hill 1970).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import IDENTITY, Array

_PATHS: dict[str, Callable[[Array], Array]] = {
    "uniaxial": lambda x: np.stack([x, x**-0.5, x**-0.5], axis=-1),
    "equibiaxial": lambda x: np.stack([x, x, x**-2.0], axis=-1),
    "planar": lambda x: np.stack([x, np.ones_like(x), 1.0 / x], axis=-1),
}
"""The principal stretches of each mode against its stretch."""

MODES = tuple(_PATHS)

STRETCHES = (0.3, 6.0)
"""The range that a verdict covers unless another is asked for."""

_SAMPLES = 400
_ROUNDS = 5
"""How often a loss is looked for, each time between the two samples that hold it."""

_OVERFLOWING = 1e200
"""Energy over shear modulus beyond which a curvature without a value is one too large for a number, not a loss."""

_SHORT_OF_LOCKING = 0.8
"""The part of the strain at which a material locks up to which the digits of its constants are judged."""


def principal_stretches(mode: str, stretch: Array) -> Array:
    """Return the three principal stretches ``(..., 3)`` of a mode (``"uniaxial"``, ``"equibiaxial"``, ``"planar"``)."""
    return _PATHS[mode](np.asarray(stretch, dtype=float))


def drucker_matrix(material: Hyperelastic, stretches: Array) -> Array:
    """Return ∂²Ŵ/∂ε_α∂ε_β in MPa, ``(..., 2, 2)``, at isochoric principal `stretches` ``(..., 3)``."""
    return _isochoric_part(_energy_and_hessian(material, stretches)[1])


def drucker_margin(material: Hyperelastic, stretches: Array) -> Array:
    """Return the smallest eigenvalue of :func:`drucker_matrix` over the initial shear modulus, ``(...)``.

    It is 2 in the undeformed state and positive where the material is stable.
    """
    _, H = _energy_and_hessian(material, stretches)
    return np.asarray(_smallest_eigenvalue(H) / material.shear_modulus)


def _energy_and_hessian(material: Hyperelastic, stretches: Array) -> tuple[Array, Array]:
    """Return W ``(...)`` and ∂²W/∂ε_a∂ε_b ``(..., 3, 3)``, MPa, by all three log strains."""
    x = np.asarray(stretches, dtype=float)
    W, w, h = material.principal(x)
    return W, np.asarray(x[..., :, None] * x[..., None, :] * h + IDENTITY * (x * w)[..., None])


def _isochoric_part(H: Array) -> Array:
    """Return the matrix of two log strains of that of three, the third being minus the sum of the others."""
    projected: Array = H[..., :2, :2] - H[..., :2, 2:] - H[..., 2:, :2] + H[..., 2:, 2:]
    return projected


def _smallest_eigenvalue(H: Array) -> Array:
    """Return that of the isochoric part, ``(...)``, also where the other one is larger by more digits than there are.

    Its determinant is the sum of the cofactors of `H` (Cauchy and Binet), in which what is large in both rows of the
    part does not have to cancel.
    """
    size = np.abs(H).max(axis=(-2, -1))
    size = np.where(size > 0.0, size, 1.0)
    H = H / size[..., None, None]
    part = _isochoric_part(H)
    trace, apart = part[..., 0, 0] + part[..., 1, 1], part[..., 0, 0] - part[..., 1, 1]
    larger = 0.5 * (trace + np.copysign(np.hypot(apart, 2.0 * part[..., 0, 1]), trace))
    rows = [(H[..., i, :], H[..., j, :]) for i, j in ((0, 1), (1, 2), (2, 0))]
    # The cofactors of a row are the cross product of the two others.
    determinant = sum(np.cross(first, second).sum(axis=-1) for first, second in rows)
    other = determinant / np.where(larger == 0.0, 1.0, larger)
    return np.asarray(size * np.minimum(larger, other))


def stable_range(
    material: Hyperelastic, mode: str, low: float = STRETCHES[0], high: float = STRETCHES[1]
) -> tuple[float, float]:
    """Return the stretches around 1 between which the material is stable in a mode, cut at `low` and `high`."""
    down = _first_loss(material, mode, low)
    up = _first_loss(material, mode, high)
    return (low if down is None else down, high if up is None else up)


def _first_loss(material: Hyperelastic, mode: str, end: float) -> float | None:
    """Return the first stretch on the way from 1 to `end` at which stability is lost."""

    def margin(log_stretch: Array) -> Array:
        # Beyond its locking stretch a material has infinite energy: it does not go there, which is not a loss.
        stretches = principal_stretches(mode, np.exp(log_stretch))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            W, H = _energy_and_hessian(material, stretches)
            H = H / material.shear_modulus
            finite = np.all(np.isfinite(H), axis=(-2, -1))
            # The derivatives of an exponential energy overflow just before it does.
            locked = np.isposinf(W) | (~finite & (W / material.shear_modulus > _OVERFLOWING))
            found = _smallest_eigenvalue(np.where(finite[..., None, None], H, -IDENTITY))
        return np.asarray(np.where(locked, 1.0, found), dtype=float)

    return _end_of(lambda log_stretch: margin(log_stretch) > 0.0, end)


def _end_of(holds: Callable[[Array], NDArray[np.bool_]], end: float) -> float | None:
    """Return the stretch on the way from 1 to `end` up to which something `holds`, a function of log stretches.

    None if it holds all the way.
    """
    if end == 1.0:
        return None
    # Quadratic spacing: sets that are lost, are often lost within a few per cent of strain.
    path = np.log(end) * np.linspace(0.0, 1.0, _SAMPLES) ** 2
    for _ in range(_ROUNDS):
        lost = np.flatnonzero(~holds(path))
        if not len(lost):
            return None
        if lost[0] == 0:
            return 1.0
        good, bad = path[lost[0] - 1 : lost[0] + 1]
        path = np.linspace(good, bad, _SAMPLES)
    return float(np.exp(good))


Places = dict[str, dict[str, float]]
"""Stretches by mode and ``"compression"`` or ``"tension"``; what has none is left out."""


def locking(material: Hyperelastic, low: float = STRETCHES[0], high: float = STRETCHES[1]) -> Places:
    """Return the stretches between `low` ≤ 1 and `high` ≥ 1 beyond which the energy is infinite: there it locks."""
    found: Places = {}
    for mode in _PATHS:
        for side, end in (("compression", low), ("tension", high)):
            is_reached = functools.partial(_is_reached, material, mode)
            place = None if is_reached(np.log([end])).all() else _end_of(is_reached, end)
            if place is not None:
                found.setdefault(mode, {})[side] = place
    return found


def _is_reached(material: Hyperelastic, mode: str, log_stretch: Array) -> NDArray[np.bool_]:
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return ~np.isposinf(material.principal(principal_stretches(mode, np.exp(log_stretch)))[0])


@dataclass(frozen=True)
class Verdict:
    """Where a material is stable: for each mode the stretches around 1, cut at the range that was examined.

    ``locked`` are the places where it locks (:func:`locking`): to go there is no loss of stability, but impossible.
    """

    examined: tuple[float, float]
    ranges: dict[str, tuple[float, float]]
    locked: Places = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether no mode is lost within the range examined."""
        return all(span == self.examined for span in self.ranges.values())

    @property
    def lost(self) -> Places:
        """The stretches at which stability is lost."""
        found: Places = {}
        for mode, (low, high) in self.ranges.items():
            places = {}
            if low > self.examined[0]:
                places["compression"] = low
            if high < self.examined[1]:
                places["tension"] = high
            if places:
                found[mode] = places
        return found

    def __str__(self) -> str:
        low, high = self.examined
        locks = f"; locks: {_in_words(self.locked)}" if self.locked else ""
        if self.stable:
            return f"stable in stretches {low:.3g}–{high:.3g}{locks}"
        return f"unstable: {_in_words(self.lost)}{locks} (stretches {low:.3g}–{high:.3g} examined)"


def _in_words(found: Places) -> str:
    return ", ".join(
        f"{mode} {'below' if side == 'compression' else 'beyond'} {stretch:.3g}"
        for mode, places in found.items()
        for side, stretch in places.items()
    )


def verdict(material: Hyperelastic, low: float = STRETCHES[0], high: float = STRETCHES[1]) -> Verdict:
    """Return where between the stretches `low` < 1 and `high` > 1 the material is stable, mode by mode."""
    ranges = {mode: stable_range(material, mode, low, high) for mode in _PATHS}
    return Verdict((low, high), ranges, locking(material, low, high))


def stable_up_to(material: Hyperelastic, largest_stretch: float) -> bool:
    """Say whether the material is stable wherever no principal stretch exceeds `largest_stretch`.

    Tension in the three modes to that stretch covers their compression too: uniaxial compression is equibiaxial
    tension of the other two directions, and the other way round.
    """
    return all(_first_loss(material, mode, largest_stretch) is None for mode in _PATHS)


def digit_sensitivity(material: Hyperelastic, largest_stretch: float, digits: int = 4) -> float:
    """Return how much the uniaxial stress changes if the constants are given with so many significant digits.

    The largest sum over the constants of |∂P/∂c| times half a unit in c's last digit, for uniaxial stretches up to
    `largest_stretch`, relative to the largest stress there. A set that loses its meaning by rounding is not a
    measurement: near-equal Ogden exponents with huge opposite moduli, or high-order polynomials. Of a material that
    locks before, the strains up to four fifths of that count: near the limit every digit of it changes the stress.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        limit = _end_of(lambda log_stretch: np.isfinite(material.uniaxial(np.exp(log_stretch))), largest_stretch)
        end = largest_stretch if limit is None else 1.0 + _SHORT_OF_LOCKING * (limit - 1.0)
        stretch = np.linspace(1.0, end, 40)
        exact = material.uniaxial(stretch)
        values = np.array(list(material.parameters.values()))
        change = np.zeros_like(stretch)
        for i, value in enumerate(values):
            if value == 0.0:
                continue
            moved = values.copy()
            moved[i] += 0.5 * 10.0 ** (np.floor(np.log10(abs(value))) + 1 - digits)
            change += np.abs(type(material).trial(moved.tolist()).uniaxial(stretch) - exact)
    # Where rounding leaves no stress at all, nothing is left of the set.
    change = np.where(np.isfinite(change), change, np.inf)
    return float(change.max() / np.abs(exact).max())
