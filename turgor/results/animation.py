"""The moving body of the report, packed small: positions as 16-bit and colours as 8-bit integers in base64."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turgor.mesh.tet10 import IntArray
from turgor.results.drawing import Drawing, drawing_of
from turgor.results.skin import flat_triangles, smooth_patches
from turgor.results.stored import Body

FloatArray = npt.NDArray[np.float64]

BUDGET_BYTES = 6_000_000
"""Room for the frames in the file."""

_FEW_FRAMES = 12
_BYTES_PER_NODE = 7 * 4 / 3  # three 16-bit coordinates and one byte of colour, in base64
_POSITION_LEVELS, _COLOUR_LEVELS = 2**16 - 1, 2**8 - 1


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """What is drawn of a body as flat triangles, with points of its own on either side of a sharp edge.

    Parameters
    ----------
    drawing
        The curved triangles that they approximate.
    nodes
        Point of the drawing that each drawn node is, shape ``(d,)``.
    triangles
        Drawn nodes of each triangle, shape ``(j, 3)``.
    """

    drawing: Drawing
    nodes: IntArray
    triangles: IntArray

    def places(self, positions: FloatArray) -> FloatArray:
        """Return the places ``(d, 3)`` of the drawn nodes where the mesh's are at `positions` ``(n, d)``."""
        return self.drawing.places(positions)[self.nodes]

    def values(self, nodal: FloatArray) -> FloatArray:
        """Return a nodal quantity ``(n,)`` of the mesh at the drawn nodes, ``(d,)``."""
        return np.asarray(nodal[self.drawing.source[self.nodes]])


def drawn_surface(body: Body, *, quartered: bool) -> DrawnSurface:
    """Return what is drawn of the body; `quartered`: each curved face as four flat triangles instead of one."""
    drawing = drawing_of(body)
    patches = smooth_patches(drawing.places(body.mesh.points), drawing.faces)
    triangles = flat_triangles(drawing.faces, quartered=quartered)
    patch = np.repeat(patches, len(triangles) // len(drawing.faces))[:, None]
    n_points = len(drawing.source)
    keys = patch.astype(np.int64) * n_points + triangles
    distinct, inverse = np.unique(keys, return_inverse=True)
    nodes = np.asarray(distinct % n_points, dtype=np.int32)
    return DrawnSurface(drawing, nodes, np.asarray(inverse.reshape(triangles.shape), dtype=np.int32))


def frames_that_fit(n_steps: int, n_nodes: int) -> list[int]:
    """Return the steps to show, evenly chosen with the first and the last, so that they fit into the budget."""
    most = max(2, int(BUDGET_BYTES / (n_nodes * _BYTES_PER_NODE)))
    return sorted({round(k) for k in np.linspace(0, n_steps - 1, min(n_steps, most))})


def surface_that_fits(body: Body, n_steps: int) -> DrawnSurface:
    """Return the finer surface if enough of its frames fit into the budget, else the coarser."""
    surface = drawn_surface(body, quartered=True)
    if len(frames_that_fit(n_steps, len(surface.nodes))) >= min(n_steps, _FEW_FRAMES):
        return surface
    return drawn_surface(body, quartered=False)


@dataclass(frozen=True)
class Bounds:
    """The box that holds every state, corners of shape ``(3,)`` in mm."""

    low: FloatArray
    high: FloatArray


def bounds(positions: Sequence[FloatArray]) -> Bounds:
    """Return the box that holds all the `positions`, each ``(d, 3)``."""
    return Bounds(
        np.min([p.min(axis=0) for p in positions], axis=0), np.max([p.max(axis=0) for p in positions], axis=0)
    )


def pack(
    surface: DrawnSurface,
    positions: Sequence[FloatArray],
    stresses: Sequence[FloatArray],
    labels: Sequence[str],
    box: Bounds,
    scale_max: float,
) -> dict[str, Any]:
    """Return the frames as plain data for the page's script.

    Parameters
    ----------
    surface
        What is drawn.
    positions
        Drawn nodes in each frame, each ``(d, 3)``, mm.
    stresses
        Their von Mises stress in each frame, each ``(d,)``, MPa.
    labels
        What the page says of each frame.
    box
        Holds every position.
    scale_max
        von Mises stress in MPa that the highest colour stands for.
    """
    step = float((box.high - box.low).max()) / _POSITION_LEVELS
    frames = []
    for place, stress, label in zip(positions, stresses, labels, strict=True):
        levels = np.rint((place - box.low) / step).astype("<u2")
        colours = np.rint(np.clip(stress / scale_max, 0.0, 1.0) * _COLOUR_LEVELS).astype(np.uint8)
        frames.append({"label": label, "xyz": _base64(levels.T), "colour": _base64(colours)})
    return {
        "origin": box.low.tolist(),
        "step": step,
        "colourStep": scale_max / _COLOUR_LEVELS,
        "triangles": _base64(surface.triangles.T.astype("<i4")),
        "frames": frames,
    }


def _base64(array: npt.NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
