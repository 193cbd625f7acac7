"""A sheet or a wire in a plane of symmetry, which cuts it lengthwise: half of a body is half as stiff as the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples import check_derivatives, neo_hookean, random_state

from turgor.common.errors import InputError
from turgor.fem.fibres import EmbeddedFibre, Fibre
from turgor.fem.loads import Traction
from turgor.fem.membrane import BondedMembrane, Membrane
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box
from turgor.solver.path import solve_path

LENGTH = 6.0
WIRE = Fibre("wire", youngs_modulus=30.0, diameter=0.2, tension_only=False, bending_stiffness=1.0)


def beam(cuts: str = "") -> Mesh:
    """A beam along z, 2 mm wide and thick, or what is in front of those of x = 0 and y = 0 that `cuts` names."""
    lower = np.array([0.0 if "x" in cuts else -1.0, 0.0 if "y" in cuts else -1.0, 0.0])
    size = np.array([1.0, 1.0, LENGTH]) - lower
    block = box(tuple(size), (int(size[0]), int(size[1]), 6), "hex27")
    surfaces = {f"symmetry-{k[0]}" if k[0] in cuts and k[1] == "0" else k: v for k, v in block.surfaces.items()}
    left = block.points[block.cells].mean(axis=1)[:, 0] + lower[0] < 0.0
    regions = {name: np.flatnonzero(side) for name, side in (("left", left), ("right", ~left)) if side.any()}
    curves = {"wire": np.array([[0.0, 0.0, 0.0], [0.0, 0.0, LENGTH]])}
    return Mesh(block.points + lower, block.cells, regions=regions, surfaces=surfaces, curves=curves)


def loaded(mesh: Mesh, part: Fibre | Membrane, force: tuple[float, float, float]) -> tuple[np.ndarray, float, System]:
    """Return the displacement of a corner of the end, the energy and the system of a clamped beam."""
    supports = [Clamped("z0"), *(Sliding(name) for name in mesh.symmetry_planes)]
    materials = {region: neo_hookean(0.03, 1e3) for region in mesh.regions}
    system = System(mesh, materials, supports, [Traction("z1", force)], [part])
    state = solve_path(system, [1.0])[0].state
    corner = np.argmin(np.linalg.norm(mesh.points - [1.0, 1.0, LENGTH], axis=1))
    return state.u[corner], system.energy(state), system


@pytest.mark.parametrize(
    ("whole", "halved"),
    [
        (Membrane(("left", "right"), 10.0, 0.02), Membrane("symmetry-x", 10.0, 0.02)),
        (WIRE, WIRE),
        (replace(WIRE, youngs_modulus=1e-3), replace(WIRE, youngs_modulus=1e-3)),
    ],
    ids=["sheet", "wire", "its bending"],
)
def test_half_of_a_reinforced_beam_bends_and_stretches_as_the_whole(whole, halved):
    force = (0.0, 2e-4, 4e-3)
    u, energy, _ = loaded(beam(), whole, force)
    half_u, half_energy, system = loaded(beam("x"), halved, force)
    np.testing.assert_allclose(half_u, u, rtol=1e-7, atol=1e-9)
    assert half_energy == pytest.approx(0.5 * energy, rel=1e-7)
    bare = replace(halved, youngs_modulus=1e-6, **({"bending_stiffness": None} if isinstance(halved, Fibre) else {}))
    assert np.linalg.norm(loaded(beam("x"), bare, force)[0] - u) > 0.05 * np.linalg.norm(u)
    for term in (*system.fibres, *system.bending, *system.membranes):
        assert check_derivatives(term, random_state(system, 0.02)) > 1e-4


def test_a_wire_in_two_planes_of_symmetry_counts_a_quarter():
    force = (0.0, 0.0, 4e-3)
    u, energy, whole = loaded(beam(), WIRE, force)
    quarter_u, quarter_energy, system = loaded(beam("xy"), WIRE, force)
    np.testing.assert_allclose(quarter_u, u, rtol=1e-7, atol=1e-9)
    assert quarter_energy == pytest.approx(0.25 * energy, rel=1e-7)
    state = random_state(system, 0.0)
    assert system.fibres[0].tension(state.u + 0.1 * system.mesh.points).max() == pytest.approx(
        whole.fibres[0].tension(0.1 * whole.mesh.points).max()
    )


def test_only_what_lies_in_the_plane_is_cut():
    mesh = replace(beam("x"), curves={"bent": np.array([[0.5, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, LENGTH]])})
    fibre = EmbeddedFibre(mesh, replace(WIRE, curve="bent", bar_length=1.0))
    assert set(fibre.part[fibre.ends[1:, 2] < 2.01]) == {1.0}
    assert set(fibre.part[fibre.ends[:-1, 2] > 1.99]) == {0.5}
    outer = BondedMembrane(mesh, Membrane("x1", 10.0, 0.02))
    assert outer.dA.sum() == pytest.approx(2.0 * LENGTH)


@pytest.mark.parametrize("part", [WIRE, Membrane("symmetry", 10.0, 0.02)])
def test_what_lies_in_a_plane_through_the_body_is_refused(part):
    block = box((2.0, 2.0, LENGTH), (1, 1, 3))
    points = block.points.copy()
    behind = points[:, 2] > 3.0
    points[behind, 0] -= 0.5
    curves = {"wire": np.array([[0.0, 0.5, 0.5], [0.0, 1.5, 0.5]])}
    low = np.all(points[block.surfaces["x0"], 2] < 3.0, axis=1)
    mesh = Mesh(points, block.cells, surfaces={"symmetry": block.surfaces["x0"][low]}, curves=curves)
    with pytest.raises(InputError, match=r"reaches through its plane of symmetry"):
        EmbeddedFibre(mesh, part) if isinstance(part, Fibre) else BondedMembrane(mesh, part)
