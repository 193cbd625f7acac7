"""Interactive figures of what only some runs have: contact, fibres and interfaces over the load, and centrelines."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.colors import sample_colorscale

from turgor.results.archive import Row
from turgor.results.plots import COLORSCALE, COLUMNS, HEIGHT, SERIES, Quantity, finish, line_trace, load_axis, panels

_KINDS = (
    ("Contact", "contact_", "_force_N", "Force / N"),
    ("Contact", "contact_", "_overlap_per_wall", "Overlap in parts of the wall"),
    ("Contact", "contact_", "_gap_per_wall", "Smallest gap in parts of the wall"),
    ("Contact", "contact_", "_displacement_mm", "Displacement of the body / mm"),
    ("Contact", "contact_", "_area_mm2", "Area in contact / mm²"),
    ("Fibres", "fibre_", "largest_tension_N", "Largest tension / N"),
    ("Fibres", "fibre_", "largest_strain", "Largest strain"),
    ("Fibres", "fibre_", "largest_moment_N_mm", "Largest bending moment / N mm"),
    ("Interfaces", "interface_", "_traction_max_MPa", "Largest traction / MPa"),
    ("Interfaces", "interface_", "_traction_mean_MPa", "Mean traction / MPa"),
)
"""Section of the report, how the keys of its columns begin and end, and the axis that they share."""

MOST_LINES = 8


def groups(history: Sequence[Row]) -> dict[str, dict[str, list[tuple[str, str]]]]:
    """Return the columns that have a figure: section → axis title → (key, name of the line).

    Of many lines with one axis those that end highest; none of what no state knows.
    """
    found: dict[str, dict[str, list[tuple[str, str]]]] = {}
    columns = {key: value for key, value in history[-1].items() if any(row.get(key) is not None for row in history)}
    for section, begin, end, title in _KINDS:
        keys = [key for key in columns if key.startswith(begin) and key.endswith(end)]
        lines = [(key, key.removeprefix(begin).removesuffix(end).strip("_") or "all") for key in keys]
        if lines:
            highest = sorted(lines, key=lambda line: -abs(columns[line[0]] or 0.0))[:MOST_LINES]
            found.setdefault(section, {})[title] = [line for line in lines if line in highest]
    return found


def all_zero(history: Sequence[Row], axes: Mapping[str, Sequence[tuple[str, str]]]) -> bool:
    """Say whether all the columns of a section are zero in every state."""
    return not any(row.get(key) for row in history for lines in axes.values() for key, _ in lines)


def over_load(history: Sequence[Row], axes: Mapping[str, Sequence[tuple[str, str]]]) -> go.Figure:
    """Return one diagram over the load for each axis title, with a line for each of its columns.

    Parameters
    ----------
    history
        Rows of the history, at least one.
    axes
        Axis title → key of a column and name of its line.
    """
    load = load_axis(history)
    rows = -(-len(axes) // COLUMNS)
    figure = panels(rows, HEIGHT)
    loads = [entry[load.key] for entry in history]
    symbols = ["circle-open" if entry.get("stable") is False else "circle" for entry in history]
    for place, (title, lines) in enumerate(axes.items()):
        at = {"row": place // COLUMNS + 1, "col": place % COLUMNS + 1}
        for (key, name), color in zip(lines, itertools.cycle(SERIES)):
            values = [entry.get(key) for entry in history]
            trace = line_trace(loads, values, symbols, color, name=name, legend=place == 0 and len(lines) > 1)
            figure.add_trace(trace, **at)
        figure.update_xaxes(title_text=load.title, **at)
        figure.update_yaxes(title_text=title, **at)
    finish(figure, height=HEIGHT * rows)
    return figure


def over_displacement(history: Sequence[Row]) -> go.Figure | None:
    """Return the force on each rigid body that moves or is on a spring over its displacement; ``None``: there is none.

    Parameters
    ----------
    history
        Rows of the history, at least one.
    """
    ends = ("_displacement_mm", "_force_N")
    names = [key.removesuffix(ends[0]) for key in history[-1] if key.startswith("contact_") and key.endswith(ends[0])]
    if not names:
        return None
    figure = go.Figure()
    for name, color in zip(names[:MOST_LINES], itertools.cycle(SERIES)):
        # The row of rest knows nothing of contact: nothing has moved there.
        moved, force = ([entry.get(name + end, 0.0) for entry in history] for end in ends)
        symbols = ["circle-open" if entry.get("stable") is False else "circle" for entry in history]
        label = name.removeprefix("contact_")
        figure.add_trace(line_trace(moved, force, symbols, color, name=label, legend=len(names) > 1))
    figure.update_xaxes(title_text="Displacement of the body / mm")
    figure.update_yaxes(title_text="Force / N")
    finish(figure, height=360)
    return figure


def line(rows: Sequence[Row]) -> go.Figure:
    """Return a line in space over the load: two views of it, its curvature and its torsion along its length.

    Parameters
    ----------
    rows
        Rows of a curve, of all steps; at least one.
    """
    places = np.array([[row[f"{axis}_mm"] for axis in "xyz"] for row in rows])
    across, up, depth = _views(places)
    shown = [(across, up), (depth, up), ("s", "curvature"), ("s", "torsion")]
    if np.ptp(places[:, "xyz".index(depth)]) == 0.0:
        shown = [(across, up), ("s", "curvature")]
    height = -(-len(shown) // COLUMNS)
    figure = panels(height, _LINE_HEIGHT)
    steps = [list(group) for _, group in itertools.groupby(rows, key=lambda row: row["step"])]
    load = load_axis(rows)
    for (first, second), place in zip(shown, itertools.count()):
        at = {"row": place // COLUMNS + 1, "col": place % COLUMNS + 1}
        for number, step in enumerate(steps):
            shade = sample_colorscale(COLORSCALE, [0.9 * (1.0 - number / max(1, len(steps) - 1))])[0]
            name = _told(load, step[0][load.key])
            x, y = ([row[_KEYS[what]] for row in step] for what in (first, second))
            figure.add_trace(line_trace(x, y, ["circle"] * len(x), shade, name=name, legend=place == 0), **at)
        figure.update_xaxes(title_text=_TITLES[first], **at)
        figure.update_yaxes(title_text=_TITLES[second], **at)
    finish(figure, height=_LINE_HEIGHT * height)
    figure.update_traces(marker={"size": 4})
    return figure


def _told(load: Quantity, value: float) -> str:
    """Write a load with its unit, or its name if it has none."""
    name, _, unit = load.title.partition(" / ")
    return f"{value:.4g} {unit}" if unit else f"{name} {value:.4g}"


_LINE_HEIGHT = 420

_KEYS = {axis: f"{axis}_mm" for axis in "sxyz"} | {"curvature": "curvature_per_mm", "torsion": "torsion_per_mm"}
_TITLES = {axis: f"{axis} / mm" for axis in "xyz"} | {
    "s": "Length along the line / mm",
    "curvature": "Curvature / (1/mm)",
    "torsion": "Torsion / (1/mm)",
}


def _views(places: np.ndarray) -> tuple[str, str, str]:
    """Return the axes to draw to the right, up, and to the right in the second view: least extent last; z or y up."""
    order = [int(axis) for axis in np.argsort(-np.ptp(places, axis=0))]
    depth = order[-1]
    up = 1 if depth == 2 else 2
    return "xyz"[3 - up - depth], "xyz"[up], "xyz"[depth]
