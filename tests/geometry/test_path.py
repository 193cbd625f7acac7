import math

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry.path import Step, offset_path, rounded_polygon

SQUARE = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
L_SHAPE = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0)]


def sampled(pieces):
    """Points along lines and arcs; every arc here is shorter than a half circle."""
    points = []
    for piece in pieces:
        start, end = np.array(piece.start), np.array(piece.end)
        if piece.centre is None:
            points.append(start)
            continue
        centre = np.array(piece.centre)
        begin, finish = (np.arctan2(*(place - centre)[::-1]) for place in (start, end))
        angle = begin + np.linspace(0, 1, 2000) * math.remainder(finish - begin, 2 * math.pi)
        points += list(centre + np.linalg.norm(start - centre) * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.array(points)


def area(points):
    following = np.roll(points, -1, axis=0)
    return 0.5 * (points[:, 0] * following[:, 1] - points[:, 1] * following[:, 0]).sum()


def test_a_rounded_square_has_its_exact_area():
    pieces = rounded_polygon(SQUARE, 0.5, 0.25)
    assert area(sampled(pieces)) == pytest.approx(9.0 - (4 - math.pi) * 0.25**2, rel=1e-6)


def test_outward_and_re_entrant_corners():
    pieces = rounded_polygon(L_SHAPE, -0.5, 0.25)
    corners = 4 * (1 - math.pi / 4) * 0.25**2  # five outward ones lose what the re-entrant one gains
    assert area(sampled(pieces)) == pytest.approx(5.0 * 5.0 - 2.0 * 2.0 - corners, rel=1e-6)


def test_pieces_follow_each_other_and_arcs_keep_their_radius():
    pieces = rounded_polygon(L_SHAPE, 0.3, 0.2)
    for piece, following in zip(pieces, pieces[1:] + pieces[:1], strict=True):
        assert piece.end == pytest.approx(following.start)
        if piece.centre is not None:
            assert math.dist(piece.centre, piece.start) == pytest.approx(0.2)
            assert math.dist(piece.centre, piece.end) == pytest.approx(0.2)


@pytest.mark.parametrize(("inset", "radius", "message"), [(2.1, 0.1, "walls meet"), (0.5, 1.6, "too short")])
def test_what_does_not_fit_is_refused(inset, radius, message):
    with pytest.raises(InputError, match=message):
        rounded_polygon(SQUARE, inset, radius)


def test_offset_paths_keep_their_distance():
    steps = [Step(3.0, math.radians(40), 2.0), Step(1.0, math.radians(-175), 1.5), Step(2.0)]
    middle, left = (sampled(offset_path((1.0, 0.0), steps, distance)) for distance in (0.0, 0.5))
    distances = np.linalg.norm(left[:, None, :] - middle[None, :, :], axis=2)
    # Straight parts are sampled at their start only, where the offset is across.
    assert distances.min(axis=1).min() > 0.5 - 1e-4
    assert np.quantile(distances.min(axis=1), 0.99) < 0.5 + 1e-3


def test_a_half_turn_comes_back_the_other_way():
    pieces = offset_path((0.0, 0.0), [Step(2.0, math.pi, 1.0), Step(2.0)], 0.0)
    assert pieces[-1].end == pytest.approx((0.0, 2.0))
    assert all(math.dist(piece.start, piece.end) > 1.0 for piece in pieces)
