"""Mesh files: write and read a mesh with all its names, as gmsh's .msh or VTK's .vtu; read those of other programs.

In a file a region is a set of cells, a surface of their faces, a cap of edges, a marker of vertices and a curve of
lines between points of its own; a plane mesh lies in the plane of x and y. In gmsh's format each is a physical group
called ``region:body`` (the kind is written out since a region and a marker may share a name; without it the group's
dimension decides). In VTK's, where cells have no sets, each is a cell array of that name, 1 on its cells and 0
elsewhere, by which ParaView can threshold.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from turgor.common.errors import InputError
from turgor.common.writing import writing
from turgor.mesh.cells import body_cell, cells_of_corners, face_cell, is_body_cell
from turgor.mesh.elevate import KINDS
from turgor.mesh.faces import outward_faces
from turgor.mesh.inp import read_inp
from turgor.mesh.mesh import Mesh
from turgor.mesh.raw import RawMesh, assembled
from turgor.mesh.tet10 import FloatArray, IntArray

# Number of nodes of a cell or face → what it is called in meshio, and its dimension.
_TYPES = {
    1: ("vertex", 0),
    2: ("line", 1),
    3: ("line3", 1),
    6: ("triangle6", 2),
    9: ("quad9", 2),
    10: ("tetra10", 3),
    27: ("hexahedron27", 3),
}
_KIND_OF_DIMENSION = {3: "region", 2: "surface", 1: "curve", 0: "marker"}

_OF_MATERIALS = ("gmsh:physical", "region", "regions", "material", "materials", "materialid", "materialids", "part")
"""Cell arrays, in small letters, by which programs tell materials apart."""

_FRAME = {".msh": (b"$", rb"\$End\w+\s*$", "a line $End…"), ".vtu": (b"<", rb"</VTKFile>", "</VTKFile>")}
"""What a file begins with, what its end holds, and that in words."""

_END_LENGTH = 1000
"""Bytes that are taken for the end of a file."""

Sets = dict[tuple[str, str], IntArray]
"""Kind and name of each set → nodes of its cells, one row a cell."""


def meshio_name(cells: IntArray) -> str:
    """Return what meshio calls the kind of `cells` ``(m, n_nodes)``."""
    return _TYPES[cells.shape[1]][0]


def check_name(path: str | Path) -> None:
    """Raise InputError if a path does not end as the files do that :func:`write` writes."""
    _check_suffix(Path(path), ".vtk", "straight cells only")


def write(mesh: Mesh, path: str | Path) -> None:
    """Write a mesh with its names to a .msh (gmsh 2.2, binary) or .vtu file, or its regions to a .vtk one.

    A .vtk (VTK's old format, as text) is for SOFA and others that know straight cells only: it holds the corners, and
    the cell array ``region`` that counts the regions from 0 in their order.

    Raises
    ------
    InputError
        If the suffix is another one or the file cannot be written.
    """
    path = Path(path)
    check_name(path)
    writer = None if path.suffix == ".vtk" else _FORMATS[path.suffix][0]
    with writing(path, "the mesh cannot be written"):
        if writer:
            writer(path, *_to_sets(mesh))
        else:
            _write_vtk(path, mesh)


def read(path: str | Path) -> Mesh:
    """Read a mesh with its names from a .msh, .vtu or .inp file, of Turgor's own or another program's.

    Of another program's file the names come from its sets (:func:`turgor.mesh.raw.assembled`); linear cells are taken
    for cells of second order with straight edges, which a warning says.

    Raises
    ------
    InputError
        If the file is absent, of another kind, damaged, cut short, or holds no valid mesh.
    """
    path = Path(path)
    _check_suffix(path, ".inp", "a deck of another program")
    if not path.is_file():
        raise InputError("there is no such file", file=path)
    try:
        return assembled(read_inp(path)) if path.suffix == ".inp" else _read_by_meshio(path)
    except InputError as error:
        raise error.at(file=path) from error
    except Exception as error:  # parsers fail in as many ways as a file can be damaged
        raise InputError(f"this is not a readable mesh file: {_words(error, path)}", file=path) from error


def _words(error: Exception, path: Path) -> str:
    """Return what a parser says of a file; arrays that do not fit say nothing that a person could use."""
    says = str(error) if path.suffix == ".inp" or isinstance(error, (meshio.ReadError, SyntaxError)) else ""
    return says or "it is damaged, its parts do not fit together"


def _check_complete(path: Path) -> None:
    """Refuse a file that begins as its format does and does not end so: half a mesh may be readable, too."""
    first, last, words = _FRAME[path.suffix]
    with path.open("rb") as stream:
        begin = stream.read(_END_LENGTH)
        stream.seek(max(0, path.stat().st_size - _END_LENGTH))
        end = stream.read()
    if begin.lstrip().startswith(first) and not re.search(last, end):
        problem = "the file ends early: it was not written or copied to its end"
        raise InputError(problem, expected=f"a file that ends in {words}")


def _read_by_meshio(path: Path) -> Mesh:
    _check_complete(path)
    stored = {".msh": meshio.gmsh, ".vtu": meshio.vtu}[path.suffix].read(path)
    own = [*stored.field_data, *stored.cell_data]
    if any(name.startswith("region:") for name in own):
        _, reader = _FORMATS[path.suffix]
        return _from_sets(*reader(stored))
    return assembled(raw_mesh(stored))


def raw_mesh(stored: meshio.Mesh) -> RawMesh:
    """Return what another program wrote: physical groups of a .msh, a .vtu's array of numbers of materials."""
    points = np.pad(stored.points, ((0, 0), (0, 3 - stored.points.shape[1])))
    blocks = [(block.type, np.asarray(block.data, dtype=np.int32)) for block in stored.cells]
    arrays = {name.lower(): np.concatenate(parts) for name, parts in stored.cell_data.items()}
    chosen = next((arrays[name] for name in _OF_MATERIALS if name in arrays), None)
    if chosen is None or chosen.dtype.kind not in "iu":
        return RawMesh(points, blocks)
    labels = {int(number): name for name, (number, _) in stored.field_data.items()}
    numbers = [int(number) for number in np.unique(chosen) if number or "gmsh:physical" not in arrays]
    sets = {labels.get(k, f"region {k}"): np.flatnonzero(chosen == k).astype(np.int32) for k in numbers}
    return RawMesh(points, blocks, sets)


def _to_sets(mesh: Mesh) -> tuple[FloatArray, Sets]:
    sets: Sets = {("region", name): mesh.cells[cells] for name, cells in mesh.regions.items()}
    sets |= {("surface", name): triangles for name, triangles in mesh.surfaces.items()}
    sets |= {("marker", name): nodes[:, None] for name, nodes in mesh.markers.items()}
    sets |= {("cap", name): edges for name, edges in mesh.caps.items()}
    flat = 3 - mesh.dimension
    points = [np.pad(mesh.points, ((0, 0), (0, flat)))]
    for name, curve in mesh.curves.items():
        start = sum(len(block) for block in points) + np.arange(len(curve) - 1, dtype=np.int32)
        sets["curve", name] = np.column_stack([start, start + 1])
        points.append(np.pad(curve, ((0, 0), (0, flat))))
    return np.vstack(points), sets


def _from_sets(points: FloatArray, sets: Sets) -> Mesh:
    regions: dict[str, IntArray] = {}
    blocks: list[IntArray] = []
    for name, cells in _of_kind(sets, "region"):
        start = sum(len(block) for block in blocks)
        regions[name] = np.arange(start, start + len(cells), dtype=np.int32)
        blocks.append(cells)
    if not blocks:
        raise InputError("the file names no region of second-order cells")
    if len({block.shape[1] for block in blocks}) > 1:
        raise InputError("the file mixes cells of several kinds")
    cells = np.vstack(blocks)
    if not is_body_cell(cells.shape[1]):
        raise InputError("the regions of the file are of no kind of cell that is known", value=meshio_name(cells))
    points = points[:, : body_cell(cells).dimension]
    used = np.unique(cells)
    index = np.full(len(points), -1, dtype=np.int32)
    index[used] = np.arange(len(used))
    cells = index[cells]
    return Mesh(
        points[used],
        cells,
        regions,
        {
            name: outward_faces(cells, index[faces[:, : face_cell(faces).n_corners]])
            for name, faces in _of_kind(sets, "surface")
        },
        {name: index[nodes[:, 0]] for name, nodes in _of_kind(sets, "marker")},
        {name: points[np.append(lines[:, 0], lines[-1, 1])] for name, lines in _of_kind(sets, "curve")},
        {name: index[edges] for name, edges in _of_kind(sets, "cap")},
    )


def _of_kind(sets: Sets, wanted: str) -> Iterator[tuple[str, IntArray]]:
    return ((name, cells) for (kind, name), cells in sets.items() if kind == wanted)


def _blocks(sets: Sets) -> list[tuple[str, IntArray]]:
    return [(meshio_name(cells), cells) for cells in sets.values()]


def _write_msh(path: Path, points: FloatArray, sets: Sets) -> None:
    numbers = [np.full(len(cells), number) for number, cells in enumerate(sets.values(), start=1)]
    names = {
        f"{kind}:{name}": np.array([number, _TYPES[cells.shape[1]][1]])
        for number, ((kind, name), cells) in enumerate(sets.items(), start=1)
    }
    blocks = _blocks(sets)
    data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
    meshio.gmsh.write(path, meshio.Mesh(points, blocks, cell_data=data, field_data=names), "2.2", binary=True)


def _read_msh(stored: meshio.Mesh) -> tuple[FloatArray, Sets]:
    known = dict(_TYPES.values())
    sets: Sets = {}
    for label, (number, dimension) in stored.field_data.items():
        kind, colon, name = label.rpartition(":")
        blocks = [
            block.data[physical == number]
            for block, physical in zip(stored.cells, stored.cell_data["gmsh:physical"], strict=True)
            if known.get(block.type) == dimension
        ]
        blocks = [block for block in blocks if len(block)]
        if blocks:
            sets[kind if colon else _KIND_OF_DIMENSION[int(dimension)], name] = np.vstack(blocks).astype(np.int32)
    return stored.points, sets


def _write_vtu(path: Path, points: FloatArray, sets: Sets) -> None:
    blocks = _blocks(sets)
    data: dict[str, list[Any]] = {
        f"{kind}:{name}": [np.full(len(block), int(key == (kind, name)), np.int8) for key, block in sets.items()]
        for kind, name in sets
    }
    meshio.vtu.write(path, meshio.Mesh(points, blocks, cell_data=data))


def _write_vtk(path: Path, mesh: Mesh) -> None:
    corners, cells = cells_of_corners(mesh.cells)
    kind = next(name for name, kind in KINDS.items() if kind.cell == mesh.cell_type and kind.linear)
    region = np.empty(mesh.n_cells, dtype=np.int32)
    for number, members in enumerate(mesh.regions.values()):
        region[members] = number
    points = np.pad(mesh.points[corners], ((0, 0), (0, 3 - mesh.dimension)))
    stored = meshio.Mesh(points, [(kind, cells)], cell_data={"region": [region]})
    meshio.vtk.write(path, stored, fmt_version="4.2", binary=False)


def _read_vtu(stored: meshio.Mesh) -> tuple[FloatArray, Sets]:
    sets: Sets = {}
    for array, values in stored.cell_data.items():
        kind, _, name = array.partition(":")
        if kind not in (*_KIND_OF_DIMENSION.values(), "cap"):
            continue
        blocks = [block.data[flag != 0] for block, flag in zip(stored.cells, values, strict=True)]
        blocks = [block for block in blocks if len(block)]
        if blocks:
            sets[kind, name] = np.vstack(blocks).astype(np.int32)
    return stored.points, sets


Writer = Callable[[Path, FloatArray, Sets], None]
Reader = Callable[[meshio.Mesh], tuple[FloatArray, Sets]]
_FORMATS: dict[str, tuple[Writer, Reader]] = {".msh": (_write_msh, _read_msh), ".vtu": (_write_vtu, _read_vtu)}


def _check_suffix(path: Path, further: str, what: str) -> None:
    if path.suffix not in (*_FORMATS, further):
        expected = f"a name that ends in {' or '.join(_FORMATS)}, or in {further} ({what})"
        raise InputError("this kind of mesh file is not known", file=path, value=path.suffix, expected=expected)
