"""A random but repeatable inflation: shape, wall ratio, materials, mesh and target pressure from one seed."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from turgor.geometry.actuator import Actuator
from turgor.geometry.catalogue import template
from turgor.materials.library import library
from turgor.mesh import Mesh
from turgor.mesh.generate import generate
from turgor.mesh.tet10 import EDGES, jacobian_coefficients

COARSENING = 1.3
"""A mesh with too many cells is made again with its size times this."""


@dataclass(frozen=True)
class Case:
    """One inflation. ``slenderness`` is wall over span; the target pressure is ``level`` × μ × slenderness.

    `size_factor` multiplies the template's own element size; `per_circle` is the least number of elements on a circle;
    `ugliness` is how far inner nodes are moved at random, in parts of the shortest edge there.
    """

    seed: int
    template: str
    parameters: dict[str, Any]
    slenderness: float
    materials: tuple[str, str]
    level: float
    steps: int
    size_factor: float
    per_circle: int
    ugliness: float

    def actuator(self) -> Actuator:
        return template(self.template)(**self.parameters)


def random_case(seed: int) -> Case:
    """Return the case of a seed; materials are the usable ones and, once in ten, any of the library."""
    rng = np.random.default_rng(seed)
    shape = SHAPES[int(rng.integers(len(SHAPES)))]
    name, parameters, slenderness = shape(rng)
    choice = _materials(usable=bool(rng.random() < 0.9))
    body = choice[int(rng.integers(len(choice)))]
    second = choice[int(rng.integers(len(choice)))] if rng.random() < 0.5 else body
    return Case(
        seed=seed,
        template=name,
        parameters=parameters,
        slenderness=slenderness,
        materials=(body, second),
        level=float(np.exp(rng.uniform(np.log(0.03), np.log(3.0)))),
        steps=int(rng.choice([1, 1, 2, 5])),
        size_factor=float(np.exp(rng.uniform(np.log(0.9), np.log(4.0)))),
        per_circle=int(rng.choice([0, 6, 8, 12])),
        ugliness=float(rng.choice([0.0, 0.0, 0.1, 0.2])),
    )


@functools.cache
def _materials(*, usable: bool) -> list[str]:
    return [entry.name for entry in library() if not (usable and entry.unusable)]


def _tube(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    radius = rng.uniform(3.0, 15.0)
    ratio = float(np.exp(rng.uniform(np.log(0.08), np.log(1.5))))
    wall = ratio * radius
    cap = rng.uniform(0.5, 2.0) * wall
    length = 2.0 * cap + rng.uniform(1.0, 10.0) * radius
    sizes = {"inner_radius": radius, "wall": wall, "length": length, "cap": cap}
    return "tube", _millimetres(sizes), ratio


def _pneunet(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    wall = rng.uniform(0.8, 3.0)
    width, height = rng.uniform(6.0, 16.0), rng.uniform(8.0, 18.0)
    sizes = {"wall": wall, "side_wall": wall, "top_wall": wall * rng.uniform(0.7, 1.5)}
    sizes |= {"chamber_width": width, "chamber_height": height, "gap": rng.uniform(1.0, 3.0)}
    counts = {"chambers": int(rng.integers(2, 5)), "symmetric": bool(rng.random() < 0.7)}
    return "pneunet", counts | _millimetres(sizes), (wall / min(width, height)) ** 2 * 4.0


def _bellows(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    wall = rng.uniform(0.8, 2.2)
    counts = {"convolutions": int(rng.integers(1, 3)), "model": str(rng.choice(["quarter", "full"], p=[0.8, 0.2]))}
    return "bellows", counts | _millimetres({"wall": wall}), wall / 15.73


def _membrane(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    sizes = {"membrane": rng.uniform(0.2, 1.0), "chamber_width": rng.uniform(2.0, 5.0)}
    sizes |= {"chamber_length": rng.uniform(6.0, 20.0), "base": rng.uniform(1.0, 3.0)}
    return "membrane", {"segments": 1} | _millimetres(sizes), sizes["membrane"] / sizes["chamber_width"]


def _reinforced_tube(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    inner = rng.uniform(6.0, 14.0)
    wall = rng.uniform(0.15, 0.6) * inner
    rings = int(rng.integers(3, 6))
    cavity = 3.0 * rings + 2.0 * (rings + 1)
    sizes = {"inner_diameter": inner, "outer_diameter": inner + 2.0 * wall, "cavity_length": cavity}
    sizes |= {"length": cavity + 15.0, "thickness": min(0.8, 0.4 * wall)}
    return "reinforced-tube", {"rings": rings, "symmetric": True} | _millimetres(sizes), 2.0 * wall / inner


def _honeycomb(rng: np.random.Generator) -> tuple[str, dict[str, Any], float]:
    thickness = rng.uniform(0.8, 2.0)
    counts = {"columns": 1, "rows": int(rng.integers(1, 3)), "model": "half"}
    return "honeycomb", counts | _millimetres({"thickness": thickness}), (thickness / 15.0) ** 2 * 4.0


SHAPES = (_tube, _tube, _pneunet, _bellows, _membrane, _reinforced_tube, _honeycomb)
"""The tube twice, for it alone has limit pressures that can be known beforehand."""


def _millimetres(sizes: dict[str, float]) -> dict[str, str]:
    return {name: f"{value:.4g} mm" for name, value in sizes.items()}


def mesh_of(case: Case, most_cells: int) -> Mesh:
    """Mesh a case, with larger elements than it asks for where they would be more than `most_cells`."""
    actuator = case.actuator()
    size = case.size_factor * actuator.default_size
    mesh = generate(actuator, size, per_circle=case.per_circle)
    while mesh.n_cells > most_cells:
        size *= COARSENING
        coarser = generate(actuator, size, per_circle=min(case.per_circle, 6))
        if coarser.n_cells >= mesh.n_cells:
            break
        mesh = coarser
    return spoilt(mesh, case.ugliness, case.seed) if case.ugliness else mesh


def spoilt(mesh: Mesh, ugliness: float, seed: int) -> Mesh:
    """Move the inner corner nodes at random by up to `ugliness` of the shortest edge there, where cells stay valid."""
    rng = np.random.default_rng([seed, 1])
    points, cells = mesh.points, mesh.cells
    first, second = np.array(EDGES).T
    length = np.linalg.norm(points[cells[:, first]] - points[cells[:, second]], axis=2)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, cells[:, :4], length.min(axis=1)[:, None])
    corners = np.unique(cells[:, :4])
    inner = np.setdiff1d(corners, _skin(cells))
    shift = np.zeros_like(points)
    shift[inner] = rng.uniform(-1.0, 1.0, (len(inner), 3)) * ugliness * shortest[inner, None]
    while True:
        moved = points + shift
        moved[cells[:, 4:]] = points[cells[:, 4:]] + 0.5 * (shift[cells[:, first]] + shift[cells[:, second]])
        coefficients = jacobian_coefficients(moved[cells])
        bad = coefficients.min(axis=1) < 0.02 * np.abs(coefficients).max(axis=1)
        if not bad.any() or not shift.any():
            return replace(mesh, points=moved)
        shift[cells[bad, :4]] = 0.0


def _skin(cells: np.ndarray) -> np.ndarray:
    """Return the corner nodes of the faces that belong to one cell only."""
    faces = np.sort(cells[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    unique, count = np.unique(faces, axis=0, return_counts=True)
    return np.unique(unique[count == 1])
