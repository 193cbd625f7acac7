"""The cases, meshed by Turgor: a capped tube, whole, a quarter and a section, a block under a punch, a bellows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from case import Case

import turgor
from turgor.mesh import Mesh
from turgor.mesh.structured import rectangle

FREE = np.nan

HEXAHEDRA = {"cells": "hexahedra", "per_circle": 8}
"""Rows of them, eight at least along a circle and one through the wall."""


@dataclass(frozen=True)
class Maker:
    """How a case is made at an element size in mm, and at which sizes unless others are asked for."""

    make: Callable[[float], Case]
    sizes: tuple[float, ...]


def tube(size: float, **meshing: Any) -> Case:
    """Case T: a tube of inner radius 6.35 mm, wall 3.5 mm and length 120 mm with solid caps of 17 mm, one end clamped.

    The pressure is 58 % of its limit.
    """
    return tube_of("full", size, {"mount": (0.0, 0.0, 0.0)}, meshing)


def quarter_tube(size: float, **meshing: Any) -> Case:
    """The quarter x, y ≥ 0 of case T, whose cut faces slide."""
    held = {"mount": (0.0, 0.0, 0.0), "symmetry-x": (0.0, FREE, FREE), "symmetry-y": (FREE, 0.0, FREE)}
    return tube_of("quarter", size, held, meshing)


def tube_section(size: float, cells: str = "triangles") -> Case:
    """The section of case T through its axis."""
    return tube_of("axisymmetric", size, {"mount": (0.0, 0.0), "axis": (0.0, FREE)}, {"cells": cells})


def tube_of(model: str, size: float, held: dict[str, tuple[float, ...]], meshing: dict[str, Any]) -> Case:
    """Return a model of case T, meshed as asked for."""
    mesh = turgor.CappedTube(model=model).mesh(size=f"{size} mm", **meshing)
    kind = "space" if mesh.dimension == 3 else model
    return case_of(mesh, kind, 0.1047, 1000.0, int(mesh.markers["tip"][0]), held, pressure=0.02)


def punch(size: float, cell_type: str = "tri6") -> Case:
    """Half of a block 2 mm wide and 1 mm high in plane strain: a rough punch, 1 mm wide, is pressed in by 0.1 mm.

    The bottom slides; the upper corner is compared.
    """
    n = 2 * round(0.5 / size)
    mesh = rectangle((1.0, 1.0), (n, n), cell_type)
    top = mesh.surfaces["y1"]
    under = top[mesh.points[top[:, 2], 0] < 0.5]
    body = Mesh(mesh.points, mesh.cells, surfaces={**mesh.surfaces, "punch": under})
    tip = int(np.argmax(mesh.points.sum(axis=1)))
    held = {"punch": (0.0, -0.1), "x0": (0.0, FREE), "y0": (FREE, 0.0)}
    return case_of(body, "plane-strain", 0.1, 1e4, tip, held)


def bellows(size: float) -> Case:
    """The section of the template `bellows`, held at the ring around its inlet."""
    mesh = turgor.Bellows(model="axisymmetric").mesh(size=f"{size} mm", cells="triangles")
    tip = int(mesh.markers["tip"][0])
    held = {"mount": (0.0, 0.0), "axis": (0.0, FREE)}
    return case_of(mesh, "axisymmetric", 1.0, 1000.0, tip, held, pressure=0.02)


def case_of(
    mesh: Mesh,
    kind: str,
    mu: float,
    ratio: float,
    tip: int,
    held: dict[str, tuple[float, ...]],
    pressure: float = 0.0,
) -> Case:
    """Return a mesh of Turgor's as a case; `ratio` is K/μ."""
    names = [*held, "cavity"] if "cavity" in mesh.surfaces else list(held)
    surfaces = {name: mesh.surfaces[name] for name in names}
    given = {name: np.array(value) for name, value in held.items()}
    return Case(kind, mu, ratio * mu, pressure, mesh.points, mesh.cells, surfaces, given, tip)


CASES = {
    "tube": Maker(tube, (5.0, 3.0, 2.0)),
    "tube-quarter": Maker(quarter_tube, (5.0, 3.0, 2.0)),
    "tube-hexahedra": Maker(partial(tube, **HEXAHEDRA), (40.0, 10.0, 7.0)),
    "tube-quarter-hexahedra": Maker(partial(quarter_tube, **HEXAHEDRA), (40.0, 10.0, 5.0)),
    "tube-section": Maker(tube_section, (1.6, 0.8, 0.4)),
    "tube-section-quads": Maker(partial(tube_section, cells="quadrilaterals"), (1.6, 0.8, 0.4)),
    "punch": Maker(punch, (0.125, 0.0625, 0.03125)),
    "punch-quads": Maker(partial(punch, cell_type="quad9"), (0.125, 0.0625, 0.03125)),
    "bellows": Maker(bellows, (0.8, 0.4, 0.2)),
}
