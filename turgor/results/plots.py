"""Interactive figures of a run, made with plotly; each function returns a figure and draws nothing."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from turgor.results.archive import Row
from turgor.results.camera import Camera, FloatArray

ACCENT = "#1f6f8b"
INK = "#1d2733"
SERIES = ("#1f6f8b", "#c8553d", "#588157", "#7b5ea7", "#d99a2b", "#4c78a8", "#9d5c63", "#3a3a3a")
"""Line colours, told apart also on paper."""

COLORSCALE = "Viridis"


@dataclass(frozen=True)
class Quantity:
    """A column of the history as an axis: its title, and the unit it is shown in."""

    key: str
    title: str


_TIP = Quantity("tip_displacement_mm", "Tip displacement / mm")

MOTION = (
    Quantity("bending_angle_deg", "Bending angle / °"),
    Quantity("chord_angle_deg", "Chord angle / °"),
    _TIP,
    Quantity("twist_deg", "Twist / °"),
    Quantity("elongation_mm", "Elongation / mm"),
    Quantity("max_displacement_mm", "Largest displacement / mm"),
    Quantity("tip_force_N", "Tip force / N"),
    Quantity("cavity_volume_mm3", "Cavity volume / mm³"),
    Quantity("max_von_mises_MPa", "Largest von Mises / MPa"),
)
"""What the load–motion curves show, most telling first."""

_TIME = Quantity("time_s", "Time / s")
_PRESSURE = Quantity("pressure_kPa", "Pressure / kPa")
_VOLUME = Quantity("cavity_volume_mm3", "Cavity volume / mm³")
_LOAD = (_TIME, _PRESSURE, Quantity("fraction", "Load parameter"))
_COMPONENTS = tuple((axis, f"tip_displacement_{axis}_mm") for axis in "xyz")
_ANGLES = ("bending_angle_deg", "twist_deg")
_NEGLIGIBLE_ANGLE_DEG, _NEGLIGIBLE_SHARE = 0.1, 1e-3

_SCENE_FILL = 0.8
"""Units of plotly's orthographic scene, of which two make its height, that half of the body's height takes up."""


COLUMNS, HEIGHT = 2, 340
"""Diagrams side by side, and the height of one with its titles in pixels."""

_ABOVE, _BELOW, _BETWEEN = 48, 60, 96
"""Pixels above, below and between diagrams: room for the title of an axis and for a legend."""


def panels(rows: int, height: int) -> go.Figure:
    """Return rows of empty diagrams, two in each, every one with its titles `height` pixels high."""
    between = _BETWEEN / (rows * height - _ABOVE - _BELOW)
    return make_subplots(rows=rows, cols=COLUMNS, horizontal_spacing=0.11, vertical_spacing=between)


def load_axis(history: Sequence[Row]) -> Quantity:
    """Return what the load is told by: the time of a programme, else the pressure or the load parameter."""
    return next(quantity for quantity in _LOAD if all(quantity.key in entry for entry in history))


def load_motion(history: Sequence[Row]) -> go.Figure:
    """Return the load–motion curves: each quantity of :data:`MOTION` that the run has, over the load.

    Where the pressure follows a programme it is shown over time, and where it falls on the way, over the volume.

    Parameters
    ----------
    history
        Rows of the history, at least one; a state that is not stable has an open marker. Angles that are only noise
        are left out.
    """
    load = load_axis(history)
    shown = [quantity for quantity in MOTION if _is_worth_showing(quantity.key, history)]
    curves = [*_pressure_curve(load, history), *((load, quantity) for quantity in shown)]
    rows = -(-len(curves) // COLUMNS)
    figure = panels(rows, HEIGHT)
    for place, (axis, quantity) in enumerate(curves):
        row, column = divmod(place, COLUMNS)
        for trace in _traces(quantity, [entry[axis.key] for entry in history], history):
            figure.add_trace(trace, row=row + 1, col=column + 1)
        figure.update_xaxes(title_text=axis.title, row=row + 1, col=column + 1)
        figure.update_yaxes(title_text=quantity.title, row=row + 1, col=column + 1)
    finish(figure, height=HEIGHT * rows)
    if _TIP in shown:
        row, column = divmod(curves.index((load, _TIP)), COLUMNS)
        corner = figure.get_subplot(row + 1, column + 1)
        figure.update_layout(legend={"x": corner.xaxis.domain[0], "y": corner.yaxis.domain[1]})
    return figure


def _pressure_curve(load: Quantity, history: Sequence[Row]) -> list[tuple[Quantity, Quantity]]:
    """Return the axes of a curve of the pressure itself, where that tells something: at most one."""
    if not all(_PRESSURE.key in entry for entry in history):
        return []
    if load == _TIME:
        return [(_TIME, _PRESSURE)]
    sizes = [abs(float(entry[_PRESSURE.key])) for entry in history]
    falls = any(later < (1.0 - _NEGLIGIBLE_SHARE) * earlier for earlier, later in itertools.pairwise(sizes))
    falls = falls or any(entry.get("event") for entry in history)
    return [(_VOLUME, _PRESSURE)] if falls and all(_VOLUME.key in entry for entry in history) else []


def _is_worth_showing(key: str, history: Sequence[Row]) -> bool:
    if key == _TIP.key:
        return all(component in entry for entry in history for _, component in _COMPONENTS)
    if not all(key in entry for entry in history):
        return False
    if key == "max_displacement_mm":
        return not _is_worth_showing(_TIP.key, history)
    return key not in _ANGLES or turns(key, history)


def turns(key: str, history: Sequence[Row]) -> bool:
    """Say whether the run has the angle `key` and it is more than noise, by itself and beside the other angle.

    A tube that only grows has angles of some thousandths of a degree from its mesh, which is not symmetric.
    """
    found = {angle: _largest(angle, history) for angle in _ANGLES if all(angle in entry for entry in history)}
    return found.get(key, 0.0) > max(_NEGLIGIBLE_ANGLE_DEG, _NEGLIGIBLE_SHARE * max(found.values(), default=0.0))


def _largest(key: str, history: Sequence[Row]) -> float:
    return max(abs(float(entry[key])) for entry in history)


def _traces(quantity: Quantity, loads: Sequence[float], history: Sequence[Row]) -> list[go.Scatter]:
    symbols = ["circle-open" if entry.get("stable") is False else "circle" for entry in history]
    cavities = [key for key in history[0] if key.startswith("pressure_") and key != _PRESSURE.key]
    if quantity == _PRESSURE and cavities:
        names = {key: key.removeprefix("pressure_").removesuffix("_kPa") for key in cavities}
        return [
            line_trace(loads, [entry[key] for entry in history], symbols, color, name=names[key], legend=False)
            for key, color in zip(cavities, itertools.cycle(SERIES), strict=False)
        ]
    if quantity != _TIP:
        values = [entry[quantity.key] for entry in history]
        return [line_trace(loads, values, symbols, ACCENT, name=quantity.title, legend=False)]
    return [
        line_trace(loads, [entry[key] for entry in history], symbols, color, name=f"tip, {axis}", legend=True)
        for (axis, key), color in zip(_COMPONENTS, SERIES, strict=False)
    ]


def line_trace(
    x: Sequence[float], y: Sequence[float | None], symbols: Sequence[str], color: str, *, name: str, legend: bool
) -> go.Scatter:
    """Return a line with a marker at each state."""
    return go.Scatter(
        x=list(x),
        y=list(y),
        name=name,
        mode="lines+markers",
        line={"color": color, "width": 2},
        marker={"symbol": list(symbols), "size": 7},
        showlegend=legend,
        hovertemplate="%{x:.4g} · %{y:.5g}<extra>" + name + "</extra>",
    )


def stress_strain(fit: Mapping[str, Any]) -> go.Figure:
    """Return the test data and every fitted curve that the fit brings.

    Parameters
    ----------
    fit
        What ``turgor fit --json`` prints, with ``data.strain`` and ``data.stress_MPa`` (equal lengths) and, in each of
        ``fits``, ``curve.strain`` and ``curve.stress_MPa``.
    """
    figure = go.Figure()
    data = fit["data"]
    if "strain" in data and "stress_MPa" in data:
        figure.add_trace(
            go.Scatter(
                x=list(data["strain"]),
                y=list(data["stress_MPa"]),
                name="test",
                mode="markers",
                marker={"color": INK, "size": 6, "symbol": "circle-open"},
                hovertemplate="%{x:.4g} · %{y:.5g} MPa<extra>test</extra>",
            )
        )
    for number, entry in enumerate(one for one in fit["fits"] if "curve" in one):
        chosen = entry["model"] == fit["recommended"]
        figure.add_trace(
            go.Scatter(
                x=list(entry["curve"]["strain"]),
                y=list(entry["curve"]["stress_MPa"]),
                name=entry["model"] + (" (recommended)" if chosen else ""),
                mode="lines",
                line={"color": SERIES[number % len(SERIES)], "width": 3 if chosen else 1.5},
                hovertemplate="%{x:.4g} · %{y:.5g} MPa<extra>" + str(entry["model"]) + "</extra>",
            )
        )
    figure.update_xaxes(title_text="Nominal strain")
    figure.update_yaxes(title_text="Nominal stress / MPa")
    finish(figure, height=420)
    return figure


def body_scene(low: FloatArray, high: FloatArray, camera: Camera, scale_max: float) -> go.Figure:
    """Return an empty 3-D scene for a stressed body: axes, camera and colour scale; its one mesh has no nodes yet.

    Parameters
    ----------
    low, high
        Corners of the box that holds every state, shape ``(3,)``, mm.
    camera
        From where to look first.
    scale_max
        von Mises stress in MPa at the upper end of the colour scale.
    """
    body = go.Mesh3d(
        x=[],
        y=[],
        z=[],
        cmin=0.0,
        cmax=scale_max,
        colorscale=COLORSCALE,
        colorbar={"title": {"text": "von Mises stress / MPa", "side": "right"}, "thickness": 16, "len": 0.75, "x": 1.0},
        hoverinfo="skip",
        lighting={"ambient": 0.75, "diffuse": 0.45, "specular": 0.08, "roughness": 0.8},
        lightposition={"x": 2000.0, "y": -4000.0, "z": 6000.0},
    )
    size = high - low
    margin = 0.03 * float(size.max())
    axes = {
        f"{name}axis": {
            "title": {"text": f"{name} / mm", "font": {"size": 12}},
            "tickfont": {"size": 10},
            "range": [float(low[number]) - margin, float(high[number]) + margin],
            "backgroundcolor": "#f6f8fa",
            "gridcolor": "#dfe4ea",
            "nticks": max(2, round(5 * float(size[number] / size.max()))),
        }
        for number, name in enumerate("xyz")
    }
    ratio = (size + 2.0 * margin) * _SCENE_FILL / camera.half_height
    eye = {name: float(2.0 * camera.towards[number]) for number, name in enumerate("xyz")}
    up = {name: float(round(camera.up[number])) for number, name in enumerate("xyz")}
    scene = {
        **axes,
        "aspectmode": "manual",
        "aspectratio": {name: float(ratio[number]) for number, name in enumerate("xyz")},
        "camera": {"eye": eye, "up": up, "projection": {"type": "orthographic"}},
    }
    figure = go.Figure(body)
    figure.update_layout(scene=scene)
    finish(figure, height=560)
    figure.update_layout(margin={"l": 0, "r": 0, "t": 0, "b": 0})
    return figure


def finish(figure: go.Figure, height: int) -> None:
    """Give a figure its height, fonts and axes."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 70, "r": 20, "t": _ABOVE, "b": _BELOW},
        font={"family": "system-ui, sans-serif", "size": 13, "color": INK},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0, "xanchor": "left"},
    )
    figure.update_xaxes(rangemode="tozero", showline=True, linecolor="#b8c0ca", ticks="outside", tickcolor="#b8c0ca")
    figure.update_yaxes(showline=True, linecolor="#b8c0ca", ticks="outside", tickcolor="#b8c0ca")
