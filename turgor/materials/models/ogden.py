"""Ogden solids with one to three terms."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.materials.hyperelastic import StretchModel, modulus, number
from turgor.materials.kinematics import Array, diagonal_matrices

_STARTS = (-12.0, -6.0, -3.0, -1.5, 0.5, 1.5, 2.5, 4.0, 6.0, 9.0, 14.0)
_RANGE = (-40.0, 40.0)
_LIMIT = 1e-7
"""Exponents below it, which only the search of a fit meets, are taken for zero."""


@dataclass(frozen=True, kw_only=True)
class OgdenModel(StretchModel):
    """W̄ = Σ 2 μ_i/α_i² (λ̄₁^α_i + λ̄₂^α_i + λ̄₃^α_i − 3); μ = Σ μ_i (Ogden 1972 in Abaqus's convention).

    Ogden's own convention, W̄ = Σ μ_i/α_i (…), has μ_i(here) = μ_i(Ogden) α_i / 2 and μ = ½ Σ μ_i α_i; ask for it
    with ``convention="ogden"`` in :func:`turgor.materials.create`. Stable for every deformation if every μ_i > 0.
    """

    terms: ClassVar[int] = 0

    def __post_init__(self) -> None:
        for i in range(1, self.terms + 1):
            if getattr(self, f"alpha{i}") == 0:
                raise InputError("an exponent of Ogden's model must not be zero", key=f"alpha{i}", value=0)
        super().__post_init__()

    @classmethod
    @override
    def starts(cls) -> list[tuple[float, ...]]:
        # The terms can be exchanged. Two terms of nearly one exponent act like λ^α ln λ, a form that some data ask for.
        apart = list(itertools.combinations(_STARTS, cls.terms))
        others = itertools.combinations(_STARTS, cls.terms - 1) if cls.terms > 1 else []
        return apart + [(*rest, 1.1 * rest[-1]) for rest in others]

    @property
    @override
    def shear_modulus(self) -> float:
        return float(sum(mu for mu, _ in self._terms()))

    def _terms(self) -> list[tuple[float, float]]:
        pairs = [(getattr(self, f"mu{i}"), getattr(self, f"alpha{i}")) for i in range(1, self.terms + 1)]
        return [pair for pair in pairs if pair[0] != 0.0]

    @override
    def derivatives(self, stretches: Array) -> tuple[Array, Array, Array]:
        logarithm = np.log(stretches)
        W = np.zeros(stretches.shape[:-1])
        slope, diagonal = np.zeros_like(stretches), np.zeros_like(stretches)
        for mu, alpha in self._terms():
            if abs(alpha) < _LIMIT:  # isochoric: Σ ln λ̄ = 0, and the term tends to μ Σ (ln λ̄)²
                W = W + mu * (logarithm**2).sum(axis=-1)
                slope += 2.0 * mu * logarithm / stretches
                diagonal += 2.0 * mu * (1.0 - logarithm) / stretches**2
                continue
            # expm1 keeps the energy accurate near the undeformed state.
            grown = np.expm1(alpha * logarithm)
            W = W + 2.0 * mu / alpha**2 * (grown[..., 0] + grown[..., 1] + grown[..., 2])
            power = 2.0 * mu / alpha * np.exp((alpha - 2.0) * logarithm)
            slope += power * stretches
            diagonal += (alpha - 1.0) * power
        return W, slope, diagonal_matrices(diagonal)


@dataclass(frozen=True, kw_only=True)
class Ogden1(OgdenModel):
    """One term: mu1 in MPa, alpha1; see :class:`OgdenModel`."""

    name: ClassVar[str] = "ogden-1"
    terms: ClassVar[int] = 1

    mu1: float = modulus()
    alpha1: float = number(_STARTS, _RANGE)


@dataclass(frozen=True, kw_only=True)
class Ogden2(OgdenModel):
    """Two terms: mu1, alpha1, mu2, alpha2; see :class:`OgdenModel`."""

    name: ClassVar[str] = "ogden-2"
    terms: ClassVar[int] = 2

    mu1: float = modulus()
    alpha1: float = number(_STARTS, _RANGE)
    mu2: float = modulus()
    alpha2: float = number(_STARTS, _RANGE)


@dataclass(frozen=True, kw_only=True)
class Ogden3(OgdenModel):
    """Three terms: mu1, alpha1 … mu3, alpha3; see :class:`OgdenModel`."""

    name: ClassVar[str] = "ogden-3"
    aliases: ClassVar[tuple[str, ...]] = ("ogden",)
    terms: ClassVar[int] = 3

    mu1: float = modulus()
    alpha1: float = number(_STARTS, _RANGE)
    mu2: float = modulus()
    alpha2: float = number(_STARTS, _RANGE)
    mu3: float = modulus()
    alpha3: float = number(_STARTS, _RANGE)
