"""Yeoh solids of order one to three."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from turgor.materials.hyperelastic import modulus
from turgor.materials.models.polynomial import PolynomialModel


@dataclass(frozen=True, kw_only=True)
class Yeoh1(PolynomialModel):
    """W̄ = C10 (Ī₁ − 3); μ = 2 C10. The first order of Yeoh's series, the neo-Hookean energy."""

    name: ClassVar[str] = "yeoh-1"
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0),)

    C10: float = modulus()


@dataclass(frozen=True, kw_only=True)
class Yeoh2(PolynomialModel):
    """W̄ = C10 (Ī₁ − 3) + C20 (Ī₁ − 3)²; μ = 2 C10."""

    name: ClassVar[str] = "yeoh-2"
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0), (2, 0))

    C10: float = modulus()
    C20: float = modulus()


@dataclass(frozen=True, kw_only=True)
class Yeoh3(PolynomialModel):
    """W̄ = C10 (Ī₁ − 3) + C20 (Ī₁ − 3)² + C30 (Ī₁ − 3)³; μ = 2 C10 (Yeoh 1993).

    Stable for every deformation when no constant is negative, the usual signs being +, −, +.
    """

    name: ClassVar[str] = "yeoh-3"
    aliases: ClassVar[tuple[str, ...]] = ("yeoh",)
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0), (2, 0), (3, 0))

    C10: float = modulus()
    C20: float = modulus()
    C30: float = modulus()
