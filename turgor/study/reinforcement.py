"""Fibres, sheets and spread fibre families as a case file names them."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from turgor.common.units import Angle, BendingStiffness, PositiveLength, PositivePressure
from turgor.fem import directions
from turgor.fem.anisotropic import ExponentialFibres, FibreFamily, QuadraticFibres
from turgor.fem.fibres import Fibre, solid_bending_stiffness
from turgor.fem.membrane import Membrane
from turgor.geometry.space import Place
from turgor.mesh import Mesh
from turgor.study.boundary import Direction
from turgor.study.validation import StrictModel, invalid


class FibreCase(StrictModel):
    """A thread along one curve of the shape, or one along each."""

    curve: str | None = Field(default=None, description="name of the curve; left out, all of them")
    youngs_modulus: PositivePressure
    diameter: PositiveLength
    tension_only: bool = Field(default=True, strict=True, description="false: it carries compression too")
    bar_length: PositiveLength | None = Field(default=None, description="left out, half of an element")
    bending_stiffness: BendingStiffness | Literal["solid"] | None = Field(
        default=None, description="E I, or `solid` for that of a round wire; left out, it bends freely"
    )

    def build(self, mesh: Mesh) -> list[Fibre]:
        """Return the fibres on the curves of the mesh."""
        curves = list(mesh.curves) if self.curve is None else [self.curve]
        bending = self.bending_stiffness
        if bending == "solid":
            bending = solid_bending_stiffness(self.youngs_modulus, self.diameter)
        return [
            Fibre(curve, self.youngs_modulus, self.diameter, self.tension_only, self.bar_length, bending)
            for curve in curves
        ]


class SheetCase(StrictModel):
    """Paper, fabric or foil on a surface of the body, or between two of its regions."""

    surface: str | None = None
    between: tuple[str, str] | None = Field(default=None, description="the two regions that it lies between")
    youngs_modulus: PositivePressure
    thickness: PositiveLength
    poisson: float = Field(default=0.3, strict=True, gt=-1.0, lt=1.0, description="Poisson's ratio in plane stress")

    @model_validator(mode="after")
    def _lies_somewhere(self) -> Self:
        if (self.surface is None) == (self.between is None):
            raise invalid("it is not said where the sheet lies", expected="either surface or between")
        return self

    def build(self) -> Membrane:
        """Return the sheet."""
        place = self.surface or self.between
        assert place is not None, "validated"
        return Membrane(place, self.youngs_modulus, self.thickness, self.poisson)


class QuadraticCase(StrictModel):
    """The standard reinforcing law, ψ = ½ k E²."""

    type: Literal["quadratic"]
    k: PositivePressure

    def build(self) -> QuadraticFibres:
        """Return the law."""
        return QuadraticFibres(self.k)


class ExponentialCase(StrictModel):
    """The law of Holzapfel, Gasser and Ogden, ψ = k1/(2 k2) (exp(k2 E²) − 1)."""

    type: Literal["exponential"]
    k1: PositivePressure
    k2: float = Field(strict=True, gt=0.0)

    def build(self) -> ExponentialFibres:
        """Return the law."""
        return ExponentialFibres(self.k1, self.k2)


class ConstantCase(StrictModel):
    """The same direction everywhere."""

    type: Literal["constant"]
    vector: Direction

    def build(self) -> directions.Constant:
        """Return the field of directions."""
        return directions.Constant(self.vector)


class HelicalCase(StrictModel):
    """The tangents of helices: `angle` from the axis, positive right-handed; 0 along it, 90° around it."""

    type: Literal["helical"]
    angle: Angle
    axis: Direction = (0.0, 0.0, 1.0)
    origin: Place = Field(default=("0 mm", "0 mm", "0 mm"), validate_default=True, description="a point on the axis")

    def build(self) -> directions.Helical:
        """Return the field of directions."""
        return directions.Helical(self.angle, self.axis, self.origin)


Law = Annotated[QuadraticCase | ExponentialCase, Field(discriminator="type")]
Directions = Annotated[ConstantCase | HelicalCase, Field(discriminator="type")]


class FibreFamilyCase(StrictModel):
    """Fibres of one direction field, spread evenly through a region."""

    region: str = "body"
    law: Law
    direction: Directions
    tension_only: bool = Field(default=False, strict=True, description="true: nothing where they are shortened")
    dispersion: float = Field(default=0.0, strict=True, ge=0.0, le=1.0 / 3.0, description="0 parallel, 1/3 isotropic")

    def build(self) -> FibreFamily:
        """Return the family."""
        return FibreFamily(
            self.region, self.law.build(), self.direction.build(), self.tension_only, dispersion=self.dispersion
        )
