"""``docs/cases.md`` shows a case that loads and names every key there is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from turgor.geometry.imported.selection import Selection
from turgor.geometry.space import NearBody, Space
from turgor.results.measures import MEASURES
from turgor.study.boundary import DisplacementCase, ElasticCase, ForceCase, GravityCase, PressureCase, TractionCase
from turgor.study.case import Case, MeshCase, RegionCase, SolverCase, load_case
from turgor.study.contact import BoxCase, ContactCase, CylinderCase, PlaneCase, SphereCase
from turgor.study.materials import FittedMaterial, LibraryMaterial, ModelMaterial
from turgor.study.reinforcement import (
    ConstantCase,
    ExponentialCase,
    FibreCase,
    FibreFamilyCase,
    HelicalCase,
    QuadraticCase,
    SheetCase,
)
from turgor.study.specimen import SpecimenCase

RESULTS = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
TEXT = (Path(__file__).parents[2] / "docs" / "cases.md").read_text(encoding="utf-8")


def test_the_case_of_the_page_loads(tmp_path: Path) -> None:
    match = re.search(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    assert match is not None
    (tmp_path / "page.yaml").write_text(match[1], encoding="utf-8")
    case = load_case(tmp_path / "page.yaml")
    assert case.full_pressure == pytest.approx(0.03)
    assert case.mesh.size == pytest.approx(3.0)


@pytest.mark.parametrize("name", MEASURES)
def test_every_measure_is_on_the_page_of_results(name: str) -> None:
    (line,) = [line for line in RESULTS.splitlines() if re.match(rf"\| `{name}`", line)]
    for parameter in MEASURES[name].parameters.model_fields:
        assert re.search(rf"`{parameter}`", line) or "those of `centreline`" in line, parameter


@pytest.mark.parametrize(
    "part",
    [
        Case,
        MeshCase,
        RegionCase,
        Selection,
        Space,
        NearBody,
        SolverCase,
        LibraryMaterial,
        ModelMaterial,
        FittedMaterial,
        SpecimenCase,
        DisplacementCase,
        ElasticCase,
        PressureCase,
        GravityCase,
        TractionCase,
        ForceCase,
        ContactCase,
        PlaneCase,
        BoxCase,
        CylinderCase,
        SphereCase,
        FibreCase,
        SheetCase,
        FibreFamilyCase,
        QuadraticCase,
        ExponentialCase,
        ConstantCase,
        HelicalCase,
    ],
)
def test_every_key_is_on_the_page(part: type[Case]) -> None:
    for key in part.model_fields:
        assert re.search(rf"`[^`]*\b{key}\b", TEXT), key
