"""Copies of the files that a case names in its run's folder, so that the resolved ``case.yaml`` runs again anywhere."""

from __future__ import annotations

from itertools import chain, count
from pathlib import Path

from turgor.common.writing import writing
from turgor.mesh.inp import whole_text
from turgor.results.files import is_same_file
from turgor.study.case import Case

FOLDER = "data"


def data_names(case: Case) -> dict[Path, str]:
    """Return each data file of the case and the name of its copy, relative to the run's folder."""
    names: dict[str, Path] = {}
    for path in case.data_files:
        tried = chain([path.name], (f"{k}-{path.name}" for k in count(1)))
        # In capitals or not: the folder may be carried to a machine that does not tell them apart.
        names[next(name for name in tried if name.lower() not in {taken.lower() for taken in names})] = path
    return {path: f"{FOLDER}/{name}" for name, path in names.items()}


def copy_data(names: dict[Path, str], folder: Path) -> None:
    """Copy the data files into the run's folder; one that is there already stays."""
    for path, name in names.items():
        copy = folder / name
        if not is_same_file(copy, path):
            content = _content(path)
            with writing(copy):
                copy.parent.mkdir(exist_ok=True)
                copy.write_bytes(content)


def same_data(names: dict[Path, str], folder: Path) -> bool:
    """Say whether every data file still is what its copy in the run's folder is."""
    return all(
        (folder / name).is_file() and (folder / name).read_bytes() == _content(path) for path, name in names.items()
    )


def _content(path: Path) -> bytes:
    """Return what stands in a file, with what a .inp file includes: the copy stands alone."""
    return whole_text(path).encode() if path.suffix == ".inp" else path.read_bytes()
