"""The folder of a run: every step is on the disk, whole, before the next one begins.

=====================  ==============================================================================================
``store.json``         version of this layout, the measures, what a plane mesh stands for, the rigid bodies there are;
                       it makes the folder a run's folder
``case.yaml``          the resolved case
``mesh.npz``           the mesh with all its names
``steps/0003.npz``     exact state of step 3, its row of the history and its curves; written last, so that its presence
                       means the step is complete
``steps/0003.vtu``     the same for ParaView
``result.pvd``         list of the ``.vtu`` files over the load parameter
``history.csv``        one row a step
``curves/NAME.csv``    a measure that is a curve: its rows of all steps
``summary.json``       what came out, once the run has ended
``fit.json``           the fit of the material, if the run made one
``warnings.json``      what the run warned of, if it did
=====================  ==============================================================================================
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self
from xml.sax.saxutils import quoteattr

import yaml

from turgor.common.errors import InputError
from turgor.common.writing import writing
from turgor.geometry.section import PlaneSection
from turgor.mesh.mesh import Mesh
from turgor.results import measures as known_measures
from turgor.results.archive import (
    Curves,
    Row,
    load_curves,
    load_mesh,
    load_record,
    load_row,
    save_mesh,
    save_record,
    save_vtu,
)
from turgor.results.files import (
    LOCK,
    PARTIAL,
    FolderLock,
    check_folder,
    is_same_file,
    json_text,
    read_json,
    read_text,
    remove,
    write_text,
)
from turgor.results.history import as_csv, row
from turgor.results.measures import Choice
from turgor.results.record import StepRecord
from turgor.results.stored import Body, StoredState
from turgor.results.summary import as_json

LAYOUT = 1
"""Version of the layout of the folder."""

_OF_LOAD = ("step", "fraction", "time_s", "pressure_kPa")
"""Columns of the history that a curve repeats."""

_STORE, _CASE, _MESH, _STEPS = "store.json", "case.yaml", "mesh.npz", "steps"
_PVD, _HISTORY, _SUMMARY, _FIT, _CURVES = "result.pvd", "history.csv", "summary.json", "fit.json", "curves"
_WARNINGS = "warnings.json"
REPORT, RUN_LOG = "report.html", "run.log"
_FILES = (_STORE, _CASE, _MESH, _PVD, _HISTORY, _SUMMARY, _FIT, _WARNINGS, REPORT, RUN_LOG)
_PATTERNS = (f"{_STEPS}/*.npz", f"{_STEPS}/*.vtu", f"{_STEPS}/*{PARTIAL}", f"{_CURVES}/*.csv")
"""What a run writes, the one that makes the folder a run's folder first."""


class RunStore:
    """The stored states of one run; made by :meth:`create`, :meth:`resume` (to add steps) or :meth:`open` (to read)."""

    def __init__(self, folder: Path, body: Body, measures: tuple[Choice, ...], lock: FolderLock | None) -> None:
        self.folder = folder
        self.body = body
        self.measures = measures
        self._lock = lock
        finished = range(_finished_steps(folder))
        self._rows = [load_row(self._step_file(index)) for index in finished]
        has_curves = any(choice.entry.is_curve for choice in measures)
        self._curves = [load_curves(self._step_file(index)) for index in finished] if has_curves else []

    @classmethod
    def create(
        cls,
        folder: str | Path,
        mesh: Mesh,
        case: Mapping[str, Any] | str,
        *,
        measures: Iterable[Choice | str] | None = None,
        section: PlaneSection | None = None,
        rigid_bodies: Iterable[str] = (),
        supports: Iterable[str] = (),
        files: Mapping[Path, str] | None = None,
        overwrite: bool = False,
    ) -> Self:
        """Begin a run in a folder, which is made if need be.

        Parameters
        ----------
        folder
            Where the files go. Files that are not a run's are left alone.
        mesh
            The mesh of the run.
        case
            The resolved case, as YAML text or as plain data.
        measures
            The measures of the history; left out, the usual ones that the mesh has the names for.
        section
            What a plane mesh stands for.
        rigid_bodies
            Names of the rigid bodies that the actuator may meet.
        supports
            Names of the surfaces that supports hold.
        files
            Data file of a measure → name of its copy in the folder.
        overwrite
            Replace the run that is in the folder.

        Raises
        ------
        InputError
            If the folder holds a run already, or files with the names of a run's that no run has written, is being
            written by another run, cannot be written, or a measure is unknown or impossible on this mesh.
        """
        place = Path(folder)
        body = Body(mesh, section, tuple(rigid_bodies), tuple(supports))
        chosen = known_measures.available(body) if measures is None else tuple(map(Choice.read, measures))
        known_measures.check(chosen, body)
        if (place / _STORE).exists() and not overwrite:
            raise InputError(
                "the folder holds a run already",
                file=place,
                expected="another folder, or to resume or overwrite that run",
            )
        check_place(place, files or {})
        was_run = _is_run(place)
        with writing(place, "the folder cannot be made"):
            (place / _STEPS).mkdir(parents=True, exist_ok=True)
        lock = FolderLock(place)
        if was_run:
            _remove_run(place)
        text = case if isinstance(case, str) else yaml.safe_dump(dict(case), sort_keys=False, allow_unicode=True)
        write_text(place / _CASE, text)
        save_mesh(place / _MESH, mesh)
        content: dict[str, Any] = {"layout": LAYOUT, "measures": [choice.plain(files) for choice in chosen]}
        content |= {"section": None if section is None else asdict(section)}
        content |= {"rigid_bodies": body.rigid_bodies, "supports": body.supports}
        write_text(place / _STORE, json_text(content))
        store = cls(place, body, chosen, lock)
        store._write_tables()
        return store

    @classmethod
    def open(cls, folder: str | Path) -> Self:
        """Open a run to read it, also while another process writes it.

        Raises
        ------
        InputError
            If the folder holds no run, or a file of it is missing or damaged.
        """
        return cls(Path(folder), *_read_store(Path(folder)), lock=None)

    @classmethod
    def resume(cls, folder: str | Path) -> Self:
        """Open a run to add steps; what a killed process left half-written is removed, a summary when there is more.

        Raises
        ------
        InputError
            As :meth:`open`; also if another process is writing into the folder.
        """
        place = Path(folder)
        content = _read_store(place)
        with _locked(place) as lock:
            for leftover in [*place.glob(f"*{PARTIAL}"), *place.glob(f"{_STEPS}/*{PARTIAL}")]:
                remove(leftover)
            store = cls(place, *content, lock=lock)
            store._write_tables()
        return store

    def append(self, record: StepRecord) -> None:
        """Write the next step; when this returns, no crash can lose it.

        Raises
        ------
        InputError
            If the record does not fit the mesh or is not the next one, or the store was opened only to read.
        """
        self._check_writable()
        record.check(self.mesh)
        if record.index != len(self._rows):
            raise InputError(
                "this is not the next step", key="index", value=record.index, expected=str(len(self._rows))
            )
        state = StoredState(self.body, record)
        entry, curves = row(state, self.measures), known_measures.tables(self.measures, state)
        path = self._step_file(record.index)
        self._outdate()
        save_vtu(path.with_suffix(".vtu"), self.mesh, record)
        save_record(path, record, entry, curves)
        self._rows.append(entry)
        if curves:
            self._curves.append(curves)
        self._write_tables()

    def finish(self, summary: Mapping[str, Any]) -> None:
        """Write ``summary.json`` and let go of the folder; raise InputError if a key of the summary is missing."""
        self._check_writable()
        write_text(self.folder / _SUMMARY, as_json(summary))
        self.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def close(self) -> None:
        """Let another process write into the folder; from now on this store only reads."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def write_fit(self, fit: Mapping[str, Any]) -> None:
        """Write the fit of the material (what ``turgor fit --json`` prints, with its curves) for the report."""
        self._check_writable()
        self._outdate()
        write_text(self.folder / _FIT, json_text(fit))

    def warn(self, sentences: Iterable[str]) -> None:
        """Keep what the run warns of, each sentence once: the parts of a resumed run warn of the same things."""
        self._check_writable()
        known = self.warnings
        kept = list(dict.fromkeys([*known, *sentences]))
        if len(kept) > len(known):
            write_text(self.folder / _WARNINGS, json_text({"warnings": kept}))

    @property
    def mesh(self) -> Mesh:
        """The mesh of the run."""
        return self.body.mesh

    @property
    def n_steps(self) -> int:
        """Number of finished steps."""
        return len(self._rows)

    @property
    def history(self) -> list[Row]:
        """The rows of ``history.csv``, in order."""
        return [dict(entry) for entry in self._rows]

    @property
    def curves(self) -> Curves:
        """The rows of each curve of all steps, by its title; each begins with the step and its load."""
        titles = self._curves[0] if self._curves else {}
        return {
            title: [
                {**{key: entry[key] for key in _OF_LOAD if key in entry}, "station": number, **place}
                for entry, curves in zip(self._rows, self._curves, strict=True)
                for number, place in enumerate(curves[title], start=1)
            ]
            for title in titles
        }

    @property
    def case_text(self) -> str:
        """The resolved case as YAML text."""
        return read_text(self.folder / _CASE)

    @property
    def summary(self) -> dict[str, Any] | None:
        """The summary, or None while the run has not ended."""
        return read_json(self.folder / _SUMMARY) if (self.folder / _SUMMARY).exists() else None

    @property
    def spent(self) -> tuple[float, float]:
        """What the run has cost so far: its time in s, and its largest memory in MB (0 where no summary says so).

        Where a part was cut short before its summary, its time is that of its steps.
        """
        try:
            solver = (self.summary or {}).get("solver", {})
        except InputError:  # damaged: the run is to be resumed, which writes another
            solver = {}
        steps = sum(float(entry["wall_s"]) for entry in self._rows)
        return float(solver.get("wall_s") or steps), float(solver.get("peak_memory_MB") or 0.0)

    @property
    def fit(self) -> dict[str, Any] | None:
        """The fit of the material, or None if the run has none."""
        return read_json(self.folder / _FIT) if (self.folder / _FIT).exists() else None

    @property
    def warnings(self) -> list[str]:
        """The sentences of what the run warned of, also while it is on its way."""
        path = self.folder / _WARNINGS
        return [str(sentence) for sentence in read_json(path).get("warnings", ())] if path.exists() else []

    def load(self, index: int) -> StepRecord:
        """Read one step; raise InputError if there is none of that number or its file is damaged."""
        if not 0 <= index < self.n_steps:
            raise InputError(
                "the run has no such step", file=self.folder, value=index, expected=f"0 to {self.n_steps - 1}"
            )
        record = load_record(self._step_file(index))
        record.check(self.mesh)
        return record

    def last(self) -> StepRecord | None:
        """Read the last finished step; None if there is none yet."""
        return self.load(self.n_steps - 1) if self._rows else None

    def records(self) -> Iterator[StepRecord]:
        """Read the steps one after the other."""
        return (self.load(index) for index in range(self.n_steps))

    def _step_file(self, index: int) -> Path:
        return _step_file(self.folder, index)

    def _check_writable(self) -> None:
        if self._lock is None:
            raise InputError("the run is open only to be read", file=self.folder, expected="RunStore.create or .resume")

    def _outdate(self) -> None:
        """Remove the summary of a run that goes on: not before, or who is refused to resume it would lose it."""
        remove(self.folder / _SUMMARY)

    def _write_tables(self) -> None:
        write_text(self.folder / _HISTORY, as_csv(self._rows))
        for title, rows in self.curves.items():
            with writing(self.folder / _CURVES, "the folder cannot be made"):
                (self.folder / _CURVES).mkdir(exist_ok=True)
            write_text(self.folder / _CURVES / f"{title}.csv", as_csv(rows))
        sets = "".join(
            f'    <DataSet timestep="{time!r}" file={quoteattr(f"{_STEPS}/{index:04d}.vtu")}/>\n'
            for index, time in enumerate(_times(self._rows))
        )
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        write_text(self.folder / _PVD, f"{head}{sets}  </Collection>\n</VTKFile>\n")


def _times(rows: Sequence[Row]) -> list[float]:
    """Return ParaView's time of each step: the load parameter, or the step's number where that does not grow."""
    fractions = [float(entry["fraction"]) for entry in rows]
    ascend = all(later > earlier for earlier, later in itertools.pairwise(fractions))
    return fractions if ascend else [float(index) for index in range(len(rows))]


@contextmanager
def _locked(folder: Path) -> Iterator[FolderLock]:
    """Lock the folder for good, or not at all where the block fails."""
    lock = FolderLock(folder)
    try:
        yield lock
    except BaseException:
        lock.release()
        raise


def _step_file(folder: Path, index: int) -> Path:
    return folder / _STEPS / f"{index:04d}.npz"


def _finished_steps(folder: Path) -> int:
    count = 0
    while _step_file(folder, count).exists():
        count += 1
    return count


def _read_store(folder: Path) -> tuple[Body, tuple[Choice, ...]]:
    if not (folder / _STORE).is_file():
        raise InputError(
            "the folder holds no run", file=folder, expected=f"a folder that 'turgor run' wrote ({_STORE})"
        )
    content = read_json(folder / _STORE)
    if content.get("layout") != LAYOUT:
        raise InputError(
            "the run has another layout", file=folder / _STORE, value=content.get("layout"), expected=str(LAYOUT)
        )
    section = content.get("section")
    try:
        body = Body(
            load_mesh(folder / _MESH),
            None if section is None else PlaneSection(**section),
            tuple(content.get("rigid_bodies", ())),
            tuple(content.get("supports", ())),
        )
        measures = tuple(Choice.read(value, folder) for value in content.get("measures", ()))
    except TypeError as error:
        raise InputError(f"the file is damaged: {error}", file=folder / _STORE) from error
    known_measures.check(measures, body)
    return body, measures


def check_place(folder: Path, files: Mapping[Path, str]) -> None:
    """Refuse a place that a run cannot be written into; nothing is made there yet.

    Parameters
    ----------
    folder
        Of the run; it need not exist.
    files
        Data file → name of its copy in the folder.

    Raises
    ------
    InputError
        If it is a file or in one, may not be written, or holds files with the names of a run's that no run has written.
    """
    check_folder(folder)
    if not _is_run(folder):
        _check_foreign(folder, files)


def _is_run(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (_STORE, LOCK))


def _check_foreign(folder: Path, files: Mapping[Path, str]) -> None:
    """Refuse a folder in which a run would replace what somebody else has put there."""
    copies = [name for path, name in files.items() if not is_same_file(folder / name, path)]
    own = [folder / name for name in (*_FILES, *copies)]
    found = [path for path in own if path.exists()] + [path for p in _PATTERNS for path in folder.glob(p)]
    if found:
        raise InputError(
            "this file is no run's, and a run would replace it",
            file=found[0],
            expected="another folder (--out), or the file somewhere else",
        )


def _remove_run(folder: Path) -> None:
    """Remove the files of an earlier run."""
    for name in _FILES:
        remove(folder / name)
    for pattern in _PATTERNS:
        for path in folder.glob(pattern):
            remove(path)
