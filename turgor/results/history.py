"""The history of a run: one row of plain numbers a step, every key ending in its unit."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from turgor.common.names import PRESSURE_PREFIX
from turgor.common.units import from_internal
from turgor.results.archive import Row
from turgor.results.measures import Choice, evaluate
from turgor.results.measures.motion import max_displacement
from turgor.results.record import SOLVER_FACTS
from turgor.results.stored import StoredState


def row(state: StoredState, measures: Iterable[Choice]) -> Row:
    """Return the row of a step.

    ``pressure_kPa`` is the pressure of largest size and ``cavity_volume_mm3`` the volume of all cavities under
    pressure; where there are several of them each also has its own columns. How each contact and each fibre stands has
    columns of its own. A measure that is not a number in this state is ``None``.

    Parameters
    ----------
    state
        The step.
    measures
        The measures to include.

    Raises
    ------
    InputError
        If the body lacks what a measure needs.
    """
    record = state.record
    numbers = evaluate(measures, state)
    return {
        "step": record.index,
        "fraction": float(record.fraction),
        **({"time_s": record.solver["time_s"]} if "time_s" in record.solver else {}),
        **_loads(record.loads),
        "max_displacement_mm": max_displacement(record.displacement),
        "max_von_mises_MPa": float(record.von_mises_max),
        "von_mises_p99_MPa": float(record.von_mises_p99),
        **_volumes(record.cavity_volumes),
        **{key: number if math.isfinite(number) else None for key, number in numbers.items()},
        **_contacts(record.standing.get("contact", {})),
        **_fibres(record.standing.get("fibres", {})),
        **{fact: record.solver[fact] for fact in SOLVER_FACTS},
        "event": str(record.solver.get("event", "")),
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


def _contacts(standing: Mapping[str, Mapping[str, Any]]) -> Row:
    """Area, overlap and force of each contact; of force on and displacement of a rigid body also the size.

    What a contact does not know in this state is ``None``, so that all states have the same columns.
    """
    columns: Row = {}
    for name, facts in standing.items():
        for key, value in facts.items():
            if isinstance(value, (list, tuple)):
                quantity, unit = key.split("_", 1)
                parts = {
                    f"contact_{name}_{quantity}_{axis}_{unit}": float(x) for axis, x in zip("xyz", value, strict=True)
                }
                size = {f"contact_{name}_{key}": math.hypot(*value)} if quantity in ("force", "displacement") else {}
                columns |= {**parts, **size}
            else:
                columns[f"contact_{name}_{key}"] = None if value is None else float(value)
    return columns


def _fibres(standing: Mapping[str, Mapping[str, Any]]) -> Row:
    """The largest tension, strain and bending moment of all fibres and, where there are several, of each."""
    columns: Row = {}
    for key in dict.fromkeys(key for facts in standing.values() for key in facts):
        columns[f"fibre_{key}"] = max(float(facts[key]) for facts in standing.values() if key in facts)
    if len(standing) > 1:
        for name, facts in standing.items():
            columns |= {f"fibre_{name}_{key}": float(value) for key, value in facts.items()}
    return columns


def _text(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else repr(value)
