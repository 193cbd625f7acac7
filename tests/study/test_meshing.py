"""Every example, as whole, cut and in the plane: a mesh comes out, and what a run of it would refuse is said."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml

import turgor as tg
from turgor.mesh.decks import write_deck
from turgor.mesh.structured import box
from turgor.study.meshing import checked_mesh

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.yaml"))
ROWS = {2: "quadrilaterals", 3: "hexahedra"}
SMALLER = {
    "honeycomb": ["geometry.rows=1", "geometry.depth=8 mm"],
    "membrane": ["geometry.chamber_length=4 mm"],
    "reinforced-tube": ["geometry.rings=6", "geometry.length=50 mm", "geometry.cavity_length=30 mm"],
}
"""Template → changes that leave its names and spare elements."""


def variants(path: Path) -> list[str]:
    """Return the change that draws each model of the example's template, itself among them."""
    fields = type(tg.load_case(path).geometry).model_fields
    if "model" in fields:
        return [f"geometry.model={model}" for model in get_args(fields["model"].annotation)]
    return ["geometry.symmetric=false", "geometry.symmetric=true"] if "symmetric" in fields else []


@pytest.mark.parametrize(
    ("path", "change"),
    [(path, change) for path in EXAMPLES for change in variants(path) or [None]],
    ids=lambda value: value.stem if isinstance(value, Path) else str(value),
)
def test_every_model_of_every_example_is_meshed(
    path: Path, change: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    own = tg.load_case(path)
    changes = [change] if change else []
    changes += SMALLER.get(own.geometry.template, [])
    shape = tg.load_draft(path, [*changes, "mesh={}"]).geometry
    dimension = 2 if shape.section else 3
    if own.mesh.cells:
        changes.append(f"mesh.cells={ROWS[dimension]}")
    if own.mesh.layers and dimension == 2:
        changes.append("mesh.layers=null")  # walls are measured in space; the refusal says so
    draft = tg.load_draft(path, [*changes, f"mesh.size={2 * shape.default_size} mm"])
    with caplog.at_level(logging.WARNING, "turgor.study"):
        mesh = tg.mesh_case(draft)
    assert mesh.dimension == dimension
    assert mesh.volume() > 0.0
    supported = {support.surface for support in own.supports}
    cuts = {name for name in mesh.surfaces if name.startswith("symmetry")}
    said = caplog.text
    for name in supported - set(mesh.surfaces):
        assert f"no such surface (found '{name}')" in said
    for name in cuts - supported:
        assert f"nothing holds the cut '{name}'" in said
    assert ("study" in said) == bool(supported - set(mesh.surfaces) or cuts - supported)


def written(folder: Path, text: str) -> Path:
    (folder / "case.yaml").write_text(text, encoding="utf-8")
    return folder / "case.yaml"


TUBE = "geometry: {template: tube, model: quarter, length: 60 mm}\nmesh: {size: 6 mm}\n"


def test_a_shape_alone_is_enough_for_a_mesh(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = written(tmp_path, TUBE + "solver: {outputs: [3 kPa]}\n")
    mesh = tg.mesh_case(tg.load_draft(path))
    assert {"mount", "cavity", "symmetry-x", "symmetry-y"} <= mesh.surfaces.keys()
    assert "supports" not in caplog.text
    with pytest.raises(tg.InputError, match="this key is missing"):
        tg.load_case(path)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("supports: [{type: clampd, surface: mount}]", "supports.0.type"),
        ("loads: [{type: pressure}]", "loads.0: no pressure is given"),
        ("materials: {body: {library: nothing-such}}", "materials.body"),
        ("mesh: {sise: 3 mm}", "mesh"),
    ],
)
def test_what_a_draft_says_must_be_right(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(tg.InputError, match=words):
        tg.load_draft(written(tmp_path, TUBE + more))


def test_a_name_that_is_not_there_stops_a_run_but_not_a_mesh(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    text = TUBE + (
        "materials: {body: {library: ecoflex-00-30-ogden}, lid: {library: ecoflex-00-30-ogden}}\n"
        "supports: [{type: clamped, surface: foot}, {type: sliding, surface: symmetry-x}]\n"
        "loads: [{type: pressure, cavity: cavity-2, value: 1 kPa}]\n"
    )
    path = written(tmp_path, text)
    tg.mesh_case(tg.load_draft(path))
    for words in ("materials.lid", "supports.0.surface", "loads.0.cavity", "nothing holds the cut 'symmetry-y'"):
        assert words in caplog.text
    with pytest.raises(tg.InputError, match=r"materials\.lid: the actuator has no such region"):
        checked_mesh(tg.load_case(path))


def block(folder: Path, suffix: str, length: float) -> Path:
    """Write a block of three to two to one as an STL or mesh file."""
    mesh = box((length, length * 2 / 3, length / 3), (1, 1, 1))
    path = folder / f"block{suffix}"
    if suffix == ".inp":
        write_deck(mesh, path)
        return path
    facets = [mesh.points[face[:3]] for faces in mesh.surfaces.values() for face in faces]
    corners = ("".join("vertex {!r} {!r} {!r}\n".format(*map(float, point)) for point in facet) for facet in facets)
    loops = "".join(f"facet normal 0 0 0\nouter loop\n{three}endloop\nendfacet\n" for three in corners)
    path.write_text(f"solid body\n{loops}endsolid body\n", encoding="ascii")
    return path


@pytest.mark.parametrize(
    ("suffix", "length", "unit", "size", "doubt"),
    [
        (".stl", 0.03, "mm", "4 mm", r"0.03 × 0.02 × 0.01 mm, smaller than an element of mesh.size, 4 mm,.*'mm'"),
        (".stl", 0.03, "mm", None, "smaller than actuators are.*'mm'"),
        (".stl", 30.0, "mm", "4 mm", None),
        (".stl", 30.0, "m", "4 m", "30000 × 20000 × 10000 mm, larger than actuators are.*'m'"),
        (".inp", 40.0, "1 m", None, "larger than actuators are.*'1000 mm'"),
        (".inp", 40.0, "1 um", None, "smaller than actuators are"),
        (".inp", 0.04, "1 m", None, None),
    ],
)
def test_a_unit_that_makes_no_actuator_is_doubted_once(
    suffix: str, length: float, unit: str, size: str | None, doubt: str | None, tmp_path: Path, caplog: Any
) -> None:
    geometry = {"template": {".stl": "stl", ".inp": "mesh"}[suffix], "unit": unit}
    geometry["file"] = block(tmp_path, suffix, length).name
    rules = {"mount": {"normal": [0, 0, -1]}} if suffix == ".stl" else {}
    case = {"geometry": geometry | rules, **({"mesh": {"size": size}} if size else {})}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")
    with caplog.at_level(logging.WARNING, "turgor.study"):
        tg.mesh_case(tg.load_draft(tmp_path / "case.yaml"))
    said = [record.getMessage() for record in caplog.records if record.name == "turgor.study"]
    assert len(said) == (doubt is not None)
    if doubt:
        assert re.match(f"geometry.unit: the body is .*{doubt}", said[0])


@pytest.mark.parametrize(("size", "doubted"), [("1e5 mm", True), ("71 mm", True), ("69 mm", False)])
def test_elements_larger_than_a_template_are_doubted(size: str, doubted: bool, tmp_path: Path, caplog: Any) -> None:
    tube = {"template": "tube", "inner_radius": "6 mm", "wall": "3 mm", "length": "70 mm", "cap": "6 mm"}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump({"geometry": tube, "mesh": {"size": size}}), encoding="utf-8")
    with caplog.at_level(logging.WARNING, "turgor.study"):
        tg.mesh_case(tg.load_draft(tmp_path / "case.yaml"))
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == doubted
    if doubted:
        assert re.match(
            r"mesh\.size: the body is 18 × 18 × 70 mm, smaller than an element of mesh\.size, .*unit", said[0]
        )


def test_a_template_is_not_doubted(tmp_path: Path, caplog: Any) -> None:
    small = {"template": "tube", "inner_radius": "0.06 mm", "wall": "0.03 mm", "length": "0.4 mm", "cap": "0.1 mm"}
    (tmp_path / "case.yaml").write_text(yaml.safe_dump({"geometry": small}), encoding="utf-8")
    with caplog.at_level(logging.WARNING, "turgor.study"):
        tg.mesh_case(tg.load_draft(tmp_path / "case.yaml"))
    assert not caplog.records
