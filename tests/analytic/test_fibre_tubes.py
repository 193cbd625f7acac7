"""Tubes wound with inextensible threads do under pressure what netting theory says.

A winding angle is measured from the tube's axis: tan θ = 2π r / pitch.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import neo_hookean

from turgor.fem.fibres import Fibre
from turgor.fem.loads import Pressure
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.geometry.tube import CappedTube
from turgor.mesh.generate import generate
from turgor.solver.path import solve_path

LENGTH, RADIUS, MIDDLE = 50.0, 6.0, 25.0
MAGIC = np.degrees(np.arctan(np.sqrt(2.0)))
KEVLAR = {"youngs_modulus": 31067.0, "diameter": 0.18}


@pytest.fixture(scope="module")
def mesh():
    return generate(CappedTube(inner_radius="5 mm", wall="2 mm", length="50 mm", cap="5 mm"), size=4.0)


def helices(pitch, senses, count=1, tilt=0.0):
    """`count` threads of each sense; +1 turns anticlockwise as it rises. Tilted, z gains r tan(tilt) cos t."""
    turns = LENGTH / pitch + 2.0 * RADIUS * np.tan(tilt) / pitch + 1.0
    t = np.arange(-2.0 * np.pi * turns, 2.0 * np.pi * turns, np.radians(5.0))
    z = pitch * t / (2.0 * np.pi) + RADIUS * np.tan(tilt) * np.cos(t)
    inside = np.flatnonzero((z >= 0.0) & (z <= LENGTH))
    runs = [run for run in np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1) if len(run) > 2]
    curves = {}
    for sense in senses:
        for k in range(count):
            angle = t + 2.0 * np.pi * k / count
            points = np.column_stack([RADIUS * np.cos(angle), sense * RADIUS * np.sin(angle), z])
            curves |= {f"{sense}/{k}/{part}": points[run] for part, run in enumerate(runs)}
    return curves


def inflated(mesh, pressure, curves):
    """Return the system and its equilibrium, reached in one step."""
    wound = replace(mesh, curves=curves)
    fibres = [Fibre(name, **KEVLAR) for name in curves]
    load = Pressure("cavity", pressure)
    system = System(wound, {"body": neo_hookean(0.1, 1e3)}, [Clamped("mount")], [load], fibres)
    found = solve_path(system, [1.0])[0]
    assert max(np.abs(fibre.strain(found.state.u)).max() for fibre in system.fibres) < 1e-2
    return system, found


def motion(system, u):
    """Shift of the tip face (3,), its twist and tilt in degrees, and the growth of the mid-section's outer radius."""
    points = system.mesh.points
    face = system.mesh.surface_nodes("tip-face")
    before, after = points[face], points[face] + u[face]
    left, _, right = np.linalg.svd((before - before.mean(axis=0)).T @ (after - after.mean(axis=0)))
    flip = np.diag([1.0, 1.0, np.linalg.det(left @ right)])
    turn = (left @ flip @ right).T
    twist = np.degrees(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
    tilt = np.degrees(np.arccos(min(turn[2, 2], 1.0)))
    skin = system.mesh.surface_nodes("outer")
    ring = skin[np.abs(points[skin, 2] - MIDDLE) < 5.0]
    moved = (points[ring] + u[ring])[:, :2]
    growth = np.linalg.norm(moved - moved.mean(axis=0), axis=1).mean() / 7.0 - 1.0
    return after.mean(axis=0) - before.mean(axis=0), twist, tilt, growth


def symmetric(angle, count):
    return helices(2.0 * np.pi * RADIUS / np.tan(np.radians(angle)), (1, -1), count)


def test_at_the_neutral_angle_length_and_diameter_stay_and_the_threads_carry_the_pressure(mesh):
    pressure, count = 0.05, 16
    system, found = inflated(mesh, pressure, symmetric(MAGIC, count))
    shift, twist, tilt, growth = motion(system, found.state.u)
    # Without threads, 0.02 MPa widen the tube by 18 % already.
    assert abs(growth) < 0.015
    assert abs(shift[2]) < 0.01 * LENGTH
    assert np.abs(shift[:2]).max() < 0.1
    assert abs(twist) < 0.1
    assert tilt < 0.1
    assert found.factorisations <= 7
    # Across the axis: p π r² = 2 n T cos θ.
    tension = np.concatenate([fibre.tension(found.state.u) for fibre in system.fibres])
    height = np.concatenate([0.5 * (fibre.ends[1:, 2] + fibre.ends[:-1, 2]) for fibre in system.fibres])
    mean = tension[np.abs(height - MIDDLE) < 10.0].mean()
    assert mean == pytest.approx(pressure * np.pi * RADIUS**2 / (2 * count * np.cos(np.radians(MAGIC))), rel=0.04)


@pytest.mark.parametrize(("angle", "stretch", "growth"), [(40.0, -4.0, 0.10), (70.0, 6.0, -0.02)])
def test_threads_along_the_tube_shorten_it_and_threads_around_it_lengthen_it(mesh, angle, stretch, growth):
    system, found = inflated(mesh, 0.05, symmetric(angle, 8))
    shift, twist, tilt, wider = motion(system, found.state.u)
    assert shift[2] * np.sign(stretch) > 0.75 * abs(stretch)
    assert wider * np.sign(growth) > 0.75 * abs(growth)
    assert abs(twist) < 0.1
    assert tilt < 0.5


@pytest.mark.parametrize("sense", [1, -1])
def test_one_standard_helix_unwinds_and_does_not_bend(mesh, sense):
    # The tube lengthens and the thread does not: it loses turns, so that the free end turns against the winding.
    system, found = inflated(mesh, 0.03, helices(6.0, (sense,)))
    shift, twist, tilt, _ = motion(system, found.state.u)
    assert shift[2] > 3.0
    assert -sense * twist == pytest.approx(34.0, abs=3.0)
    assert tilt < 0.5


def test_a_tilted_helix_bends_and_twists_its_mirror_image_the_other_way_and_both_together_only_shift(mesh):
    tilt = np.radians(45.0)
    results = {}
    for senses in ((1,), (-1,), (1, -1)):
        system, found = inflated(mesh, 0.03, helices(6.0, senses, tilt=tilt))
        results[senses] = motion(system, found.state.u)
    right, left, both = results[(1,)], results[(-1,)], results[(1, -1)]
    for shift, twist, bend, _ in (right, left):
        assert bend > 10.0
        assert abs(twist) > 8.0
        assert np.linalg.norm(shift[:2]) > 8.0
    assert right[1] < 0.0 < left[1]
    np.testing.assert_allclose(left[0], right[0] * [1.0, -1.0, 1.0], atol=0.15)
    assert np.linalg.norm(both[0][:2]) > 8.0
    assert abs(both[0][1]) < 0.1
    assert max(abs(both[1]), both[2]) < 0.5
