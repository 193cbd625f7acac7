"""The report of a stored run: one HTML file that needs nothing else, no network either."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import plotly.graph_objects as go
import yaml
from plotly.offline import get_plotlyjs

from turgor.common.errors import MissingPackageError
from turgor.mesh.mesh import Mesh
from turgor.mesh.quality import quality
from turgor.mesh.symmetry import part_in_front, planes_of_symmetry
from turgor.results import animation, curve_plots, plots
from turgor.results.archive import Row
from turgor.results.camera import camera_for
from turgor.results.files import write_text
from turgor.results.measures import evaluate
from turgor.results.pictures import draw
from turgor.results.record import StepRecord
from turgor.results.store import REPORT, RunStore
from turgor.results.stored import Body

_N_PICTURES = 5
_N_MODES = 2
_MODE_SIZE = 0.1
"""Largest displacement of a mode in its picture, in parts of the size of the body."""

_PARTS = {2: "half", 4: "quarter", 8: "eighth"}
"""What is left of a body by how many of it make the whole."""

_MOST_PLANES = 3

_SCENE_ASPECT = 1.6
_SIGNIFICANT = 4

_HEADLINES = (
    ("pressure_kPa", "Pressure", "kPa"),
    ("bending_angle_deg", "Bending angle", "°"),
    ("chord_angle_deg", "Chord angle", "°"),
    ("tip_displacement_mm", "Tip displacement", "mm"),
    ("max_displacement_mm", "Largest displacement", "mm"),
    ("tip_force_N", "Tip force", "N"),
    ("max_von_mises_MPa", "Largest von Mises stress", "MPa"),
    ("cavity_volume_mm3", "Cavity volume", "mm³"),
)


@dataclass(frozen=True)
class Card:
    """A headline number."""

    title: str
    value: str
    unit: str


@dataclass(frozen=True)
class Picture:
    """A picture and what is said below it; `source` is a data address that holds the PNG file."""

    caption: str
    source: str


def report(folder: str | Path) -> Path:
    """Write the report of the run in `folder` from what is stored there, and return the path of the HTML file.

    Where pictures cannot be drawn on this machine the report is made without them and says what is missing.

    Raises
    ------
    InputError
        If the folder holds no run, or a file of it is missing or damaged.
    """
    store = RunStore.open(folder)
    content: dict[str, Any] = {
        "title": _title(store),
        "summary": store.summary,
        "warnings": store.warnings,
        "case": store.case_text,
        "plotly_js": get_plotlyjs(),
        "fit": _fit_section(store.fit),
        "history": store.history,
        # Rows of older runs may lack columns that others have.
        "columns": list(dict.fromkeys(key for entry in store.history for key in entry)),
        "mesh": _mesh_facts(store.body),
    }
    if store.n_steps:
        content |= _states_section(store)
    loader = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    environment.trim_blocks = environment.lstrip_blocks = True
    environment.filters["number"] = number
    path = store.folder / REPORT
    write_text(path, environment.get_template("report.html").render(**content))
    return path


def number(value: object) -> str:
    """Return a number as people write it: at most four significant digits, yes or no, an en dash for nothing."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, str)):
        return str(value)
    if isinstance(value, (list, tuple)):
        return ", ".join(number(entry) for entry in value)
    if not isinstance(value, float) or not math.isfinite(value):
        return str(value)
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        decimals = max(0, _SIGNIFICANT - 1 - math.floor(math.log10(abs(value)))) if value else 0
        text = f"{value:.{decimals}f}"
        return (text.rstrip("0").rstrip(".") if decimals else text).replace("-", "−")
    return f"{value:.{_SIGNIFICANT - 1}e}".replace("-", "−")


def _title(store: RunStore) -> str:
    case = yaml.safe_load(store.case_text)
    name = case.get("name") if isinstance(case, Mapping) else None
    return str(name or store.folder.resolve().name)


def _states_section(store: RunStore) -> dict[str, Any]:
    """Everything that is drawn from the states: curves, the moving body, pictures."""
    mesh, history = store.mesh, store.history
    load = plots.load_axis(history)
    scale_max = _round_up(max(entry["von_mises_p99_MPa"] for entry in history))
    surface = animation.surface_that_fits(store.body, store.n_steps)
    shown = animation.frames_that_fit(store.n_steps, len(surface.nodes))
    records = [store.load(index) for index in shown]
    positions = [
        surface.places(mesh.points + u) for u in (np.zeros_like(mesh.points), *(r.displacement for r in records))
    ]
    stresses = [np.zeros(len(surface.nodes)), *(surface.values(record.von_mises) for record in records)]
    labels = ["at rest", *(_frame_label(history, index, load) for index in shown)]
    box = animation.bounds(positions)
    camera = camera_for(np.concatenate(positions), _SCENE_ASPECT, surface.drawing.cuts)
    pictures, note = _pictures(store, history, load, scale_max)
    curve = [_rest_row(store, history[0]), *history] if history[0]["fraction"] > 0.0 else history
    return {
        "cards": _cards(history),
        "unstable": any(entry.get("stable") is False for entry in history),
        "part": _part(store.mesh),
        "motion": _as_json(plots.load_motion(curve)),
        "extra": _extra_figures(store, curve),
        "scene": _as_json(plots.body_scene(box.low, box.high, camera, scale_max)),
        "frames": animation.pack(surface, positions, stresses, labels, box, scale_max),
        "load_title": load.title.split(" / ")[0],
        "pictures": pictures,
        "pictures_note": note,
    }


def _part(mesh: Mesh) -> str | None:
    """Return what part of the whole a mesh is that planes of symmetry cut, however many surfaces they lie in."""
    planes = list(planes_of_symmetry(mesh))
    part = part_in_front(planes) if len(planes) <= _MOST_PLANES else 0.0
    return _PARTS.get(round(1.0 / part)) if part > 0.0 else None


def _extra_figures(store: RunStore, history: Sequence[Row]) -> list[dict[str, Any]]:
    """Figures that only some runs have: what contact and fibres carry, and the measures that are curves.

    Of a section in which all is zero only the names of what is.
    """
    groups = curve_plots.groups(history)
    quiet = [title for title, axes in groups.items() if curve_plots.all_zero(history, axes)]
    most = {title: max(map(len, axes.values())) for title, axes in groups.items()}
    most = {title: lines for title, lines in most.items() if lines == curve_plots.MOST_LINES}
    figures = [(title, curve_plots.over_load(history, axes)) for title, axes in groups.items() if title not in quiet]
    dynamometers = curve_plots.over_displacement(history)
    figures += [] if dynamometers is None else [("Force over displacement", dynamometers)]
    figures += [(title.replace("-", " ").capitalize(), curve_plots.line(rows)) for title, rows in store.curves.items()]
    return [{"title": title, "zero": [axis.split(" / ")[0].lower() for axis in groups[title]]} for title in quiet] + [
        {"id": f"extra-{number}", "title": title, "figure": _as_json(figure), "most": most.get(title)}
        for number, (title, figure) in enumerate(figures)
    ]


def _as_json(figure: go.Figure) -> str:
    # "</" would end the script element of the page.
    return str(figure.to_json()).replace("</", "<\\/")


def _frame_label(history: Sequence[Row], index: int, load: plots.Quantity) -> str:
    label = _load_label(history[index], load)
    bends = plots.turns("bending_angle_deg", history)
    return f"{label} · bent by {history[index]['bending_angle_deg']:.1f}°" if bends else label


def _load_label(entry: Row, load: plots.Quantity) -> str:
    value = f"{entry[load.key]:.4g}"
    event = f" · {entry['event'].replace('-', ' ')}" if entry.get("event") else ""
    if load.key == "time_s" and "pressure_kPa" in entry:
        return f"{value} s, {entry['pressure_kPa']:.4g} kPa{event}"
    return (f"{value} kPa" if load.key == "pressure_kPa" else f"load parameter {value}") + event


def _cards(history: Sequence[Row]) -> list[Card]:
    values = dict(history[-1])
    tip = [values.get(f"tip_displacement_{axis}_mm") for axis in "xyz"]
    if None not in tip:
        values["tip_displacement_mm"] = math.hypot(*(float(component) for component in tip if component is not None))
        del values["max_displacement_mm"]
    if not plots.turns("bending_angle_deg", history):
        values.pop("bending_angle_deg", None)
    return [Card(title, number(float(values[key])), unit) for key, title, unit in _HEADLINES if key in values]


def _rest_row(store: RunStore, first: Row) -> Row:
    """The row of the body at rest, so that the curves begin where the motion does."""
    rest = np.zeros_like(store.mesh.points)
    volumes = [store.body.enclosed_volume(name, rest) for name in store.load(0).cavity_volumes]
    zeros: Row = {key: 0.0 for key, value in first.items() if isinstance(value, float)}
    # A gap of zero would be a touch; how far surfaces are apart at rest is not stored.
    zeros |= {key: None for key in zeros if key.startswith("contact_") and key.endswith(("_gap_mm", "_gap_per_wall"))}
    volume = {"cavity_volume_mm3": sum(volumes)} if volumes else {}
    return {**zeros, **volume, **evaluate(store.measures, store.body.at_rest()), "stable": True}


def _pictures(
    store: RunStore, history: Sequence[Row], load: plots.Quantity, scale_max: float
) -> tuple[list[Picture], str | None]:
    count = store.n_steps
    indices = sorted({max(0, round((k + 1) * count / _N_PICTURES) - 1) for k in range(_N_PICTURES)})
    records: list[StepRecord] = [store.load(index) for index in indices]
    labels = [_load_label(history[index], load) for index in indices]
    for index in [entry["step"] for entry in history if entry.get("event")][:_N_MODES]:
        record = store.load(index)
        if record.mode is not None:
            # First in the list: the last one is also drawn cut open.
            records.insert(0, _along_mode(store.body, record))
            labels.insert(0, f"the mode at {_load_label(history[index], load)}, enlarged")
    try:
        drawn = draw(store.body, records, labels, scale_max)
    except MissingPackageError as error:
        return [], str(error)
    captions, files = list(labels), list(drawn.states)
    if drawn.last is not None:
        captions.append(drawn.last_label)
        files.append(drawn.last)
    return [Picture(text, _data_address(file)) for text, file in zip(captions, files, strict=True)], None


def _along_mode(body: Body, record: StepRecord) -> StepRecord:
    """Return a state moved on along the mode in which it gives way, far enough to be seen."""
    assert record.mode is not None
    size = float(np.ptp(body.mesh.points, axis=0).max())
    return replace(record, displacement=record.displacement + _MODE_SIZE * size * record.mode)


def _data_address(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


_MODELS = {
    "plane-strain": "plane strain, {thickness:g} mm thick",
    "plane-stress": "plane stress, {thickness:g} mm thick",
    "axisymmetric": "turned about the y axis",
}
_CELLS = {
    "tet10": "ten-node tetrahedra",
    "hex27": "27-node hexahedra",
    "tri6": "six-node triangles",
    "quad9": "nine-node quadrilaterals",
}


def _mesh_facts(body: Body) -> dict[str, Any]:
    mesh, section = body.mesh, body.section
    model = {} if section is None else {"Model": _MODELS[section.kind].format(thickness=section.thickness or 1.0)}
    measured = quality(mesh)
    jacobian, worst = measured.scaled_jacobian, measured.centres[measured.worst_cell].round(1).tolist()
    return {
        **model,
        "Elements": f"{mesh.n_cells} {_CELLS[mesh.cell_type]}",
        "Nodes": mesh.n_points,
        "Scaled Jacobian": f"at least {jacobian.min():.2f} (near {worst} mm), mean {jacobian.mean():.2f}",
        **({"Volume / mm³": mesh.volume()} if section is None else {"Area / mm²": mesh.volume()}),
        "Regions": ", ".join(mesh.regions),
        "Surfaces": ", ".join(mesh.surfaces) or "–",
        "Markers": ", ".join(mesh.markers) or "–",
    }


def _fit_section(fit: Mapping[str, Any] | None) -> dict[str, Any] | None:
    if fit is None:
        return None
    return {
        "rows": fit["fits"],
        "recommended": fit["recommended"],
        "reason": fit.get("reason"),
        "figure": _as_json(plots.stress_strain(fit)),
    }


def _round_up(value: float) -> float:
    """Round a positive number up to one with two significant digits; 1 where there is nothing to scale by."""
    if not math.isfinite(value) or value <= 0.0:
        return 1.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit * (1.0 - 1e-9)) * unit
