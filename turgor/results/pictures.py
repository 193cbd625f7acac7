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
from typing import Any

import numpy as np

from turgor.common.errors import MissingPackageError
from turgor.common.optional import is_available, library_advice
from turgor.results.camera import Camera, camera_for
from turgor.results.drawing import drawing_of
from turgor.results.record import StepRecord
from turgor.results.stored import Body

SIZE = (960, 720)
"""Width and height of a picture in pixels."""

TIME_LIMIT_S = 300.0

_GRAPHICS_ADVICE = (
    "OpenGL did not start without a screen; on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri"
)


@dataclass(frozen=True)
class Pictures:
    """PNG files as bytes: the body in each state, and of a body in space the last state once more, and what it shows.

    That is the body cut open along its side plane. One that planes of symmetry cut is seen from these cuts in every
    state, and the last time from outside.
    """

    states: tuple[bytes, ...]
    last: bytes | None = None
    last_label: str = ""


def draw(body: Body, records: Sequence[StepRecord], labels: Sequence[str], scale_max: float) -> Pictures:
    """Draw some states with one camera and one colour scale, so that the pictures can be compared.

    Parameters
    ----------
    body
        The body of the run.
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
    drawing, mesh = drawing_of(body), body.mesh
    positions = [mesh.points, *(mesh.points + record.displacement for record in records)]
    places = np.array([drawing.places(here) for here in positions])
    seen, aspect = np.concatenate(places), SIZE[0] / SIZE[1]
    arrays: dict[str, Any] = {
        "places": places,
        "faces": drawing.faces,
        "von_mises": np.array([record.von_mises[drawing.source] for record in records]),
    }
    scene: dict[str, Any] = {
        "labels": list(labels),
        "scale_max": scale_max,
        "size": SIZE,
        "camera": _plain(camera_for(seen, aspect, drawing.cuts)),
    }
    if body.kind == "space" and len(drawing.cuts):
        scene |= {"outside": _plain(camera_for(seen, aspect, -drawing.cuts))}
        scene |= {"last_label": f"{labels[-1]}, from outside"}
    elif body.kind == "space":
        arrays |= {"points": mesh.points, "moved": positions[-1], "cells": mesh.cells, "nodal": records[-1].von_mises}
        scene |= {"last_label": f"{labels[-1]}, cut open"}
    with tempfile.TemporaryDirectory(prefix="turgor-") as name:
        folder = Path(name)
        np.savez(folder / "job.npz", **arrays)
        (folder / "job.json").write_text(json.dumps(scene), encoding="utf-8")
        _render(folder)
        states = tuple((folder / f"state-{k}.png").read_bytes() for k in range(len(records)))
        if "last_label" not in scene:
            return Pictures(states)
        return Pictures(states, (folder / "last.png").read_bytes(), scene["last_label"])


def _plain(camera: Camera) -> dict[str, Any]:
    """Return a camera as plain values."""
    return {
        "target": camera.target.tolist(),
        "towards": camera.towards.tolist(),
        "up": camera.up.tolist(),
        "half_height": camera.half_height,
        "side": camera.side,
    }


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
