"""The neo-Hookean solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from turgor.materials.hyperelastic import modulus
from turgor.materials.models.polynomial import PolynomialModel


@dataclass(frozen=True, kw_only=True)
class NeoHookean(PolynomialModel):
    """W̄ = C10 (Ī₁ − 3); μ = 2 C10 (Treloar 1943).

    The Gaussian network. Good to a stretch of about 1.5; no stiffening.
    """

    name: ClassVar[str] = "neo-hookean"
    powers: ClassVar[tuple[tuple[int, int], ...]] = ((1, 0),)

    C10: float = modulus()
