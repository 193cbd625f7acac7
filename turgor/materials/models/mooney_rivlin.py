"""Mooney–Rivlin solids with two, three, five and nine constants, numbered as ANSYS does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from turgor.materials.hyperelastic import modulus
from turgor.materials.models.polynomial import PolynomialModel


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin2(PolynomialModel):
    """W̄ = C10 (Ī₁ − 3) + C01 (Ī₂ − 3); μ = 2 (C10 + C01) (Mooney 1940).

    A negative C01, which a fit of uniaxial data alone easily gives, is unstable in biaxial tension.
    """

    name: ClassVar[str] = "mooney-rivlin-2"
    aliases: ClassVar[tuple[str, ...]] = ("mooney-rivlin", "polynomial-1")
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0), (0, 1))

    C10: float = modulus()
    C01: float = modulus()


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin3(PolynomialModel):
    """The two-constant form + C11 (Ī₁ − 3)(Ī₂ − 3); μ = 2 (C10 + C01)."""

    name: ClassVar[str] = "mooney-rivlin-3"
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0), (0, 1), (1, 1))

    C10: float = modulus()
    C01: float = modulus()
    C11: float = modulus()


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin5(PolynomialModel):
    """The full polynomial of second order, C10, C01, C20, C11, C02; μ = 2 (C10 + C01)."""

    name: ClassVar[str] = "mooney-rivlin-5"
    aliases: ClassVar[tuple[str, ...]] = ("polynomial-2",)
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))

    C10: float = modulus()
    C01: float = modulus()
    C20: float = modulus()
    C11: float = modulus()
    C02: float = modulus()


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin9(PolynomialModel):
    """The full polynomial of third order, C10 … C02, C30, C21, C12, C03; μ = 2 (C10 + C01)."""

    name: ClassVar[str] = "mooney-rivlin-9"
    aliases: ClassVar[tuple[str, ...]] = ("polynomial-3",)
    powers: ClassVar[tuple[tuple[int, int], ...]] = (
        (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)
    )  # fmt: skip

    C10: float = modulus()
    C01: float = modulus()
    C20: float = modulus()
    C11: float = modulus()
    C02: float = modulus()
    C30: float = modulus()
    C21: float = modulus()
    C12: float = modulus()
    C03: float = modulus()
