"""Sections cut into four-sided blocks, from which quadrilaterals and, turned about an axis, hexahedra are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turgor.geometry.path import Piece, polygon

FloatArray = npt.NDArray[np.float64]

AXIS = "axis"
"""Name of the sides on the axis about which a section is turned."""


@dataclass(frozen=True)
class Block:
    """A four-sided part of a section.

    Parameters
    ----------
    region
        What it belongs to.
    sides
        Four lines or arcs that follow each other anticlockwise; what two blocks share is a whole side of both.
    names
        Surface that each side is part of; None between blocks.
    """

    region: str
    sides: tuple[Piece, Piece, Piece, Piece]
    names: tuple[str | None, str | None, str | None, str | None]


@dataclass(frozen=True)
class Blocks:
    """A section of radius and height in blocks, with the markers and curves of the body in space, ``(k, 3)`` each."""

    parts: Sequence[Block]
    markers: Mapping[str, FloatArray]
    curves: Mapping[str, FloatArray] = field(default_factory=dict)


def capped_tube(radii: Sequence[float], regions: Sequence[str], cap: float, length: float) -> list[Block]:
    """Return the blocks of a tube with caps.

    Parameters
    ----------
    radii
        Of the cavity and of the outside of each layer, ascending, mm.
    regions
        Of the caps' middle, over the cavity, and of each layer.
    cap, length
        Thickness of the caps and length over all, mm.
    """
    columns, rows, last = [0.0, *radii], [0.0, cap, length - cap, length], len(radii) - 1
    blocks = []
    for column, region in enumerate(regions):
        for row, end in enumerate(("mount", None, "tip-face")):
            if (column, row) == (0, 1):
                continue
            (left, right), (low, high) = columns[column : column + 2], rows[row : row + 2]
            inside = AXIS if column == 0 else "cavity" if (column, row) == (1, 1) else None
            names = (
                end if row == 0 else "cavity" if (column, row) == (0, 2) else None,
                "outer" if column == last else None,
                end if row == 2 else "cavity" if (column, row) == (0, 0) else None,
                inside,
            )
            first, second, third, fourth = polygon([(left, low), (right, low), (right, high), (left, high)])
            blocks.append(Block(region, (first, second, third, fourth), names))
    return blocks
