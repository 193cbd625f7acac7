"""Volumetric strain energies U(J), and the bulk modulus from K, D1 or Poisson's ratio."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.materials.kinematics import Array

NEARLY_INCOMPRESSIBLE = 1e4
"""K/μ of a material whose compressibility is not given: the volume then changes by about σ/(10⁴ μ)."""


@dataclass(frozen=True)
class Volumetric:
    """A volumetric strain energy U(J) with U(1) = U'(1) = 0 and U''(1) = K.

    Parameters
    ----------
    bulk_modulus
        K at J = 1 in MPa, positive and finite.

    Raises
    ------
    InputError
        If the bulk modulus is not a positive finite number.
    """

    bulk_modulus: float
    name: ClassVar[str] = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.bulk_modulus) and self.bulk_modulus > 0):
            raise InputError(
                "the bulk modulus must be positive and finite",
                key="bulk_modulus",
                value=self.bulk_modulus,
                expected="a pressure above 0 MPa",
            )

    def energy(self, J: Array) -> Array:
        """U(J) in MPa, of the shape of `J`."""
        raise NotImplementedError

    def pressure(self, J: Array) -> Array:
        """U'(J) in MPa, of the shape of `J`: the mean Cauchy stress, positive in tension."""
        raise NotImplementedError

    def stiffness(self, J: Array) -> Array:
        """U''(J) in MPa, of the shape of `J`."""
        raise NotImplementedError


@dataclass(frozen=True)
class Quadratic(Volumetric):
    """U = K/2 (J − 1)², the law of Abaqus with K = 2/D1 and of ANSYS with K = 2/d."""

    name: ClassVar[str] = "quadratic"

    @override
    def energy(self, J: Array) -> Array:
        return 0.5 * self.bulk_modulus * (J - 1.0) ** 2

    @override
    def pressure(self, J: Array) -> Array:
        return self.bulk_modulus * (J - 1.0)

    @override
    def stiffness(self, J: Array) -> Array:
        return np.full_like(np.asarray(J, dtype=float), self.bulk_modulus)


@dataclass(frozen=True)
class Logarithmic(Volumetric):
    """U = K (J ln J − J + 1): infinite pressure as J → 0 and convex for every J (Liu et al. 1994)."""

    name: ClassVar[str] = "logarithmic"

    @override
    def energy(self, J: Array) -> Array:
        return self.bulk_modulus * (J * np.log(J) - J + 1.0)

    @override
    def pressure(self, J: Array) -> Array:
        # Far off, a step may predict a negative dilatation; that its forces are no numbers ends it.
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.bulk_modulus * np.log(J)

    @override
    def stiffness(self, J: Array) -> Array:
        return self.bulk_modulus / np.asarray(J, dtype=float)


LAWS: dict[str, type[Volumetric]] = {law.name: law for law in (Quadratic, Logarithmic)}
"""The volumetric laws by name."""


def bulk_modulus_from(
    shear_modulus: float,
    *,
    bulk_modulus: float | None = None,
    D1: float | None = None,
    poisson: float | None = None,
) -> float:
    """Return K in MPa from whichever of the three is given.

    Parameters
    ----------
    shear_modulus
        Initial shear modulus μ in MPa.
    bulk_modulus
        K in MPa.
    D1
        Abaqus's and ANSYS's constant of U = (J − 1)²/D1 in 1/MPa; K = 2/D1.
    poisson
        Initial Poisson's ratio ν; K = 2 μ (1 + ν) / (3 (1 − 2 ν)).

    Returns
    -------
    float
        K in MPa; :data:`NEARLY_INCOMPRESSIBLE` times μ if none of the three is given.

    Raises
    ------
    InputError
        If more than one is given, or one is out of its range.
    """
    given = {"bulk_modulus": bulk_modulus, "D1": D1, "poisson": poisson}
    named = [key for key, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError("the compressibility is given twice", key=" and ".join(named), expected="only one of the two")
    if poisson is not None:
        if not -1.0 < poisson < 0.5:
            raise InputError(
                "Poisson's ratio is out of range",
                key="poisson",
                value=poisson,
                expected="a number above -1 and below 0.5 (leave it out for a nearly incompressible material)",
            )
        return 2.0 * shear_modulus * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    if D1 is not None:
        if not (math.isfinite(D1) and D1 > 0):
            raise InputError(
                "D1 must be positive and finite",
                key="D1",
                value=D1,
                expected="a compliance above 0 1/MPa (leave it out for a nearly incompressible material)",
            )
        return 2.0 / D1
    return NEARLY_INCOMPRESSIBLE * shear_modulus if bulk_modulus is None else bulk_modulus


def poisson_ratio(shear_modulus: float, bulk_modulus: float) -> float:
    """Return ν = (3 K − 2 μ) / (2 (3 K + μ)) of the linearised material."""
    return (3.0 * bulk_modulus - 2.0 * shear_modulus) / (2.0 * (3.0 * bulk_modulus + shear_modulus))
