"""Extra rays take the colours of pixels beside them only where those agree."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.render.caster import Hits, RayCaster, picture_packets
from carstage_sim.render.lending import lent

pytestmark = pytest.mark.xdist_group("kernels")

_SIZE = (5, 4)


def hits(row, triangle):
    count = len(row)
    return Hits(
        np.zeros(3, np.float32),
        np.ones((count, 3), np.float32),
        np.ones(count, np.float32),
        np.asarray(row, np.int32),
        np.asarray(triangle, np.int32),
        np.zeros((count, 2), np.float32),
    )


def shown(colour, *, met=(-1, 7), at=12, there=(-1, 7), offset=(-0.3, 0.2)):
    """The colour and openness of one ray of pixel ``at``; pixel 11 beside it shows ``there``."""
    row, triangle = np.full(20, -1), np.full(20, 3)
    row[11], triangle[11] = there
    caster = RayCaster(1)
    out = np.zeros((1, 3), np.float32)
    left = lent(
        caster, hits(row, triangle), _SIZE, colour, np.array([at], np.int32),
        np.array([offset], np.float32), hits([met[0]], [met[1]]), picture_packets(1, 1), out,
    )  # fmt: skip
    return out[0], list(left.order), list(left.starts)


def test_a_ray_takes_the_colour_of_what_the_pixel_beside_shows():
    colour = np.full((20, 3), 0.2, np.float32)
    colour[11] = (0.5, 0.4, 0.3)
    found, left, starts = shown(colour)
    assert np.array_equal(found, colour[11])
    assert (left, starts) == ([], [0])


@pytest.mark.parametrize("other", [(-1, 8), (2, 7), (-2, -1)])
def test_what_no_pixel_beside_shows_is_shaded(other):
    colour = np.full((20, 3), 0.2, np.float32)
    _, left, starts = shown(colour, met=other)
    assert (left, starts) == ([0], [0, 1])
    far, left, _ = shown(colour, at=14)
    assert left == [0]
    assert not far.any()


def test_pixels_of_one_triangle_that_disagree_lend_nothing():
    colour = np.full((20, 3), 0.2, np.float32)
    assert shown(colour, met=(-1, 3))[1] == []
    colour[17, 1] = 0.24
    assert shown(colour, met=(-1, 3))[1] == [0], "a shadow's edge"
    colour[17, 1] = 0.21
    assert shown(colour, met=(-1, 3))[1] == []


def test_only_the_four_pixels_around_a_ray_lend():
    colour = np.full((20, 3), 0.2, np.float32)
    colour[17, 1] = 0.24
    assert shown(colour, met=(-1, 3), offset=(-0.3, -0.2))[1] == [], "it is on the other side"
    assert shown(colour, offset=(0.3, 0.2))[1] == [0], "pixel 11 is on the other side"
