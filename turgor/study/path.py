"""A path of equilibria as the Python story hands it out: series with units, and the report."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from turgor.common.errors import InputError
from turgor.common.units import registry
from turgor.mesh import Mesh
from turgor.results.archive import Row
from turgor.results.history import row
from turgor.results.measures import Choice, check, silent
from turgor.results.record import StepRecord
from turgor.results.report import report
from turgor.results.store import RunStore
from turgor.results.stored import Body, StoredState
from turgor.results.summary import Summary, summarise
from turgor.solver.events import Outcome
from turgor.study.machine import peak_memory_mb
from turgor.study.validation import suggestion

if TYPE_CHECKING:
    import pint


@dataclass(frozen=True, eq=False)
class Path:
    """The equilibria from the first load step to the last, each with what is measured on it; it does not change.

    Parameters
    ----------
    body
        The actuator: its mesh, and what a plane one stands for.
    dofs
        Number of unknowns.
    description
        What was inflated, in plain values, for the report.
    measures
        What is measured on each of them.
    records
        The equilibria.
    """

    body: Body
    dofs: int
    description: dict[str, Any]
    measures: tuple[Choice, ...]
    records: tuple[StepRecord, ...] = ()

    def longer(self, record: StepRecord) -> Path:
        """Return the path with one more equilibrium."""
        return replace(self, records=(*self.records, record))

    @property
    def mesh(self) -> Mesh:
        """The mesh of the actuator."""
        return self.body.mesh

    @cached_property
    def history(self) -> list[Row]:
        """One row a step: key ending in its unit → number, as in ``history.csv``."""
        return [row(StoredState(self.body, record), self.measures) for record in self.records]

    def measure(self, name: str, /, **parameters: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Measure every state: ``path.measure("displacement", at=("0 mm", "0 mm", "40 mm"))``.

        Parameters
        ----------
        name
            Of a measure.
        parameters
            As in a case file.

        Returns
        -------
        ndarray
            Numbers ``(steps, keys)``, or of a curve ``(steps, stations, columns)``, in mm, N, MPa and degrees.

        Raises
        ------
        InputError
            If there is no such measure, or it is impossible on this body.
        """
        choice = Choice.read({name: parameters})
        check([choice], self.body)
        return np.array([choice.of(StoredState(self.body, record)) for record in self.records])

    def series(self, key: str) -> pint.Quantity[Any]:
        """Return one number of every step, shape ``(steps,)``, with its unit.

        Parameters
        ----------
        key
            A key of the history without its unit: ``"twist"``, ``"tip_displacement_x"``. Not a number where a state
            does not have it, as the gap of surfaces that are out of reach of each other.

        Raises
        ------
        InputError
            If the history has no such key.
        """
        # The longest unit first: "N_mm" ends in "mm" too.
        names = dict.fromkeys(name for entry in self.history for name in entry)
        units = {name: next((unit for unit in _UNITS if name.endswith(f"_{unit}")), None) for name in names}
        columns = {name.removesuffix(f"_{unit}"): name for name, unit in units.items() if unit}
        if key not in columns:
            raise InputError("there is no such series", key="series", value=key, expected=suggestion(key, columns))
        name = columns[key]
        values = np.array([entry.get(name, np.nan) for entry in self.history], dtype=float)
        return registry().Quantity(values, _UNITS[units[name] or ""])

    @property
    def pressure(self) -> pint.Quantity[Any]:
        """Pressure of each step in kPa, shape ``(steps,)``."""
        return self.series("pressure")

    @property
    def bending_angle(self) -> pint.Quantity[Any]:
        """Bending angle of each step in degrees, shape ``(steps,)``; needs the surfaces ``mount`` and ``tip-face``."""
        return self.series("bending_angle")

    @property
    def tip_displacement(self) -> pint.Quantity[Any]:
        """Displacement of the marker ``tip`` in mm, shape ``(steps, 3)``."""
        parts = [self.series(f"tip_displacement_{axis}").magnitude for axis in "xyz"]
        return registry().Quantity(np.column_stack(parts), "mm")

    @property
    def cavity_volume(self) -> pint.Quantity[Any]:
        """Volume of all cavities under pressure in mm³, shape ``(steps,)``."""
        return self.series("cavity_volume")

    @property
    def stable(self) -> bool | None:
        """Whether every state is stable; ``None`` if the linear solver cannot tell."""
        answers = [record.solver["stable"] for record in self.records]
        return None if None in answers else all(answers)

    @property
    def reached(self) -> bool:
        """Whether the last step is the target."""
        return bool(self.records) and self.records[-1].fraction == 1.0

    @property
    def warnings(self) -> list[str]:
        """What is to be known of these equilibria, in sentences: measures that are empty in all of them."""
        return silent(self.measures, self.history)

    @property
    def summary(self) -> Summary:
        """The numbers of the last step, the mesh and the solver, as in ``summary.json``."""
        return summarise(
            self.history,
            self.mesh,
            converged=self.reached,
            reason="the target was reached" if self.reached else "the path ends before its target",
            outcome=Outcome.REACHED if self.reached else Outcome.UNEXPLAINED,
            dofs=self.dofs,
            wall_s=sum(record.solver["wall_s"] for record in self.records),
            peak_memory_mb=peak_memory_mb(),
            warnings=self.warnings,
        )

    def report(self, folder: str | pathlib.Path, *, overwrite: bool = False) -> pathlib.Path:
        """Write every step, the tables and the report into a folder and return the path of ``report.html``.

        Raises
        ------
        InputError
            If the folder holds a run already (unless `overwrite`) or cannot be written.
        """
        place = pathlib.Path(folder)
        case = {"name": place.resolve().name, **self.description}
        with RunStore.create(
            place,
            self.mesh,
            case,
            measures=self.measures,
            section=self.body.section,
            rigid_bodies=self.body.rigid_bodies,
            supports=self.body.supports,
            overwrite=overwrite,
        ) as store:
            for record in self.records:
                store.append(record)
            store.warn(self.warnings)
            store.finish(self.summary)
        return report(place)


_UNITS = {
    "N_mm": "N*mm",
    "mm2": "mm^2",
    "percent": "percent",
    "kPa": "kPa",
    "MPa": "MPa",
    "mm": "mm",
    "mm3": "mm^3",
    "deg": "deg",
    "N": "N",
    "s": "s",
}
"""Ending of a key of the history → pint's name of the unit."""
