"""The report: one file that holds everything, says what is so, and needs no network."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from results.hollow_finger import CASE, bent_record, finished_run, hollow_finger

from turgor.common.errors import InputError, MissingPackageError
from turgor.mesh.mesh import Mesh
from turgor.results import animation, plots
from turgor.results import report as report_module
from turgor.results.curve_plots import all_zero, groups, line, over_displacement
from turgor.results.pictures import Pictures
from turgor.results.report import number, report
from turgor.results.store import RunStore
from turgor.results.stored import Body

FIT = {
    "fits": [
        {
            "model": "neo-hookean",
            "parameters": {"C10": 0.0172},
            "units": "MPa",
            "rmse_MPa": 0.0031,
            "r2": 0.981,
            "stable": True,
            "curve": {"strain": [0.0, 1.0, 2.0], "stress_MPa": [0.0, 0.06, 0.1]},
        },
        {
            "model": "ogden-1",
            "parameters": {"mu1": 0.02, "alpha1": 2.4},
            "units": "MPa",
            "rmse_MPa": 0.0005,
            "r2": 0.999,
            "stable": False,
            "curve": {"strain": [0.0, 1.0, 2.0], "stress_MPa": [0.0, 0.05, 0.11]},
        },
        {"model": "yeoh-3", "parameters": {}, "units": "MPa", "rmse_MPa": float("nan"), "r2": None, "stable": False},
    ],
    "recommended": "ogden-1",
    "reason": "the best of all",
    "data": {"strain": [0.0, 1.0, 2.0], "stress_MPa": [0.0, 0.052, 0.109]},
}


class Page(HTMLParser):
    """What a page says, loads and shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text: list[str] = []
        self.addresses: list[str] = []
        self.identities: list[str] = []
        self._silent = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._silent += tag in ("script", "style")
        values = dict(attrs)
        self.addresses += [value for name in ("src", "href") if (value := values.get(name))]
        self.identities += [value] if (value := values.get("id")) else []

    def handle_endtag(self, tag: str) -> None:
        self._silent -= tag in ("script", "style")

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.text.append(data)

    @property
    def words(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.text))


def frames_of(html: str) -> dict[str, Any]:
    found = re.search(r"const packed = (\{.*\});", html)
    assert found
    content: dict[str, Any] = json.loads(found[1])
    return content


@pytest.fixture
def without_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        report_module, "draw", lambda _, records, *__: Pictures((b"a",) * len(records), b"b", "cut open")
    )


@pytest.fixture
def folder(tmp_path: Path, run_folder: Path) -> Path:
    return Path(shutil.copytree(run_folder, tmp_path / "run"))


def test_the_whole_report_with_real_pictures(folder: Path) -> None:
    path = report(folder)
    assert path == folder / "report.html"
    html = path.read_text(encoding="utf-8")
    page = Page(html)
    assert path.stat().st_size < 8e6
    assert all(address.startswith("data:image/png;base64,") for address in page.addresses)
    for words in (
        "hollow-finger",
        "Target reached : reached 40 kPa",
        "Bending angle 200",
        "Degrees of freedom",
    ):
        assert words in page.words
    assert {"motion", "body", "frame"} < set(page.identities)
    assert "fit" not in page.identities
    if "There are no pictures" not in page.words:
        assert len(page.addresses) == 6
        assert base64.b64decode(page.addresses[0].split(",")[1]).startswith(b"\x89PNG")


@pytest.mark.usefixtures("without_pictures")
def test_the_moving_body_comes_back_from_its_packing(folder: Path, finger: Mesh) -> None:
    packed = frames_of(report(folder).read_text(encoding="utf-8"))
    surface = animation.drawn_surface(Body(finger), quartered=True)
    triangles = np.frombuffer(base64.b64decode(packed["triangles"]), "<i4").reshape(3, -1).T
    assert np.array_equal(triangles, surface.triangles)
    store = RunStore.open(folder)
    assert len(packed["frames"]) == 1 + store.n_steps
    assert packed["frames"][0]["label"] == "at rest"
    for record, frame in zip(store.records(), packed["frames"][1:], strict=True):
        levels = np.frombuffer(base64.b64decode(frame["xyz"]), "<u2").reshape(3, -1).T
        places = np.array(packed["origin"]) + packed["step"] * levels
        assert places == pytest.approx(surface.places(finger.points + record.displacement), abs=packed["step"])
        colours = np.frombuffer(base64.b64decode(frame["colour"]), np.uint8) * packed["colourStep"]
        assert colours == pytest.approx(surface.values(record.von_mises), abs=packed["colourStep"])
    assert packed["step"] < 0.003
    assert packed["frames"][3]["label"] == "24 kPa · bent by 120.0°"


@pytest.mark.usefixtures("without_pictures")
def test_the_fit_has_its_own_section(folder: Path) -> None:
    with RunStore.resume(folder) as store:
        store.write_fit(FIT)
    page = Page(report(folder).read_text(encoding="utf-8"))
    assert "fit" in page.identities
    assert "Not finished" in page.words  # a resumed run has not ended
    words = page.words.replace("\u00a0", " ")
    assert "ogden-1 (recommended) mu1 = 0.02, alpha1 = 2.4 5.000e−04 0.999 no" in words
    assert "yeoh-3 – – – no" in words
    assert "the best of all" in words


@pytest.mark.usefixtures("without_pictures")
def test_what_a_run_warned_of_stands_before_its_results(folder: Path) -> None:
    assert "Warnings" not in Page(report(folder).read_text(encoding="utf-8")).words
    with RunStore.resume(folder) as store:
        store.warn(["materials.body: unstable where λ > 2", "the unit"])
        store.warn(["the unit"])
    words = Page(report(folder).read_text(encoding="utf-8")).words
    assert "Warnings materials.body: unstable where λ > 2 the unit Pressure" in words


@pytest.mark.usefixtures("without_pictures")
def test_the_report_of_a_half_says_so(tmp_path: Path, folder: Path) -> None:
    half = hollow_finger((6, 4, 3), half=True)
    with RunStore.create(tmp_path / "half", half, CASE) as store:
        store.append(bent_record(half, 0, 1.0))
    said = "volumes and forces are those of this half"
    assert said in Page(report(tmp_path / "half").read_text(encoding="utf-8")).words
    assert said not in Page(report(folder).read_text(encoding="utf-8")).words


@pytest.mark.usefixtures("without_pictures")
def test_text_from_a_case_cannot_become_markup(tmp_path: Path, small_finger: Mesh) -> None:
    with RunStore.create(tmp_path, small_finger, {"name": "</script><b>hi</b>"}) as store:
        store.append(bent_record(small_finger, 0, 1.0))
    html = report(tmp_path).read_text(encoding="utf-8")
    assert "<b>hi</b>" not in html
    assert "</script><b>hi</b>" in Page(html).words


def test_without_graphics_the_report_says_what_is_missing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> Pictures:
        raise MissingPackageError("apt-get install libegl1")

    monkeypatch.setattr(report_module, "draw", missing)
    page = Page(report(folder).read_text(encoding="utf-8"))
    assert "There are no pictures: apt-get install libegl1" in page.words
    assert {"motion", "body"} < set(page.identities)


def test_a_run_without_steps_and_a_folder_without_a_run(tmp_path: Path, small_finger: Mesh) -> None:
    RunStore.create(tmp_path / "run", small_finger, CASE).close()
    page = Page(report(tmp_path / "run").read_text(encoding="utf-8"))
    assert "No step was finished" in page.words
    with pytest.raises(InputError, match="holds no run"):
        report(tmp_path)


@pytest.mark.usefixtures("without_pictures")
def test_a_body_without_names_or_cavities_is_reported_too(tmp_path: Path, small_finger: Mesh) -> None:
    bare = Mesh(small_finger.points, small_finger.cells)
    record = bent_record(small_finger, 0, 0.5)
    with RunStore.create(tmp_path, bare, "name: bare\n") as store:
        store.append(type(record)(**{**vars(record), "loads": {"gravity": 0.5}, "cavity_volumes": {}}))
    page = Page(report(tmp_path).read_text(encoding="utf-8"))
    assert "Largest displacement" in page.words
    assert "Bending angle" not in page.words


def test_curves_begin_at_rest_and_mark_unstable_states(tmp_path: Path, small_finger: Mesh) -> None:
    finished_run(tmp_path / "run", small_finger, np.array([0.5, 1.0]))
    history = RunStore.open(tmp_path / "run").history
    history[1]["stable"] = False
    figure = plots.load_motion(history)
    titles = [figure.layout[f"yaxis{k}"].title.text for k in ("", 2, 3, 4, 5)]
    assert titles[0] == "Bending angle / °"
    assert "Twist / °" not in titles  # there is none
    assert figure.layout.xaxis.title.text == "Pressure / kPa"
    bending = figure.data[0]
    assert list(bending.x) == pytest.approx([20.0, 40.0])
    assert list(bending.y) == pytest.approx([100.0, 200.0])
    assert list(bending.marker.symbol) == ["circle", "circle-open"]
    rest = report_module._rest_row(RunStore.open(tmp_path / "run"), history[0])
    assert rest["bending_angle_deg"] == pytest.approx(0.0)
    assert rest["cavity_volume_mm3"] == pytest.approx(small_finger.enclosed_volume("cavity"))


@pytest.mark.usefixtures("without_pictures")
@pytest.mark.parametrize("gaps", [(None, 0.25), (0.25, None)])
def test_a_gap_that_only_some_states_know_has_a_column_of_its_own(
    tmp_path: Path, small_finger: Mesh, gaps: tuple[float | None, ...]
) -> None:
    with RunStore.create(tmp_path, small_finger, CASE) as store:
        for index, gap in enumerate(gaps):
            facts = {"area_mm2": 7.0, "gap_mm": gap, "gap_per_wall": gap, "force_N": [0.0, 0.0, 3.0]}
            record = bent_record(small_finger, index, 0.5 * (index + 1))
            store.append(dataclasses.replace(record, standing={"contact": {"plate": facts}}))
    history = store.history
    assert [entry["contact_plate_gap_mm"] for entry in history] == list(gaps)
    table = re.search(r"Every step.*?</table>", report(tmp_path).read_text(encoding="utf-8"), re.DOTALL)
    assert table
    columns = re.findall("<th>(.*?)</th>", table[0])
    for written, entry in zip(table[0].split("<tbody>")[1].split("<tr>")[1:], history, strict=True):
        shown = dict(zip(columns, re.findall("<td>(.*?)</td>", written), strict=True))
        assert shown == {key: number(value) for key, value in entry.items()}
    rest = report_module._rest_row(store, history[0])
    assert rest.get("contact_plate_gap_mm") is None  # zero would be a touch
    assert groups(history)["Contact"]["Smallest gap in parts of the wall"]
    assert list(groups([{**entry, "contact_plate_gap_per_wall": None} for entry in history])["Contact"]) == [
        "Force / N",
        "Area in contact / mm²",
    ]


def test_a_section_of_zeros_is_told_in_words() -> None:
    history = [{"pressure_kPa": float(p), "contact_self_area_mm2": 0.0, "stable": True} for p in (0, 10, 20)]
    axes = groups(history)["Contact"]
    assert all_zero(history, axes)
    history[-1]["contact_self_area_mm2"] = 0.3
    assert not all_zero(history, axes)


def test_of_many_lines_those_that_end_highest_are_drawn() -> None:
    row = {f"fibre_fibre-{k}_largest_strain": 0.01 * k for k in range(1, 13)}
    (lines,) = groups([row])["Fibres"].values()
    assert [name for _, name in lines] == [f"fibre-{k}" for k in range(5, 13)]


def test_diagrams_leave_room_for_titles_and_legends_between_them() -> None:
    for rows in (2, 3):
        figure = plots.panels(rows, plots.HEIGHT)
        plots.finish(figure, plots.HEIGHT * rows)
        margin = figure.layout.margin
        drawn = figure.layout.height - margin.t - margin.b
        upper, lower = figure.layout.yaxis.domain, figure.layout.yaxis3.domain
        assert (upper[0] - lower[1]) * drawn == pytest.approx(96.0)


def test_lines_of_a_curve_are_named_by_load_and_unit() -> None:
    rows = [
        {"step": step, "pressure_kPa": p, "curvature_per_mm": 0.1, "torsion_per_mm": 0.0}
        | {f"{axis}_mm": float(place) for axis in "sxyz"}
        for step, p in enumerate((10.0, 20.684))
        for place in range(3)
    ]
    assert [trace.name for trace in line(rows).data[:2]] == ["10 kPa", "20.68 kPa"]
    programme = [{**row, "time_s": 2.0 * row["step"]} for row in rows]
    assert [trace.name for trace in line(programme).data[:2]] == ["0 s", "2 s"]


def test_angles_that_are_noise_are_left_out(run_folder: Path) -> None:
    history = RunStore.open(run_folder).history
    assert plots.turns("bending_angle_deg", history)
    assert not plots.turns("twist_deg", history)
    straight = [{**row, "bending_angle_deg": 0.003, "twist_deg": -40.0} for row in history]
    assert not plots.turns("bending_angle_deg", straight)
    assert plots.turns("twist_deg", straight)
    assert not plots.turns("twist_deg", [{"pressure_kPa": 1.0}])


def test_frames_keep_to_their_budget() -> None:
    assert animation.frames_that_fit(10, 1_000) == list(range(10))
    few = animation.frames_that_fit(100, 60_000)
    assert few[0] == 0
    assert few[-1] == 99
    assert len(few) * 60_000 * 7 * 4 / 3 <= animation.BUDGET_BYTES
    assert len(few) > 5


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (40.0, "40"),
        (0.088, "0.088"),
        (6079.9993, "6080"),
        (31234.6, "31235"),
        (140370.2, "140370"),
        (-12.3456, "−12.35"),
        (2.3e-5, "2.300e−05"),
        (1.5e9, "1.500e+09"),
        (float("nan"), "nan"),
        (7, "7"),
        (None, "–"),
        (True, "yes"),
        ([1.0, 2.5], "1, 2.5"),
    ],
)
def test_numbers_are_written_as_people_do(value: object, text: str) -> None:
    assert number(value) == text


def test_force_is_drawn_over_the_displacement_of_a_body_that_gives_way():
    rows = [
        {"step": 0, "stable": True, "contact_scale_force_N": 0.0, "contact_scale_displacement_mm": 0.0},
        {"step": 1, "stable": False, "contact_scale_force_N": 0.2, "contact_scale_displacement_mm": 0.4},
    ]
    figure = over_displacement([{"step": -1}, *rows])
    assert list(figure.data[0].x) == [0.0, 0.0, 0.4]
    assert list(figure.data[0].y) == [0.0, 0.0, 0.2]
    assert figure.data[0].marker.symbol[2] == "circle-open"
    assert over_displacement([{"step": 0, "contact_scale_force_N": 0.2}]) is None  # a body that stands still
