"""Meshes for other solvers: node, element, set and surface blocks of Abaqus and CalculiX (.inp) and FEBio (.feb).

Both count from one, and both order the nodes of a ten-node tetrahedron and a six-node triangle as we do. The files
written here hold the mesh only (a deck takes them in by ``*INCLUDE, INPUT=mesh.inp`` or ``<Mesh from="mesh.feb"/>``);
:mod:`turgor.study.export` makes models of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.writing import writing
from turgor.mesh.faces import host_cells
from turgor.mesh.mesh import Mesh

Ints = npt.NDArray[Any]

# The corners of the faces S1 to S4 of a tetrahedron in Abaqus.
_INP_FACES = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])


def write_deck(mesh: Mesh, path: str | Path) -> None:
    """Write a mesh of tetrahedra as a .inp or .feb file.

    In a .inp every region is an ELSET; every surface is a SURFACE of element faces, an NSET of its nodes and, for loads
    by face (``*DLOAD`` with ``P1`` to ``P4``), the ELSETs ``NAME_S1`` to ``NAME_S4`` of the elements whose face of that
    number it holds; every marker is an NSET. Names are in capitals with underscores for hyphens. In a .feb they are
    Elements, Surface and NodeSet.

    Raises
    ------
    InputError
        If the suffix is another one, the mesh is not of tetrahedra, two names become one label, or the file cannot be
        written.
    """
    path = Path(path)
    writers = {".inp": inp_lines, ".feb": _feb}
    if path.suffix not in writers:
        expected = "a name that ends in .inp or .feb"
        raise InputError("this kind of deck is not known", file=path, value=path.suffix, expected=expected)
    if mesh.cells.shape[1] != 10:
        raise InputError("only meshes of ten-node tetrahedra are written as decks", file=path)
    with writing(path, "the mesh cannot be written"):
        path.write_text("\n".join(writers[path.suffix](mesh)) + "\n", encoding="utf-8")


def inp_lines(mesh: Mesh) -> Iterator[str]:
    """Yield the blocks of a .inp file; raise InputError if two names become one label."""
    yield "*NODE, NSET=ALL_NODES"
    for number, place in enumerate(mesh.points.tolist(), start=1):
        yield ", ".join([str(number), *map(inp_number, place)])
    for name, cells in _labelled(mesh.regions):
        yield f"*ELEMENT, TYPE=C3D10, ELSET={name}"
        for cell in cells.tolist():
            yield ", ".join(str(number) for number in (cell + 1, *(mesh.cells[cell] + 1).tolist()))
    for name, nodes in _labelled(_node_sets(mesh)):
        yield f"*NSET, NSET={name}"
        yield from _rows(nodes + 1, 12)
    for name, triangles in _labelled(mesh.surfaces):
        hosts, sides = element_faces(mesh, triangles)
        used = [side for side in range(4) if (sides == side).any()]
        for side in used:
            yield f"*ELSET, ELSET={name}_S{side + 1}"
            yield from _rows(hosts[sides == side] + 1, 12)
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        yield from (f"{name}_S{side + 1}, S{side + 1}" for side in used)


def element_faces(mesh: Mesh, triangles: Ints) -> tuple[Ints, Ints]:
    """Return the host cell and the number (0 to 3) of its face in Abaqus's count, of each triangle."""
    hosts = host_cells(mesh.cells, triangles)
    sides = np.sort(mesh.cells[hosts][:, _INP_FACES], axis=2)
    wanted = np.sort(triangles[:, :3], axis=1)
    return hosts, np.argmax((sides == wanted[:, None, :]).all(axis=2), axis=1)


def _feb(mesh: Mesh) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<febio_spec version="4.0">'
    yield from feb_mesh_lines(mesh)
    yield "</febio_spec>"


def feb_mesh_lines(mesh: Mesh) -> Iterator[str]:
    """Yield the ``Mesh`` section of a .feb file."""
    yield "<Mesh>"
    yield '<Nodes name="all">'
    for number, (x, y, z) in enumerate(mesh.points.tolist(), start=1):
        yield f'<node id="{number}">{x!r},{y!r},{z!r}</node>'
    yield "</Nodes>"
    for name, cells in mesh.regions.items():
        yield f'<Elements type="tet10" name={quoteattr(name)}>'
        for cell in cells.tolist():
            yield f'<elem id="{cell + 1}">{_joined(mesh.cells[cell] + 1)}</elem>'
        yield "</Elements>"
    for name, nodes in _node_sets(mesh).items():
        yield f"<NodeSet name={quoteattr(name)}>{_joined(nodes + 1)}</NodeSet>"
    for name, triangles in mesh.surfaces.items():
        yield f"<Surface name={quoteattr(name)}>"
        for number, triangle in enumerate(triangles, start=1):
            yield f'<tri6 id="{number}">{_joined(triangle + 1)}</tri6>'
        yield "</Surface>"
    yield "</Mesh>"


def _node_sets(mesh: Mesh) -> dict[str, Ints]:
    """Return the nodes of every surface and marker; a marker that shares a surface's name is called ``marker-NAME``."""
    sets: dict[str, Ints] = {name: mesh.surface_nodes(name) for name in mesh.surfaces}
    for name, nodes in mesh.markers.items():
        sets[f"marker-{name}" if name in sets else name] = nodes
    return sets


def inp_number(value: float) -> str:
    """Return a number for a .inp file: CalculiX reads no more than twenty characters, and drops the others."""
    return f"{value:.13g}"


def label(name: str) -> str:
    """Return a name as the label that it becomes in a .inp file."""
    return name.upper().replace("-", "_").replace(" ", "_")


def _labelled(things: Mapping[str, Ints]) -> list[tuple[str, Ints]]:
    labels = [label(name) for name in things]
    twice = sorted({label for label in labels if labels.count(label) > 1})
    if twice:
        raise InputError("two names become the same label", value=twice[0])
    return list(zip(labels, things.values(), strict=True))


def _rows(numbers: Ints, width: int) -> Iterable[str]:
    return (", ".join(map(str, numbers[start : start + width].tolist())) for start in range(0, len(numbers), width))


def _joined(numbers: Ints) -> str:
    return ",".join(map(str, numbers.tolist()))
