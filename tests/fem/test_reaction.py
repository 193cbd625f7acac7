"""What supports carry, against the balance of forces and torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_bodies import half_chamber, merged, shifted_mesh
from samples import neo_hookean

from turgor.fem.contact.spec import ContactCase, RigidContact, SelfContact
from turgor.fem.loads import Force, Gravity, Pressure
from turgor.fem.reaction import Reactions
from turgor.fem.rigid import Cylinder, Plane
from turgor.fem.section import Axisymmetric, PlaneStrain
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding, Support
from turgor.fem.system import System
from turgor.mesh.faces import boundary_faces, rim_edges
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quarter_ring, rectangle, shell_octant, tube_sector
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


def cut_area(places: np.ndarray, edges: np.ndarray) -> float:
    """Area that edges of three nodes, at `places` ``(n_points, 2)``, sweep about the origin: that of parabolas."""
    a, b, m = np.moveaxis(places[edges], 1, 0)
    swept = 0.5 * cross(a, b) + 2.0 / 3.0 * cross(m - 0.5 * (a + b), b - a)
    return abs(float(swept.sum()))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def opening(mesh: Mesh, u: np.ndarray, axis: int) -> float:
    """Area of the opening of the surface ``inner`` in the plane across an axis, its nodes displaced by `u`."""
    edges = rim_edges(mesh.surface("inner"))
    edges = edges[(mesh.points[edges][:, :, axis] == 0.0).all(axis=1)]
    return cut_area(np.delete(mesh.points + u, axis, axis=1), edges)


@pytest.mark.parametrize("blocked", [False, True], ids=["free", "against a plate"])
@pytest.mark.parametrize("kind", ["tet10", "hex27"])
def test_the_mount_of_a_dome_carries_what_the_air_pushes_it_off_with(kind: str, blocked: bool) -> None:
    # Glued to a plate with its rim; the octant's planes of symmetry carry the air's push on the half that is left out.
    mesh, p = shell_octant(1.0, 1.5, 1, kind), 0.03
    plate = RigidContact(Plane((0.0, 0.0, 1.52), (0.0, 0.0, -1.0)), "outer", label="plate")
    supports = [Clamped("z0"), Sliding("x0"), Sliding("y0")]
    loads = [Pressure("inner", p)]
    system = System(mesh, {"body": neo_hookean(0.1, 100.0)}, supports, loads, contact=[plate] if blocked else [])
    force, torque, u = carried(system)
    felt = np.zeros(3)
    if blocked:
        (touch,) = system.touches(solve_path(system, [1.0])[0].state)
        felt = np.array(touch.force)
        assert felt[2] > 0.05 * p
    assert np.abs(u).max() > 0.05
    pushed = p * np.array([opening(mesh, u, axis) for axis in range(3)])
    assert pushed[2] == pytest.approx(p * np.pi / 4, rel=1e-2)
    assert sum(force.values()) == pytest.approx(felt - pushed, abs=1e-6 * p)
    assert force["z0"][2] == pytest.approx(felt[2] - pushed[2], abs=1e-6 * p)
    # The octant mirrors itself in the plane x = y.
    total = sum(torque.values())
    assert total[0] == pytest.approx(-total[1], abs=1e-3 * p)


def test_the_mount_of_a_section_carries_what_the_air_pushes_it_off_with() -> None:
    mesh, p = quarter_ring(1.0, 1.5, 2), 0.03
    material, loads = {"body": neo_hookean(0.1, 100.0)}, [Pressure("inner", p)]
    dome = System(mesh, material, [Clamped("y0")], loads, section=Axisymmetric())
    force, _, u = carried(dome)
    assert np.abs(u).max() > 0.05
    assert force["y0"] == pytest.approx([0.0, -p * np.pi, 0.0], abs=1e-8 * p)
    arch = System(mesh, material, [Clamped("y0"), Sliding("x0")], loads, section=PlaneStrain(7.0))
    force, _, u = carried(arch)
    crown = mesh.surface_nodes("x0")[np.argmin(mesh.points[mesh.surface_nodes("x0"), 1])]
    height = mesh.points[crown, 1] + u[crown, 1]
    assert height > 1.05
    assert sum(force.values()) == pytest.approx([-7.0 * p * height, -7.0 * p, 0.0], abs=1e-8 * p)


def test_planes_of_symmetry_through_a_cap_carry_what_the_air_pushes_its_other_half_with() -> None:
    tube = tube_sector(1.0, 1.5, 3.0, 1)
    edges = rim_edges(tube.surface("inner"))
    top = edges[(tube.points[edges][..., 2] == 3.0).all(axis=1)]
    mesh, p = replace(tube, caps={"plug": top}), 0.02
    supports = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    system = System(mesh, {"body": neo_hookean(0.1, 100.0)}, supports, [Pressure("inner", p)])
    force, _, u = carried(system)
    places = mesh.points + u
    assert force["z0"][2] == pytest.approx(-p * opening(mesh, u, 2), rel=1e-6)
    assert np.abs(u[np.unique(top), 2]).max() > 0.01
    for axis, name in enumerate(("x0", "y0")):
        # Wall and cap cut the plane along the wall's rim and a straight line to the middle of the cap, on the axis,
        # where the other half of the cap holds it with the rest.
        field = system.cavities[0].field
        height = field.caps[0].places(places - field.origin)[len(field.caps[0].nodes), 2]
        end = places[next(node for node in np.unique(top) if mesh.points[node, axis] == 0.0)]
        area = opening(mesh, u, axis) + 0.5 * end[1 - axis] * height
        assert force[name][axis] == pytest.approx(-p * area, rel=3e-3)


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
