import math
import time

import numpy as np
import pytest
import trimesh

from turgor.common.errors import InputError
from turgor.geometry.space import Ball, Cylinder, HalfSpace, NearBody, Space
from turgor.mesh.partition import partition
from turgor.mesh.structured import box, shell_octant, tube_sector

ORIGIN = ("0 mm", "0 mm", "0 mm")


def upper(height):
    return Space(half_space=HalfSpace(point=("0 mm", "0 mm", height), normal=(0, 0, 2)))


def test_a_half_space_cuts_a_block_along_its_elements():
    mesh = partition(box((1.0, 1.0, 2.0), (2, 2, 4)), {"top": upper("1 mm")})
    assert mesh.volume("top") == pytest.approx(1.0)
    assert mesh.volume("body") == pytest.approx(1.0)
    assert mesh.points[mesh.cells[mesh.region("top")]][..., 2].min() == 1.0


def test_the_number_of_corners_decides_at_the_interface():
    block = box((1.0, 1.0, 2.0), (2, 2, 4))
    volumes = [partition(block, {"top": upper("0.9 mm")}, at_least=k).volume("top") for k in (1, 2, 3, 4)]
    assert volumes == sorted(volumes, reverse=True)
    assert volumes[0] == pytest.approx(1.5)
    assert volumes[-1] == pytest.approx(1.0)


def test_the_printed_reinforcement_of_the_multi_material_paper():
    # At least three corners farther from the axis than the soft tube's radius of 9 mm.
    tube = tube_sector(5.0, 9.8, 5.0, 6)
    outside = Space(none_of=(Space(cylinder=Cylinder(point=ORIGIN, direction=(0, 0, 1), radius="9.000001 mm")),))
    mesh = partition(tube, {"reinforcement": outside}, at_least=3)
    radius = np.hypot(*mesh.points[mesh.cells[:, :4]][..., :2].transpose(2, 0, 1))
    assert set(mesh.region("reinforcement")) == set(np.flatnonzero((radius > 9.0).sum(axis=1) >= 3))
    # With one corner enough, the layer of elements outside the soft tube is the reinforcement.
    layer = partition(tube, {"reinforcement": outside}, at_least=1).volume("reinforcement")
    assert layer == pytest.approx(math.pi / 4 * (9.8**2 - 9**2) * 5, rel=1e-4)


def test_parts_of_space_combine():
    points = np.random.default_rng(0).uniform(-2, 2, (5000, 3))
    ball = Space(ball=Ball(centre=ORIGIN, radius="1 mm"))
    cube = Space(box=(("0 mm", "0 mm", "0 mm"), ("-2 mm", "2 mm", "2 mm")))
    in_ball = np.linalg.norm(points, axis=1) <= 1
    in_cube = (points[:, 0] <= 0) & (points[:, 1] >= 0) & (points[:, 2] >= 0)
    np.testing.assert_array_equal(ball.contains(points), in_ball)
    np.testing.assert_array_equal(cube.contains(points), in_cube)
    np.testing.assert_array_equal(Space(all_of=(ball, cube)).contains(points), in_ball & in_cube)
    np.testing.assert_array_equal(Space(any_of=(ball, cube)).contains(points), in_ball | in_cube)
    np.testing.assert_array_equal(Space(none_of=(ball, cube)).contains(points), ~in_ball & ~in_cube)
    both = Space(ball=ball.ball, none_of=(cube,))
    np.testing.assert_array_equal(both.contains(points), in_ball & ~in_cube)


def test_rules_come_from_text():
    space = Space.model_validate({"any_of": [{"ball": {"centre": ["1 mm", "0 cm", "0 mm"], "radius": "2 mm"}}]})
    assert space.contains(np.array([[2.5, 0.0, 0.0], [3.5, 0.0, 0.0]])).tolist() == [True, False]


def test_the_first_of_two_claims_wins_and_names_stay():
    block = box((1.0, 1.0, 2.0), (2, 2, 4))
    mesh = partition(block, {"a": upper("1 mm"), "b": upper("0.5 mm")})
    assert mesh.volume("a") == pytest.approx(1.0)
    assert mesh.volume("b") == pytest.approx(0.5)
    assert mesh.volume("body") == pytest.approx(0.5)
    assert set(mesh.surfaces) == set(block.surfaces)
    everything = partition(block, {"all": upper("0 mm")})
    assert list(everything.regions) == ["all"]


def test_claims_on_nothing_are_refused():
    block = box((1.0, 1.0, 2.0), (2, 2, 4))
    with pytest.raises(InputError, match=r"regions\.top: no cell lies"):
        partition(block, {"top": upper("3 mm")})
    with pytest.raises(InputError, match="at_least: a tetrahedron has four corners"):
        partition(block, {"top": upper("1 mm")}, at_least=5)
    with pytest.raises(InputError, match="no rule says which part of space"):
        partition(block, {"top": Space()})
    flat = Space(half_space=HalfSpace(point=ORIGIN, normal=(0, 0, 0)))
    with pytest.raises(InputError, match="a direction has no length"):
        partition(block, {"top": flat})


def test_partition_is_quick():
    shell = shell_octant(1.0, 1.5, 6)
    start = time.perf_counter()
    partition(shell, {"core": Space(ball=Ball(centre=ORIGIN, radius="1.2 mm"))})
    assert shell.n_cells > 15_000
    assert time.perf_counter() - start < 2.0


def test_distance_to_a_body_from_an_stl_file(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    hollow = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    hollow.invert()
    trimesh.util.concatenate([ball, hollow]).export(tmp_path / "ball.stl")
    points = np.random.default_rng(0).uniform(-2, 2, (5000, 3))
    radius = np.linalg.norm(points, axis=1)
    clear = (np.abs(radius[:, None] - [0.5, 0.7, 1.0, 1.3, 0.8]) > 0.02).all(axis=1)  # away from the facets' error
    for distance, inside in (
        ("0 mm", (radius > 0.5) & (radius < 1.0)),
        ("0.3 mm", (radius > 0.2) & (radius < 1.3)),
        ("-0.2 mm", (radius > 0.7) & (radius < 0.8)),
    ):
        near = Space(stl=NearBody(file=str(tmp_path / "ball.stl"), unit="mm", distance=distance))
        outer = clear & (np.abs(radius - 0.2) > 0.02)
        np.testing.assert_array_equal(near.contains(points)[outer], inside[outer])


def test_each_region_may_have_its_own_number_of_corners():
    block = box((1.0, 1.0, 2.0), (2, 2, 4))
    spaces = {"top": upper("0.9 mm"), "low": Space(none_of=(upper("0.6 mm"),))}
    mesh = partition(block, spaces, at_least={"top": 1, "low": 4})
    assert mesh.volume("top") == pytest.approx(partition(block, {"top": spaces["top"]}, at_least=1).volume("top"))
    assert mesh.volume("low") == pytest.approx(0.5)
    with pytest.raises(InputError, match="only tetrahedra"):
        partition(box((1.0, 1.0, 1.0), (1, 1, 1), "hex27"), {"top": upper("0.5 mm")})
