"""Which extra rays are not traced or not shaded, and the colours that they take."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.render.caster import Hits, RayCaster, picture_packets
from carstage_sim.render.crew import alone
from carstage_sim.render.edges import Rough
from carstage_sim.render.lending import aim_again, extra_rays, lent, mixed
from carstage_sim.render.materials import material_table
from ray_scenes import frame_of, soup

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


def between(colour, *, at=12, offset=(-0.3, 0.2), **others):
    """The colour of one ray of pixel ``at``, if it is not traced; ``others`` show a steep side."""
    corners = np.zeros((2, 3, 3)) + np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    corners[1] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    triangle = np.zeros(20, int)
    for place, other in others.items():
        triangle[int(place[1:])] = other
    caster = RayCaster(1)
    out = np.zeros((1, 3), np.float32)
    left = mixed(
        caster, frame_of(soup(corners)), material_table().detail,
        hits(np.where(triangle < 0, -2, -1), triangle), _SIZE, colour,
        np.array([at], np.int32), np.array([offset], np.float32), picture_packets(1, 1), out,
    )  # fmt: skip
    caster.close()
    return None if len(left.order) else out[0]


def test_a_ray_amid_four_pixels_of_one_surface_has_the_colour_between_theirs():
    colour = np.random.default_rng(3).random((20, 3)).astype(np.float32)
    level = colour[12] * 0.7 + colour[11] * 0.3
    under = colour[17] * 0.7 + colour[16] * 0.3
    assert between(colour) == pytest.approx(level * 0.8 + under * 0.2, abs=1e-6)
    assert between(colour, _12=-1, _11=-1, _16=-1, _17=-1) is not None, "the sky"
    assert between(colour, _13=1, _7=1) is not None, "those beyond do not count"


@pytest.mark.parametrize("place", [11, 16, 17])
@pytest.mark.parametrize("other", [1, -1])
def test_a_ray_beside_another_surface_is_traced(place, other):
    assert between(np.ones((20, 3), np.float32), **{f"_{place}": other}) is None


def test_a_ray_at_the_border_is_traced():
    assert between(np.ones((20, 3), np.float32), at=10) is None
    assert between(np.ones((20, 3), np.float32), at=17) is None


def test_the_rays_that_are_left_look_beside_the_centres_of_their_pixels():
    rough = Rough(
        np.array([3, 7], np.int32), np.array([0, 2], np.int32), np.zeros(20, np.uint8)
    )  # fmt: skip
    packets = extra_rays(rough, 2)
    assert (packets.order.tolist(), packets.starts.tolist()) == ([0, 1, 2, 3], [0, 4])
    offsets = np.array([[0.0, 0.5, 0.0], [0.0, 0.0, -0.25]], np.float32)
    directions, aimed = np.ones((20, 3), np.float32), np.zeros((4, 3), np.float32)
    alone(aim_again, (directions, rough.pixels, offsets, np.ones(4, np.bool_), aimed), 0, 2)
    assert aimed.tolist() == [[1.0, 1.5, 1.0], [1.0, 1.0, 0.75]] * 2
    aimed[:] = 0.0
    alone(aim_again, (directions, rough.pixels, offsets, np.arange(4) == 3, aimed), 0, 2)
    assert aimed.tolist() == [[0.0] * 3] * 3 + [[1.0, 1.0, 0.75]], "the others stay as they are"


@pytest.mark.parametrize("threads", [1, 4])
def test_rays_that_are_left_fill_packets_in_their_order(threads):
    """Packets are joined as long as all of the next would have fitted in."""
    width, height, rng = 90, 70, np.random.default_rng(2)
    count = width * height
    triangle = rng.integers(0, 2, count)
    edges = np.flatnonzero(rng.random(count) < 0.8).astype(np.int32)
    places = rng.integers(0, 33, 2 * len(edges)).cumsum()
    begins = np.array([0, *places[places < len(edges)], len(edges)], np.int32)
    offsets = np.array([[-0.3, 0.2], [0.3, -0.2]], np.float32)
    rough = Rough(edges, begins, np.zeros(count, np.uint8))
    packets, colour = extra_rays(rough, 2), np.full((count, 3), 0.2, np.float32)
    again = hits(np.full(2 * len(edges), -1), rng.integers(0, 8, 2 * len(edges)))
    shown_by, out = hits(np.full(count, -1), triangle), np.full((2 * len(edges), 3), -1, np.float32)
    caster = RayCaster(threads)
    left = lent(
        caster, shown_by, (width, height), colour, edges, offsets, again, packets, out
    )  # fmt: skip
    corners = np.zeros((2, 3, 3)) + np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    corners[1] = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    mix_out = np.full_like(out, -1)
    traced = mixed(
        caster, frame_of(soup(corners)), material_table().detail, shown_by, (width, height),
        colour, edges, offsets, packets, mix_out,
    )  # fmt: skip
    caster.close()
    for found, colours in ((left, out), (traced, mix_out)):
        order, starts = [], [0]
        for first, last in zip(packets.starts, packets.starts[1:], strict=False):
            if last - first + len(order) - starts[-1] > 64:
                starts.append(len(order))
            order += [ray for ray in range(first, last) if colours[ray, 0] == -1]
        assert 1000 < len(order) < len(out)
        assert found.order.tolist() == order
        assert found.starts.tolist() == [*starts, len(order)]
