"""Who is near whom: a tree of boxes around faces and their normals, made once and fitted anew to every state."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from turgor.fem.contact.closest import dot
from turgor.fem.contact.partners import FACING, Balls, balls
from turgor.fem.contact.skin import Skin
from turgor.fem.kernels import jit, parallel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.int64]

ASKEW = 0.5
"""So much farther from opposite (in cosine) may the middles of two curved faces be than the places where they touch."""

LEAF = 6
"""Faces in a box that is not divided further."""

CORNER = 0.2
"""Neighbours whose middles lie so far (in sine) in front of each other at rest make a corner that may close."""

DEEPEST = 128
"""Boxes that may wait to be looked into; a tree that halves has far fewer."""


ROOM = 16
"""Candidates of a face for which there is room at first."""


class Search:
    """Finds the faces that may meet.

    Faces that share a corner meet only where they look at each other at rest, as in the root of a fold; the two sides
    of one wall never do: faces of one body that lie near and behind one another at rest. Which faces share a box is
    decided at rest, where they lie and look; the boxes themselves are those of each state.

    Parameters
    ----------
    skin
        The faces.
    group
        Number of each face's group ``(k,)``: only faces of different groups meet. ``None``: any may meet any.
    """

    def __init__(self, skin: Skin, group: Ints | None) -> None:
        self.skin = skin
        k = len(skin.faces)
        self._group = np.arange(k, dtype=np.int32) if group is None else group
        self._rest = balls(skin.points, skin.faces)[:3]
        centre, normal, _ = self._rest
        # Faces that look the same way are put together, as if a right angle between them were this long a way.
        apart = 0.5 * float(np.linalg.norm(np.ptp(centre, axis=0)))
        self._room = ROOM
        self._links, self._order = _tree(np.hstack([centre, apart * normal]))

    def candidates(self, around: Balls, reach: float) -> tuple[Indices, Ints]:
        """Return for each face the faces that its points may overlap, or meet within `reach`.

        Parameters
        ----------
        around
            Balls around all faces where they are.
        reach
            In mm.

        Returns
        -------
        start, candidates
            In compressed rows: the candidates of face ``f`` are ``candidates[start[f]:start[f + 1]]``.
        """
        skin, k = self.skin, len(self.skin.faces)
        centre, normal, radius, _ = around
        if not np.isfinite(centre).all():
            # The iteration has gone astray, which is for the solver to say.
            return np.zeros(k + 1, np.int64), np.empty(0, np.int32)
        boxes = np.empty((len(self._links), 2, 6))
        _fit(centre, normal, radius, self._links, self._order, boxes)
        corners = np.ascontiguousarray(skin.faces[:, : skin.cell.n_corners])
        now = (centre, normal, radius, skin.depth, reach)
        always = (corners, self._group, *self._rest, skin.wall, skin.part)
        count = np.empty(k, np.int64)
        while True:
            found = np.empty((k, self._room), np.int32)
            _search(*now, *always, boxes, self._links, self._order, count, found)
            if (most := int(count.max(initial=0))) <= self._room:
                break
            self._room = 2 * most
        start = np.concatenate([[0], np.cumsum(count)])
        return start, found[np.arange(self._room) < count[:, None]]


def _tree(places: Floats) -> tuple[Indices, Indices]:
    """Return the links of boxes ``(b, 2)`` and the order of the `places` ``(k, 6)`` in them, ``(k,)``.

    The links are the two boxes inside, which come later, or, of a box that holds faces itself, minus one less its
    first place in the order, and their number.
    """
    order = np.arange(len(places))
    links: list[list[int]] = []
    waiting = [(0, len(places), -1, 0)]
    while waiting:
        begin, end, parent, side = waiting.pop()
        if parent >= 0:
            links[parent][side] = len(links)
        if end - begin <= LEAF:
            links.append([-1 - begin, end - begin])
            continue
        here, half = order[begin:end], (end - begin) // 2
        axis = int(np.argmax(np.ptp(places[here], axis=0)))
        order[begin:end] = here[np.argpartition(places[here, axis], half)]
        waiting += [(begin, begin + half, len(links), 0), (begin + half, end, len(links), 1)]
        links.append([0, 0])
    return np.array(links), order


@jit
def _fit(centre, normal, radius, links, order, boxes):  # type: ignore[no-untyped-def]
    """Fill the boxes ``(b, 2, 6)`` around balls and around their normals, the innermost first."""
    for b in range(len(links) - 1, -1, -1):
        boxes[b, 0], boxes[b, 1] = np.inf, -np.inf
        if links[b, 0] < 0:
            for f in order[-1 - links[b, 0] : -1 - links[b, 0] + links[b, 1]]:
                for i in range(3):
                    boxes[b, 0, i] = min(boxes[b, 0, i], centre[f, i] - radius[f])
                    boxes[b, 1, i] = max(boxes[b, 1, i], centre[f, i] + radius[f])
                    boxes[b, 0, 3 + i] = min(boxes[b, 0, 3 + i], normal[f, i])
                    boxes[b, 1, 3 + i] = max(boxes[b, 1, 3 + i], normal[f, i])
        else:
            for inner in links[b]:
                for i in range(6):
                    boxes[b, 0, i] = min(boxes[b, 0, i], boxes[inner, 0, i])
                    boxes[b, 1, i] = max(boxes[b, 1, i], boxes[inner, 1, i])


@jit
def _may_hold(box, middle, outward, far):  # type: ignore[no-untyped-def]
    """Whether a box may hold faces within `far` of a place that are about opposite to a direction."""
    square = 0.0
    cosine = 0.0
    for i in range(3):
        out = max(box[0, i] - middle[i], 0.0, middle[i] - box[1, i])
        square += out * out
        cosine += min(outward[i] * box[0, 3 + i], outward[i] * box[1, 3 + i])
    return square <= far * far and cosine < FACING + ASKEW


@jit
def _one_wall(f, m, centre, normal, radius, wall):  # type: ignore[no-untyped-def]
    """Whether two faces of one part are two sides of one wall: near and behind one another at rest."""
    square = behind = ahead = 0.0
    for i in range(3):
        away = centre[m, i] - centre[f, i]
        square += away * away
        behind += away * normal[f, i]
        ahead += away * normal[m, i]
    distance = np.sqrt(square)
    if distance >= 1.5 * max(wall[f], wall[m]) + radius[f] + radius[m]:
        return False
    return behind < -1e-6 * distance and ahead > 1e-6 * distance


@jit
def _in_a_corner(f, m, centre, normal):  # type: ignore[no-untyped-def]
    """Whether two faces look at each other across a corner of the body at rest: they may fold upon each other."""
    square = ahead = back = 0.0
    for i in range(3):
        away = centre[m, i] - centre[f, i]
        square += away * away
        ahead += away * normal[f, i]
        back -= away * normal[m, i]
    return min(ahead, back) > CORNER * np.sqrt(square)


@jit
def _share(first, second):  # type: ignore[no-untyped-def]
    for a in first:
        for b in second:
            if a == b:
                return True
    return False


@parallel
def _search(  # type: ignore[no-untyped-def]
    centre,
    normal,
    radius,
    depth,
    reach,
    corners,
    group,
    rest_centre,
    rest_normal,
    rest_radius,
    wall,
    part,
    boxes,
    links,
    order,
    count,
    found,
):
    """Write how many candidates each face has, ``count (k,)``, and the first of them, ``found (k, room)``."""
    room = found.shape[1]
    for f in nb.prange(len(centre)):
        waiting = np.empty(DEEPEST, np.int64)
        waiting[0], left, here = 0, 1, 0
        while left > 0:
            left -= 1
            b = waiting[left]
            if not _may_hold(boxes[b], centre[f], normal[f], radius[f] + max(reach, depth[f])):
                continue
            if links[b, 0] >= 0:
                waiting[left], waiting[left + 1] = links[b, 0], links[b, 1]
                left += 2
                continue
            for m in order[-1 - links[b, 0] : -1 - links[b, 0] + links[b, 1]]:
                if dot(normal[f], normal[m]) >= FACING + ASKEW or group[f] == group[m]:
                    continue
                square = 0.0
                for i in range(3):
                    square += (centre[f, i] - centre[m, i]) ** 2
                far = radius[f] + radius[m] + max(reach, min(depth[f], depth[m]))
                if square > far * far:
                    continue
                if _share(corners[f], corners[m]):
                    if not _in_a_corner(f, m, rest_centre, rest_normal):
                        continue
                elif part[f] == part[m] and _one_wall(f, m, rest_centre, rest_normal, rest_radius, wall):
                    continue
                if here < room:
                    found[f, here] = m
                here += 1
        count[f] = here
