"""Fibres that resist bending: derivatives, objectivity, closed forms, and what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state
from scipy.spatial.transform import Rotation

from turgor.common.errors import InputError
from turgor.fem.fibres import Fibre, solid_bending_stiffness
from turgor.fem.loads import Traction
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.mesh.structured import box, shell_octant, tube_sector
from turgor.solver.choice import not_iterative
from turgor.solver.path import solve_path

STIFFNESS = 0.3
HELD = (Clamped("x0"),)


def system_with(mesh, curve, supports=HELD, *, loads=(), bar_length=None, bending=STIFFNESS):
    fibre = Fibre("wire", 30.0, 0.2, tension_only=False, bar_length=bar_length, bending_stiffness=bending)
    wired = replace(mesh, curves={"wire": np.asarray(curve)})
    return System(wired, {"body": neo_hookean()}, supports, loads, [fibre])


def arc(radius=1.25, count=40):
    angle = np.linspace(0.1, np.pi / 2 - 0.1, count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle) * 0.8, np.sin(angle) * 0.6])


def helix(radius, pitch, turns, centre):
    t = np.linspace(0.0, 2.0 * np.pi * turns, 200)
    return np.asarray(centre) + np.column_stack([radius * np.cos(t), radius * np.sin(t), pitch * t / (2.0 * np.pi)])


def energy(system, u):
    (bending,) = system.bending
    return bending.energy(system.consistent(u, system.loading.at(0.0)))


CURVED = {
    "tetrahedra": lambda: system_with(shell_octant(1.0, 1.5, 1), arc()),
    "hexahedra": lambda: system_with(
        tube_sector(1.0, 1.5, 1.0, 1, "hex27"), helix(1.2, 4.0, 0.22, (0.0, 0.0, 0.05)), [Clamped("z0")], bar_length=0.2
    ),
    "straight": lambda: system_with(box((2.0, 1.0, 1.0), (2, 1, 1)), [[0.1, 0.2, 0.3], [1.9, 0.7, 0.9]]),
}


@pytest.mark.parametrize("name", CURVED)
def test_derivatives(name):
    system = CURVED[name]()
    (bending,) = system.bending
    state = random_state(system, 0.02)
    assert check_derivatives(bending, state) > 1.0
    assert bending.moment(state.u).min() > 1e-3


@pytest.mark.parametrize("name", CURVED)
def test_rest_is_free_of_moment_and_rotations_change_nothing(name):
    system = CURVED[name]()
    (bending,) = system.bending
    points = system.mesh.points
    turned = points @ Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix().T
    for u in (np.zeros_like(points), turned - points + [1.0, 2.0, 3.0]):
        assert bending.moment(u).max() < 1e-12
        force = np.zeros_like(points)
        bending.force(system.consistent(u, system.loading.at(0.0)), force)
        assert np.abs(force).max() < 1e-11
    u = random_state(system, 0.02).u
    rotated = (points + u) @ Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix().T - points
    assert energy(system, rotated) == pytest.approx(energy(system, u), rel=1e-10)


def rolled_up(points, radius):
    """Return the displacement that bends lines along x into circles about an axis along y, z being across."""
    x, y, z = points.T
    r = radius - z
    return np.column_stack([r * np.sin(x / radius), y, radius - r * np.cos(x / radius)]) - points


def test_a_straight_wire_bent_to_a_circle_has_the_energy_of_euler():
    errors = []
    for n in (4, 8):
        mesh = box((4.0, 1.0, 1.0), (n, 1, 1), "hex27")
        system = system_with(mesh, [[0.0, 0.5, 0.0], [4.0, 0.5, 0.0]], bar_length=2.0 / n)
        (bending,) = system.bending
        u = rolled_up(mesh.points, 2.0)
        assert bending.moment(u) == pytest.approx(STIFFNESS / 2.0, rel=0.08)
        # Half a bar at each end has no joint.
        bent = 4.0 - system.fibres[0].length[0]
        errors.append(energy(system, u) / (0.5 * STIFFNESS / 2.0**2 * bent) - 1.0)
    assert abs(errors[1]) < 0.3 * abs(errors[0])
    assert abs(errors[1]) < 0.01


def test_a_bent_wire_is_straightened_and_bent_the_other_way_by_the_same_moments():
    # From curvature 1/ρ to 1/ρ' takes E I (1/ρ' − 1/ρ): the wire lies at rest on a circle, near whose top these maps
    # hardly stretch it.
    mesh = box((3.0, 1.0, 2.0), (12, 1, 8), "hex27")
    angle = np.linspace(-0.5, 0.5, 60)
    curve = np.column_stack([1.5 + 2.5 * np.sin(angle), np.full(60, 0.5), 2.5 - 2.5 * np.cos(angle) + 0.5])
    system = system_with(mesh, curve, bar_length=0.125)
    x = mesh.points[:, 0] - 1.5
    for curvature in (0.0, -0.4, 0.6):
        lift = np.sqrt(2.5**2 - x**2)
        target = np.zeros_like(x) if curvature == 0.0 else (1 - np.sqrt(1 - (x * curvature) ** 2)) / curvature
        u = np.zeros_like(mesh.points)
        u[:, 2] = target - (2.5 - lift)
        (bending,) = system.bending
        middle = np.abs(bending.places[:, 0] - 1.5) < 0.3
        expected = STIFFNESS * abs(curvature - 0.4)
        assert bending.moment(u)[middle].mean() == pytest.approx(expected, rel=0.03), curvature


def test_the_curvature_of_a_ring_keeps_its_direction_in_the_section():
    # Half a turn of every section about the centre line, as of a rubber ring that is everted, turns k₀ round: the
    # moment is E I · 2 / R, though the centre line is where it was. A mirror does the same to the line that carries k₀.
    radius = 2.0
    mesh = box((5.0, 5.0, 1.0), (6, 6, 2), "hex27")
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    ring = np.column_stack([2.5 + radius * np.cos(angle), 2.5 + radius * np.sin(angle), np.full(73, 0.5)])
    system = system_with(mesh, ring)
    (bending,) = system.bending
    turned = mesh.points * [1.0, 1.0, -1.0] + [0.0, 0.0, 1.0]
    assert bending.moment(turned - mesh.points) == pytest.approx(2.0 * STIFFNESS / radius, rel=0.02)


def test_a_closed_curve_has_a_joint_where_it_closes():
    mesh = box((3.0, 3.0, 1.0), (3, 3, 1), "hex27")
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    ring = np.column_stack([1.5 + np.cos(angle), 1.5 + np.sin(angle), np.full(73, 0.5)])
    for points, missing in ((ring, 0), (ring[:-1], 1)):
        system = system_with(mesh, points, bar_length=0.2)
        (bending,) = system.bending
        assert len(bending.places) == len(system.fibres[0].length) - missing
        # Growth alone turns no bar against another; an ellipse is bent at the closure as opposite to it.
        assert bending.moment(mesh.points - 1.5) == pytest.approx(0.0, abs=1e-12)
        if not missing:
            moment = bending.moment(mesh.points * [0.5, 0.0, 0.0])
            assert moment[-1] == pytest.approx(moment[len(moment) // 2 - 1], rel=1e-6)
            assert moment[-1] > 0.1


def test_a_wire_stiffens_a_cantilever_by_its_own_bending_stiffness():
    # F L³ / 3 (E_b I_b + E I): the wire runs into the grip, and along the middle, where nothing stretches it.
    length, grip, side, stiffness = 36.0, 9.0, 2.0, 0.4
    mesh = box((length + grip, side, side), (15, 1, 1), "hex27")
    sides = np.vstack([mesh.surface(name) for name in ("y0", "y1", "z0", "z1")])
    held = sides[(mesh.points[sides][:, :, 0] <= grip).all(axis=1)]
    mesh = replace(mesh, surfaces={**mesh.surfaces, "grip": held})
    curve = [[0.0, 1.0, 1.0], [length + grip, 1.0, 1.0]]
    force = 2e-4
    tips, factorisations = {}, {}
    for bending in (None, stiffness):
        loads = [Traction("x1", (0.0, 0.0, force / side**2))]
        system = system_with(mesh, curve, [Clamped("grip")], loads=loads, bending=bending)
        found = solve_path(system, [1.0])[0]
        tips[bending] = found.state.u[system.mesh.surface_nodes("x1"), 2].mean()
        factorisations[bending] = found.factorisations
    block = 3.0 * 0.1 * side**4 / 12.0
    assert block / (block + stiffness) == pytest.approx(0.5)
    assert tips[stiffness] == pytest.approx(force * length**3 / 3.0 / (block + stiffness), rel=0.04)
    assert tips[None] / tips[stiffness] == pytest.approx(2.0, rel=0.06)
    assert factorisations[stiffness] <= factorisations[None] + 1


def test_a_solid_wire_has_the_stiffness_of_a_round_section():
    r = np.linspace(0.0, 0.2, 2001)
    assert solid_bending_stiffness(200e3, 0.4) == pytest.approx(200e3 * np.pi * np.trapezoid(r**3, r), rel=1e-6)


def test_corners_keep_their_angle():
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1))
    system = system_with(mesh, [[0.3, 0.3, 0.5], [1.7, 0.3, 0.5], [1.7, 1.7, 0.5]], bar_length=0.5)
    (bending,) = system.bending
    corner = np.abs(bending.places - [1.7, 0.3, 0.5]).max(axis=1) < 1e-12
    sheared = np.zeros_like(mesh.points)
    sheared[:, 0] = 0.2 * mesh.points[:, 1]
    moments = bending.moment(sheared)
    bar = system.fibres[0].length[0]
    angle = np.pi / 2 - np.arctan(0.2)  # between x and the sheared y
    assert moments[corner] == pytest.approx(STIFFNESS / bar * 2.0 * (1.0 - np.tan(angle / 2.0)), rel=1e-6)
    assert moments[~corner] == pytest.approx(0.0, abs=1e-12)


def test_what_it_is_not():
    mesh = box((2.0, 1.0, 1.0), (2, 1, 1))
    line = [[0.1, 0.5, 0.5], [1.9, 0.5, 0.5]]
    assert system_with(mesh, line, bending=None).bending == []
    assert system_with(mesh, line, bar_length=5.0).bending == []  # one bar has no joint
    assert not_iterative(system_with(mesh, line)) == "embedded fibres"
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match=r"fibres\.wire\.bending_stiffness.*positive"):
            system_with(mesh, line, bending=wrong)
    with pytest.raises(InputError, match=r"runs back on itself at \(1.9, 0.5, 0.5\)"):
        system_with(mesh, [*line, [0.2, 0.6, 0.5]])
