"""The report of a fit: data and what was cleaned, every model with its residuals, other modes, stability, the table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
import plotly.graph_objects as go
import yaml
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from turgor.materials.assessment import stability_map
from turgor.materials.fit_result import Fit, FitReport
from turgor.materials.kinematics import Array
from turgor.materials.least_squares import predict
from turgor.materials.measurement import MaterialTest
from turgor.materials.stability import STRETCHES
from turgor.results.files import write_text

FILE_NAME = "fit.html"

_MODES = ("uniaxial", "equibiaxial", "planar")
_POINTS = 160
_SHOWN_AT_FIRST = 4
_INK, _GRID, _GONE, _BAND = "#1d2733", "#dfe4ea", "#b3412e", "rgba(31, 111, 139, 0.18)"
_COLOURS = (
    "#1f6f8b", "#d98324", "#2e7d4f", "#8e4585", "#b3412e", "#5d6b7a", "#3f7fd1", "#a58b00",
    "#00838f", "#c2185b", "#6d4c41", "#7cb342",
)  # fmt: skip


@dataclass(frozen=True)
class Drawing:
    """A figure as JSON and its place in the page."""

    id: str
    figure: str


def write_fit_page(report: FitReport, path: str | Path) -> Path:
    """Write the self-contained page of a fit; return its path.

    Parameters
    ----------
    report
        The fits.
    path
        The HTML file.
    """
    page = (
        _environment()
        .get_template("fit_report.html")
        .render(
            plotly_js=get_plotlyjs(),
            report=report,
            tests=[test.as_dict() for test in report.tests],
            fits=report.fits,
            largest=report.largest_stress,
            drawings={
                "data": Drawing("data", _json(curves(report))),
                "residuals": Drawing("residuals", _json(residuals(report))),
                "modes": Drawing("modes", _json(other_modes(report))),
                "map": Drawing("map", _json(stability(report))) if report.recommended else None,
            },
            yaml=material_yaml(report) if report.recommended else "",
        )
    )
    target = Path(path)
    write_text(target, page)
    return target


def material_yaml(report: FitReport) -> str:
    """Return the lines that a case file takes for the recommended material.

    Raises
    ------
    InputError
        If the fit recommends none.
    """
    material = report.best
    constants = {
        constant.name: f"{value!r} {constant.unit}" if constant.unit else value
        for constant, value in zip(material.constants(), material.parameters.values(), strict=True)
    }
    volume = {"bulk_modulus": f"{material.bulk_modulus!r} MPa"} if report.measured_volume else {}
    return yaml.safe_dump({"model": material.file or material.name, "constants": constants, **volume}, sort_keys=False)


def curves(report: FitReport) -> go.Figure:
    """Draw the tests, the rows that were dropped, and every model's answer to each kind of test."""
    figure = _figure("engineering strain (or shear)", "nominal stress, MPa")
    for test in _mechanical(report):
        label = test.name or Path(test.file).stem or test.mode
        figure.add_scatter(
            x=test.deformation, y=test.stress, name=f"{label}, {test.mode}", mode="markers",
            marker={"size": 5, "color": _INK, "opacity": 0.45},
        )  # fmt: skip
        for part in test.dropped:
            figure.add_scatter(
                x=part.stretch - 1.0, y=part.stress, name=f"dropped: {part.reason} ({len(part.rows)})", mode="markers",
                marker={"symbol": "x", "size": 7, "color": _GONE},
            )  # fmt: skip
    for fit, colour, visible in _coloured(report):
        for i, test in enumerate(_one_of_each_mode(report)):
            x = _grid(test)
            figure.add_scatter(
                x=x.deformation, y=_response(fit, x), name=fit.model, legendgroup=fit.model, showlegend=i == 0,
                line={"color": colour, "dash": "dash" if fit.objections else "solid"}, visible=visible,
            )  # fmt: skip
    return figure


def residuals(report: FitReport) -> go.Figure:
    """Draw the residual of every model at the measured points."""
    figure = _figure("engineering strain (or shear)", "model − test, MPa")
    for fit, colour, visible in _coloured(report):
        for i, test in enumerate(_mechanical(report)):
            figure.add_scatter(
                x=test.deformation, y=_response(fit, test) - test.stress, name=fit.model, legendgroup=fit.model,
                showlegend=i == 0, line={"color": colour, "width": 1.2}, visible=visible,
            )  # fmt: skip
    return figure


def other_modes(report: FitReport) -> go.Figure:
    """Draw what the fits predict in the three modes, measured or not, with the band that the good ones span."""
    figure = make_subplots(1, len(_MODES), subplot_titles=list(_MODES), horizontal_spacing=0.06)
    _style(figure)
    top = max((float(np.max(_grid(test).stretch)) for test in _mechanical(report) if test.mode in _MODES), default=2.0)
    stretch = np.linspace(1.0, min(top, 4.0), _POINTS)
    for column, mode in enumerate(_MODES, 1):
        low, high = report.band(mode, stretch)
        figure.add_scatter(
            x=stretch - 1, y=low, line={"width": 0}, showlegend=False, hoverinfo="skip", row=1, col=column
        )
        figure.add_scatter(
            x=stretch - 1, y=high, line={"width": 0}, fill="tonexty", fillcolor=_BAND, name="good fits span",
            legendgroup="band", showlegend=column == 1, row=1, col=column,
        )  # fmt: skip
        asked = MaterialTest(mode, stretch, np.zeros_like(stretch))
        for fit, colour, visible in _coloured(report):
            figure.add_scatter(
                x=stretch - 1, y=_response(fit, asked), name=fit.model, legendgroup=fit.model, showlegend=column == 1,
                line={"color": colour, "dash": "dash" if fit.objections else "solid"}, visible=visible,
                row=1, col=column,
            )  # fmt: skip
        for test in (test for test in _mechanical(report) if test.mode == mode):
            figure.add_scatter(
                x=test.deformation, y=test.stress, mode="markers", marker={"size": 4, "color": _INK, "opacity": 0.4},
                name="measured", legendgroup="measured", showlegend=False, row=1, col=column,
            )  # fmt: skip
        inside = [value for value in (float(np.nanmax(high, initial=0.0)),) if np.isfinite(value) and value > 0]
        if inside:
            figure.update_yaxes(range=[0.0, min(1.1 * inside[0], 12.0 * report.largest_stress)], row=1, col=column)
    figure.update_xaxes(title="engineering strain")
    figure.update_yaxes(title="nominal stress, MPa", col=1)
    return figure


def stability(report: FitReport) -> go.Figure:
    """Draw Drucker's margin of the recommended material in the plane of two principal stretches."""
    axis, margin = stability_map(report.best)
    figure = _figure("stretch λ₁", "stretch λ₂")
    figure.add_contour(
        x=axis, y=axis, z=np.clip(margin, -1.0, 2.0), contours={"start": 0.0, "end": 2.0, "size": 0.5},
        colorscale=[[0.0, "#b3412e"], [1 / 3, "#f3d9d4"], [1 / 3, "#e3efe7"], [1.0, "#2e7d4f"]], zmin=-1.0, zmax=2.0,
        colorbar={"title": "margin / μ"}, name="",
    )  # fmt: skip
    for mode, second in (("uniaxial", axis**-0.5), ("equibiaxial", axis), ("planar", np.ones_like(axis))):
        figure.add_scatter(x=axis, y=second, name=mode, line={"color": _INK, "width": 1.2, "dash": "dot"})
    span = [np.log10(STRETCHES[0]), np.log10(STRETCHES[1])]
    figure.update_xaxes(type="log", range=span)
    figure.update_yaxes(type="log", range=span)
    return figure


def _mechanical(report: FitReport) -> list[MaterialTest]:
    return [test for test in report.tests if test.mode != "volumetric"]


def _one_of_each_mode(report: FitReport) -> list[MaterialTest]:
    """The widest test of each mode: models answer a mode, not a specimen."""
    widest: dict[str, MaterialTest] = {}
    for test in _mechanical(report):
        if test.mode not in widest or np.ptp(test.stretch) > np.ptp(widest[test.mode].stretch):
            widest[test.mode] = test
    return list(widest.values())


def _grid(test: MaterialTest) -> MaterialTest:
    rest = 0.0 if test.mode == "simple-shear" else 1.0
    stretch = np.linspace(min(rest, float(test.stretch.min())), float(test.stretch.max()), _POINTS)
    return MaterialTest(test.mode, stretch, np.zeros_like(stretch))


def _response(fit: Fit, test: MaterialTest) -> Array:
    if fit.material is None:
        return np.full_like(test.stretch, np.nan)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return predict(fit.material, test)


def _coloured(report: FitReport) -> list[tuple[Fit, str, bool | str]]:
    """The fits with a colour each; the recommended one and the closest are shown, the others wait in the legend."""
    first = [fit.model for fit in report.fits if not fit.objections][:_SHOWN_AT_FIRST]
    found = []
    for i, fit in enumerate(report.fits):
        shown = fit.model in first or fit.model == report.recommended
        found.append((fit, _COLOURS[i % len(_COLOURS)], True if shown else "legendonly"))
    return found


def _figure(x: str, y: str) -> go.Figure:
    figure = go.Figure()
    _style(figure)
    figure.update_xaxes(title=x)
    figure.update_yaxes(title=y)
    return figure


def _style(figure: go.Figure) -> None:
    figure.update_layout(
        template="none", height=460, margin={"l": 64, "r": 16, "t": 32, "b": 52},
        font={"family": "system-ui, sans-serif", "color": _INK}, legend={"font": {"size": 12}},
    )  # fmt: skip
    figure.update_xaxes(gridcolor=_GRID, zerolinecolor=_GRID)
    figure.update_yaxes(gridcolor=_GRID, zerolinecolor=_GRID)


def _json(figure: go.Figure) -> str:
    text: str = figure.to_json()
    return text


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["short"] = _short
    return environment


def _short(value: object, digits: int = 4) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)
