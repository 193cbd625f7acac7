"""Half a body that meets its mirror image does what the whole one does."""

from __future__ import annotations

import numpy as np
import pytest
from contact_checks import check_contact
from samples import neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.contact.mirror import Mirror
from turgor.fem.contact.spec import ContactCase, Method, PairContact, RigidContact, SelfContact, Spring
from turgor.fem.loads import Pressure
from turgor.fem.rigid import Sphere
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding, Support
from turgor.fem.system import System
from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quarter_ring
from turgor.solver.path import output_fractions, solve_path

SUCTION = -6e-4


def quarter() -> Mesh:
    """A quarter of an oval ring, 12.6 mm wide and 18 mm high inside, cut where x and y are zero."""
    ring = quarter_ring(9.0, 10.0, 2, "quad9")
    points = ring.points * [0.7, 1.0]
    return Mesh(points, ring.cells, surfaces={"inner": ring.surfaces["inner"], "symmetry": cuts(ring)})


def cuts(ring: Mesh) -> np.ndarray:
    return np.vstack([ring.surfaces["x0"], ring.surfaces["y0"]])


def half() -> Mesh:
    """The half x ≥ 0 and x ≤ 0 of the same ring, in one piece."""
    part = quarter()
    places = np.vstack([part.points, part.points * [-1.0, 1.0]])
    _, first, number = np.unique(places.round(9), axis=0, return_index=True, return_inverse=True)
    turned = part.cells[:, [1, 0, 3, 2, 4, 7, 6, 5, 8]] + part.n_points
    points, cells = places[first], number.ravel()[np.vstack([part.cells, turned])]
    faces = boundary_faces(cells)
    x, y = points[faces].transpose(2, 0, 1)
    inside = np.hypot(x / 6.3, y / 9.0).max(axis=1) < 1.0 + 1e-6
    cut = (np.abs(y) < 1e-9).all(axis=1)
    return Mesh(
        points, cells, surfaces={"inner": faces[inside & ~cut], "outer": faces[~inside], "symmetry": faces[cut]}
    )


def inflated(
    mesh: Mesh, supports: list[Support], method: Method = "penalty", contact: ContactCase | None = None
) -> tuple[System, np.ndarray]:
    """The system, and the volume of its air at five pressures, mm³."""
    system = System(
        mesh,
        {"body": neo_hookean()},
        supports,
        [Pressure("inner", SUCTION)],
        section=PlaneStrain(),
        contact=[contact or SelfContact(method=method)],
    )
    found = solve_path(system, output_fractions(5))
    return system, np.array([system.cavities[0].volume(e.state.u) for e in found])


def test_a_wall_that_is_sucked_in_meets_its_image_as_it_meets_another_wall():
    part, of_quarter = inflated(quarter(), [Sliding("symmetry")])
    assert [c.name for c in part.contacts] == ["self", "self:mirror", "self:mirror-2"]
    # So soft a bed holds it where it is, and nothing else.
    whole, of_half = inflated(half(), [Sliding("symmetry"), ElasticSupport("outer", 1e-9)])
    assert of_quarter == pytest.approx(0.5 * of_half, rel=1e-3)
    # Walls that pass through each other leave a negative volume.
    assert of_quarter[-1] > 6.0
    assert [c.name for c in whole.contacts] == ["self", "self:mirror"]
    assert whole.touches(whole.reference_state())[0].area == 0.0


def test_so_it_does_where_a_barrier_keeps_the_rest_apart():
    _, volumes = inflated(quarter(), [Sliding("symmetry")], "barrier")
    _, by_penalty = inflated(quarter(), [Sliding("symmetry")])
    assert volumes == pytest.approx(by_penalty, rel=1e-3)


def test_so_does_a_surface_that_may_meet_itself():
    part, volumes = inflated(quarter(), [Sliding("symmetry")], contact=PairContact("inner", "inner"))
    assert [c.name for c in part.contacts] == ["inner:inner", "inner:inner:mirror", "inner:inner:mirror-2"]
    assert volumes == pytest.approx(inflated(quarter(), [Sliding("symmetry")])[1], rel=1e-6)


@pytest.mark.parametrize("kind", ["tet10", "hex27"])
def test_derivatives_behind_the_plane(kind):
    block = box((2.0, 1.0, 1.0), (2, 1, 1), kind)
    mesh = Mesh(block.points, block.cells, surfaces={"symmetry": block.surfaces["z0"], "held": block.surfaces["x0"]})
    system = System(mesh, {"body": neo_hookean()}, [Sliding("symmetry"), Clamped("held")], contact=[SelfContact()])
    (mirror,) = (c for c in system.contacts if isinstance(c, Mirror))
    state = random_state(system, 0.02)
    sunk = system.consistent(state.u - [0.0, 0.0, 0.6], state.loads)
    check_contact(mirror, sunk)
    # The image is as high above the plane as the lowest point of the sides is below it.
    lowest = (mirror.skin.shape @ (mesh.points + sunk.u)[mirror.faces])[:, :, 2].min()
    assert mirror.touch(sunk).overlap == pytest.approx(-2.0 * lowest, rel=1e-12)


def test_a_body_on_both_sides_of_its_plane_of_symmetry_is_refused():
    block = box((2.0, 1.0, 1.0), (2, 1, 2))
    points = block.points - [[1.0, 0.0, 0.0]] * np.maximum(block.points[:, 2:] - 0.5, 0.0)
    cut = block.surfaces["x0"]
    low = cut[(block.points[cut][:, :, 2] < 0.5 + 1e-9).all(axis=1)]
    mesh = Mesh(points, block.cells, surfaces={"symmetry": low, "held": block.surfaces["z0"]})
    supports = [Sliding("symmetry"), Clamped("held")]
    with pytest.raises(InputError, match=r"reaches through its plane of symmetry.*0\.5 mm behind"):
        System(mesh, {"body": neo_hookean()}, supports, contact=[SelfContact()])


def ball_under_a_block(
    width: float, at: float, method: Method = "penalty", spring: Spring | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Force, N, and displacement, mm, of a ball at x = `at` that a block, or its half, is pressed on by 1 mm."""
    block = box((width, 4.0, 2.0), (round(width), 4, 2), "hex27")
    points = block.points - [width - 2.0, 2.0, 0.0]
    surfaces = {"down": block.surfaces["z1"], "low": block.surfaces["z0"]}
    held: list[Support] = [Prescribed("down", (0.0, 0.0, -1.0))]
    if width == 2.0:
        surfaces["symmetry"] = block.surfaces["x0"]
        held.append(Sliding("symmetry"))
    mesh = Mesh(points, block.cells, surfaces=surfaces)
    ball = RigidContact(Sphere((at, 0.0, -2.01), 2.0), "low", method=method, spring=spring)
    system = System(mesh, {"body": neo_hookean(0.1, 100.0)}, held, contact=[ball])
    (touch,) = system.touches(solve_path(system, output_fractions(4))[-1].state)
    return np.array(touch.force), np.array(touch.displacement)


def force_on_a_ball(width: float, at: float, method: Method = "penalty") -> np.ndarray:
    return ball_under_a_block(width, at, method)[0]


def test_half_a_ball_feels_half_of_the_force():
    half = force_on_a_ball(2.0, 0.0)
    assert abs(half[0]) < 1e-12
    assert 2.0 * np.linalg.norm(half) == pytest.approx(np.linalg.norm(force_on_a_ball(4.0, 0.0)), rel=0.02)
    # A ball beside the plane has another one behind it, which feels its own force.
    assert abs(force_on_a_ball(2.0, 0.5)[0]) > 0.01


def test_half_a_ball_is_on_half_of_its_spring():
    along = Spring(0.2, (0.0, 0.0, 1.0))
    whole, half = (ball_under_a_block(width, 0.0, spring=along) for width in (4.0, 2.0))
    np.testing.assert_allclose(half[1], whole[1], rtol=1e-6)
    assert 2.0 * half[0][2] == pytest.approx(whole[0][2], rel=1e-6)
    # One that may move out of the plane, or stands beside it, has another one behind it.
    for at, direction in ((0.0, (0.1, 0.0, 1.0)), (0.5, (0.0, 0.0, 1.0))):
        force, moved = ball_under_a_block(2.0, at, spring=Spring(0.2, direction))
        assert force @ direction / np.linalg.norm(direction) == pytest.approx(-0.2 * np.linalg.norm(moved), rel=1e-6)
