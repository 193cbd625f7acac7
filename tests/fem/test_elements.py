"""Every element in every section: derivatives of all terms, patch test, rigid turns, sections that do not fit."""

from __future__ import annotations

import numpy as np
import pytest
from samples import neo_hookean, random_state, shifted
from scipy.optimize import minimize_scalar

from turgor.common.errors import InputError
from turgor.fem.elements import pressure_modes
from turgor.fem.fields import extrapolation, von_mises
from turgor.fem.frames import block_products
from turgor.fem.loads import Force, Gravity, Pressure, Traction
from turgor.fem.pattern import packed_size
from turgor.fem.section import Axisymmetric, PlaneStrain, PlaneStress
from turgor.fem.sheet import Sheet
from turgor.fem.supports import Clamped, ElasticSupport, Prescribed, Sliding
from turgor.fem.system import System
from turgor.materials.expression import define_model
from turgor.materials.models.arruda_boyce import ArrudaBoyce
from turgor.materials.models.extended_tube import ExtendedTube
from turgor.materials.models.gent import Gent
from turgor.materials.models.mooney_rivlin import MooneyRivlin2
from turgor.materials.models.ogden import Ogden2
from turgor.materials.models.van_der_waals import VanDerWaals
from turgor.materials.volumetric import Logarithmic, Quadratic
from turgor.mesh.cells import CELLS
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, quarter_ring, rectangle, shell_octant
from turgor.solver.path import solve_path

SECTIONS = {"plane strain": PlaneStrain(0.7), "plane stress": PlaneStress(0.7), "axisymmetric": Axisymmetric()}
CASES = [("tet10", None), ("hex27", None)] + [(kind, name) for kind in ("tri6", "quad9") for name in SECTIONS]
MATERIALS = {
    "neo-Hookean": neo_hookean(ratio=20, density=2e-3),
    "Mooney–Rivlin, logarithmic": MooneyRivlin2(C10=0.03, C01=0.02, volumetric=Logarithmic(3.0), density=2e-3),
    "Ogden": Ogden2(mu1=0.08, alpha1=1.6, mu2=0.01, alpha2=4.0, volumetric=Quadratic(0.5), density=2e-3),
}
STEP = 1e-5


@pytest.fixture(params=CASES, ids=lambda case: " ".join(filter(None, case)))
def case(request):
    kind, name = request.param
    return kind, SECTIONS.get(name)


def shell(kind):
    return (shell_octant if kind in ("tet10", "hex27") else quarter_ring)(1.0, 1.5, 1, kind)


def planes(mesh):
    return [Sliding(name) for name in ("x0", "y0", "z0")[: mesh.dimension] if name in mesh.surfaces]


def loaded_shell(kind, section, material):
    """A shell under everything that can act on it."""
    mesh = shell(kind)
    along = (0.0, -1.0, 2.0)[: mesh.dimension]
    loads = [Pressure("inner", 0.3), Gravity(along), Traction("outer", (0.1, 0.2, 0.3)[: mesh.dimension])]
    loads += [Force("inner", along)]
    supports = [*planes(mesh), ElasticSupport("outer", 0.3), ElasticSupport("inner", 0.2, normal_only=True)]
    return System(mesh, {"body": material}, supports, loads, section=section)


def differences(function, state, direction):
    """Fourth-order central difference of `function` along `direction`."""
    f = [function(shifted(state, direction, k * STEP)) for k in (1, -1, 2, -2)]
    return (8 * (f[0] - f[1]) - (f[2] - f[3])) / (12 * STEP)


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_force_and_stiffness_are_derivatives(case, material):
    system = loaded_shell(*case, material)
    state = random_state(system, 0.02)
    direction = np.random.default_rng(7).standard_normal(state.u.shape)
    assert len(system.terms) == 7
    for term, lagged in zip(system.terms, state.lagged, strict=True):

        def force(at, term=term):
            out = np.zeros_like(state.u)
            term.force(at, out)
            return out

        slope = np.vdot(force(state), direction)
        assert abs(slope) > 1e-8
        assert slope == pytest.approx(differences(term.energy, state, direction), rel=1e-7)
        packed = np.empty((len(term.nodes), packed_size(state.u.shape[1] * term.nodes.shape[1])))
        term.stiffness(state, lagged, packed)
        product = np.zeros_like(state.u)
        block_products(term.nodes, packed, direction, product)
        expected = differences(force, state, direction)
        size = np.linalg.norm(force(state)) + np.linalg.norm(expected)
        assert np.linalg.norm(product - expected) <= 2e-8 * size


def test_what_lags_follows_a_small_step(case):
    system = loaded_shell(*case, MATERIALS["Mooney–Rivlin, logarithmic"])
    state = random_state(system, 0.02)
    direction = np.random.default_rng(8).standard_normal(state.u.shape)
    solid = system.solids[0]
    expected = differences(lambda at: system.consistent(at.u, at.loads).lagged[0], state, direction)
    change = solid.lagged_after(state, direction) - state.lagged[0]
    assert np.abs(change).max() > 0.1
    if isinstance(solid, Sheet):
        # No geometric stiffness takes the stress across a sheet.
        in_plane = np.arange(6 * solid.dV.shape[1]).reshape(-1, 6)[:, [0, 1, 3]].ravel()
        change, expected = change[:, in_plane], expected[:, in_plane]
    np.testing.assert_allclose(change, expected, atol=1e-8)


def test_assembled_forces_and_stiffness(case):
    system = loaded_shell(*case, MATERIALS["neo-Hookean"])
    state = random_state(system, 0.02)
    system.stiffness(state)
    direction = np.random.default_rng(9).standard_normal(state.u.shape)
    expected = differences(lambda at: system.forces(at)[0], state, direction)
    np.testing.assert_allclose(system.stiffness_times(direction), expected, atol=1e-7 * np.abs(expected).max())


def distorted(mesh, amplitude=0.08):
    """Inner nodes moved at random; simplices keep straight sides, the others do not."""
    points = mesh.points.copy()
    inner = np.ones(mesh.n_points, bool)
    inner[np.unique(np.vstack(list(mesh.surfaces.values())))] = False
    cell = mesh.cell
    moved = inner.copy()
    if cell.simplex:
        moved[:] = False
        moved[np.unique(mesh.cells[:, : cell.n_corners])] = True
        moved &= inner
    points[moved] += amplitude * np.random.default_rng(3).uniform(-1, 1, (moved.sum(), mesh.dimension))
    if cell.simplex:
        for middle, (a, b) in enumerate(cell.edges, start=cell.n_corners):
            points[mesh.cells[:, middle]] = 0.5 * (points[mesh.cells[:, a]] + points[mesh.cells[:, b]])
    assert moved.sum() > 0
    return Mesh(points, mesh.cells, surfaces=mesh.surfaces)


def uniform_gradient(dimension, section):
    if isinstance(section, Axisymmetric):
        return np.diag([1.2, 1.2**-2])
    F = np.array([[1.1, 0.2, 0.0], [0.0, 0.95, 0.1], [0.05, 0.0, 1.0]])[:dimension, :dimension]
    return F if isinstance(section, PlaneStress) else F / np.linalg.det(F) ** (1 / dimension)


def test_patch_of_uniform_strain(case):
    kind, section = case
    F = uniform_gradient(3 if section is None else 2, section)
    body = box((1.0, 1.0, 1.0), (2, 2, 2), kind) if section is None else rectangle((1.0, 1.0), (2, 2), kind)
    mesh = distorted(body)
    supports = [Clamped(name) for name in mesh.surfaces]
    system = System(mesh, {"body": neo_hookean()}, supports, section=section)
    wanted = mesh.points @ (F - np.eye(len(F))).T
    constraints = system.constraints
    constraints.value[constraints.fixed] = wanted[constraints.fixed]
    found = solve_path(system, [1.0])[0]
    np.testing.assert_allclose(found.state.u, wanted, atol=1e-9)
    ratio = system.dilatation(found.state)
    np.testing.assert_allclose(ratio, ratio[0], atol=1e-12)
    assert ratio[0] == pytest.approx(1.0, abs=1e-4)
    stress = system.solids[0].cauchy_stress(found.state)
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0, 0], stress.shape), atol=1e-9)
    if isinstance(section, PlaneStress):
        np.testing.assert_allclose(stress[..., [2, 4, 5]], 0.0, atol=1e-12)
    smooth = von_mises(system, found.state)
    np.testing.assert_allclose(smooth.nodal, smooth.largest, rtol=1e-6)


def test_a_rigid_turn_gives_no_stress(case):
    kind, section = case
    mesh = shell(kind)
    system = System(mesh, {"body": neo_hookean()}, planes(mesh), section=section)
    Q = np.eye(mesh.dimension)
    if isinstance(section, Axisymmetric):
        u = mesh.points * 0 + [0.0, 0.8]
    else:
        Q[:2, :2] = [[np.cos(2.0), -np.sin(2.0)], [np.sin(2.0), np.cos(2.0)]]
        u = mesh.points @ (Q - np.eye(mesh.dimension)).T
    state = system.consistent(u, np.zeros(0))
    assert system.energy(state) < 1e-16
    np.testing.assert_allclose(system.solids[0].cauchy_stress(state), 0.0, atol=1e-10)


def test_volumes_and_forces_are_those_of_the_slice_or_the_full_turn(case):
    kind, section = case
    mesh = shell(kind) if section is None else quarter_ring(1.0, 1.5, 4, kind)
    density = 2e-3
    loads = [Pressure("inner", 0.1), Gravity((0.0, -3.0)), Traction("outer", (0.0, 0.2)), Force("outer", (0.0, 5.0))]
    if section is None:
        loads[1:] = [Gravity((0, -3.0, 0)), Traction("outer", (0, 0.2, 0)), Force("outer", (0, 5.0, 0))]
    system = System(mesh, {"body": neo_hookean(density=density)}, planes(mesh), loads, section=section)
    solid, shell_area, air = {
        type(None): (np.pi / 6 * (1.5**3 - 1), np.pi / 2 * 1.5**2, np.pi / 6),
        Axisymmetric: (2 * np.pi / 3 * (1.5**3 - 1), 2 * np.pi * 1.5**2, 2 * np.pi / 3),
    }.get(type(section), (0.7 * np.pi / 4 * 1.25, 0.7 * np.pi / 2 * 1.5, 0.7 * np.pi / 4))
    assert system.solids[0].volume.sum() == pytest.approx(solid, rel=1e-3)
    assert system.cavities[0].volume(np.zeros_like(mesh.points)) == pytest.approx(air, rel=1e-3)
    weight, pull, force = (term.nodal.sum(axis=0)[1] for term in system.terms[2:])
    assert weight == pytest.approx(-3.0 * density * solid, rel=1e-3)
    assert pull == pytest.approx(0.2 * shell_area, rel=1e-3)
    assert force == pytest.approx(5.0, rel=1e-12)


def test_pressure_modes_are_orthonormal_and_contain_the_linear_functions():
    for mesh in (quarter_ring(1.0, 1.5, 2), shell_octant(1.0, 1.5, 1, "hex27")):
        cell, nodes = mesh.cell, mesh.points[mesh.cells]
        rng = np.random.default_rng(0)
        dV = rng.uniform(0.5, 1.0, (mesh.n_cells, len(cell.weights)))
        modes = pressure_modes(nodes, cell, dV)
        products = np.einsum("mqk,mq,mql->mkl", modes, dV, modes) / dV.sum(axis=1)[:, None, None]
        np.testing.assert_allclose(products, np.broadcast_to(np.eye(1 + mesh.dimension), products.shape), atol=1e-12)
        linear = cell.shape_at_quadrature @ nodes @ rng.standard_normal(mesh.dimension) + 2.0
        projected = np.einsum("mqk,mrk,mr,mr->mq", modes, modes, dV, linear) / dV.sum(axis=1)[:, None]
        np.testing.assert_allclose(projected, linear, atol=1e-12)


def test_a_linear_stress_is_continued_to_the_nodes():
    for cell in CELLS.values():
        if cell.dimension > 1:
            slope = np.arange(1.0, 1.0 + cell.dimension)
            np.testing.assert_allclose(
                extrapolation(cell, cell.nodes) @ (cell.points @ slope), cell.nodes @ slope, atol=1e-13
            )


def test_a_free_sheet_stretches_as_a_bar():
    # Plane stress: stretching by λ along x with free sides is uniaxial tension, P = μ (λ − λ⁻²).
    mesh = rectangle((1.0, 0.6), (2, 1))
    supports = [Sliding("x0"), Sliding("y0"), Prescribed("x1", (1.0, None))]
    for ratio, tolerance in ((1e3, 1e-3), (1e7, 1e-6)):
        system = System(mesh, {"body": neo_hookean(ratio=ratio)}, supports, section=PlaneStress(0.5))
        found = solve_path(system, [1.0])[0]
        pull = system.forces(found.state)[0][mesh.surface_nodes("x1"), 0].sum()
        assert pull == pytest.approx(0.1 * (2.0 - 0.25) * 0.6 * 0.5, rel=tolerance)
        assert found.factorisations < 12


def test_a_compressible_sheet_thins_by_poissons_ratio():
    material = neo_hookean(mu=1.0, ratio=2.0)
    mesh = rectangle((1.0, 1.0), (1, 1))
    supports = [Sliding("x0"), Sliding("y0"), Prescribed("x1", (1e-5, None))]
    system = System(mesh, {"body": material}, supports, section=PlaneStress())
    found = solve_path(system, [1.0])[0]
    nu = material.poisson_ratio
    assert found.state.u[mesh.surface_nodes("y1"), 1].mean() == pytest.approx(-nu * 1e-5, rel=1e-4)
    assert system.dilatation(found.state)[0] - 1.0 == pytest.approx((1 - 2 * nu) * 1e-5, rel=1e-4)


FUNG = define_model({"name": "fung", "energy": "mu*(exp(20*(I1 - 3)) - 1)", "constants": {"mu": {"unit": "MPa"}}})
LOCKING = {
    "Gent": Gent(mu=1.0, Jm=3.0, volumetric=Quadratic(5.0)),
    "Gent, nearly incompressible": Gent(mu=1.0, Jm=3.0, volumetric=Quadratic(1e4)),
    "van der Waals": VanDerWaals(mu=1.0, lambda_m=2.2, a=0.1, beta=0.5, volumetric=Logarithmic(5.0)),
    "extended tube": ExtendedTube(Gc=1.0, delta=0.5, Ge=0.2, beta=0.4, volumetric=Quadratic(5.0)),
    "Arruda and Boyce": ArrudaBoyce(mu=1.0, lambda_m=0.6, volumetric=Quadratic(5.0)),
    "Fung": FUNG(mu=0.1, volumetric=Quadratic(100.0)),
}


@pytest.mark.parametrize("name", LOCKING)
@pytest.mark.parametrize("stretches", [(1.9, 1.9), (2.3, 1.1), (2.1, 0.7)])
def test_a_sheet_that_locks_at_its_volume_at_rest_grows_instead(name, stretches):
    material = LOCKING[name]
    mesh = rectangle((1.0, 1.0), (1, 1))
    system = System(mesh, {"body": material}, [Clamped("x0")], section=PlaneStress())
    F = np.diag(stretches)

    def energy(log_thickness):
        with np.errstate(over="ignore"):
            return float(material.energy(np.diag([*stretches, np.exp(log_thickness)])))

    grid = np.linspace(-3.0, 1.0, 4001)
    values = [energy(place) for place in grid]
    best = int(np.argmin(values))
    least = minimize_scalar(energy, bounds=grid[[best - 1, best + 1]], method="bounded", options={"xatol": 1e-12})
    state = system.consistent(mesh.points @ (F - np.eye(2)), np.zeros(0))
    assert system.energy(state) == pytest.approx(least.fun, rel=1e-8)
    J = np.prod(stretches) * np.exp(least.x)
    np.testing.assert_allclose(system.dilatation(state), J, rtol=1e-5)
    stress = system.solids[0].cauchy_stress(state)
    assert np.abs(stress[..., [2, 4, 5]]).max() < 1e-9 * np.abs(stress).max()


def test_nodes_on_the_axis_stay_there_by_themselves():
    mesh = quarter_ring(1.0, 1.5, 2)
    system = System(mesh, {"body": neo_hookean()}, [Sliding("y0")], section=Axisymmetric())
    on_axis = np.flatnonzero(mesh.points[:, 0] == 0.0)
    assert len(on_axis) == 5
    assert system.constraints.fixed[on_axis, 0].all()


RING = quarter_ring(1.0, 1.5, 1)
ACROSS = Mesh(RING.points - [1.2, 0.0], RING.cells, surfaces=RING.surfaces)


@pytest.mark.parametrize(
    ("mesh", "section", "supports", "loads", "words"),
    [
        (RING, None, [Clamped("x0")], [], "needs a section"),
        (box((1, 1, 1), (1, 1, 1)), PlaneStrain(), [Clamped("x0")], [], "has no section"),
        (RING, PlaneStrain(0.0), [Clamped("x0")], [], "thickness must be positive"),
        (ACROSS, Axisymmetric(), [Clamped("y0")], [], "across the axis"),
        (RING, PlaneStrain(), [Sliding("x0")], [], "free to shift along y"),
        (RING, PlaneStrain(), [Sliding("y0")], [], "free to shift along x"),
        (
            rectangle((1.0, 1.0), (1, 1)),
            PlaneStrain(),
            [ElasticSupport("x0", 1.0, normal_only=True)],
            [],
            "free to shift along y",
        ),
        (RING, Axisymmetric(), [], [], "free to shift along y"),
        (RING, PlaneStrain(), [Clamped("x0")], [Gravity((0.0, 0.0, 1.0))], "out of the plane"),
        (RING, Axisymmetric(), [Clamped("y0")], [Gravity((1.0, 0.0))], "axis of revolution"),
        (RING, Axisymmetric(), [Clamped("y0")], [Force("outer", (1.0, 0.0))], "axis of revolution"),
        (RING, PlaneStrain(), [Prescribed("x0", (0.0, 0.0, 1.0))], [], "out of the plane"),
        (RING, PlaneStrain(), [Clamped("x0")], [Pressure("inner", 0.1)], "leaks"),
        (
            rectangle((0.5, 1.0), (1, 1), corner=(1.0, 0.0)),
            Axisymmetric(),
            [Clamped("y0")],
            [Pressure("x0", 0.1)],
            "leaks: it ends in a plane across y",
        ),
        (
            rectangle((0.5, 1.0), (1, 1), corner=(1.0, 0.0)),
            Axisymmetric(),
            [Clamped("y0")],
            [Pressure("y1", 0.1)],
            "leaks",
        ),
    ],
)
def test_refusals(mesh, section, supports, loads, words):
    with pytest.raises(InputError, match=words):
        System(mesh, {"body": neo_hookean(density=1e-9)}, supports, loads, section=section)
