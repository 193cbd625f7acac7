"""One test of a material: what was measured, dropped, assumed and is doubtful."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turgor.common.errors import InputError
from turgor.materials.cleaning import Dropped
from turgor.materials.kinematics import Array

MODES = ("uniaxial", "equibiaxial", "planar", "simple-shear", "volumetric")
STRAIN_SOURCES = ("extensometer", "video", "crosshead", "unknown")

MINIMUM_POINTS = 5
TOE_SPAN = 0.1
"""The strain over which the first part of a curve is taken for a line."""

TOE_LIMIT = 0.005
"""A toe of less strain is not worth a word."""

USUAL_STIFFNESS = (1e-3, 1e3)
"""Stress over strain in MPa, from the softest gels to plastics harder than any elastomer; a slip of the stress's unit
by a factor of a million leads out of it."""

CROSSHEAD_WARNING = (
    "the strain comes from the crosshead: the specimen's shoulders and its slip in the grips count as strain of the "
    "gauge, so that stiffness comes out typically 20–50 % too low; give the effective gauge length or a known modulus "
    "to correct it"
)


@dataclass(frozen=True)
class MaterialTest:
    """One test of one specimen, cleaned.

    Attributes
    ----------
    mode
        One of :data:`MODES`.
    stretch
        Stretch in the direction of the load, ``(n,)``; the amount of shear γ for ``"simple-shear"``, and J for
        ``"volumetric"``.
    stress
        Nominal stress in MPa, ``(n,)``; for ``"volumetric"`` the mean Cauchy stress (negative in compression).
    lateral
        Lateral stretch ``(n,)``, if it was measured; NaN where it is missing.
    """

    mode: str
    stretch: Array
    stress: Array
    lateral: Array | None = None
    name: str = ""
    file: str = ""
    strain_source: str = "unknown"
    rows_read: int = 0
    dropped: tuple[Dropped, ...] = ()
    columns: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    corrections: tuple[str, ...] = ()

    @property
    def deformation(self) -> Array:
        """What is zero at rest: engineering strain, the amount of shear, or J − 1."""
        return self.stretch if self.mode == "simple-shear" else self.stretch - 1.0

    @property
    def has_lateral(self) -> bool:
        """Whether the lateral stretch was measured anywhere."""
        return self.lateral is not None and bool(np.any(np.isfinite(self.lateral)))

    @property
    def doubted(self) -> MaterialTest:
        """The test, with a warning where its stress is so large or small that the unit is likely to be another one."""
        strain, stress = (float(np.abs(part).max()) for part in (self.deformation, self.stress))
        low, high = USUAL_STIFFNESS
        if self.mode == "volumetric" or not strain or low <= stress / strain <= high:
            return self
        doubt = (
            f"the stress is up to {stress:.3g} MPa at strains up to {strain:.3g}: "
            f"{'softer' if stress / strain < low else 'stiffer'} than elastomers are; check the unit of the stress, or "
            "those of the force and the cross-section"
        )
        return replace(self, warnings=(*self.warnings, doubt))

    def within(self, low: float, high: float) -> MaterialTest:
        """Return the part of the test between two engineering strains.

        Raises
        ------
        InputError
            If fewer than :data:`MINIMUM_POINTS` points are left.
        """
        inside = (self.deformation >= low) & (self.deformation <= high)
        if np.count_nonzero(inside) < MINIMUM_POINTS:
            raise InputError(
                f"only {np.count_nonzero(inside)} points lie in this strain range",
                file=self.file,
                key="strain range",
                value=f"{low:g}:{high:g}",
                expected=f"a range that holds at least {MINIMUM_POINTS} points; the test covers strains from "
                f"{self.deformation.min():.4g} to {self.deformation.max():.4g}",
            )
        lateral = None if self.lateral is None else self.lateral[inside]
        return replace(self, stretch=self.stretch[inside], stress=self.stress[inside], lateral=lateral)

    def with_gauge_length(self, used: float, effective: float) -> MaterialTest:
        """Return the test with its strain corrected from the gauge length `used` to the `effective` one (both mm)."""
        if not (0 < used < np.inf and 0 < effective < np.inf):
            raise InputError("a gauge length must be positive", value=(used, effective))
        note = f"strain × {used / effective:.6g}: gauge length {effective:g} mm instead of {used:g} mm"
        return self._stretched(used / effective, note)

    def with_known_modulus(self, stress: float, strain: float = 1.0) -> MaterialTest:
        """Return the test with its strain scaled so that the nominal `stress` (MPa) is met at `strain`.

        A datasheet's "100 % modulus" is the stress at strain 1. The stress itself is not changed.

        Raises
        ------
        InputError
            If the test does not reach that stress.
        """
        if not 0 < stress <= float(self.stress.max()):
            raise InputError(
                "the test does not reach the known modulus",
                file=self.file,
                value=stress,
                expected=f"a stress above 0 and up to {self.stress.max():.4g} MPa",
            )
        measured = float(np.interp(stress, np.maximum.accumulate(self.stress), self.deformation))
        note = f"strain × {strain / measured:.6g}: {stress:g} MPa is known at a strain of {strain:g}"
        return self._stretched(strain / measured, note)

    @property
    def toe(self) -> float:
        """The strain at which the first part of the curve, drawn back as a line, meets zero stress.

        Slack in the grips, a specimen not yet straight, or a preload that was set to zero show as a toe.
        """
        if self.mode not in ("uniaxial", "planar", "equibiaxial") or self.deformation.min() < 0:
            return 0.0
        first = self.deformation <= self.deformation.min() + TOE_SPAN
        if np.count_nonzero(first) < MINIMUM_POINTS:
            return 0.0
        strain, stress = self.deformation[first], self.stress[first]
        middle = strain - strain.mean()
        # Points at one strain have no slope; a line through them would be one of rounding errors.
        slope = middle @ stress / (middle @ middle) if np.ptp(strain) > 0 else 0.0
        return float(strain.mean() - stress.mean() / slope) if slope > 0 else 0.0

    def with_toe_removed(self) -> MaterialTest:
        """Return the test with its strain counted from the end of the toe, the gauge being longer by as much."""
        toe = self.toe
        note = f"strain counted from {toe:.4g}, where the first part of the curve meets zero stress"
        return replace(self, stretch=self.stretch / (1.0 + toe), corrections=(*self.corrections, note))

    def _stretched(self, factor: float, note: str) -> MaterialTest:
        if self.mode not in ("uniaxial", "planar", "equibiaxial"):
            raise InputError("the strain of this kind of test cannot be rescaled", file=self.file, value=self.mode)
        stretch = 1.0 + factor * (self.stretch - 1.0)
        return replace(self, stretch=stretch, corrections=(*self.corrections, note))

    def as_dict(self) -> dict[str, object]:
        """Return what was read, dropped, assumed and corrected, in plain values."""
        return {
            "file": self.file,
            "name": self.name,
            "mode": self.mode,
            "columns": list(self.columns),
            "strain_source": self.strain_source,
            "points_read": self.rows_read,
            "points_used": len(self.stretch),
            "strain_min": float(self.deformation.min()),
            "strain_max": float(self.deformation.max()),
            "stress_max_MPa": float(np.abs(self.stress).max()),
            "dropped": [part.as_dict() for part in self.dropped],
            "assumed": list(self.assumed),
            "warnings": list(self.warnings),
            "corrections": list(self.corrections),
            "toe_strain": self.toe,
        }


@dataclass(frozen=True, kw_only=True)
class Specimen:
    """What a file may not say: dimensions in mm, the mode and the source of the strain.

    ``gauge_length`` turns displacements into strain, ``area`` (mm²; else thickness × width) forces into stress.
    """

    mode: str | None = None
    strain_source: str | None = None
    gauge_length: float | None = None
    area: float | None = None

    def __post_init__(self) -> None:
        if self.mode is not None and self.mode not in MODES:
            raise InputError("unknown kind of test", key="mode", value=self.mode, expected="one of " + ", ".join(MODES))
        if self.strain_source is not None and self.strain_source not in STRAIN_SOURCES:
            expected = "one of " + ", ".join(STRAIN_SOURCES)
            raise InputError(
                "unknown source of strain", key="strain_source", value=self.strain_source, expected=expected
            )
        for key in ("gauge_length", "area"):
            value = getattr(self, key)
            if value is not None and not 0 < value < np.inf:
                raise InputError("this dimension must be positive", key=key, value=value)
