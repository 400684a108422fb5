"""Which pixels are sampled again, and which become the mean of nine."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.mesh import Material
from carstage_sim.render.caster import Hits, RayCaster, picture_packets
from carstage_sim.render.edges import EVEN, rough_pixels
from carstage_sim.render.film import develop_even, film_codes, weight_in_mean
from carstage_sim.render.materials import material_table
from carstage_sim.render.quality import SAMPLING, Quality
from ray_scenes import frame_of, soup

pytestmark = pytest.mark.xdist_group("kernels")

_SIDE = 5
_MIDDLE = 12


def marks(triangle, *, quality=Quality.LOW, leafy=True, contrast=True):
    """Marks of a picture of 5 x 5 pixels, checkered, whose pixels show these triangles."""
    corners = np.zeros((9, 3, 3)) + np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    frame = frame_of(soup(corners, leafy=leafy))
    count = _SIDE * _SIDE
    numbers = np.asarray(triangle, np.int32).reshape(-1)
    hits = Hits(
        np.zeros(3, np.float32), np.ones((count, 3), np.float32), np.ones(count, np.float32),
        np.where(numbers < 0, -2, -1).astype(np.int32), numbers, np.zeros((count, 2), np.float32),
    )  # fmt: skip
    codes = np.zeros((_SIDE, _SIDE, 4), np.uint8)
    if contrast:
        codes[(np.arange(count) % 2).reshape(_SIDE, _SIDE) == 1] = 200
    caster = RayCaster(1)
    found = rough_pixels(
        caster, frame, material_table().detail, hits, codes, SAMPLING[quality]
    )  # fmt: skip
    caster.close()
    assert set(found.pixels.tolist()) == set(np.flatnonzero(found.marks == 1).tolist())
    return found.marks


def grid(number, **others):
    numbers = np.full((_SIDE, _SIDE), number)
    for place, other in others.items():
        numbers.reshape(-1)[int(place[1:])] = other
    return numbers


def test_a_pixel_amid_its_own_triangle_is_even_and_those_at_the_border_are_sampled():
    found = marks(grid(0)).reshape(_SIDE, _SIDE)
    assert (found[1:-1, 1:-1] == EVEN).all()
    border = found.copy()
    border[1:-1, 1:-1] = 1
    assert (border == 1).all()


def test_one_other_triangle_beside_lets_a_pixel_be_sampled_again():
    assert marks(grid(0, _6=3))[_MIDDLE] == 1, "across"
    assert marks(grid(0, _0=3))[_MIDDLE] == EVEN, "two pixels away"


def test_a_crown_is_even_whichever_of_its_leaves_are_met():
    leaves = np.array([1, 2, 4, 5, 7])[np.arange(_SIDE * _SIDE) % 5]
    kinds = {Material.LEAVES, Material.NEEDLES}
    detail = material_table().detail
    assert len({int(detail[kind]) for kind in kinds}) == 1, "both have the pattern of leaves"
    assert marks(leaves)[_MIDDLE] == EVEN
    assert marks(leaves, leafy=False)[_MIDDLE] == 1
    leaves[_MIDDLE + 1] = 0
    assert marks(leaves)[_MIDDLE] == 1, "a trunk beside"


def test_leaves_with_gaps_all_over_are_even_and_the_border_of_a_crown_is_not():
    leaves = np.array([1, 2, 4, 5, 7])[np.arange(_SIDE * _SIDE) % 5]
    gaps = leaves.copy()
    gaps[[_MIDDLE - 4, _MIDDLE, _MIDDLE + 1]] = 0, 3, -1
    assert marks(gaps)[_MIDDLE] == EVEN
    assert marks(gaps, leafy=False)[_MIDDLE] == 1
    for step in (1, _SIDE):
        border = leaves.copy()
        beyond = (np.arange(len(border)) // step) % _SIDE > 2
        border[beyond] = 0
        assert marks(border)[_MIDDLE] == 1


def test_the_sky_is_sampled_again():
    assert marks(grid(-1))[_MIDDLE] == 1


def test_what_has_no_contrast_is_left_alone():
    assert not marks(grid(0), contrast=False).any()


@pytest.mark.parametrize("width", [1, 7, 8, 9, 16, 29])
def test_neighbours_that_differ_are_marked_wherever_they_are(width):
    """By epic sampling: a strong difference counts on one triangle, a weak one between two."""
    rng = np.random.default_rng(width)
    height, count = 20, 20 * width
    triangle = rng.integers(0, 2, count).astype(np.int32)
    codes = rng.integers(100, 104, (height, width, 4)).astype(np.uint8)
    codes[rng.random((height, width)) < 0.1, rng.integers(0, 3)] += 14
    codes[rng.random((height, width)) < 0.04, rng.integers(0, 3)] -= 40
    codes[..., 3] = 255
    corners = np.array([[[0, 0, 0], [0, 1, 0], [0, 0, 1.0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1.0]]])
    hits = Hits(
        np.zeros(3, np.float32), np.ones((count, 3), np.float32), np.ones(count, np.float32),
        np.full(count, -1, np.int32), triangle, np.zeros((count, 2), np.float32),
    )  # fmt: skip
    sampling, caster = SAMPLING[Quality.EPIC], RayCaster(1)
    frame = frame_of(soup(corners))
    found = rough_pixels(caster, frame, material_table().detail, hits, codes, sampling)
    caster.close()
    wanted = np.zeros((height, width), bool)
    kinds = triangle.reshape(height, width)
    for one, other in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ):
        apart = abs(codes[one][..., :3].astype(int) - codes[other][..., :3]).max(-1, initial=0)
        differ = (apart > sampling.strong) | (
            (apart > sampling.weak) & (kinds[one] != kinds[other])
        )
        wanted[one] |= differ
        wanted[other] |= differ
    assert 0.1 < wanted.mean() < 0.95
    assert np.array_equal(found.marks.reshape(height, width), wanted)


def test_epic_pictures_sample_all_of_them():
    assert (marks(grid(0), quality=Quality.EPIC) == 1).all()


@kernel
def _develop_even(codes, colours, chosen, width, pixels):  # type: ignore[no-untyped-def]
    develop_even(codes, colours, chosen, width, 0, chosen.shape[0], pixels)


def test_a_mean_of_nine_keeps_the_light_and_as_much_noise_as_three_rays():
    weight = weight_in_mean.py_func
    weights = [float(weight(abs(x), abs(y))) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    assert sum(weights) == pytest.approx(1.0, abs=1e-6)
    assert sum(w * w for w in weights) == pytest.approx(1 / 3, abs=0.03)
    colours = np.random.default_rng(1).random((_SIDE * _SIDE, 3), np.float32)
    pixels = np.zeros((_SIDE * _SIDE, 4), np.uint8)
    chosen = np.zeros(_SIDE * _SIDE, np.uint8)
    chosen[_MIDDLE] = EVEN
    _develop_even(film_codes(2.2), colours, chosen, _SIDE, pixels)
    around = colours.reshape(_SIDE, _SIDE, 3)[1:4, 1:4].reshape(9, 3)
    mean = (np.array(weights)[:, None] * around).sum(axis=0)
    wanted = film_codes(2.2)[np.rint(mean * 8191).astype(int)]
    assert np.abs(pixels[_MIDDLE, 2::-1].astype(int) - wanted).max() <= 1
    assert not pixels[np.arange(len(pixels)) != _MIDDLE].any()


@pytest.mark.parametrize("quality", list(Quality))
@pytest.mark.parametrize("threads", [1, 4])
def test_rough_pixels_are_gathered_square_after_square(threads, quality):
    """In groups of those whose rays fit into a packet, none of two squares."""
    width, height, rng = 61, 283, np.random.default_rng(4)
    count = width * height
    triangle = rng.integers(0, 9, count).astype(np.int32)
    hits = Hits(
        np.zeros(3, np.float32), np.ones((count, 3), np.float32), np.ones(count, np.float32),
        np.full(count, -1, np.int32), triangle, np.zeros((count, 2), np.float32),
    )  # fmt: skip
    codes = np.zeros((height, width, 4), np.uint8)
    codes[:, :30][rng.random((height, 30)) < 0.15] = 200
    codes[64:80] = 0  # squares without any
    caster, frame = RayCaster(threads), frame_of(soup(np.zeros((9, 3, 3)) + np.eye(3)))
    sampling = SAMPLING[quality]
    found = rough_pixels(caster, frame, material_table().detail, hits, codes, sampling)
    caster.close()
    squares, room = picture_packets(width, height), 64 // len(sampling.offsets)
    pixels, begins = [], []
    for first, last in zip(squares.starts, squares.starts[1:], strict=False):
        rough = [i for i in squares.order[first:last].tolist() if found.marks[i] == 1]
        begins += range(len(pixels), len(pixels) + len(rough), room)
        pixels += rough
    assert 1000 < len(pixels) < count
    assert found.pixels.tolist() == pixels
    assert found.begins.tolist() == [*begins, len(pixels)]
