"""What overlaps a rigid body before anything moves: told, and refused where it is deep."""

from __future__ import annotations

import logging
from typing import Any

import pytest

import turgor as tg
from turgor.fem.section import PlaneStrain
from turgor.mesh.structured import box, rectangle
from turgor.study.setup import Setup

HELD = [{"type": "clamped", "surface": "x0"}]


def stands(*bodies: dict[str, object], **more: object) -> None:
    """Build a bar, 20 mm long and 2 mm thick, beside rigid bodies."""
    mesh = box((20.0, 2.0, 2.0), (10, 1, 1))
    setup = Setup.read(supports=HELD, contact={"bodies": list(bodies), **more})
    setup.system(mesh, {"body": tg.material("neo-hookean", {"C10": "0.05 MPa"})})


def plane(z: float, up: int) -> dict[str, object]:
    return {"type": "plane", "point": ["0 mm", "0 mm", f"{z} mm"], "normal": [0, 0, up]}


def test_a_plane_the_wrong_way_round_is_refused_with_the_other_normal() -> None:
    with pytest.raises(tg.InputError, match=r"^contact.bodies.1: .*up to 3 mm inside this body.*normal, \[0, 0, 1\]"):
        stands(plane(5.0, -1) | {"name": "above"}, plane(-1.0, -1) | {"name": "below"})


def test_a_ball_around_the_actuator_is_refused() -> None:
    ball = {"type": "sphere", "centre": ["10 mm", "1 mm", "1 mm"], "radius": "30 mm"}
    with pytest.raises(tg.InputError, match=r"^contact.bodies.0: .*29.* mm inside .*a place that leaves the actuator"):
        stands(ball)


def test_a_plane_through_the_actuator_has_no_better_normal() -> None:
    across = {"type": "plane", "point": ["10 mm", "0 mm", "0 mm"], "normal": [1, 0, 0]}
    with pytest.raises(tg.InputError, match="expected a place that leaves the actuator outside"):
        stands(across)


@pytest.mark.parametrize(("height", "told"), [(-1.0, False), (0.0, False), (0.5, True)])
def test_a_plane_that_presses_from_the_start_is_told_of(height: float, told: bool, caplog: Any) -> None:
    with caplog.at_level(logging.WARNING, "turgor.study"):
        stands(plane(height, 1))
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == told
    if told:
        assert said[0].startswith("contact.bodies.0: at rest 'plane' presses already, 0.5 mm deep (25% of the wall)")


def test_a_plane_in_a_plane_model_is_looked_at_too() -> None:
    sheet = rectangle((20.0, 2.0), (10, 1))
    setup = Setup.read(
        supports=HELD,
        contact={"bodies": [{"type": "plane", "point": ["0 mm", "-1 mm", "0 mm"], "normal": [0, -1, 0]}]},
    )
    rubber = {"body": tg.material("neo-hookean", {"C10": "0.05 MPa"})}
    with pytest.raises(tg.InputError, match=r"up to 3 mm inside .*the other normal, \[0, 1, 0\]"):
        setup.system(sheet, rubber, section=PlaneStrain(1.0))
