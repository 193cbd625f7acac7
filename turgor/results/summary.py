"""The summary of a run: what ``summary.json`` holds and ``turgor run --json`` prints."""

from __future__ import annotations

import importlib.metadata
import platform
from collections.abc import Mapping, Sequence
from typing import Any

from turgor.common.errors import InputError
from turgor.mesh.mesh import Mesh
from turgor.results.archive import Row
from turgor.results.files import json_text
from turgor.results.record import SOLVER_FACTS

Summary = dict[str, Any]

KEYS: dict[str, tuple[str, ...]] = {
    "converged": (),
    "reason": (),
    "outcome": (),
    "final": (),
    "mesh": ("elements", "nodes", "dofs"),
    "solver": ("steps", "iterations", "factorisations", "wall_s", "peak_memory_MB", "stable"),
    "versions": (),
}
"""The keys of a summary and what at least lies under them."""

_PACKAGES = ("turgor", "numpy", "scipy", "numba", "mkl", "gmsh", "meshio")
_NOT_FINAL = {"step", "fraction", "event", *SOLVER_FACTS}
_PLACES = ("time_s", "cavity_volume_mm3", "stable")
_TIP = tuple(f"tip_displacement_{axis}_mm" for axis in "xyz")


def summarise(
    history: Sequence[Row],
    mesh: Mesh,
    *,
    converged: bool,
    reason: str,
    outcome: str | None = None,
    dofs: int,
    wall_s: float,
    peak_memory_mb: float,
    warnings: Sequence[str] = (),
) -> Summary:
    """Return the summary of a run.

    Parameters
    ----------
    history
        The rows of the steps that were reached.
    mesh
        The mesh of the run.
    converged
        Whether the target was reached.
    reason
        Why the run ended, in words.
    outcome
        The same as one of a few words (``docs/results.md``); left out, by `converged`.
    dofs
        Free degrees of freedom.
    wall_s
        Duration of the whole run in s, of all its parts where it was resumed.
    peak_memory_mb
        Largest resident memory in MB, of any part.
    warnings
        What the run warned of, in sentences.
    """
    final = {key: value for key, value in history[-1].items() if key not in _NOT_FINAL} if history else {}
    if all(key in final for key in _TIP):
        final["tip_displacement_mm"] = [final.pop(key) for key in _TIP]
    return {
        "converged": converged,
        "reason": reason,
        "outcome": outcome or ("target-reached" if converged else "not-converged"),
        "final": final,
        "mesh": {"elements": mesh.n_cells, "nodes": mesh.n_points, "dofs": dofs},
        "solver": {
            "steps": len(history),
            "iterations": sum(entry["iterations"] for entry in history),
            "factorisations": sum(entry["factorisations"] for entry in history),
            "wall_s": wall_s,
            "peak_memory_MB": peak_memory_mb,
            "stable": history[-1]["stable"] if history else None,
        },
        "versions": versions(),
        **({"events": events} if (events := [_event(entry) for entry in history if entry.get("event")]) else {}),
        **({"warnings": list(warnings)} if warnings else {}),
    }


def _event(entry: Row) -> Row:
    """Return what a special state is, where it is, and its step, whose file holds its mode."""
    places = [key for key in entry if key in _PLACES or (key.startswith("pressure_") and key.endswith("_kPa"))]
    return {"event": entry["event"], "step": entry["step"]} | {key: entry[key] for key in places}


def versions() -> dict[str, str]:
    """Return the versions of Turgor, Python and the packages that results depend on."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def as_json(summary: Mapping[str, Any]) -> str:
    """Return the summary as strict JSON text, numbers that are not finite as ``null``.

    Raises
    ------
    InputError
        If a key of the contract is missing.
    """
    for key, inner in KEYS.items():
        missing = [key] if key not in summary else [f"{key}.{name}" for name in inner if name not in summary[key]]
        if missing:
            raise InputError("the summary is incomplete", key=missing[0])
    return json_text(summary)
