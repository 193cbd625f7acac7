"""The dimensioned drawing of a shape as a picture: its views to scale, with every parameter's name and value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from turgor.common.errors import InputError
from turgor.common.writing import writing
from turgor.geometry.actuator import Actuator
from turgor.geometry.drawing import AIR, OUTSIDE, Distance, Pointer, Turn, View, Window
from turgor.mesh.picture import check_png

WIDTH, _DPI = 11.0, 130
"""Of a drawing, in inches."""
_LINE, _FONT = 0.24, 8.5
_MARGIN, _TITLE = 0.35, 0.3
_TALLEST = 4.2
_BLACK, _BLUE = "#222222", "#1f4e8c"
_FILLS = {
    AIR: "#dbeaf7",
    OUTSIDE: "white",
    "base": "#c9b79c",
    "reinforcement": "#c78d6b",
    "outer-layer": "#aebbc9",
    "membrane": "#c9b79c",
    "plate": "#aebbc9",
}
_FILL = "#cfd6dd"
_ARROW = {"arrowstyle": "-|>,head_length=0.35,head_width=0.12", "color": _BLUE, "lw": 0.8, "shrinkA": 0, "shrinkB": 0}


def save_drawing(actuator: Actuator, path: str | Path, picture: Any = None) -> None:
    """Draw the views of an actuator, one under the other and each to a scale of its own, and save them as PNG.

    Parameters
    ----------
    actuator
        What to draw.
    path
        Ends in .png.
    picture
        An image ``(height, width, 3 or 4)`` to stand under the views.

    Raises
    ------
    InputError
        If the path does not end in .png or nothing can be written there, or the shape has no drawing.
    """
    views = actuator.views()
    check_png(path)
    if not views:
        raise InputError("this shape has no dimensioned drawing", value=actuator.template)
    layouts = [_Layout(view) for view in views]
    below = 0.0 if picture is None else WIDTH * picture.shape[0] / picture.shape[1]
    height = sum(layout.height for layout in layouts) + _TITLE + below
    figure = Figure(figsize=(WIDTH, height), dpi=_DPI)
    FigureCanvasAgg(figure)
    title = f"{actuator.template}, lengths in mm"
    figure.text(0.5, 1.0 - 0.5 * _TITLE / height, title, ha="center", va="center", size=11)
    top = height - _TITLE
    for layout in layouts:
        axes = figure.add_axes((0.0, (top - layout.height) / height, 1.0, layout.height / height))
        layout.draw(axes, actuator.shown())
        top -= layout.height
    if picture is not None:
        axes = figure.add_axes((0.0, 0.0, 1.0, below / height))
        axes.imshow(picture)
        axes.set_axis_off()
    with writing(path, "the picture cannot be written"):
        figure.savefig(path, facecolor="white")


class _Layout:
    """One view with its scale, in inches per mm, such that it and its marks fit the width."""

    def __init__(self, view: View) -> None:
        self.view = view
        left, right, bottom, top = view.window or _bounds([points for _, points in view.areas])
        below, above, before, after = _room(view)
        self.scale = min((WIDTH - before - after) / (right - left), _TALLEST / (top - bottom))
        self.height = (top - bottom) * self.scale + below + above + _TITLE
        spare = 0.5 * (WIDTH - before - after - (right - left) * self.scale)
        self.window: Window = (left, right, bottom, top)
        self.limits: Window = (
            left - (before + spare) / self.scale,
            right + (after + spare) / self.scale,
            bottom - below / self.scale,
            top + (above + _TITLE) / self.scale,
        )

    def draw(self, axes: Any, values: dict[str, str]) -> None:
        axes.set_xlim(self.limits[:2])
        axes.set_ylim(self.limits[2:])
        axes.set_axis_off()
        for region, points in self.view.areas:
            self._clipped(axes, axes.fill(*points.T, facecolor=_FILLS.get(region, _FILL), edgecolor=_BLACK, lw=0.9))
        for line in self.view.lines:
            self._clipped(axes, axes.plot(*line.T, color="#777777", lw=0.8, ls=(0, (8, 2, 2, 2))))
        for line in self.view.fibres:
            self._clipped(axes, axes.plot(*line.T, color="#8b1a1a", lw=1.3))
        axes.text(
            0.01, 1.0 - 0.5 * _TITLE / self.height, self.view.title, transform=axes.transAxes, size=9.5, weight="bold"
        )
        for text, place in self.view.notes.items():
            axes.text(*place, text, size=_FONT, color="#555555", style="italic", ha="center", va="center")
        for mark in self.view.marks:
            text = f"{mark.name} = {values[mark.name]}"
            if isinstance(mark, Distance):
                self._distance(axes, mark, text)
            elif isinstance(mark, Pointer):
                self._pointer(axes, mark, text)
            else:
                self._turn(axes, mark, text)

    def _clipped(self, axes: Any, artists: Sequence[Any]) -> None:
        left, right, bottom, top = self.window
        if self.view.window is None:
            return
        for artist in artists:
            artist.set_clip_path(_frame(axes, left, right, bottom, top))

    def _distance(self, axes: Any, mark: Distance, text: str) -> None:
        start, end = np.array(mark.start), np.array(mark.end)
        direction = (end - start) / np.linalg.norm(end - start)
        side = math.copysign(1.0, mark.level or 1.0) * np.array([-direction[1], direction[0]])
        away = abs(mark.level) * _LINE / self.scale * side
        line = {"color": _BLUE, "lw": 0.5}
        for place in (start, end):
            if mark.level:
                axes.plot(*np.array([place, place + away + 0.05 / self.scale * side]).T, **line)
        a, b = start + away, end + away
        if np.linalg.norm(end - start) * self.scale > 0.3:
            axes.annotate("", a, b, arrowprops={**_ARROW, "arrowstyle": "<|-|>,head_length=0.35,head_width=0.12"})
        else:
            axes.plot(*np.array([a, b]).T, **line)
            for tip, sense in ((a, -1.0), (b, 1.0)):
                axes.annotate("", tip, tip + sense * 0.2 / self.scale * direction, arrowprops=_ARROW)
        self._text(axes, 0.5 * (a + b), side, text, 0.05)

    def _pointer(self, axes: Any, mark: Pointer, text: str) -> None:
        way = np.array([math.cos(math.radians(mark.angle)), math.sin(math.radians(mark.angle))])
        foot = np.array(mark.place) + mark.level * _LINE / self.scale * way
        axes.annotate("", mark.place, foot, arrowprops=_ARROW)
        self._text(axes, foot, way, text, 0.03)

    def _turn(self, axes: Any, mark: Turn, text: str) -> None:
        corner = np.array(mark.corner)
        angle = np.linspace(mark.start, mark.end, 40)
        arc = corner + mark.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        axes.plot(*arc.T, color=_BLUE, lw=0.9)
        for turn in (mark.start, mark.end):
            reach = corner + 1.15 * mark.radius * np.array([math.cos(turn), math.sin(turn)])
            axes.plot(*np.array([corner, reach]).T, color=_BLUE, lw=0.5)
        middle = 0.5 * (mark.start + mark.end)
        self._text(axes, arc[20], np.array([math.cos(middle), math.sin(middle)]), text, 0.06)

    def _text(self, axes: Any, place: Any, side: Any, text: str, gap: float) -> None:
        across = abs(side[0]) > 0.5
        horizontal = ("left" if side[0] > 0 else "right") if across else "center"
        vertical = "center" if across else ("bottom" if side[1] > 0 else "top")
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8}
        axes.text(
            *(place + gap / self.scale * side),
            text,
            size=_FONT,
            color=_BLUE,
            ha=horizontal,
            va=vertical,
            bbox=box,
            zorder=5,
        )


def _bounds(outlines: Sequence[Any]) -> Window:
    points = np.vstack(outlines)
    (left, bottom), (right, top) = points.min(axis=0), points.max(axis=0)
    return float(left), float(right), float(bottom), float(top)


def _room(view: View) -> tuple[float, float, float, float]:
    """Return the inches that marks need below, above, left and right of what is drawn."""
    room = np.full(4, _MARGIN)
    for mark in view.marks:
        if isinstance(mark, Distance) and mark.level:
            run = np.subtract(mark.end, mark.start)
            side = math.copysign(1.0, mark.level) * np.array([-run[1], run[0]]) / np.linalg.norm(run)
            _widen(room, side, _LINE * (abs(mark.level) + 1.2))
        elif isinstance(mark, Pointer):
            angle = math.radians(mark.angle)
            _widen(room, np.array([math.cos(angle), math.sin(angle)]), _LINE * (mark.level + 1.2))
    # Beside a view stands text as wide as a name with its value.
    room[2:] = np.where(room[2:] > _MARGIN, room[2:] + 1.5, 1.0)
    return tuple(room)


def _widen(room: Any, side: Any, length: float) -> None:
    for place, reach in enumerate((-side[1], side[1], -side[0], side[0])):
        if reach > 0.5:
            room[place] = max(room[place], length)


def _frame(axes: Any, left: float, right: float, bottom: float, top: float) -> Any:
    frame = Rectangle((left, bottom), right - left, top - bottom, transform=axes.transData, fill=False, lw=0)
    axes.add_patch(frame)
    return frame
