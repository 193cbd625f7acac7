"""What supports carry, against the balance of forces and torques."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bodies import half_chamber, merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.spec import ContactCase, RigidContact, SelfContact
from turgor.fem.loads import Force, Gravity, Pressure
from turgor.fem.reaction import Reactions
from turgor.fem.rigid import Cylinder
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding, Support
from turgor.fem.system import System
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path

HEAVY = neo_hookean(0.5, 20.0, density=1.1e-9)
G = 9806.65


def carried(system: System) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Forces and torques about the origin by surface, and the displacement, at the full load."""
    state = solve_path(system, [1.0])[0].state
    facts = Reactions(system).facts(state)
    force = {name: np.array(entry["force_N"]) for name, entry in facts.items()}
    torque = {
        name: np.array(entry["torque_N_mm"]) + np.cross(entry["about_mm"], force[name]) for name, entry in facts.items()
    }
    return force, torque, state.u


def test_a_hanging_block_weighs_on_its_support_in_the_place_where_it_hangs() -> None:
    mesh = box((6.0, 4.0, 5.0), (3, 2, 2))
    system = System(mesh, {"body": HEAVY}, [Clamped("x0")], [Gravity((0.0, 0.0, -G))])
    force, torque, u = carried(system)
    weight = 1.1e-9 * 6.0 * 4.0 * 5.0 * G
    assert force["x0"] == pytest.approx([0.0, 0.0, weight], abs=1e-9 * weight)
    # The centre of mass of equal elements; the lever is that of the deformed block.
    solid = system.solids[0]
    places = np.einsum("qa,mai->mqi", mesh.cell.shape_at_quadrature, (mesh.points + u)[mesh.cells])
    centre = np.einsum("mq,mqi->i", solid.dV, places) / solid.dV.sum()
    assert torque["x0"] == pytest.approx(np.cross(centre, [0.0, 0.0, weight]), abs=1e-8 * weight)


def hollow_cube() -> Mesh:
    """A cube of 27 cells less the one in the middle; surfaces ``cavity`` and ``mount``."""
    grid = box((6.0, 6.0, 6.0), (3, 3, 3), "hex27")
    full = np.linalg.norm(grid.points[grid.cells].mean(axis=1) - 3.0, axis=1) > 0.5
    used, cells = np.unique(grid.cells[full], return_inverse=True)
    cells, points = cells.reshape(-1, 27).astype(np.int32), grid.points[used]
    skin = boundary_faces(cells)
    inside = np.linalg.norm(points[skin].mean(axis=1) - 3.0, axis=1) < 1.5
    mount = (points[skin][:, :, 0] == 0.0).all(axis=1)
    return Mesh(points, cells, surfaces={"cavity": skin[inside], "mount": skin[mount]})


def test_air_in_a_closed_cavity_pulls_at_no_support() -> None:
    mesh = hollow_cube()
    system = System(mesh, {"body": neo_hookean(0.1, 100.0)}, [Clamped("mount")], [Pressure("cavity", 0.02)])
    force, torque, u = carried(system)
    assert np.abs(u).max() > 0.05
    side = 0.02 * 2.0**2  # what the air pushes one side of the cavity with, N
    assert np.abs(force["mount"]).max() < 1e-8 * side
    assert np.abs(torque["mount"]).max() < 1e-8 * side * 6.0


@pytest.mark.parametrize("own", [(), (SelfContact(),)], ids=["without self-contact", "with self-contact"])
def test_what_a_dynamometer_feels_is_what_the_supports_carry(own: tuple[ContactCase, ...]) -> None:
    one = half_chamber((12.0, 6.0, 12.0), (6, 3, 6))
    mesh = merged(left=one, right=shifted_mesh(one, 13.0))
    supports = [Clamped("left-z0"), Clamped("right-z0"), Sliding("left-y0"), Sliding("right-y0")]
    loads = [Pressure("left-cavity", 0.03), Pressure("right-cavity", 0.03)]
    rod = RigidContact(Cylinder((8.0, -9.0, 15.1), (8.0, 9.0, 15.1), 3.0), label="rod")
    system = System(mesh, {"body": neo_hookean(0.1, 1000.0)}, supports, loads, contact=[*own, rod])
    state = solve_path(system, [0.5, 1.0])[-1].state
    touches = {touch.name: touch for touch in system.touches(state)}
    if own:
        assert touches["self"].area > 1.0
    felt = np.array(touches["rod"].force)
    facts = Reactions(system).facts(state)
    total = sum(np.array(entry["force_N"]) for entry in facts.values())
    assert felt[2] > 0.2
    # Across y the planes of symmetry also carry the air's force on what the halves leave out.
    assert (total - felt)[[0, 2]] == pytest.approx(0.0, abs=1e-6 * felt[2])
    turning = sum(
        np.array(entry["torque_N_mm"]) + np.cross(entry["about_mm"], entry["force_N"]) for entry in facts.values()
    )
    felt_turning = np.array(touches["rod"].torque) + np.cross(rod.body.reference_point, felt)
    assert turning[1] == pytest.approx(felt_turning[1], abs=1e-6 * felt[2] * 12.0)


def test_what_two_supports_hold_together_is_counted_once() -> None:
    mesh = box((2.0, 3.0, 4.0), (2, 2, 2))
    supports: list[Support] = [
        *(Sliding(f"{axis}0") for axis in "xyz"),
        Prescribed("z1", (None, None, 0.4)),
        ElasticSupport("x1", 0.2, normal_only=True),
    ]
    system = System(mesh, {"body": HEAVY}, supports, [Force("y1", (0.0, 0.1, 0.0))])
    force, _, _ = carried(system)
    assert sum(force.values()) == pytest.approx([0.0, -0.1, 0.0], abs=1e-7)
    assert force["z1"][2] == pytest.approx(-force["z0"][2], rel=1e-5)
    assert force["z1"][2] > 0.3
    assert force["x1"][0] == pytest.approx(-force["x0"][0], rel=1e-5)
    assert force["x1"][0] > 0.01, "the springs resist that the block grows thinner"
    clamped = System(mesh, {"body": HEAVY}, [Clamped("z0"), Clamped("x0")], [Force("y1", (0.0, 0.1, 0.0))])
    force, _, _ = carried(clamped)
    assert force["z0"] + force["x0"] == pytest.approx([0.0, -0.1, 0.0], abs=1e-7)


def test_supports_of_a_section_carry_the_weight_of_the_slice_or_of_the_full_turn() -> None:
    mesh = rectangle((5.0, 3.0), (3, 2))
    gravity = [Gravity((0.0, -G))]
    slice_ = System(mesh, {"body": HEAVY}, [Clamped("x0")], gravity, section=PlaneStrain(7.0))
    force, torque, _ = carried(slice_)
    weight = 1.1e-9 * 5.0 * 3.0 * 7.0 * G
    assert force["x0"] == pytest.approx([0.0, weight, 0.0], abs=1e-9 * weight)
    assert torque["x0"][2] == pytest.approx(2.5 * weight, rel=1e-2)
    disc = System(mesh, {"body": HEAVY}, [Clamped("x1")], gravity, section=Axisymmetric())
    force, torque, _ = carried(disc)
    weight = 1.1e-9 * np.pi * 5.0**2 * 3.0 * G
    assert force["x1"] == pytest.approx([0.0, weight, 0.0], abs=1e-9 * weight)
    assert torque["x1"] == pytest.approx(0.0, abs=1e-12)
