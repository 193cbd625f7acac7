"""Measures at points that are named: displacement, and the distance from positions that were measured."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, Field, ValidationInfo

from turgor.common.errors import InputError
from turgor.common.names import PRESSURE_PREFIX, Name
from turgor.common.units import PositiveLength, from_internal
from turgor.geometry.space import Place
from turgor.mesh.mesh import Mesh, in_space
from turgor.results.material_line import at_points
from turgor.results.measured import MeasuredPositions, read_positions
from turgor.results.measures.registry import measure
from turgor.results.stored import StoredState
from turgor.results.symmetry import MOUNT, TIP_FACE, surface_middle

FloatArray = npt.NDArray[np.float64]


def _file(value: object, info: ValidationInfo) -> Path:
    if not isinstance(value, (str, Path)) or not str(value):
        raise ValueError("this is not a file name; expected the path of a CSV file")
    path: Path = (info.context or {}).get("folder", Path()) / Path(value).expanduser()
    if not path.is_file():
        raise ValueError(f"there is no such file: {value}; expected a CSV file, its path relative to the case file")
    return path


Places = Annotated[tuple[Place, ...], Field(min_length=1)]
DataFile = Annotated[Path, BeforeValidator(_file)]

MOST_LISTED = 8
"""Measured pressures that are told one by one."""


@measure(*(f"displacement_{{name}}_{axis}_mm" for axis in "xyz"))
def displacement(state: StoredState, *, at: Place, name: Name | None = None) -> FloatArray:
    """Displacement ``(3,)`` in mm of the material point that lies `at` a place at rest."""
    del name
    return in_space(np.asarray(_shares(state.mesh, (at,)) @ state.displacement)[0])


def _measured_states(*, file: Path, **others: object) -> str:
    del others
    pressures = [from_internal(value, "pressure", "kPa") for value in _table(file, file.stat().st_mtime_ns).pressures]
    few = ", ".join(f"{pressure:.4g}" for pressure in pressures)
    listed = few if len(pressures) <= MOST_LISTED else f"{pressures[0]:.4g} to {pressures[-1]:.4g}"
    return f"'{file.name}' has what was measured at {listed} kPa, and solver.outputs asks for states"


@measure("marker_rmse_{name}_percent", surfaces=(MOUNT, TIP_FACE), states=_measured_states)
def marker_rmse(
    state: StoredState, *, file: DataFile, at: Places, length: PositiveLength | None = None, name: Name | None = None
) -> float:
    """Root mean square of the distances between markers and their measured positions, in percent of a length.

    ``100 √(Σ_k |x_k − m_k|² / n) / L`` over the n markers (as in the multi-material paper), for a state at a pressure
    that the table has; at others it is not a number. Of a table without one of the coordinates the others count.

    Parameters
    ----------
    state
        The state.
    file
        The table; see :func:`turgor.results.measured.read_positions`.
    at
        Where the markers sit at rest, in the order of their numbers in the table.
    length
        L; left out, the distance from the middle of the mount to that of the tip face at rest.
    name
        Tells several of these measures apart.
    """
    del name
    table = _table(file, file.stat().st_mtime_ns)
    if table.places.shape[1] != len(at):
        raise InputError(
            f"the table has {table.places.shape[1]} markers and {len(at)} places are given",
            file=file,
            key="at",
            expected="one place for each marker",
        )
    shares = _shares(state.mesh, at)
    pressures = (p for name, p in state.record.loads.items() if name.startswith(PRESSURE_PREFIX))
    pressure = max(pressures, key=abs, default=0.0)
    measured = table.at(from_internal(pressure, "pressure"))
    if measured is None:
        return math.nan
    gaps = (in_space(np.asarray(shares @ state.positions)) - measured)[:, table.measured]
    if length is None:
        ends = [surface_middle(state.mesh, surface) for surface in (MOUNT, TIP_FACE)]
        length = float(np.linalg.norm(ends[1] - ends[0]))
    return 100.0 * math.sqrt(float((gaps**2).sum(axis=1).mean())) / length


@lru_cache(maxsize=8)
def _table(file: Path, changed: int) -> MeasuredPositions:
    """Read a table once, and again where the file has `changed`."""
    del changed
    return read_positions(file)


@lru_cache(maxsize=32)
def _shares(mesh: Mesh, at: tuple[tuple[float, float, float], ...]) -> Any:
    """Return the nodes' shares in the points; a mesh does not change, so that all its states have the same."""
    places = np.array(at)
    if places[:, mesh.dimension :].any():
        raise InputError("the point lies outside the plane of the model", key="at", expected="'0 mm' as third number")
    return at_points(mesh, places[:, : mesh.dimension])
