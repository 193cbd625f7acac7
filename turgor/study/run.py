"""Run a case: materials, mesh, system, load path, store, measures, report, in one direction.

Every state is on the disk before the next one begins, so that a run that was killed can be resumed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turgor.common.compiled import kernels_are_kept
from turgor.common.errors import InputError, SolverError
from turgor.common.log import logger
from turgor.common.names import PRESSURE_PREFIX
from turgor.common.units import from_internal
from turgor.common.writing import UnwritableError
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.system import System
from turgor.mesh import Mesh
from turgor.results.archive import Row
from turgor.results.measures import check_kinds, silent
from turgor.results.record import StepRecord
from turgor.results.report import report
from turgor.results.store import RUN_LOG, RunStore, check_place
from turgor.results.stored import kind_of
from turgor.results.summary import Summary, summarise
from turgor.solver.control import ATMOSPHERE
from turgor.solver.events import Event, Outcome
from turgor.solver.newton import Equilibrium
from turgor.solver.stops import StoppedShortError
from turgor.study.build import check_sizes, doubts, system_of
from turgor.study.case import Case
from turgor.study.course import Course
from turgor.study.datafiles import copy_data, data_names, same_data
from turgor.study.fitting import fit_document
from turgor.study.machine import peak_memory_mb
from turgor.study.materials import FittedMaterial, build_materials
from turgor.study.meshing import checked_mesh
from turgor.study.progress import Progress, Silent
from turgor.study.runlog import RunLog
from turgor.study.states import Recorder, to_equilibrium

log = logger("study")

SAME = 1e-3
"""Two limits whose loads differ by less than this part are one."""

LIMITS = (Event.LIMIT, Event.MINIMUM, Event.AIR_LIMIT)

MARK = "store.json"
"""The file that makes a folder a run's folder; see :mod:`turgor.results.store`."""


@dataclass(frozen=True)
class Run:
    """What came out of a run: its folder, its summary (as ``summary.json``) and whether the target was reached."""

    folder: Path
    summary: Mapping[str, Any]

    @property
    def converged(self) -> bool:
        """Whether the full load was reached."""
        return bool(self.summary["converged"])

    @property
    def reason(self) -> str:
        """Why the run ended."""
        return str(self.summary["reason"])


def run(
    case: Case,
    folder: str | Path,
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Run a case and keep everything in a folder.

    Parameters
    ----------
    case
        What to run.
    folder
        Where the files go; see :class:`turgor.results.store.RunStore`.
    resume
        Continue the run in the folder behind its last stored step; a folder without a run begins one.
    overwrite
        Replace the run that is in the folder.
    progress
        Told about every stage and step.

    Returns
    -------
    Run
        Also where the solver stopped short of the full load: then ``converged`` is False, and the steps that were
        reached, the summary and the report are in the folder all the same.

    Raises
    ------
    InputError
        If the case cannot be run as it stands, the folder cannot be written, it holds a run and neither `resume` nor
        `overwrite` is asked for, or both are, or the run to resume is one of another case.
    KeyboardInterrupt
        Passed on with a message that says how to resume.
    """
    if resume and overwrite:
        raise InputError("a run is either resumed or overwritten", key="--resume", expected="only one of the two")
    place, files = Path(folder), data_names(case)
    check_place(place, files)
    check_kinds(case.measures or (), kind_of(case.geometry.section))
    stored = (place / MARK).is_file()
    if stored and not (resume or overwrite):
        expected = "another folder, or resume (--resume) or overwrite (--overwrite)"
        raise InputError("the folder holds a run already", file=place, expected=expected)
    show = progress or Silent()
    with RunLog(show.warn) as run_log:
        return _Running(case, place, files, show, run_log).run(continues=stored and resume)


class _Running:
    """One run on its way; the parts of :func:`run` share what is here."""

    def __init__(self, case: Case, folder: Path, files: dict[Path, str], show: Progress, run_log: RunLog) -> None:
        self.case, self.folder, self.files, self.show, self.run_log = case, folder, files, show, run_log
        self.begun = time.perf_counter()
        self._walked = False

    def run(self, *, continues: bool) -> Run:
        if any(isinstance(choice, FittedMaterial) for choice in self.case.materials.values()):
            self.show.stage("fit")
        materials, fit = build_materials(self.case.materials)
        check_sizes(self.case, materials)
        for text in doubts(self.case, materials):
            log.warning(text)
        with self._resumed() if continues else nullcontext() as stored:
            mesh = stored.mesh if stored else self._meshed()
            self.show.stage("system")
            kept = kernels_are_kept("contact" if self.case.contact else "fem")
            system = system_of(self.case, mesh, materials)
            course = self.case.course(system)
            # Nothing is written before everything that can be checked has been.
            with stored or self._created(mesh) as store:
                if not kept:
                    # Not before the case is known to be right: what is wrong with it is to be told alone.
                    self.show.tell("kernels are compiled for this machine first, which takes a minute or two, once")
                self.run_log.write_to(self.folder / RUN_LOG, append=continues)
                log.info("%d elements, %d unknowns", mesh.n_cells, system.n_dofs)
                store.warn(self.run_log.warnings)
                spent = store.spent
                if fit:
                    store.write_fit(fit_document(fit))
                stop = self._walk(system, course, store)
                for text in silent(self.case.measures or (), store.history):
                    log.warning(text)
                store.warn(self.run_log.warnings)
                summary = self._summary(system, store, stop, spent)
                store.finish(summary)
        self.show.stage("report")
        report(self.folder)
        return Run(self.folder, summary)

    def _meshed(self) -> Mesh:
        self.show.stage("mesh")
        return checked_mesh(self.case)

    def _created(self, mesh: Mesh) -> RunStore:
        text = self.case.to_yaml(self.files)
        contact = self.case.contact
        store = RunStore.create(
            self.folder,
            mesh,
            text,
            measures=self.case.measures,
            section=self.case.geometry.section,
            rigid_bodies=contact.labels if contact else (),
            supports=self.case.held,
            files=self.files,
            overwrite=True,
        )
        copy_data(self.files, self.folder)
        return store

    def _resumed(self) -> RunStore:
        store = RunStore.resume(self.folder)
        if store.case_text != self.case.to_yaml(self.files) or not same_data(self.files, self.folder):
            store.close()
            raise InputError(
                "the run in this folder is one of another case and cannot be resumed with this one",
                file=self.folder,
                expected="the same case file, --set changes and test data, or another folder",
            )
        log.info("resuming behind step %d", store.n_steps)
        return store

    def _walk(self, system: System, course: Course, store: RunStore) -> SolverError | None:
        """Follow the path; return what stopped it short, or ``None`` if it reached the end."""
        last = _passable(store, store.n_steps)
        before = _passable(store, last.index) if last else None
        known = [store.load(index) for index in range(last.index + 1 if last else 0, store.n_steps)]
        if last and last.fraction >= 1.0 and not known:
            return None
        self._walked = True
        start, earlier = (to_equilibrium(system, record) if record else None for record in (last, before))
        self.show.stage("load")
        recorder = Recorder(system, store.n_steps, course)

        def keep(equilibrium: Equilibrium) -> None:
            if known and _is_same(equilibrium, known[0]):
                del known[0]  # in the store already
            else:
                self._keep(recorder, store, equilibrium)

        try:
            course.walk(start, keep, self._tell, earlier)
        except SolverError as error:
            log.error("%s %s", error, error.facts)
            return error
        except KeyboardInterrupt as signal:
            log.warning("interrupted")
            raise type(signal)(
                f"interrupted; {store.n_steps} finished steps are in {self.folder}, and --resume continues behind them"
            ) from None
        return None

    def _keep(self, recorder: Recorder, store: RunStore, equilibrium: Equilibrium) -> None:
        record = recorder.record(equilibrium)
        text = ", ".join(_load_text(name, value) for name, value in record.loads.items())
        if equilibrium.event is not None:
            log.warning("%s at %s", equilibrium.event, text)
        self._doubt(record, store.warnings)
        try:
            store.warn(self.run_log.warnings)  # before the step: a run that is cut short is not to go on without them
            store.append(record)
        except UnwritableError as error:
            kept = f"a folder with room; {store.n_steps} finished steps are kept, and --resume continues behind them"
            raise InputError(error.problem, file=error.file, expected=kept) from error
        recorder.begin()
        log.info("step %d: %s, %d iterations", record.index, text, equilibrium.iterations)
        self.show.advance(record.fraction, text)

    def _doubt(self, record: StepRecord, told: Sequence[str]) -> None:
        """Say where a state is an equilibrium but none of an actuator; what the run has `told` of a step not again."""
        doubts = {
            "is deeper than a vacuum": (
                f"{_load_text(name, value)} at step {record.index} is deeper than a vacuum: no cavity of air gets there"
                for name, value in record.loads.items()
                if name.startswith(PRESSURE_PREFIX) and value < -ATMOSPHERE
            ),
            "encloses less than nothing": (
                f"{name} encloses less than nothing at step {record.index}: its walls have passed through each other, "
                "which contact: true would not let them"
                for name, volume in record.cavity_volumes.items()
                if volume < 0.0
            ),
            "are seen to overlap": (
                f"contact '{name}': the surfaces are seen to overlap by more than "
                f"{100.0 * LARGEST_OVERLAP:g} % of the wall at step {record.index}"
                for name, touch in record.standing.get("contact", {}).items()
                if touch.get("surfaces_intersect")
            ),
        }
        for words, texts in doubts.items():
            text = next(texts, None)
            if text is not None and not any(words in sentence for sentence in told):
                log.warning(text)

    def _tell(self, fraction: float, iteration: int, residual: float) -> None:
        self.show.note(f"to {100.0 * fraction:.4g} % of the load: iteration {iteration}, residual {residual:.1e}")

    def _summary(
        self, system: System, store: RunStore, stop: SolverError | None, spent: tuple[float, float]
    ) -> Summary:
        """Return the summary; `spent` are the time in s and the memory in MB of the parts before this one."""
        # To look at a finished run once more is no part of it.
        wall_s = time.perf_counter() - self.begun if self._walked else 0.0
        summary = summarise(
            store.history,
            store.mesh,
            converged=stop is None,
            reason=_stopped(stop, store.history) if stop else _reached(store.history),
            outcome=_outcome(stop, store.history),
            dofs=system.n_dofs,
            wall_s=spent[0] + wall_s,
            peak_memory_mb=max(spent[1], peak_memory_mb()),
            warnings=store.warnings,
        )
        last = store.last()
        return summary | dict(last.standing if last else {}) | ({"facts": stop.facts} if stop else {})


def _passable(store: RunStore, behind: int) -> StepRecord | None:
    """Return the last record before the step `behind` at which the path can be taken up.

    At a limit it has no direction; from before, the limit is met again.
    """
    before = (store.load(index) for index in reversed(range(behind)))
    return next((record for record in before if record.solver["event"] not in LIMITS), None)


def _is_same(found: Equilibrium, known: StepRecord) -> bool:
    """Whether a limit is the one that a record was made of."""
    there = float(known.solver["load_fraction"])
    return found.event == known.solver["event"] and abs(found.fraction - there) <= SAME * abs(there)


def _outcome(stop: SolverError | None, history: Sequence[Row]) -> Outcome:
    if stop is not None:
        return stop.outcome if isinstance(stop, StoppedShortError) else Outcome.UNEXPLAINED
    bifurcated = bool(history) and history[-1]["stable"] is False and _bifurcation(history) is not None
    return Outcome.BIFURCATION if bifurcated else Outcome.REACHED


def _stopped(stop: SolverError, history: Sequence[Row]) -> str:
    met = _bifurcation(history)
    if met is None or history[-1]["stable"] is not False:
        return str(stop)
    return f"{stop}. Before, at {_place(met)}, the path bifurcates, and the states behind it are unstable"


def _reached(history: Sequence[Row]) -> str:
    met = _bifurcation(history)
    if met is None:
        return "the target was reached"
    regained = history[-1]["stable"] is not False
    last = next(row for row in reversed(history) if row["stable"] is False)
    until = f"up to {_place(last)} the states behind it" if regained else "the states behind it"
    return (
        f"the target was reached, but at {_place(met)} the path bifurcates: {until} follow a branch that is "
        "unstable. A small force or flaw along the mode that is stored there shows the branch that is taken"
    )


def _place(row: Row) -> str:
    return f"{row['pressure_kPa']:.4g} kPa" if "pressure_kPa" in row else f"{row['fraction']:.4g} of the load"


def _bifurcation(history: Sequence[Row]) -> Row | None:
    return next((row for row in history if row.get("event") == Event.BIFURCATION), None)


def _load_text(name: str, value: float) -> str:
    _, _, place = name.partition(":")
    if name.startswith(PRESSURE_PREFIX):
        return f"{from_internal(value, 'pressure', 'kPa'):.4g} kPa in {place}"
    return f"{name} × {value:.4g}"
