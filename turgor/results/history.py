"""The history of a run: one row of plain numbers a step, every key ending in its unit."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence

from turgor.common.units import from_internal
from turgor.mesh.mesh import Mesh
from turgor.results.archive import Row
from turgor.results.measures import evaluate, max_displacement
from turgor.results.record import SOLVER_FACTS, StepRecord

PRESSURE_PREFIX = "pressure:"
"""A load ``pressure:<cavity>`` is the pressure in that cavity in MPa; other loads are dimensionless factors."""


def row(record: StepRecord, mesh: Mesh, measures: Iterable[str]) -> Row:
    """Return the row of a step.

    ``pressure_kPa`` is the pressure of largest size and ``cavity_volume_mm3`` the volume of all cavities; where there
    are several cavities each also has its own columns.

    Parameters
    ----------
    record
        The step.
    mesh
        Its mesh.
    measures
        Names of the measures to include.

    Raises
    ------
    InputError
        If a measure is unknown or the mesh lacks what it needs.
    """
    motion = evaluate(measures, mesh, record.displacement)
    return {
        "step": record.index,
        "fraction": float(record.fraction),
        **_loads(record.loads),
        "max_displacement_mm": max_displacement(record.displacement),
        "max_von_mises_MPa": float(record.von_mises_max),
        "von_mises_p99_MPa": float(record.von_mises_p99),
        **_volumes(record.cavity_volumes),
        **motion,
        **{fact: record.solver[fact] for fact in SOLVER_FACTS},
    }


def as_csv(rows: Sequence[Row]) -> str:
    """Return the rows as CSV text; numbers are written so that reading them back gives the same number."""
    columns = list(dict.fromkeys(key for entry in rows for key in entry))
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: _text(value) for key, value in entry.items()} for entry in rows)
    return stream.getvalue()


def _loads(loads: Mapping[str, float]) -> Row:
    pressures = {
        name.removeprefix(PRESSURE_PREFIX): from_internal(value, "pressure", "kPa")
        for name, value in loads.items()
        if name.startswith(PRESSURE_PREFIX)
    }
    columns: Row = {"pressure_kPa": max(pressures.values(), key=abs)} if pressures else {}
    if len(pressures) > 1:
        columns |= {f"pressure_{name}_kPa": value for name, value in pressures.items()}
    others = {name: value for name, value in loads.items() if not name.startswith(PRESSURE_PREFIX)}
    return columns | {f"{name.replace(':', '_')}_factor": float(value) for name, value in others.items()}


def _volumes(volumes: Mapping[str, float]) -> Row:
    columns: Row = {"cavity_volume_mm3": float(sum(volumes.values()))} if volumes else {}
    if len(volumes) > 1:
        columns |= {f"volume_{name}_mm3": float(value) for name, value in volumes.items()}
    return columns


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)
