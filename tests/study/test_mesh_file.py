"""A case whose shape is a mesh that another program made."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
import yaml

import turgor as tg
from turgor.common.units import to_internal
from turgor.mesh.decks import write_deck
from turgor.mesh.structured import shell_octant
from turgor.study.meshing import checked_mesh


def case_of(folder: Path, radii: tuple[float, float], unit: str, **more: object) -> Path:
    """Write an octant of a hollow ball of inner and outer radius to a .inp file, and its case."""
    write_deck(shell_octant(*radii, 1), folder / "ball.inp")
    inner, outer = (radius * to_internal(unit, "length") for radius in radii)
    case = {
        "geometry": {
            "template": "mesh",
            "file": "ball.inp",
            "unit": unit,
            "surfaces": {"cavity": {"ball": {"centre": ["0 mm"] * 3, "radius": f"{inner + 0.01} mm"}}},
            "tip": ["0 mm", "0 mm", f"{outer} mm"],
        },
        "supports": [{"type": "sliding", "surface": name} for name in ("x0", "y0", "z0")],
        "solver": {"steps": 1},
        **more,
    }
    (folder / "ball.yaml").write_text(yaml.safe_dump(case))
    return folder / "ball.yaml"


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    """A ball in centimetres."""
    return case_of(
        tmp_path,
        (0.4, 0.6),
        "1 cm",
        materials={"body": {"model": "neo-hookean", "constants": {"C10": "0.05 MPa"}}},
        loads=[{"type": "pressure", "value": "5 kPa"}],
    )


def test_the_ball_swells(ball: Path, tmp_path: Path) -> None:
    done = tg.run(tg.load_case(ball), tmp_path / "run")
    # Small strain of an incompressible ball of radii a and b: u(r) = C/r² with p = 4 μ C (1/a³ − 1/b³).
    a, b, mu, p = 4.0, 6.0, 0.1, 0.005
    tip = done.summary["final"]["tip_displacement_mm"][2]
    assert tip == pytest.approx(p * a**3 * b / (4 * mu * (b**3 - a**3)), rel=0.1)
    again = tg.load_case(tmp_path / "run" / "case.yaml")
    assert Path(again.geometry.file).parent.name == "data"


def test_the_copy_of_a_deck_holds_what_it_includes(ball: Path, tmp_path: Path) -> None:
    deck = tmp_path / "ball.inp"
    whole = deck.read_text()
    begin = whole.index("*ELEMENT")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.inp").write_text(whole[:begin].rstrip("\n"))
    deck.write_text(f"** a ball\n*Include, input=parts/nodes.inp\n{whole[begin:]}")
    done = tg.run(tg.load_case(ball), tmp_path / "run")
    copy = tmp_path / "run" / "data" / "ball.inp"
    assert copy.read_text() == f"** a ball\n{whole}"
    again = tg.run(tg.load_case(ball), tmp_path / "run", resume=True)
    assert again.summary["final"] == done.summary["final"]
    (tmp_path / "parts" / "nodes.inp").unlink()
    carried = tg.run(tg.load_case(tmp_path / "run" / "case.yaml"), tmp_path / "carried")
    assert carried.summary["final"] == done.summary["final"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("mesh.size=1 mm", "mesh.size: the mesh comes from a file"),
        ("geometry.file=none.inp", "geometry.file: there is no such file"),
        ("geometry.surfaces.lid={half_space: {point: [0 mm, 0 mm, 9 cm], normal: [0, 0, 1]}}", "geometry.surfaces.lid"),
        ("supports.0.surface=x9", "supports.0.surface: the actuator has no such surface"),
    ],
)
def test_a_wrong_key_is_named(change: str, words: str, ball: Path) -> None:
    with pytest.raises(tg.InputError) as found:
        checked_mesh(tg.load_case(ball, [change]))
    assert words in str(found.value)


def test_a_case_goes_on_behind_the_snap_of_a_balloon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("turgor.study.run.report", lambda folder: folder)
    # A Mooney–Rivlin sphere of radii 5 and 6 mm has its limit at 29.12 kPa and jumps (tests/analytic/test_balloons.py).
    case = case_of(
        tmp_path,
        (5.0, 6.0),
        "1 mm",
        materials={"body": {"model": "mooney-rivlin", "constants": {"C10": "0.05 MPa", "C01": "0.007 MPa"}}},
        loads=[{"type": "pressure", "value": "30 kPa"}],
        control={"type": "pressure", "at_limit": "post-snap"},
    )
    done = tg.run(tg.load_case(case), tmp_path / "run")
    with (done.folder / "history.csv").open(encoding="utf-8") as stream:
        limit, snapped, end = csv.DictReader(stream)
    assert [row["event"] for row in (limit, snapped, end)] == ["limit-pressure", "post-snap", ""]
    assert float(limit["pressure_kPa"]) == pytest.approx(29.12, rel=0.01)
    assert snapped["pressure_kPa"] == limit["pressure_kPa"]
    # Inner stretch 4.198: the outer radius is the cube root of 6³ + 5³ (4.198³ − 1).
    assert float(snapped["tip_displacement_z_mm"]) == pytest.approx(21.06 - 6.0, rel=0.05)
    assert float(end["pressure_kPa"]) == pytest.approx(30.0, rel=1e-9)
    assert done.summary["outcome"] == "target-reached"
