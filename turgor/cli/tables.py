"""Tables of the commands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.table import Table

import turgor as tg

if TYPE_CHECKING:
    from turgor.geometry.actuator import Actuator
    from turgor.materials.fit_result import FitReport
    from turgor.materials.library import LibraryEntry


def pairs(title: str, facts: Mapping[str, Any]) -> Table:
    """Return a table of keys and values; inner mappings are spread out under their key."""
    table = _table(title, "", "")
    for key, value in _flat(facts):
        table.add_row(key, _text(value))
    return table


def final(summary: Mapping[str, Any], folder: Path) -> Table:
    """Return what a run came to."""
    facts = {
        **summary["final"],
        **summary["mesh"],
        "wall_s": summary["solver"]["wall_s"],
        "report": folder / "report.html",
    }
    return pairs("reached" if summary["converged"] else "stopped short", facts)


def fits(report: FitReport) -> Table:
    """Return the fits, best first, the recommended one marked."""
    table = _table("", "", "model", "RMSE / MPa", "R²", "stable", "constants")
    for entry in report.fits:
        mark = "→" if entry.model == report.recommended else ""
        constants = ", ".join(
            f"{name} = {value:.5g} {entry.units[name]}".rstrip() for name, value in entry.parameters.items()
        )
        stability = "yes" if entry.stable else "no"
        table.add_row(mark, entry.model, f"{entry.rmse:.4g}", f"{entry.r2:.5f}", stability, constants)
    table.caption, table.caption_justify = report.reason, "left"
    return table


def library(entries: Iterable[LibraryEntry]) -> Table:
    """Return the published materials, one a row."""
    table = _table("", "name", "model", "μ / MPa", "at 100 % / MPa", "stability", "source")
    for entry in entries:
        mu = f"{entry.build.shear_modulus:.3g}"
        stress = f"{entry.stress_at_100_percent:.3g}"
        table.add_row(entry.name, entry.model, mu, stress, str(entry.verdict), entry.source)
    return table


def templates(known: Iterable[type[Actuator]]) -> Table:
    """Return the templates with the first line of what they say of themselves."""
    table = _table("", "template", "parameters", "shape")
    for template in known:
        shape = (template.__doc__ or "").strip().splitlines()[0]
        table.add_row(template.template, str(len(template.parameters())), shape)
    return table


def parameters(template: type[Actuator]) -> Table:
    """Return the parameters of one template."""
    table = _table(template.template, "parameter", "default", "bounds", "meaning", "source of the default")
    for entry in template.parameters():
        table.add_row(entry.name, entry.default, entry.bounds, entry.meaning, entry.source)
    return table


def template_document(template: type[Actuator]) -> dict[str, Any]:
    """Return one template in plain values."""
    return {
        "template": template.template,
        "description": (template.__doc__ or "").strip(),
        "parameters": [vars(entry) for entry in template.parameters()],
    }


def mesh_document(mesh: tg.Mesh, path: Path) -> dict[str, Any]:
    """Return what a mesh is made of and how good it is, in plain values."""
    walls = tg.mesh_walls(mesh)
    return {
        "file": str(path),
        "elements": mesh.n_cells,
        "nodes": mesh.n_points,
        "volume_mm3" if mesh.dimension == 3 else "area_mm2": mesh.volume(),
        "regions": {name: len(cells) for name, cells in mesh.regions.items()},
        "surfaces": {name: len(triangles) for name, triangles in mesh.surfaces.items()},
        "markers": {name: len(nodes) for name, nodes in mesh.markers.items()},
        "quality": tg.mesh_quality(mesh).summary(),
        **({"walls": walls.summary()} if walls else {}),
    }


def environment(found: Mapping[str, Any]) -> Table:
    """Return what Turgor stands on."""
    return pairs("environment", {key: value for key, value in found.items() if key != "missing"})


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title or None, title_justify="left", box=box.SIMPLE_HEAD, show_header=any(columns))
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _flat(facts: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    for key, value in facts.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(entry) for entry in value)
    return str(value)
