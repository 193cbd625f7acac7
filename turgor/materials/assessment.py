"""Everything that can be said of a set of constants before a run: moduli, stability, ellipticity, monotony, digits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turgor.materials.fit_result import SENSITIVITY_LIMIT, biaxial_ratios, implausible_ratios
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.kinematics import Array
from turgor.materials.stability import (
    MODES,
    STRETCHES,
    Places,
    Verdict,
    digit_sensitivity,
    drucker_margin,
    locking,
    stable_up_to,
    verdict,
)

_GRID = 13
_DIRECTIONS = 9
_CURVE = 300


@dataclass(frozen=True)
class Assessment:
    """What is known of a material without a run.

    Attributes
    ----------
    shear_modulus, young_modulus, bulk_modulus, poisson_ratio
        Of the undeformed state, MPa and 1.
    drucker
        Where Drucker's inequality holds, mode by mode, and where the material locks.
    elliptic
        Whether the incompressible material is strongly elliptic at all sampled principal stretches of the range.
    monotonic
        For each mode the stretches around 1 between which the nominal stress grows.
    digit_sensitivity
        Relative change of the uniaxial stress if four digits of the constants are kept.
    """

    shear_modulus: float
    young_modulus: float
    bulk_modulus: float
    poisson_ratio: float
    drucker: Verdict
    elliptic: bool
    monotonic: dict[str, tuple[float, float]]
    digit_sensitivity: float

    def as_dict(self) -> dict[str, object]:
        """Return the assessment in plain values, keys ending in their unit."""
        return {
            "shear_modulus_MPa": self.shear_modulus,
            "young_modulus_MPa": self.young_modulus,
            "bulk_modulus_MPa": self.bulk_modulus,
            "poisson_ratio": self.poisson_ratio,
            "drucker_stable": self.drucker.stable,
            "drucker": str(self.drucker),
            "drucker_lost": self.drucker.lost,
            "locks": self.drucker.locked,
            "strongly_elliptic": self.elliptic,
            "monotonic_stretches": {mode: list(span) for mode, span in self.monotonic.items()},
            "digit_sensitivity": self.digit_sensitivity if np.isfinite(self.digit_sensitivity) else None,
        }


def assess(material: Hyperelastic, low: float = STRETCHES[0], high: float = STRETCHES[1]) -> Assessment:
    """Return the assessment of a material for stretches from `low` < 1 to `high` > 1."""
    return Assessment(
        shear_modulus=material.shear_modulus,
        young_modulus=material.young_modulus,
        bulk_modulus=material.bulk_modulus,
        poisson_ratio=material.poisson_ratio,
        drucker=verdict(material, low, high),
        elliptic=bool(np.all(ellipticity_margin(material, stretch_plane(low, high)) > 0.0)),
        monotonic={mode: _monotonic_range(material, mode, low, high) for mode in MODES},
        digit_sensitivity=digit_sensitivity(material, high),
    )


def stretch_plane(low: float, high: float, points: int = _GRID) -> Array:
    """Return isochoric principal stretches ``(n, 3)`` that cover the plane, none of them outside `low` … `high`."""
    axis = np.exp(np.linspace(np.log(low), np.log(high), points))
    axis = np.sort(np.append(axis, 1.0))
    first, second = (part.ravel() for part in np.meshgrid(axis, axis))
    third = 1.0 / (first * second)
    inside = (third >= low) & (third <= high) & (first >= second) & (second >= third)
    stretches: Array = np.stack([first, second, third], axis=-1)[inside]
    return stretches


def ellipticity_margin(material: Hyperelastic, stretches: Array) -> Array:
    """Return the least of a·Q(N)·a over amplitudes a and sampled directions N, over the shear modulus, ``(...)``.

    Q is the acoustic tensor ∂²W/∂F∂F : N⊗N of the incompressible material: amplitudes are normal to F^(−T) N, whereby
    pressure and bulk modulus drop out (Zee and Sternberg 1983). Positive for all N means that no shear band forms.

    Parameters
    ----------
    stretches
        Isochoric principal stretches, ``(..., 3)``.
    """
    x = np.asarray(stretches, dtype=float)
    with np.errstate(over="ignore", invalid="ignore"):
        tangent = material.tangent(x[..., :, None] * np.eye(3))
    least = np.full(x.shape[:-1], np.inf)
    for N in _directions():
        Q = np.einsum("...ijkl,j,l->...ik", tangent, N, N)
        normal = N / x
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        # Two unit vectors that span the plane of admissible amplitudes.
        helper = np.eye(3)[np.argmin(np.abs(normal), axis=-1)]
        first = np.cross(normal, helper)
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        basis = np.stack([first, np.cross(normal, first)], axis=-1)
        reduced = np.einsum("...ia,...ik,...kb->...ab", basis, Q, basis)
        finite = np.all(np.isfinite(reduced), axis=(-2, -1))
        values = np.linalg.eigvalsh(np.where(finite[..., None, None], reduced, np.eye(2)))[..., 0]
        least = np.minimum(least, values)
    return np.asarray(least / material.shear_modulus)


def _directions() -> Array:
    """Unit vectors of one octant: the others follow by symmetry."""
    polar = np.linspace(0.0, np.pi / 2.0, _DIRECTIONS)
    theta, phi = (part.ravel() for part in np.meshgrid(polar, polar))
    vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return np.unique(vectors.round(12), axis=0)


def _monotonic_range(material: Hyperelastic, mode: str, low: float, high: float) -> tuple[float, float]:
    response = {"uniaxial": material.uniaxial, "equibiaxial": material.equibiaxial, "planar": material.planar}[mode]
    ends = []
    for end in (low, high):
        x = np.exp(np.log(end) * np.linspace(0.0, 1.0, _CURVE))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            steps = np.diff(response(x)) * (1.0 if end > 1.0 else -1.0)
        falling = np.flatnonzero(steps < 0.0)
        ends.append(end if not len(falling) else float(x[falling[0]]))
    return ends[0], ends[1]


def stability_map(
    material: Hyperelastic, low: float = STRETCHES[0], high: float = STRETCHES[1], points: int = 61
) -> tuple[Array, Array]:
    """Return the stretches of both axes ``(n,)`` and Drucker's margin over the plane λ₁, λ₂ of stretches ``(n, n)``."""
    axis = np.exp(np.linspace(np.log(low), np.log(high), points))
    first, second = np.meshgrid(axis, axis)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        stretches = np.stack([first, second, 1.0 / (first * second)], axis=-1)
        curvature = material.principal(stretches)[2]
        locked = np.asarray(~np.all(np.isfinite(curvature), axis=(-2, -1)))
        safe = np.where(locked[..., None], 1.0, stretches)
        margin = drucker_margin(material, safe)
    return axis, np.where(locked, np.nan, margin)


def warnings_in_use(material: Hyperelastic, largest_stretch: float) -> tuple[str, ...]:
    """Return what should be said before a run in which no principal stretch is expected above `largest_stretch`."""
    found = []
    if not stable_up_to(material, largest_stretch):
        spans = verdict(material, 1.0 / largest_stretch**2, largest_stretch)
        found.append(f"the material is unstable where the run may go ({_tension(spans.lost) or 'in compression'})")
    if locked := locking(material, 1.0, largest_stretch):
        found.append(f"the material locks where the run may go ({_tension(locked)}) and cannot be stretched beyond")
    sensitivity = digit_sensitivity(material, largest_stretch)
    if not sensitivity < SENSITIVITY_LIMIT:
        found.append(f"four digits of its constants do not fix its stress (changes by {sensitivity:.0%})")
    found += implausible_ratios(biaxial_ratios(material))[:1]
    return tuple(found)


def _tension(found: Places) -> str:
    """Say where in tension; uniaxial compression is equibiaxial tension, and the other way round."""
    return "; ".join(
        f"{mode} beyond a stretch of {places['tension']:.3g}" for mode, places in found.items() if "tension" in places
    )
