"""Embedded fibres: derivatives, what they carry, and what they refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.fibres import Fibre
from turgor.fem.frames import unpack_symmetric
from turgor.fem.loads import Traction
from turgor.fem.pattern import packed_size
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle, shell_octant, tube_sector
from turgor.solver.path import solve_path

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]


def system_with(mesh, curve, supports, *, loads=(), mu=0.1, **properties):
    fibre = Fibre("thread", **{"youngs_modulus": 30.0, "diameter": 0.2, "tension_only": False} | properties)
    threaded = replace(mesh, curves={"thread": np.asarray(curve)})
    return System(threaded, {"body": neo_hookean(mu)}, supports, loads, [fibre])


def arc(radius=1.25, count=40):
    angle = np.linspace(0.1, np.pi / 2 - 0.1, count)
    return radius * np.column_stack([np.cos(angle), np.sin(angle) * 0.8, np.sin(angle) * 0.6])


@pytest.fixture(scope="module")
def octant():
    return shell_octant(1.0, 1.5, 1)


@pytest.mark.parametrize("tension_only", [False, True])
def test_derivatives(octant, tension_only):
    system = system_with(octant, arc(), [Clamped("x0")], tension_only=tension_only)
    fibre = system.fibres[0]
    state = random_state(system, 0.02)
    assert check_derivatives(fibre, state) > 1e-2
    strain = fibre.strain(state.u)
    assert strain.min() < -1e-3 < 1e-3 < strain.max()
    assert (fibre.tension(state.u)[strain < 0] < 0).all() == (not tension_only)
    assert fibre.nodes.shape[1] > 10  # some bars lie in two cells


def test_derivatives_in_hexahedra():
    mesh = tube_sector(1.0, 1.5, 1.0, 1, "hex27")
    system = system_with(mesh, [[1.2, 0.1, 0.1], [0.9, 0.9, 0.5], [0.1, 1.2, 0.9]], [Clamped("z0")], bar_length=0.1)
    assert check_derivatives(system.fibres[0], random_state(system, 0.02)) > 1e-2


def test_the_lagged_force_is_the_linearised_one(octant):
    system = system_with(octant, arc(), [Clamped("x0")])
    fibre, state = system.fibres[0], random_state(system, 0.02)
    du = np.random.default_rng(1).standard_normal(state.u.shape)
    step = 1e-6
    more, less = (fibre.lagged_at(state.moved(h * du)) for h in (step, -step))
    slope = (more - less) / (2 * step)
    assert np.abs(slope).max() > 1.0
    change = fibre.lagged_after(state, du) - fibre.lagged_at(state)
    np.testing.assert_allclose(change, slope, rtol=1e-6, atol=1e-7)


def test_lagged_forces_change_the_geometric_stiffness_only(octant):
    system = system_with(octant, arc(), [Clamped("x0")])
    fibre, state = system.fibres[0], random_state(system, 0.02)
    size = 3 * fibre.nodes.shape[1]
    blocks = np.empty((2, len(fibre.nodes), packed_size(size)))
    fibre.stiffness(state, fibre.lagged_at(state), blocks[0])
    fibre.stiffness(state, np.zeros(len(fibre.nodes)), blocks[1])
    assert np.abs(blocks[0] - blocks[1]).max() > 1e-3
    # Without axial force, what remains of a bar is its stiffness along itself.
    eigenvalues = np.linalg.eigvalsh(unpack_symmetric(blocks[1], size))
    assert (eigenvalues[:, -1] > 1e-2).all()
    assert np.abs(eigenvalues[:, :-1]).max() < 1e-9


def test_uniform_strain_is_felt_by_every_bar():
    mesh = box((2.0, 1.0, 1.0), (3, 2, 2))
    curve = np.array([[0.1, 0.2, 0.3], [1.9, 0.7, 0.9]])
    system = system_with(mesh, curve, PLANES, bar_length=0.1)
    fibre = system.fibres[0]
    F = np.array([[1.3, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.3, 1.1]])
    direction = (curve[1] - curve[0]) / np.linalg.norm(curve[1] - curve[0])
    strain = np.linalg.norm(F @ direction) - 1
    u = mesh.points @ (F - np.eye(3)).T
    np.testing.assert_allclose(fibre.strain(u), strain, rtol=1e-10)
    assert fibre.length.sum() == pytest.approx(np.linalg.norm(curve[1] - curve[0]))
    assert fibre.length.max() <= 0.1
    force = 30.0 * np.pi * 0.2**2 / 4 * strain
    np.testing.assert_allclose(fibre.tension(u), force, rtol=1e-10)
    energy = 0.5 * force * strain * fibre.length.sum()
    assert fibre.energy(system.consistent(u, system.loading.at(0.0))) == pytest.approx(energy)


def test_a_fibre_shares_the_load_of_a_bar():
    # The section of the fibre adds to that of the block: P A = P_nh(λ) A + E A_f (λ − 1); through the middle, where the
    # block's centre line stays straight. The end faces stay plane.
    mesh = box((4.0, 1.0, 1.0), (4, 2, 2))
    system = system_with(
        mesh, [[0.0, 0.5, 0.5], [4.0, 0.5, 0.5]], [*PLANES, Prescribed("x1", (0.8, None, None))], youngs_modulus=2.0
    )
    found = solve_path(system, [1.0])[0]
    pull = system.forces(found.state)[0][system.mesh.surface_nodes("x1"), 0].sum()
    alone = 0.1 * (1.2 - 1.2**-2)
    fibre = 2.0 * np.pi * 0.2**2 / 4 * 0.2
    assert fibre / alone > 0.2
    assert pull == pytest.approx(alone + fibre, rel=2e-3)
    np.testing.assert_allclose(system.fibres[0].tension(found.state.u), fibre, rtol=5e-3)


def test_a_thread_goes_slack_and_carries_nothing():
    mesh = box((4.0, 1.0, 1.0), (4, 2, 2))
    squeezed = [*PLANES, Prescribed("x1", (-0.6, None, None))]
    curve = [[0.0, 0.5, 0.5], [4.0, 0.5, 0.5]]
    pulls = {}
    for tension_only in (True, False):
        system = system_with(mesh, curve, squeezed, youngs_modulus=2.0, tension_only=tension_only)
        found = solve_path(system, [1.0])[0]
        pulls[tension_only] = system.forces(found.state)[0][system.mesh.surface_nodes("x1"), 0].sum()
        assert (system.fibres[0].strain(found.state.u) < 0).all()
    assert pulls[True] == pytest.approx(0.1 * (0.85 - 0.85**-2), rel=1e-3)
    assert pulls[False] < 1.1 * pulls[True] < 0


def test_a_stiff_fibre_off_the_centre_bends_the_bar_towards_itself():
    mesh = box((6.0, 1.0, 1.0), (6, 2, 2))
    system = system_with(
        mesh,
        [[0.0, 0.5, 0.9], [6.0, 0.5, 0.9]],
        [Clamped("x0")],
        loads=[Traction("x1", (0.03, 0.0, 0.0))],
        youngs_modulus=31067.0,
    )
    found = solve_path(system, [1.0])[0]
    tip = found.state.u[system.mesh.surface_nodes("x1")].mean(axis=0)
    assert tip[2] > 0.2
    assert abs(tip[1]) < 0.02 * tip[2]
    assert np.abs(system.fibres[0].strain(found.state.u)).max() < 1e-4
    assert found.factorisations <= 9


def test_bars_end_at_the_corners_of_the_curve():
    mesh = box((2.0, 2.0, 1.0), (2, 2, 1))
    corner = [1.7, 0.3, 0.5]
    system = system_with(mesh, [[0.3, 0.3, 0.5], corner, [1.7, 1.7, 0.5]], [Clamped("x0")], bar_length=0.45)
    ends = system.fibres[0].ends
    assert len(ends) == 9
    assert np.abs(ends - corner).max(axis=1).min() < 1e-12
    assert system.fibres[0].length == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"youngs_modulus": 0.0}, "youngs_modulus.*positive"),
        ({"diameter": float("nan")}, "diameter.*positive"),
        ({"bar_length": -1.0}, "bar_length.*positive"),
    ],
)
def test_refusals(octant, change, words):
    with pytest.raises(InputError, match=words):
        system_with(octant, arc(), [Clamped("x0")], **change)


def test_a_curve_that_leaves_the_body_is_refused_by_name_and_place(octant):
    with pytest.raises(InputError, match=r"curves\.thread.*leaves the body at"):
        system_with(octant, arc(radius=1.6), [Clamped("x0")])
    with pytest.raises(InputError, match="two in the same place"):
        system_with(octant, np.repeat(arc()[:2], 2, axis=0), [Clamped("x0")])
    with pytest.raises(InputError, match="no curve"):
        System(octant, {"body": neo_hookean()}, [Clamped("x0")], [], [Fibre("absent", 1.0, 1.0)])


def test_a_plane_section_is_refused():
    with pytest.raises(InputError, match="plane section"):
        System(
            rectangle((1.0, 1.0), (1, 1)),
            {"body": neo_hookean()},
            [Clamped("x0")],
            [],
            [Fibre("absent", 1.0, 1.0)],
            PlaneStrain(),
        )
