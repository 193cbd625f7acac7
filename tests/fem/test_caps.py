"""Caps over openings: volume, force and stiffness of the air that wall and cap enclose together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state
from scipy.spatial.transform import Rotation

from turgor.common.errors import InputError
from turgor.fem.loads import Force, Pressure
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.faces import rim_edges
from turgor.mesh.mesh import Mesh
from turgor.mesh.opening import volume_field
from turgor.mesh.structured import box, tube_sector
from turgor.solver.path import solve_path

SIZE = np.array([1.0, 2.0, 1.5])


@pytest.fixture(scope="module")
def open_box():
    """The skin of a block without its top as a wall, which encloses the block from its wrong side."""
    block = box(tuple(SIZE), (2, 2, 2))
    wall = np.vstack([block.surface(name) for name in ("x0", "x1", "y0", "y1", "z0")])
    return replace(block, surfaces={**block.surfaces, "cavity": wall}, caps={"lid": rim_edges(wall)})


@pytest.fixture(scope="module")
def quarter_tube():
    """A quarter of a tube whose end z = 3 is open and capped; x0, y0 and z0 are planes of symmetry."""
    tube = tube_sector(1.0, 1.5, 3.0, 1)
    edges = rim_edges(tube.surface("inner"))
    top = edges[(tube.points[edges][..., 2] == 3.0).all(axis=1)]
    return replace(tube, caps={"plug": top})


def system_of(mesh, cavity, supports, extra=()):
    return System(mesh, {"body": neo_hookean(ratio=50)}, supports, [Pressure(cavity, 0.02), *extra])


def test_wall_and_cap_enclose_the_volume_however_they_move(open_box):
    volume = -np.prod(SIZE)
    assert open_box.enclosed_volume("cavity") == pytest.approx(volume, rel=1e-13)
    turn = Rotation.from_rotvec([0.3, -1.0, 0.4]).as_matrix()
    moved = open_box.points @ turn.T + (30.0, -20.0, 10.0)
    assert open_box.enclosed_volume("cavity", moved - open_box.points) == pytest.approx(volume, rel=1e-12)
    stretch = np.array([[1.2, 0.3, 0.0], [0.0, 0.9, 0.1], [0.2, 0.0, 1.4]])
    moved = open_box.points @ stretch.T
    expected = volume * np.linalg.det(stretch)
    assert open_box.enclosed_volume("cavity", moved - open_box.points) == pytest.approx(expected, rel=1e-12)


def test_a_cap_in_a_half_model_lies_between_the_symmetry_planes(quarter_tube):
    assert quarter_tube.enclosed_volume("inner") == pytest.approx(3.0 * np.pi / 4, rel=1e-3)
    field = volume_field(quarter_tube.points, quarter_tube.surface("inner"), "inner", caps=quarter_tube.caps)
    assert len(field.caps) == 1
    assert (field.axes == 1.0).all()  # without the cap z = 0 and z = 3 would be two parallel planes
    # The middle of the fan lies where the planes x = 0 and y = 0 meet.
    middle = field.caps[0].places(quarter_tube.points - field.origin)[len(field.caps[0].nodes)]
    np.testing.assert_allclose(middle, [0.0, 0.0, 3.0], atol=1e-12)


@pytest.mark.parametrize("shape", ["open_box", "quarter_tube"])
def test_derivatives(shape, request):
    mesh = request.getfixturevalue(shape)
    name, supports = ("cavity", [Clamped("z0")])
    if shape == "quarter_tube":
        name, supports = "inner", [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    system = system_of(mesh, name, supports)
    state = random_state(system, 0.02)
    (cap,) = system.cavities[0].caps
    assert cap in system.terms
    assert check_derivatives(cap, state) > 1e-5
    total = mesh.enclosed_volume(name, state.u)
    assert system.cavities[0].volume(state.u) == pytest.approx(total, rel=1e-12)
    assert system.conjugate(state) == pytest.approx(0.02 * total, rel=1e-12)


def test_air_in_a_closed_space_pushes_nothing_as_a_whole(open_box):
    system = system_of(open_box, "cavity", [Clamped("z0")])
    state = random_state(system, 0.03)
    force = np.zeros_like(state.u)
    for term in (system.cavities[0], *system.cavities[0].caps):
        term.force(state, force)
    size = np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * size)
    torque = np.cross(open_box.points + state.u, force).sum(axis=0)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12 * size)


def test_the_rim_carries_pressure_times_opening(quarter_tube):
    system = system_of(quarter_tube, "inner", [Sliding("x0"), Sliding("y0"), Sliding("z0")])
    state = system.reference_state().with_loads(np.array([0.02]))
    force = np.zeros_like(state.u)
    for term in (system.cavities[0], *system.cavities[0].caps):
        term.force(state, force)
    rim = np.unique(quarter_tube.caps["plug"])
    assert -force[rim, 2].sum() == pytest.approx(0.02 * np.pi / 4, rel=1e-3)
    elsewhere = np.setdiff1d(np.flatnonzero(quarter_tube.points[:, 2] > 0.0), rim)
    assert np.abs(force[elsewhere, 2]).max() < 1e-15
    assert (-force[rim, 2]).max() < 0.5 * 0.02 * np.pi / 4  # no node of it all


def test_a_capped_tube_lengthens_as_lame_says(quarter_tube):
    mu, bulk, pressure = 0.1, 0.2, 1e-4
    modulus, poisson = 9 * bulk * mu / (3 * bulk + mu), (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu))
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    loads = [Pressure("inner", pressure)]
    system = System(quarter_tube, {"body": neo_hookean(mu, bulk / mu)}, planes, loads)
    found: list[float] = []
    middle = np.abs(quarter_tube.points[:, 2] - 1.0) < 1e-9
    assert middle.any()
    solve_path(system, [1.0], on_equilibrium=lambda state: found.append(state.state.u[middle, 2].mean()))
    # A thick tube with closed ends: axial stress p a²/(b² − a²), hoop and radial stress sum to twice that.
    assert found[-1] == pytest.approx((1 - 2 * poisson) * pressure / (1.5**2 - 1.0) / modulus, rel=0.03)


def test_a_leak_is_said(quarter_tube):
    inner = quarter_tube.surface("inner")[:-1]
    leaking = Mesh(quarter_tube.points, quarter_tube.cells, surfaces={"cavity": inner}, caps=quarter_tube.caps)
    with pytest.raises(InputError, match=r"cavity: the cavity leaks: its wall ends near .* or a cap over each opening"):
        leaking.enclosed_volume("cavity")
    part = replace(quarter_tube, caps={"plug": quarter_tube.caps["plug"][:-1]}, surfaces={})
    field = {"points": part.points, "faces": quarter_tube.surface("inner"), "name": "inner"}
    # What the cap leaves of the rim lies in the end plane of the mesh, where the cap does not end.
    with pytest.raises(InputError, match=r"caps\.plug: the rim under the cap ends near"):
        volume_field(**field, caps=part.caps)


def test_a_cap_between_two_parallel_planes_of_symmetry_is_refused():
    """The flat bottom of a channel along x that the planes y = 0 and y = 3 cut; its end at x = 2 is capped."""
    block = box((2.0, 3.0, 4.0), (2, 2, 2))
    rim = rim_edges(block.surface("z1"))
    end = rim[(np.abs(block.points[rim, 0] - 2.0) < 1e-9).all(axis=1)]
    with pytest.raises(
        InputError, match=r"caps\.end: .* ends in two parallel symmetry planes across y; expected a model"
    ):
        volume_field(block.points, block.surface("z1"), "cavity", caps={"end": end})


def test_a_force_and_a_pressure_both_count(open_box):
    system = system_of(open_box, "cavity", [Clamped("z0")], [Force("x1", (0.0, 0.0, 1.0))])
    assert len(system.cavities[0].caps) == 1
    assert system.loading.names == ("pressure:cavity", "force:x1")
