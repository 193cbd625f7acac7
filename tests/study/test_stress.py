"""The stress of each region of a body, from the solver to the measures, against states known in closed form."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from samples import neo_hookean

from turgor.common.errors import InputError
from turgor.fem.supports import Prescribed, Sliding
from turgor.fem.system import System
from turgor.mesh.faces import all_faces, shared_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box
from turgor.results.measures import Choice, evaluate
from turgor.results.record import StepRecord
from turgor.results.store import RunStore
from turgor.results.stored import Body, StoredState
from turgor.solver.path import solve_path
from turgor.study.states import Recorder

STRETCH = 1.1
MODULI = {"soft": 0.1, "stiff": 10.0}
STRESS = {name: mu * (STRETCH**2 - 1.0 / STRETCH) for name, mu in MODULI.items()}
"""Uniaxial and incompressible: σ = μ (λ² − 1/λ), MPa."""


def side_by_side(kind: str) -> Mesh:
    """Two bars along z that share the faces at x = 2 mm; either bar's side of these is a surface."""
    solid = box((4.0, 4.0, 4.0), (2, 2, 2), kind)
    is_stiff = solid.points[solid.cells].mean(axis=1)[:, 0] > 2.0
    regions = {"soft": np.flatnonzero(~is_stiff), "stiff": np.flatnonzero(is_stiff)}
    soft, stiff = (solid.cells[cells] for cells in regions.values())
    between = {
        "side-of-soft": all_faces(soft)[shared_faces(soft, stiff)],
        "side-of-stiff": all_faces(stiff)[shared_faces(stiff, soft)],
    }
    return Mesh(solid.points, solid.cells, regions, {**solid.surfaces, **between})


def stretched(mesh: Mesh) -> StepRecord:
    """The record of both bars stretched alike."""
    planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
    rubbers = {name: neo_hookean(mu) for name, mu in MODULI.items()}
    system = System(mesh, rubbers, [*planes, Prescribed("z1", (None, None, 4.0 * (STRETCH - 1.0)))])
    return Recorder(system).record(solve_path(system, [1.0])[0])


@pytest.fixture(scope="module", params=["tet10", "hex27"])
def bars(request: pytest.FixtureRequest) -> StoredState:
    mesh = side_by_side(request.param)
    return StoredState(Body(mesh), stretched(mesh))


def statistics(state: StoredState, **chosen: str) -> list[float]:
    """The largest stress, its 99th percentile and its mean."""
    return list(evaluate([Choice.read({"von_mises": chosen})], state).values())


@pytest.mark.parametrize("region", MODULI)
def test_a_region_has_the_stress_of_its_own(bars: StoredState, region: str) -> None:
    assert statistics(bars, region=region) == pytest.approx([STRESS[region]] * 3, rel=1e-3)


@pytest.mark.parametrize(
    ("surface", "region"), [("x0", "soft"), ("x1", "stiff"), ("side-of-soft", "soft"), ("side-of-stiff", "stiff")]
)
def test_a_surface_has_the_stress_of_the_region_that_its_faces_belong_to(
    bars: StoredState, surface: str, region: str
) -> None:
    assert statistics(bars, surface=surface) == pytest.approx([STRESS[region]] * 3, rel=1e-3)


@pytest.mark.parametrize("chosen", [{}, {"surface": "z1"}])
def test_over_both_the_largest_is_that_of_the_stiffer_and_the_mean_lies_halfway(
    bars: StoredState, chosen: dict[str, str]
) -> None:
    half = sum(STRESS.values()) / 2.0
    assert statistics(bars, **chosen) == pytest.approx([STRESS["stiff"]] * 2 + [half], rel=1e-3)
    assert bars.record.von_mises_max == pytest.approx(STRESS["stiff"], rel=1e-3)


def test_the_nodes_on_an_interface_show_the_larger_stress(bars: StoredState) -> None:
    expected = np.where(bars.mesh.points[:, 0] > 2.0 - 1e-9, STRESS["stiff"], STRESS["soft"])
    np.testing.assert_allclose(bars.record.von_mises, expected, rtol=1e-3)


def test_a_run_keeps_the_stress_of_each_region(bars: StoredState, tmp_path: Path) -> None:
    measures: list[Choice | str] = [Choice.read({"von_mises": {"region": name}}) for name in MODULI]
    with RunStore.create(tmp_path, bars.mesh, "name: bars\n", measures=measures) as store:
        store.append(bars.record)
        with pytest.raises(InputError, match=r"von_mises_by_region.soft.*does not fit the mesh"):
            store.append(dataclasses.replace(bars.record, von_mises_by_region={"soft": np.zeros(1)}))
    found = RunStore.open(tmp_path)
    again = StoredState(found.body, found.load(0))
    for name in MODULI:
        np.testing.assert_array_equal(again.von_mises_in(name), bars.von_mises_in(name))
        assert found.history[0][f"von_mises_{name}_mean_MPa"] == statistics(bars, region=name)[2]


def test_a_run_stored_without_the_stress_of_each_region_is_read_and_leaves_the_measure_empty(
    bars: StoredState, tmp_path: Path
) -> None:
    with RunStore.create(tmp_path, bars.mesh, "name: bars\n", measures=["von_mises"]) as store:
        store.append(dataclasses.replace(bars.record, von_mises_by_region={}))
    found = RunStore.open(tmp_path)
    state = StoredState(found.body, found.load(0))
    np.testing.assert_array_equal(state.record.von_mises, bars.record.von_mises)
    assert found.history[0]["von_mises_max_MPa"] is None
    for chosen in ({}, {"region": "soft"}, {"surface": "x0"}):
        assert all(map(math.isnan, statistics(state, **chosen)))
