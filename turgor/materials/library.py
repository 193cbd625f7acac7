"""The library of published material constants: each set with its source, its range and what is doubtful.

The sets stand in ``library.yaml`` beside this file, constants as printed; whether a set is stable, and its stress at
100 % strain, is computed. Sets known to be unusable are kept, so that whoever meets them elsewhere can look them up.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import resources
from typing import Any

import numpy as np
import yaml

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.registry import create
from turgor.materials.stability import Verdict, verdict

_FILE = "library.yaml"

TEST_TOLERANCE = 0.25
"""A set whose stress at the end of its own test is farther off than this part of it is not a fit of that test."""


@dataclass(frozen=True)
class LibraryEntry:
    """One published set of constants.

    ``constants`` are text with units, as printed; ``convention`` says how Ogden's are to be read; ``tests`` and
    ``strain_range`` (engineering strain, ``None`` where not stated) say what they were fitted to; ``citable`` is false
    where the origin of the numbers could not be traced to a publication; ``unusable`` says why a set must not be used;
    ``measured`` is a point of the uniaxial test behind the set, ``strain`` and ``stress_MPa``, where it is printed.
    """

    name: str
    material: str
    model: str
    constants: Mapping[str, str | float]
    source: str
    tests: str
    strain_range: tuple[float, float] | None = None
    convention: str | None = None
    compressibility: Mapping[str, Any] = field(default_factory=dict)
    density: str | None = None
    citable: bool = True
    unusable: str = ""
    remark: str = ""
    measured: Mapping[str, float] = field(default_factory=dict)

    @functools.cached_property
    def build(self) -> Hyperelastic:
        """The material."""
        try:
            return create(
                self.model,
                self.constants,
                convention=self.convention,
                density=self.density,
                **self.compressibility,
            )
        except InputError as error:
            raise error.at(key=self.name) from error

    @functools.cached_property
    def verdict(self) -> Verdict:
        """Where the material is stable, for stretches from 0.3 to 6."""
        return verdict(self.build)

    @property
    def stress_at_100_percent(self) -> float:
        """Nominal uniaxial stress at a stretch of 2 in MPa, the common yardstick."""
        return float(self.build.uniaxial(2.0))

    @property
    def contradiction(self) -> str:
        """What the test behind the set excludes; empty if nothing or if no point of it is printed.

        A tensile test has no compressive stress, and a fit meets the end of its own test within
        :data:`TEST_TOLERANCE`.
        """
        if not self.measured:
            return ""
        strain, stress = self.measured["strain"], self.measured["stress_MPa"]
        path = 1.0 + np.linspace(0.0, strain, 200)[1:]
        answer = self.build.uniaxial(path)
        if answer.min() < 0:
            at = path[int(np.argmin(answer))] - 1.0
            return f"compressive stress ({answer.min():.3g} MPa at a strain of {at:.3g}) in a tensile test"
        if abs(answer[-1] - stress) > TEST_TOLERANCE * stress:
            return f"{answer[-1]:.3g} MPa at a strain of {strain:g}, where {stress:g} MPa was measured"
        return ""

    def as_dict(self) -> dict[str, object]:
        """Return the entry and what is computed from it in plain values."""
        material = self.build
        return {
            "name": self.name,
            "material": self.material,
            "model": self.model,
            "constants": dict(self.constants),
            "convention": self.convention,
            "initial_shear_modulus_MPa": material.shear_modulus,
            "poisson_ratio": material.poisson_ratio,
            "stress_at_100_percent_MPa": self.stress_at_100_percent,
            "stability": str(self.verdict),
            "stable": self.verdict.stable,
            "tests": self.tests,
            "strain_range": list(self.strain_range) if self.strain_range else None,
            "density": self.density,
            "source": self.source,
            "citable": self.citable,
            "unusable": self.unusable,
            "contradiction": self.contradiction,
            "remark": self.remark,
        }


@functools.cache
def _entries() -> dict[str, LibraryEntry]:
    text = resources.files("turgor.materials").joinpath(_FILE).read_text(encoding="utf-8")
    document = yaml.safe_load(text)
    sources: dict[str, str] = document["sources"]
    entries: dict[str, LibraryEntry] = {}
    for name, item in document["sets"].items():
        span = item.pop("strain_range", None)
        source = sources[item.pop("source")]
        entries[name] = LibraryEntry(name=name, source=source, strain_range=tuple(span) if span else None, **item)
    return entries


def library() -> list[LibraryEntry]:
    """Return every published set, in alphabetical order."""
    return [_entries()[name] for name in sorted(_entries())]


def find(name: str) -> LibraryEntry:
    """Return the set called `name`.

    Raises
    ------
    InputError
        If there is none; the message suggests near names.
    """
    entries = _entries()
    if name not in entries:
        near = get_close_matches(str(name), entries, n=3, cutoff=0.4)
        expected = " or ".join(near) if near else "a name that 'turgor materials' lists"
        raise InputError("the library has no material of this name", key="library", value=name, expected=expected)
    return entries[name]


def get(name: str) -> Hyperelastic:
    """Return the material of the set called `name`; see :func:`find`."""
    return find(name).build
