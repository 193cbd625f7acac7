"""Contact as a case file names it: of the body with itself, of two of its surfaces, and with rigid bodies."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from turgor.common.units import Length, PositiveLength, Stiffness
from turgor.fem.contact.spec import ContactCase as Contact
from turgor.fem.contact.spec import Method, PairContact, RigidContact, SelfContact, Spring
from turgor.fem.rigid import Box, Cylinder, Plane, RigidBody, Sphere
from turgor.geometry.space import Place
from turgor.study.boundary import Direction
from turgor.study.validation import StrictModel, invalid

Friction = Annotated[float, Field(ge=0.0, le=10.0)]


class SpringCase(StrictModel):
    """What a rigid body is on: it moves along one direction, against a stiffness."""

    stiffness: Stiffness
    direction: Direction

    def build(self) -> Spring:
        """Return the spring."""
        return Spring(self.stiffness, self.direction)


class _RigidCase(StrictModel):
    """What all rigid bodies share: which surface may meet them, and how they move."""

    name: str | None = Field(default=None, min_length=1, description="in results; left out, the body's type")
    surface: str | None = Field(default=None, description="what may meet the body; left out, the whole skin")
    move: tuple[Length, Length, Length] | None = Field(
        default=None, description="displacement at the full load, on a spring that of its far end"
    )
    spring: SpringCase | None = Field(default=None, description="left out, the body does not give way")
    friction: Friction | None = Field(default=None, description="coefficient; left out, that of the contact")

    def build(self, label: str, friction: float, method: Method) -> RigidContact:
        """Return the contact with this body; `friction` is the coefficient where it has none of its own."""
        own = friction if self.friction is None else self.friction
        spring = None if self.spring is None else self.spring.build()
        return RigidContact(self.body(), self.surface, self.move, label, own, method, spring)

    def body(self) -> RigidBody:
        """Return the body."""
        raise NotImplementedError


class PlaneCase(_RigidCase):
    """Everything behind a plane; `normal` points to where the actuator is."""

    type: Literal["plane"]
    point: Place
    normal: Direction

    def body(self) -> Plane:
        """Return the body."""
        return Plane(self.point, self.normal)


class BoxCase(_RigidCase):
    """A block with faces across the axes, between two opposite corners."""

    type: Literal["box"]
    lower: Place
    upper: Place

    @model_validator(mode="after")
    def _has_a_volume(self) -> Self:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise invalid(
                "the box has no volume", key="upper", expected="the corner that is above 'lower' along x, y and z"
            )
        return self

    def body(self) -> Box:
        """Return the body."""
        return Box(self.lower, self.upper)


class CylinderCase(_RigidCase):
    """A round bar between two points, with flat ends."""

    type: Literal["cylinder"]
    start: Place
    end: Place
    radius: PositiveLength

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.start == self.end:
            raise invalid("the cylinder begins where it ends", key="end", expected="another point than 'start'")
        return self

    def body(self) -> Cylinder:
        """Return the body."""
        return Cylinder(self.start, self.end, self.radius)


class SphereCase(_RigidCase):
    """A ball."""

    type: Literal["sphere"]
    centre: Place
    radius: PositiveLength

    def body(self) -> Sphere:
        """Return the body."""
        return Sphere(self.centre, self.radius)


RigidCase = Annotated[PlaneCase | BoxCase | CylinderCase | SphereCase, Field(discriminator="type")]


class ContactCase(StrictModel):
    """What may touch what."""

    self: bool = Field(default=False, strict=True, description="any part of the skin with any other")
    pairs: tuple[tuple[str, str], ...] = Field(default=(), description="two surfaces each")
    bodies: tuple[RigidCase, ...] = Field(default=(), description="rigid bodies")
    friction: Friction = Field(default=0.0, description="coefficient of friction wherever something touches")
    method: Method = Field(default="penalty", description="on overlaps, or a barrier that lets nothing overlap")

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not (self.self or self.pairs or self.bodies):
            raise invalid("nothing may touch anything", expected="self: true, pairs or bodies")
        labels = self.labels
        twice = next((label for label in labels if labels.count(label) > 1), None)
        if twice is not None:
            raise invalid("two bodies have this name", key="bodies", value=twice, expected="a name of its own for each")
        if self.method == "barrier":
            self._check_barrier()
        return self

    def _check_barrier(self) -> None:
        """Refuse what the barrier does not know."""
        if self.rubs:
            raise invalid("the barrier knows no friction", key=self.rubs, expected="no friction, or method: penalty")
        both = [f"bodies.{k}.move" for k, body in enumerate(self.bodies) if body.move and body.spring]
        if both:
            expected = "move or spring, or method: penalty"
            raise invalid("by the barrier a spring has no far end that moves", key=both[0], expected=expected)

    @property
    def rubs(self) -> str | None:
        """The key of a coefficient of friction above zero; ``None`` without any."""
        given = [f"bodies.{k}.friction" for k, body in enumerate(self.bodies) if body.friction]
        return "friction" if self.friction > 0.0 else next(iter(given), None)

    @property
    def labels(self) -> list[str]:
        """The names of the rigid bodies in results."""
        return [body.name or body.type for body in self.bodies]

    def build(self) -> list[Contact]:
        """Return the contacts."""
        own = [SelfContact(self.friction, self.method)] if self.self else []
        pairs = [PairContact(*names, self.friction, self.method) for names in self.pairs]
        labelled = zip(self.bodies, self.labels, strict=True)
        return [*own, *pairs, *(body.build(label, self.friction, self.method) for body, label in labelled)]


def _shorthand(value: object) -> object:
    """Let ``contact: true`` stand for contact of the body with itself."""
    return {"self": True} if value is True else None if value is False else value


ContactChoice = Annotated[ContactCase | None, BeforeValidator(_shorthand)]
