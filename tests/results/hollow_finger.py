"""A hollow finger whose states are known in closed form: bent to a circular arc, twisted, stretched."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from turgor.mesh.faces import boundary_faces
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box
from turgor.results.record import StepRecord
from turgor.results.store import RunStore
from turgor.results.stored import Body, StoredState
from turgor.results.summary import summarise

FloatArray = npt.NDArray[np.float64]

LENGTH, WIDTH, HEIGHT = 100.0, 12.0, 12.0
CASE = "name: hollow-finger\nloads:\n  - pressure: 40 kPa\n"


def hollow_finger(divisions: tuple[int, int, int] = (20, 4, 4), markers: bool = True, *, half: bool = False) -> Mesh:
    """A box along x, its axis on the x axis, with a box-shaped cavity one element away from its faces.

    Of an even number of elements across y there is a `half`, y ≥ 0.
    """
    block = box((LENGTH, WIDTH, HEIGHT), divisions)
    points = block.points - [0.0, WIDTH / 2, HEIGHT / 2]
    cell = np.array([LENGTH, WIDTH, HEIGHT]) / divisions
    centres = points[block.cells[:, :4]].mean(axis=1)
    hollow = np.array([LENGTH, WIDTH, HEIGHT]) / 2 - cell
    kept = (np.abs(centres - [LENGTH / 2, 0.0, 0.0]) > hollow).any(axis=1) & ((centres[:, 1] > 0.0) | (not half))
    nodes, cells = np.unique(block.cells[kept], return_inverse=True)
    points, cells = points[nodes], cells.reshape(-1, 10)
    faces = boundary_faces(cells)
    centre = points[faces[:, :3]].mean(axis=1)
    x = centre[:, 0]
    cut = half & (np.abs(centre[:, 1]) < 1e-6)
    on_hull = (np.abs(centre - [LENGTH / 2, 0, 0]) > np.array([LENGTH, WIDTH, HEIGHT]) / 2 - 1e-6).any(axis=1)
    surfaces = {
        "mount": faces[x < 1e-6],
        "tip-face": faces[x > LENGTH - 1e-6],
        "outer": faces[on_hull & (x > 1e-6) & (x < LENGTH - 1e-6)],
        "cavity": faces[~on_hull & ~cut],
        **({"symmetry": faces[cut]} if half else {}),
    }
    line = np.flatnonzero((np.abs(points[:, 1]) < 1e-9) & (np.abs(points[:, 2] + HEIGHT / 2) < 1e-9))
    line = line[np.argsort(points[line, 0])]
    named = {"base": line[:1], "tip": line[-1:], "centreline": line} if markers else {}
    return Mesh(points, cells, surfaces=surfaces, markers=named)


def rod(points: FloatArray, bending: float, twist: float = 0.0, stretch: float = 1.0) -> FloatArray:
    """Displacement of a rod along x, first stretched, then twisted about its axis, then bent about −y, in rad."""
    s = stretch * points[:, 0]
    share = points[:, 0] / LENGTH
    turned = Rotation.from_rotvec(np.outer(bending * share, [0.0, -1.0, 0.0]))
    turned = turned * Rotation.from_rotvec(np.outer(twist * share, [1.0, 0.0, 0.0]))
    curvature = bending / (stretch * LENGTH)
    axis = np.zeros_like(points)
    axis[:, 0] = np.sin(curvature * s) / curvature if curvature else s
    axis[:, 2] = (1.0 - np.cos(curvature * s)) / curvature if curvature else 0.0
    return axis + turned.apply(points * [0.0, 1.0, 1.0]) - points


def moved(body: Body, displacement: FloatArray, **changes: Any) -> StoredState:
    """A state of a body whose nodes have moved by `displacement`, with other fields of its record changed."""
    record = replace(body.at_rest().record, displacement=np.asarray(displacement), **changes)
    return StoredState(body, record)


def bent_record(mesh: Mesh, index: int, fraction: float, full_bending: float = math.radians(200.0)) -> StepRecord:
    """A state on the way to `full_bending`, with a von Mises stress that grows away from the bending axis."""
    displacement = rod(mesh.points, fraction * full_bending)
    von_mises = fraction * (0.02 + 0.01 * np.abs(mesh.points[:, 2]))
    return StepRecord(
        index=index,
        fraction=fraction,
        loads={"pressure:cavity": 0.04 * fraction},
        displacement=displacement,
        element_pressure=np.linspace(-0.01, 0.02, mesh.n_cells) * fraction,
        element_dilatation=np.full(mesh.n_cells, 1.0 + 1e-4 * fraction),
        von_mises=von_mises,
        von_mises_max=float(von_mises.max()) * 1.1,
        von_mises_p99=float(np.quantile(von_mises, 0.99)),
        cavity_volumes={"cavity": Body(mesh).enclosed_volume("cavity", displacement)},
        solver={"iterations": 4, "factorisations": 4, "stable": True, "residual": 1e-9, "wall_s": 0.5},
    )


def finished_run(folder: Path, mesh: Mesh, fractions: FloatArray) -> Path:
    """Store a whole run and return its folder."""
    with RunStore.create(folder, mesh, CASE) as store:
        for index, fraction in enumerate(fractions):
            store.append(bent_record(mesh, index, float(fraction)))
        summary = summarise(
            store.history,
            mesh,
            converged=True,
            reason="reached 40 kPa",
            dofs=3 * mesh.n_points,
            wall_s=3.5,
            peak_memory_mb=120.0,
        )
        store.finish(summary)
    return folder
