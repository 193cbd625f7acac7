"""Pictures of the deformed, stressed body as PNG files.

VTK ends the process with a signal where OpenGL cannot start (no graphics library, no driver), so the drawing is done by
a process of its own, :mod:`turgor.results.render`; its end, however it comes, leaves the report alive.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turgor.common.errors import MissingPackageError
from turgor.common.optional import is_available, library_advice
from turgor.mesh.mesh import Mesh
from turgor.results.camera import camera_for
from turgor.results.record import StepRecord
from turgor.results.skin import compact, outside_faces

SIZE = (960, 720)
"""Width and height of a picture in pixels."""

TIME_LIMIT_S = 300.0

_GRAPHICS_ADVICE = (
    "OpenGL did not start without a screen; on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri"
)


@dataclass(frozen=True)
class Pictures:
    """PNG files as bytes: the whole body in each state, and the last state cut open along its side plane."""

    states: tuple[bytes, ...]
    section: bytes


def draw(mesh: Mesh, records: Sequence[StepRecord], labels: Sequence[str], scale_max: float) -> Pictures:
    """Draw some states with one camera and one colour scale, so that the pictures can be compared.

    Parameters
    ----------
    mesh
        The mesh of the run.
    records
        The states to draw, at least one.
    labels
        Text in the corner of each picture.
    scale_max
        von Mises stress in MPa at the upper end of the colour scale.

    Raises
    ------
    MissingPackageError
        If pyvista, or a system library that drawing needs, is missing; the message says how to install it.
    """
    if not is_available("pyvista"):
        raise MissingPackageError("pictures need the package 'pyvista': pip install pyvista")
    faces = outside_faces(mesh)
    nodes, compacted = compact(faces)
    displacements = np.array([record.displacement for record in records])
    seen = [mesh.points[nodes], *(mesh.points + displacements)[:, nodes]]
    camera = camera_for(np.concatenate(seen), SIZE[0] / SIZE[1])
    with tempfile.TemporaryDirectory(prefix="turgor-") as name:
        folder = Path(name)
        np.savez(
            folder / "job.npz",
            points=mesh.points,
            cells=mesh.cells,
            nodes=nodes,
            faces=compacted,
            displacements=displacements,
            von_mises=np.array([record.von_mises for record in records]),
            target=camera.target,
            towards=camera.towards,
            up=camera.up,
        )
        scene = {
            "labels": list(labels),
            "scale_max": scale_max,
            "size": SIZE,
            "half_height": camera.half_height,
            "side": camera.side,
        }
        (folder / "job.json").write_text(json.dumps(scene), encoding="utf-8")
        _render(folder)
        states = tuple((folder / f"state-{k}.png").read_bytes() for k in range(len(records)))
        return Pictures(states, (folder / "section.png").read_bytes())


def _render(folder: Path) -> None:
    command = [sys.executable, "-m", "turgor.results.render", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise MissingPackageError(f"drawing the pictures took more than {TIME_LIMIT_S:.0f} s") from error
    if done.returncode == 0:
        return
    if done.returncode < 0:
        raise MissingPackageError(_GRAPHICS_ADVICE)
    last_line = (done.stderr.strip().splitlines() or ["no message"])[-1]
    raise MissingPackageError(f"the pictures could not be drawn: {library_advice(last_line)}")
