"""Isotropic hyperelastic materials W(F) = W̄(F̄) + U(J), F̄ = J^(−1/3) F.

A model is one frozen dataclass in ``turgor/materials/models``: its constants, the derivatives of W̄ and the
initial shear modulus. What follows from these (stress, tangent, homogeneous tests) is in the base classes here.

Shapes: `F` is ``(..., 3, 3)`` with any leading shape; `P` ``(..., 3, 3)``; the tangent ``(..., 3, 3, 3, 3)`` with
``tangent[..., i, j, k, l] = ∂P_ij/∂F_kl``; the three stretches ``(..., 3)``. Stresses and energies are in MPa.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.materials.kinematics import IDENTITY, Array, Invariants, dyad, outer, tensor, twist
from turgor.materials.volumetric import NEARLY_INCOMPRESSIBLE, Quadratic, Volumetric, poisson_ratio


@dataclass(frozen=True)
class Constant:
    """What is known of one material constant before it has a value.

    ``dimension`` is a key of :data:`turgor.common.units.INTERNAL_UNITS` or ``"number"``; ``linear`` says that W is
    linear in it when the constants that are not are held; ``starts`` and ``bounds`` serve the fit of those.
    """

    dimension: str
    linear: bool
    name: str = ""
    starts: tuple[float, ...] = ()
    bounds: tuple[float, float] = (-math.inf, math.inf)

    @property
    def unit(self) -> str:
        """The unit the value is kept in; empty for a pure number."""
        return "MPa" if self.dimension == "pressure" else ""


def modulus(*, lower: float = -math.inf) -> Any:
    """Declare a constant in MPa in which W is linear; a fit keeps it at or above `lower`."""
    return field(metadata={"constant": Constant("pressure", linear=True, bounds=(lower, math.inf))})


def number(starts: Sequence[float], bounds: tuple[float, float]) -> Any:
    """Declare a constant without dimension in which W is not linear, with start values and bounds for a fit."""
    return field(metadata={"constant": Constant("number", linear=False, starts=tuple(starts), bounds=bounds)})


@dataclass(frozen=True, kw_only=True)
class Hyperelastic:
    """Base of every material; see :class:`InvariantModel` and :class:`StretchModel`.

    Parameters
    ----------
    volumetric
        U(J); left out, the material is nearly incompressible: K/2 (J − 1)² with K = 1e4 μ.
    density
        Mass per reference volume in t/mm³, or ``None`` if unknown.

    Raises
    ------
    InputError
        If a constant is not finite or out of its range, or the initial shear modulus is not positive.
    """

    name: ClassVar[str] = ""
    aliases: ClassVar[tuple[str, ...]] = ()
    file: ClassVar[str] = ""
    """The file of a user's model, which names it in a case file; empty for a model of the package."""
    basis: ClassVar[str] = ""
    smooth_at_rest: ClassVar[bool] = True
    """Whether W̄ has a third derivative in the undeformed state."""

    volumetric: Volumetric = None  # type: ignore[assignment]  # set from μ below where it is left out
    density: float | None = None

    def __post_init__(self) -> None:
        for constant in self.constants():
            _check_constant(constant, getattr(self, constant.name), self.name)
        mu = self.shear_modulus
        if not (math.isfinite(mu) and mu > 0):
            raise InputError(
                f"these constants of {self.name} give an initial shear modulus of {mu:.4g} MPa",
                expected="constants with a positive initial shear modulus (check signs, units and convention)",
            )
        if self.density is not None and not (math.isfinite(self.density) and self.density > 0):
            raise InputError("the density must be positive", key="density", value=self.density)
        if self.volumetric is None:
            object.__setattr__(self, "volumetric", Quadratic(NEARLY_INCOMPRESSIBLE * mu))

    @classmethod
    @functools.cache
    def constants(cls) -> tuple[Constant, ...]:
        """Return the constants that the model takes, in the order they are declared."""
        return tuple(
            dataclasses.replace(f.metadata["constant"], name=f.name)
            for f in dataclasses.fields(cls)
            if "constant" in f.metadata
        )

    @classmethod
    def starts(cls) -> list[tuple[float, ...]]:
        """Return start values for a fit of the constants in which W is not linear, in the order of these."""
        return list(itertools.product(*(constant.starts for constant in cls.constants() if not constant.linear)))

    @classmethod
    def of(cls, constants: Mapping[str, float]) -> Self:
        """Return the nearly incompressible material of these constants, given by name."""
        return cls(**constants)  # type: ignore[arg-type]  # the constants are the subclass's own fields

    @classmethod
    def trial(cls, values: Sequence[float]) -> Self:
        """Return a material of these constants without checking them: the trial points of a fit."""
        material = object.__new__(cls)
        for constant, value in zip(cls.constants(), values, strict=True):
            object.__setattr__(material, constant.name, float(value))
        object.__setattr__(material, "volumetric", None)
        object.__setattr__(material, "density", None)
        return material

    @property
    def parameters(self) -> dict[str, float]:
        """The constants by name, in their internal units."""
        return {constant.name: getattr(self, constant.name) for constant in self.constants()}

    @property
    def shear_modulus(self) -> float:
        """Initial shear modulus μ in MPa, as the model's docstring states it."""
        raise NotImplementedError

    @property
    def bulk_modulus(self) -> float:
        """Initial bulk modulus K in MPa."""
        return self.volumetric.bulk_modulus

    @property
    def poisson_ratio(self) -> float:
        """Initial Poisson's ratio."""
        return poisson_ratio(self.shear_modulus, self.bulk_modulus)

    @property
    def young_modulus(self) -> float:
        """Initial Young's modulus in MPa."""
        return 2.0 * self.shear_modulus * (1.0 + self.poisson_ratio)

    def principal(self, stretches: ArrayLike) -> tuple[Array, Array, Array]:
        """Return W̄ and its derivatives by the principal stretches, taken as independent.

        Parameters
        ----------
        stretches
            Isochoric principal stretches, ``(..., 3)``.

        Returns
        -------
        tuple
            W̄ ``(...)``, ∂W̄/∂λ_a ``(..., 3)``, ∂²W̄/∂λ_a∂λ_b ``(..., 3, 3)``.
        """
        raise NotImplementedError

    def energy(self, F: ArrayLike) -> Array:
        """W per reference volume at the deformation gradients `F`."""
        raise NotImplementedError

    def stress(self, F: ArrayLike) -> Array:
        """First Piola–Kirchhoff stress P = ∂W/∂F at `F`."""
        raise NotImplementedError

    def tangent(self, F: ArrayLike) -> Array:
        """∂P/∂F at `F`, ``(..., 3, 3, 3, 3)``."""
        raise NotImplementedError

    def uniaxial(self, stretch: ArrayLike) -> Array:
        """Nominal stress in uniaxial tension or compression of the incompressible material."""
        x = np.asarray(stretch, dtype=float)
        return self._nominal(x, x**-0.5)

    def equibiaxial(self, stretch: ArrayLike) -> Array:
        """Nominal stress in equibiaxial tension or compression of the incompressible material."""
        x = np.asarray(stretch, dtype=float)
        return self._nominal(x, x)

    def planar(self, stretch: ArrayLike) -> Array:
        """Nominal stress in planar tension (pure shear) of the incompressible material."""
        x = np.asarray(stretch, dtype=float)
        return self._nominal(x, np.ones_like(x))

    def simple_shear(self, shear: ArrayLike) -> Array:
        """Shear stress P₁₂ at the amount of shear γ; it is ∂W/∂γ along F = I + γ e₁⊗e₂.

        Simple shear has the stretches λ, 1, 1/λ of planar tension with λ − 1/λ = γ (Ogden 1984, §2.2.6).
        """
        gamma = np.asarray(shear, dtype=float)
        stretch = 0.5 * (gamma + np.sqrt(gamma**2 + 4.0))
        return self.planar(stretch) * stretch**2 / (1.0 + stretch**2)

    def _nominal(self, first: Array, second: Array) -> Array:
        # Incompressible, the third direction free: P_1 = w_1 - w_3 λ_3/λ_1 (Ogden 1984, eq. 4.3.48).
        third = 1.0 / (first * second)
        slope = self._slope(np.stack([first, second, third], axis=-1))
        nominal: Array = slope[..., 0] - slope[..., 2] * third / first
        return nominal

    def _slope(self, stretches: Array) -> Array:
        """The gradient of :meth:`principal` alone, which fits ask for ten thousand times."""
        return self.principal(stretches)[1]


@dataclass(frozen=True, kw_only=True)
class InvariantModel(Hyperelastic):
    """A material given by W̄(Ī₁, Ī₂) of the isochoric invariants."""

    basis: ClassVar[str] = "invariants"

    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return W̄, ∂W̄/∂Ī₁, ∂W̄/∂Ī₂, ∂²W̄/∂Ī₁², ∂²W̄/∂Ī₁∂Ī₂, ∂²W̄/∂Ī₂², each of the shape of `I1`."""
        raise NotImplementedError

    @override
    def principal(self, stretches: ArrayLike) -> tuple[Array, Array, Array]:
        x = np.asarray(stretches, dtype=float)
        squares = x**2
        I1 = squares.sum(axis=-1)
        # Σ_{a<b} λ_a² λ_b² rather than (I1² - Σ λ⁴)/2: no cancellation at large stretch.
        I2 = squares[..., 0] * squares[..., 1] + (squares[..., 0] + squares[..., 1]) * squares[..., 2]
        W, W1, W2, W11, W12, W22 = (part[..., None] for part in self.derivatives(I1, I2))
        others = I1[..., None] - squares
        dI1, dI2 = 2.0 * x, 2.0 * x * others
        slope = W1 * dI1 + W2 * dI2
        cross = outer(dI1, dI2)
        curvature = (
            W11[..., None] * outer(dI1, dI1)
            + W12[..., None] * (cross + np.swapaxes(cross, -1, -2))
            + W22[..., None] * outer(dI2, dI2)
            + W2[..., None] * 4.0 * outer(x, x) * (1.0 - IDENTITY)
            + (2.0 * (W1 + W2 * others))[..., None] * IDENTITY
        )
        return W[..., 0], slope, curvature

    @override
    def _slope(self, stretches: Array) -> Array:
        squares = stretches**2
        a, b, c = squares[..., 0], squares[..., 1], squares[..., 2]
        I1 = a + b + c
        _, W1, W2, *_ = self.derivatives(I1, a * b + (a + b) * c)
        slope: Array = 2.0 * stretches * (W1[..., None] + W2[..., None] * (I1[..., None] - squares))
        return slope

    @override
    def energy(self, F: ArrayLike) -> Array:
        kinematics = Invariants(np.asarray(F, dtype=float))
        return self.derivatives(kinematics.I1, kinematics.I2)[0] + self.volumetric.energy(kinematics.J)

    @override
    def stress(self, F: ArrayLike) -> Array:
        k = Invariants(np.asarray(F, dtype=float))
        _, W1, W2, *_ = (tensor(part, 2) for part in self.derivatives(k.I1, k.I2))
        return W1 * k.dI1 + W2 * k.dI2 + tensor(self.volumetric.pressure(k.J) * k.J, 2) * k.G

    @override
    def tangent(self, F: ArrayLike) -> Array:
        k = Invariants(np.asarray(F, dtype=float))
        _, W1, W2, W11, W12, W22 = (tensor(part, 4) for part in self.derivatives(k.I1, k.I2))
        cross = dyad(k.dI1, k.dI2)
        return (
            W11 * dyad(k.dI1, k.dI1)
            + W12 * (cross + dyad(k.dI2, k.dI1))
            + W22 * dyad(k.dI2, k.dI2)
            + W1 * k.d2I1()
            + W2 * k.d2I2()
            + _volumetric_tangent(self.volumetric, k.J, k.G)
        )


_NEAR = 1e-2
"""Relative distance of two stretches below which the divided difference of the stresses is integrated."""

_GAUSS_POINTS, _GAUSS_WEIGHTS = (part / 2.0 for part in np.polynomial.legendre.leggauss(5))
"""Gauss–Legendre rule on (−½, ½)."""


@dataclass(frozen=True, kw_only=True)
class StretchModel(Hyperelastic):
    """A material given by W̄(λ̄₁, λ̄₂, λ̄₃), symmetric in the isochoric principal stretches."""

    basis: ClassVar[str] = "stretches"

    def derivatives(self, stretches: Array) -> tuple[Array, Array, Array]:
        """Return W̄ ``(...)``, ∂W̄/∂λ̄_a ``(..., 3)`` and ∂²W̄/∂λ̄_a∂λ̄_b ``(..., 3, 3)``."""
        raise NotImplementedError

    @override
    def principal(self, stretches: ArrayLike) -> tuple[Array, Array, Array]:
        return self.derivatives(np.asarray(stretches, dtype=float))

    @override
    def energy(self, F: ArrayLike) -> Array:
        stretches = np.linalg.svd(np.asarray(F, dtype=float), compute_uv=False)
        J = stretches.prod(axis=-1)
        return self.derivatives(stretches / tensor(np.cbrt(J), 1))[0] + self.volumetric.energy(J)

    @override
    def stress(self, F: ArrayLike) -> Array:
        U, x, Vt = np.linalg.svd(np.asarray(F, dtype=float))
        slope, _ = self._isochoric(x)
        slope = slope + tensor(self.volumetric.pressure(x.prod(axis=-1)) * x.prod(axis=-1), 1) / x
        P: Array = (U * slope[..., None, :]) @ Vt
        return P

    @override
    def tangent(self, F: ArrayLike) -> Array:
        U, x, Vt = np.linalg.svd(np.asarray(F, dtype=float))
        slope, curvature = self._isochoric(x)
        local = np.zeros((*x.shape[:-1], 3, 3, 3, 3))
        for i in range(3):
            for j in range(3):
                local[..., i, i, j, j] = curvature[..., i, j]
        for i, j in ((0, 1), (0, 2), (1, 2)):
            # Derivative of an isotropic tensor function (Ogden 1984, §6.1.4): the divided difference of the
            # principal stresses is split into its even and odd parts, each of which is smooth at λ_i = λ_j.
            even = self._divided_difference(x, slope, i, j)
            odd = (slope[..., i] + slope[..., j]) / (x[..., i] + x[..., j])
            local[..., i, j, i, j] = local[..., j, i, j, i] = 0.5 * (even + odd)
            local[..., i, j, j, i] = local[..., j, i, i, j] = 0.5 * (even - odd)
        isochoric: Array = np.einsum("...ia,...bj,...kc,...dl,...abcd->...ijkl", U, Vt, U, Vt, local, optimize=True)
        G = (U / x[..., None, :]) @ Vt
        return isochoric + _volumetric_tangent(self.volumetric, x.prod(axis=-1), G)

    def _isochoric(self, x: Array) -> tuple[Array, Array]:
        """First and second derivatives of W̄(J^(−1/3) λ) by the three stretches `x`."""
        scale = tensor(np.cbrt(x.prod(axis=-1)), 1)
        bar = x / scale
        _, w, h = self.derivatives(bar)
        # With log stretches the split is a projection: t_a = λ̄_a w_a - mean.
        t = bar * w
        deviator = t - t.mean(axis=-1, keepdims=True)
        H = outer(bar, bar) * h + IDENTITY * t[..., None]
        projection = IDENTITY - 1.0 / 3.0
        H = projection @ H @ projection
        return deviator / x, (H - IDENTITY * deviator[..., None]) / outer(x, x)

    def _divided_difference(self, x: Array, slope: Array, i: int, j: int) -> Array:
        """(p_i − p_j)/(λ_i − λ_j), to machine accuracy also where the two stretches (nearly) coincide."""
        difference = x[..., i] - x[..., j]
        near = np.abs(difference) < _NEAR * (x[..., i] + x[..., j])
        quotient: Array = np.asarray((slope[..., i] - slope[..., j]) / np.where(near, 1.0, difference))
        if np.any(near):
            # p_j(λ) = p_i(λ with i and j exchanged): integrate ∂p_i along the line between the two.
            y = np.broadcast_to(x[near], (len(_GAUSS_POINTS), *x[near].shape)).copy()
            middle = 0.5 * (y[..., i] + y[..., j])
            offset = _GAUSS_POINTS[:, None] * difference[near]
            y[..., i], y[..., j] = middle + offset, middle - offset
            _, h = self._isochoric(y)
            quotient[near] = np.einsum("g,g...->...", _GAUSS_WEIGHTS, h[..., i, i] - h[..., i, j])
        return quotient


def _volumetric_tangent(volumetric: Volumetric, J: Array, G: Array) -> Array:
    pressure = volumetric.pressure(J) * J
    stiffness = volumetric.stiffness(J) * J**2
    return tensor(stiffness + pressure, 4) * dyad(G, G) - tensor(pressure, 4) * twist(G)


def _check_constant(constant: Constant, value: object, model: str) -> None:
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"this constant of {model} is not a finite number", key=constant.name, value=value)
    low, high = constant.bounds
    if not constant.linear and not low <= value <= high:
        raise InputError(
            f"this constant of {model} is out of range",
            key=constant.name,
            value=value,
            expected=f"a number from {low:g} to {high:g}",
        )
