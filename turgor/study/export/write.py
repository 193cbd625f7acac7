"""Write a case as a complete model of another program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from turgor.common.errors import InputError
from turgor.common.log import logger
from turgor.common.writing import writing
from turgor.mesh import Mesh
from turgor.results.files import check_targets
from turgor.study.build import check_sizes, doubts
from turgor.study.case import Case
from turgor.study.export import calculix, febio
from turgor.study.export.problem import Problem, problem_of
from turgor.study.materials import build_materials
from turgor.study.meshing import checked_mesh

log = logger("study")

_Writer = Callable[[Problem], Iterator[str]]
_PROGRAMS: dict[str, tuple[str, _Writer]] = {
    ".inp": (calculix.PROGRAM, calculix.inp_model),
    ".feb": (febio.PROGRAM, febio.feb_model),
}


def export_case(case: Case, path: str | Path) -> Mesh:
    """Write a case as a model that another program runs: mesh, materials, supports, loads and the states asked for.

    Parameters
    ----------
    case
        What to write.
    path
        ``.inp`` for CalculiX and Abaqus, ``.feb`` for FEBio 4.

    Returns
    -------
    Mesh
        The mesh that was written.

    Raises
    ------
    InputError
        If the suffix is another one, the program lacks something that the case uses, the case cannot be run as it
        stands, or the file cannot be written or is one that the case reads.
    """
    path = Path(path)
    if path.suffix not in _PROGRAMS:
        expected = "a name that ends in .inp (CalculiX, Abaqus) or .feb (FEBio)"
        raise InputError("models of this kind are not written", file=path, value=path.suffix, expected=expected)
    check_targets([path], case.files_read)
    program, writer = _PROGRAMS[path.suffix]
    materials, _ = build_materials(case.materials)
    check_sizes(case, materials)
    for text in doubts(case, materials):
        log.warning(text)
    mesh = checked_mesh(case)
    lines = list(writer(problem_of(case, mesh, materials, program)))
    with writing(path, "the model cannot be written"):
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return mesh
