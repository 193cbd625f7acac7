"""Rigid bodies thinner than the wall that they meet, or moved farther than they are thick, are not passed."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.contact.spec import RigidContact
from turgor.fem.rigid import Box, Cylinder, Plane, RigidBody, Sphere
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import output_fractions, solve_path


def pressed_on(body: RigidBody, steps: int) -> float:
    """Lowest place of a block of 10 × 10 × 6 mm, 0.1 mm above a body, that is pressed down by 1.5 mm."""
    block = box((10.0, 10.0, 6.0), (2, 2, 2), "hex27")
    down = Prescribed("z1", (0.0, 0.0, -1.5))
    system = System(block, {"body": neo_hookean(0.1, 100.0)}, [down], contact=[RigidContact(body)])
    end = solve_path(system, output_fractions(steps))[-1]
    return float((block.points + end.state.u)[:, 2].min())


@pytest.mark.parametrize("steps", [1, 4])
@pytest.mark.parametrize("thickness", [1.0, 0.5])
def test_a_plate_holds_a_block_as_a_plane_does(thickness, steps):
    plane = pressed_on(Plane((0.0, 0.0, -0.1), (0.0, 0.0, 1.0)), 1)
    assert -0.2 < plane < -0.1
    plate = Box((-5.0, -5.0, -0.1 - thickness), (15.0, 15.0, -0.1))
    assert pressed_on(plate, steps) == pytest.approx(plane, abs=1e-6)


def lifted(steps: int, way: float = 7.0, x: float = 28.0) -> tuple[float, float]:
    """Place of the end of a strip of 30 × 1 mm that a rod of 6 mm lifts, and the force on the rod across it, N."""
    strip = rectangle((30.0, 1.0), (30, 1), "quad9")
    rod = RigidContact(Sphere((x, -3.05), 3.0), "y0", motion=(0.0, way))
    system = System(strip, {"body": neo_hookean(1.0, 1e3)}, [Clamped("x0")], section=PlaneStrain(), contact=[rod])
    end = solve_path(system, output_fractions(steps))[-1]
    (touch,) = system.touches(end.state)
    assert touch.force is not None
    return float((strip.points + end.state.u)[strip.surface_nodes("x1"), 1].mean()), float(touch.force[1])


@pytest.mark.parametrize("steps", [2, 7])
def test_a_rod_lifts_a_strip_however_far_it_moves_in_a_step(steps):
    place, force = lifted(steps)
    in_one, force_in_one = lifted(1)
    assert place == pytest.approx(8.03, abs=0.05)
    assert place == pytest.approx(in_one, abs=1e-4)
    assert force == pytest.approx(force_in_one, rel=1e-2)


@pytest.mark.parametrize(("way", "x"), [(1.0, 28.0), (7.0, 27.5), (7.0, 28.2), (7.0, 29.0)])
def test_a_slender_strip_that_comes_and_goes_under_a_rod_finds_its_place(way, x):
    # Touched in one iteration and lost in the next: a search that ends too early goes round for ever.
    place, force = lifted(7, way, x)
    assert 0.5 + way < place < 0.5 + 1.2 * way
    assert force < 0.0


@pytest.mark.parametrize(
    ("body", "depth"),
    [
        (Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), np.inf),
        (Sphere((0.0, 0.0, 0.0), 2.0), 2.0),
        (Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 2.0), 0.5),
        (Box((0.0, 0.0, 0.0), (3.0, 4.0, 1.0)), 0.5),
    ],
)
def test_how_deep_a_point_may_be_in_a_body(body, depth):
    assert body.depth == pytest.approx(depth)
    if np.isfinite(depth):
        inside = np.random.default_rng(0).uniform(-3.0, 4.0, (20_000, 3))
        deepest = -body.distance(inside)[0].min()
        assert 0.9 * depth < deepest <= depth
