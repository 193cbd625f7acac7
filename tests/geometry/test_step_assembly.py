"""A STEP assembly that OpenCASCADE's own exchange wrote (see data/make_assembly.py), with names, places and inches."""

import math
from pathlib import Path

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry.imported.step import StepFile
from turgor.mesh.generate import generate

FILE = str(Path(__file__).parent / "data" / "assembly.step")
BOTTOM = {"normal": (0, 0, -1), "nearest": ("0 mm", "0 mm", "0 mm")}
INLET = {"nearest": ("-4 mm", "0 mm", "12 mm")}


@pytest.fixture(scope="module")
def mesh():
    return generate(StepFile(file=FILE, mount=BOTTOM, caps={"inlet": INLET}), 3.0)


def test_bodies_become_conforming_regions_by_their_names(mesh):
    assert sorted(mesh.regions) == ["soft-body", "stiff-plate"]
    assert mesh.volume("soft-body") == pytest.approx(4000.0 - math.pi * (96.0 + 32.0 / 3.0), rel=1e-3)
    assert mesh.volume("stiff-plate") == pytest.approx(800.0 - math.pi * 2.0, rel=1e-4)
    shared = np.intersect1d(mesh.cells[mesh.region("soft-body")], mesh.cells[mesh.region("stiff-plate")])
    assert len(shared) > 30
    np.testing.assert_allclose(mesh.points[shared, 2], 10.0)


def test_the_cap_closes_the_cavity_that_two_bodies_bound(mesh):
    assert set(mesh.surfaces) == {"mount", "outer", "cavity-1", "cavity-2"}
    assert mesh.enclosed_volume("cavity-1") == pytest.approx(math.pi * (96.0 + 2.0), rel=2e-3)
    assert mesh.enclosed_volume("cavity-2") == pytest.approx(math.pi * 32.0 / 3.0, rel=5e-3)
    np.testing.assert_allclose(mesh.points[mesh.caps["inlet"], 2], 12.0)
    np.testing.assert_allclose(np.hypot(*(mesh.points[mesh.caps["inlet"], :2] + (4, 0)).T), 1.0, rtol=1e-6)


def test_without_the_cap_there_is_only_the_closed_pocket():
    assert set(generate(StepFile(file=FILE, mount=BOTTOM), 4.0).surfaces) == {"mount", "outer", "cavity"}


def test_rules_combine_by_any_and_none():
    high = {"between": (("0 mm", "0 mm", "9 mm"), ("0 mm", "0 mm", "13 mm"))}
    sides = {"any_of": [{"normal": (1, 0, 0)}, {"normal": (-1, 0, 0)}], "none_of": [high]}
    part = StepFile(file=FILE, mount=BOTTOM, surfaces={"flanks": sides, "plate": {**high, "none_of": [INLET]}})
    mesh = generate(part, 4.0)
    assert mesh.surface_area("flanks") == pytest.approx(2 * 20.0 * 10.0)
    np.testing.assert_allclose(np.abs(mesh.points[mesh.surface_nodes("flanks"), 0]), 10.0)
    assert mesh.points[mesh.surface_nodes("plate"), 2].min() == pytest.approx(10.0)


def test_a_combination_of_nothing_is_refused():
    with pytest.raises(InputError, match="mount: no rule says what is meant"):
        generate(StepFile(file=FILE, mount={"any_of": [{}]}), 4.0)
