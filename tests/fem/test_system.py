"""Assembly, constraints and what a system refuses."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from samples import check_assembled, neo_hookean, random_state, shifted

from turgor.common.errors import InputError
from turgor.fem.loading import Loading
from turgor.fem.loads import Force, Gravity, Pressure, Traction
from turgor.fem.pattern import SparsePattern
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, shell_octant, tube_sector

PLANES = [Sliding("x0"), Sliding("y0"), Sliding("z0")]


def full_matrix(system, values):
    upper = sp.csr_matrix((values, system.pattern.column, system.pattern.row_start), shape=(system.n_dofs,) * 2)
    return (upper + sp.triu(upper, 1).T).toarray()


def turned(mesh: Mesh, Q: np.ndarray) -> Mesh:
    return Mesh(mesh.points @ Q.T, mesh.cells, mesh.regions, mesh.surfaces)


def rotation() -> np.ndarray:
    Q, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def test_assembled_stiffness_is_the_derivative_of_the_free_forces():
    mesh = shell_octant(1.0, 1.5, 1)
    supports = [*PLANES, ElasticSupport("outer", 0.2)]
    system = System(mesh, {"body": neo_hookean(ratio=20)}, supports, [Pressure("inner", 0.2)])
    state = random_state(system, 0.02)
    matrix = full_matrix(system, system.stiffness(state))
    columns = []
    for k in range(0, system.n_dofs, 17):
        unit = np.zeros(system.n_dofs)
        unit[k] = 1.0
        direction = system.nodal(unit)
        more, less = (system.free_part(system.forces(shifted(state, direction, h))[0]) for h in (1e-6, -1e-6))
        columns.append((more - less) / 2e-6)
    difference = np.array(columns).T - matrix[:, ::17]
    assert np.abs(difference).max() < 1e-6 * np.abs(matrix).max()
    assert np.abs(matrix - matrix.T).max() == 0.0


def test_assembly_is_the_same_to_the_bit_every_time():
    system = System(shell_octant(1.0, 1.5, 2), {"body": neo_hookean()}, PLANES, [Pressure("inner", 0.2)])
    state = random_state(system, 0.005)
    first = system.stiffness(state).copy()
    assert np.array_equal(first, system.stiffness(state))


def test_oblique_sliding_equals_the_straight_one_seen_from_a_turned_frame():
    mesh, Q = box((1.0, 1.2, 0.8), (2, 2, 2)), rotation()
    loads = [Traction("x1", (0.02, 0.01, 0.0))]
    straight = System(mesh, {"body": neo_hookean(ratio=50)}, PLANES, loads)
    oblique = System(
        turned(mesh, Q), {"body": neo_hookean(ratio=50)}, PLANES, [Traction("x1", tuple(Q @ [0.02, 0.01, 0.0]))]
    )
    assert len(oblique.constraints.frame_nodes) > 10
    assert len(straight.constraints.frame_nodes) == 0
    results = []
    for system in (straight, oblique):
        state = system.reference_state().with_loads(system.loading.at(1.0))
        matrix = full_matrix(system, system.stiffness(state))
        right = system.free_part(system.forces(state)[0])
        results.append(system.nodal(np.linalg.solve(matrix, -right)))
    assert np.abs(results[0]).max() > 1e-3
    np.testing.assert_allclose(results[1], results[0] @ Q.T, atol=1e-10)


def test_stiffness_times_a_field_counts_fixed_components_too():
    mesh = turned(box((1.0, 1.2, 0.8), (2, 2, 2)), rotation())
    system = System(mesh, {"body": neo_hookean(ratio=50)}, PLANES)
    state = random_state(system, 0.02)
    system.stiffness(state)
    direction = np.random.default_rng(4).standard_normal(mesh.points.shape)
    check_assembled(system, state, direction, 1e-6)


def test_half_a_tube_between_end_planes_encloses_its_volume():
    mesh = tube_sector(1.0, 1.5, 0.7, 2)
    supports = [*PLANES, Sliding("z1")]
    system = System(mesh, {"body": neo_hookean()}, supports, [Pressure("inner", 0.1)])
    assert system.cavities[0].volume(np.zeros_like(mesh.points)) == pytest.approx(np.pi / 4 * 0.7, rel=2e-4)
    stretched = mesh.points * np.array([0.2, 0.2, 0.1])
    assert system.cavities[0].volume(stretched) == pytest.approx(1.2**2 * 1.1 * np.pi / 4 * 0.7, rel=2e-4)


def test_pressure_does_the_work_of_the_volume_swept():
    mesh = shell_octant(1.0, 1.5, 2)
    system = System(mesh, {"body": neo_hookean()}, PLANES, [Pressure("inner", 0.1)])
    force = np.zeros_like(mesh.points)
    system.cavities[0].force(system.reference_state().with_loads(np.array([0.1])), force)
    # Growing in all directions at unit rate, the octant sweeps 3 V; along x alone, V.
    volume = 4 / 3 * np.pi / 8
    assert np.vdot(force, mesh.points) == pytest.approx(-0.1 * 3 * volume, rel=2e-4)
    assert np.vdot(force[:, 0], mesh.points[:, 0]) == pytest.approx(-0.1 * volume, rel=2e-4)


@pytest.mark.parametrize(
    ("supports", "loads", "words"),
    [
        ([], [], "free to"),
        ([Sliding("x0")], [], "free to"),
        ([Sliding("x0"), Sliding("y0")], [], "free to shift along z"),
        ([ElasticSupport("x0", 0.1, normal_only=True)], [], "free to"),
        (PLANES, [Pressure("x1", 0.1)], "leaks"),
        (PLANES, [Pressure("nowhere", 0.1)], "nowhere"),
        ([Clamped("nowhere")], [], "nowhere"),
        ([Clamped("x0"), Prescribed("y0", (0.1, None, None))], [], "different displacements"),
        (PLANES, [Gravity((0, 0, -9810.0))], "density"),
    ],
)
def test_refusals(supports, loads, words):
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match=words):
        System(mesh, {"body": neo_hookean()}, supports, loads)


def test_cavity_whose_rim_is_not_held_leaks():
    mesh = shell_octant(1.0, 1.5, 1)
    with pytest.raises(InputError, match=r"leaks.*across x"):
        System(
            mesh, {"body": neo_hookean()}, [Sliding("y0"), Sliding("z0"), Clamped("outer")], [Pressure("inner", 0.1)]
        )


def test_two_parts_must_both_be_held():
    one = box((1.0, 1.0, 1.0), (1, 1, 1))
    n = one.n_points
    both = Mesh(
        np.vstack([one.points, one.points + np.array([3.0, 0.0, 0.0])]),
        np.vstack([one.cells, one.cells + n]),
        surfaces={"x0": one.surface("x0")},
    )
    with pytest.raises(InputError, match=r"part 2 of 2.*free to"):
        System(both, {"body": neo_hookean()}, [Clamped("x0")])


def test_materials_must_match_the_regions():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match="region 'body'"):
        System(mesh, {}, PLANES)
    with pytest.raises(InputError, match="skin"):
        System(mesh, {"body": neo_hookean(), "skin": neo_hookean()}, PLANES)


def test_each_load_has_a_name_of_its_own():
    forces = [Force("z1", tuple(axis)) for axis in np.eye(3)]
    loading = Loading([*forces[:2], Traction("z1", (0.0, 0.0, 0.1)), Force("z0", (1.0, 0.0, 0.0)), forces[2]])
    assert loading.names == ("force:z1", "force:z1#2", "traction:z1", "force:z0", "force:z1#3")


def test_the_solid_of_a_region_is_found_whatever_the_order_of_the_materials():
    mesh = box((1.0, 1.0, 2.0), (1, 1, 2))
    above = mesh.points[mesh.cells].mean(axis=1)[:, 2] > 1.0
    regions = {"low": np.flatnonzero(~above), "high": np.flatnonzero(above)}
    mesh = Mesh(mesh.points, mesh.cells, regions, mesh.surfaces)
    system = System(mesh, {"high": neo_hookean(2.0), "low": neo_hookean(1.0)}, [Clamped("z0")])
    for name, modulus in (("low", 1.0), ("high", 2.0)):
        assert np.array_equal(system.solid_of(name).index, regions[name])
        assert system.solid_of(name).material.shear_modulus == modulus
    with pytest.raises(InputError, match="region"):
        system.solid_of("middle")


def test_a_block_that_holds_a_node_twice_adds_both_its_places():
    nodes = np.array([[0, 2, 2], [1, 0, 2]], np.int32)
    pattern = SparsePattern(3, 2, [nodes], np.ones(6, bool))
    rng = np.random.default_rng(0)
    expected, packed = np.zeros((6, 6)), []
    for block in nodes:
        matrix = rng.standard_normal((6, 6))
        matrix += matrix.T
        packed.append(matrix[np.triu_indices(6)])
        places = (2 * block[:, None] + np.arange(2)).ravel()
        np.add.at(expected, np.ix_(places, places), matrix)
    for added in (False, True):
        values = np.zeros(pattern.n_stored)
        if added:
            pattern.add_blocks(nodes, np.array(packed), values)
        else:
            pattern.sum_blocks(np.concatenate(packed), values)
        upper = sp.csr_matrix((values, pattern.column, pattern.row_start), shape=(6, 6)).toarray()
        np.testing.assert_allclose(upper, np.triu(expected), atol=1e-12)
