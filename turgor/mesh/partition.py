"""Regions of a mesh by rules of plain geometry, for materials that no CAD body tells apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from turgor.common.errors import InputError
from turgor.geometry.space import Space
from turgor.mesh.mesh import Mesh


def partition(mesh: Mesh, regions: Mapping[str, Space], *, at_least: int | Mapping[str, int] = 4) -> Mesh:
    """Return the mesh with some cells moved to regions given by parts of space.

    The interface follows the elements' faces, so it is as rough as they are large; where the geometry of the interface
    is known, let the template or the CAD file draw it.

    Parameters
    ----------
    mesh
        Its cells stay in their regions where no rule claims them.
    regions
        Name → part of space, in the order of precedence: a cell that several claim goes to the first. A region of the
        mesh may be named to be enlarged.
    at_least
        How many of a cell's four corners must lie in the part of space, for all regions or by their names. Four takes
        the cells inside it; three is the rule of the multi-material tube ("Quasi-static FEA model for a multi-material
        soft pneumatic actuator in SOFA", section IV).

    Returns
    -------
    Mesh
        The same points, cells and other names; regions that lose all their cells are left out.

    Raises
    ------
    InputError
        If the cells are no tetrahedra, `at_least` is not 1 to 4, or a rule claims no cell.
    """
    if mesh.cell_type != "tet10":
        raise InputError("only tetrahedra are moved to regions by rules", value=mesh.cell_type, expected="tet10")
    least = dict.fromkeys(regions, at_least) if isinstance(at_least, int) else at_least
    for number in least.values():
        if number not in (1, 2, 3, 4):
            raise InputError("a tetrahedron has four corners", key="at_least", value=number, expected="1, 2, 3 or 4")
    names = list(dict.fromkeys([*regions, *mesh.regions]))
    used, of_cells = np.unique(mesh.cells[:, :4], return_inverse=True)
    corners, of_cells = mesh.points[used], of_cells.reshape(-1, 4)
    owner = np.empty(mesh.n_cells, dtype=np.int64)
    for name, cells in mesh.regions.items():
        owner[cells] = names.index(name)
    for number, (name, space) in reversed(list(enumerate(regions.items()))):
        try:
            inside = space.contains(corners)
        except InputError as error:
            raise error.at(key=f"regions.{name}") from error
        claimed = inside[of_cells].sum(axis=1) >= least[name]
        if not claimed.any():
            raise InputError("no cell lies in this part of space", key=f"regions.{name}")
        owner[claimed] = number
    found = {name: np.flatnonzero(owner == number).astype(np.int32) for number, name in enumerate(names)}
    return replace(mesh, regions={name: cells for name, cells in found.items() if len(cells)})
