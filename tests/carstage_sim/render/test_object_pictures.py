"""Clients' pictures on objects: which way up they are, and how they look from afar."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest

from carstage.spec.patches import PatchPicture, PatchSpec, patch_corners, patch_place
from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.pictures import PictureTables, _face, picture_colour, picture_tables
from carstage_sim.world.pictures import LARGEST_PX, PlacedPicture, halved, reduced

pytestmark = pytest.mark.xdist_group("kernels")

RED, GREEN, BLUE, WHITE = np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], np.ones(3)
PLATE = (0.6, 1.2, 0.01)
CASE = (0.22, 0.06, 0.16)
SIGN = (0.02, 0.4, 0.5)


def quarters(size: int = 16) -> np.ndarray:
    """Red top left, green top right, blue bottom left, white bottom right; row 0 is the lowest."""
    half = size // 2
    picture = np.zeros((size, size, 3), np.float32)
    picture[half:, :half], picture[half:, half:] = RED, GREEN
    picture[:half, :half], picture[:half, half:] = BLUE, WHITE
    return picture


@numba.njit
def colour_at(tables, p, n, pixel):
    return picture_colour(tables.pictures, tables.texels, 0, p, n, pixel)


@numba.njit
def face_at(tables, p, n):
    return _face(tables.pictures, 0, p, n)


def tables(*placed: PlacedPicture) -> PictureTables:
    return picture_tables(placed)


def placed(extent: tuple[float, float, float], picture: np.ndarray | None = None) -> PlacedPicture:
    texels = quarters() if picture is None else picture
    return PlacedPicture(texels, (0.0, 0.0, 0.0), np.eye(3), extent)


def colour(found: PictureTables, place: Any, normal: Any, pixel: float = 1e-4) -> np.ndarray:
    p, n = (tuple(np.float32(x) for x in one) for one in (place, normal))
    return np.array(colour_at(found, p, n, np.float32(pixel)))


@pytest.mark.parametrize(
    ("normal", "right", "up"),
    [
        ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 1, 0), (1, 0, 0), (0, 0, 1)),
        ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
        ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
    ],
)
def test_a_picture_stands_upright_and_is_never_mirrored(normal, right, up):
    """``right`` is that of who looks at the face, in CARLA's left-handed axes."""
    normal, right, up = (np.array(one, float) for one in (normal, right, up))
    found = tables(placed((1.0, 1.0, 1.0)))
    for side, height, expected in ((-1, 1, RED), (1, 1, GREEN), (-1, -1, BLUE), (1, -1, WHITE)):
        place = normal + 0.5 * side * right + 0.5 * height * up
        assert np.allclose(colour(found, place, normal), expected)


def test_a_board_shows_no_picture_of_its_own_on_its_rim():
    found = tables(placed(PLATE))
    on_top = colour(found, (0.6, 0.5, 0.0), (1, 0, 0))
    assert any(np.allclose(on_top, upper) for upper in (RED, GREEN))
    assert np.allclose(on_top, colour(found, (0.6, 0.5, 0.004), (1, 0, 0)))


def test_a_picture_follows_the_box_that_it_is_on():
    turned = PlacedPicture(quarters(), (3.0, 2.0, 1.0), rotation_matrix((0.0, 90.0, 0.0)), SIGN)
    # The sign's front, +x, looks along +y; who looks at it has +x to the right.
    found = tables(turned)
    assert np.allclose(colour(found, (3.2, 2.02, 1.2), (0, 1, 0)), GREEN)
    assert np.allclose(colour(found, (2.8, 2.02, 0.8), (0, 1, 0)), BLUE)


def test_from_afar_a_picture_is_its_mean_and_changes_smoothly():
    rng = np.random.default_rng(3)
    noise = rng.random((61, 40, 3)).astype(np.float32)
    found = tables(placed((0.05, 1.0, 1.0), noise))
    place, normal = (0.05, 0.31, -0.22), (1, 0, 0)
    far = colour(found, place, normal, 50.0)
    assert np.allclose(far, noise.mean(axis=(0, 1)), atol=0.03)
    sizes = np.geomspace(1e-3, 4.0, 400)
    seen = np.array([colour(found, place, normal, size) for size in sizes])
    assert np.abs(np.diff(seen, axis=0)).max() < 0.05
    assert np.allclose(colour(found, place, normal, 1e-3), seen[0])


def test_sizes_that_are_no_power_of_two_are_halved_with_their_last_row():
    picture = np.arange(15, dtype=np.float32).reshape(5, 1, 3).repeat(3, axis=1)
    assert halved(picture).shape == (3, 2, 3)
    assert np.allclose(halved(picture)[-1, 0], picture[-1, 0])
    assert max(reduced(np.zeros((LARGEST_PX * 3, 4, 3), np.float32)).shape) <= LARGEST_PX


@pytest.mark.parametrize("extent", [PLATE, CASE, SIGN])
@pytest.mark.parametrize("front", [True, False])
def test_labels_have_a_patch_where_the_simulator_draws_it(extent, front):
    """The framework places patches by ``carstage.spec.patches``, which the simulator never sees."""
    patch = PatchSpec(
        "patch0", "billboard", PatchPicture(4, 3, ""), 0.6, (0.2, 0.7), "", 10.0, "right"
    )
    place = patch_place(patch, extent)
    corners = patch_corners(place, (0.0, 0.0, 0.0), extent, front)
    normal = np.zeros(3)
    normal[int(np.argmin(extent))] = 1.0 if front else -1.0
    found = tables(placed(extent))
    left, right = (at / place.columns for at in (place.left, place.left + place.width))
    low, high = (at / place.rows for at in (place.low, place.low + place.height))
    expected = [(left, high), (right, high), (right, low), (left, low)]
    n = tuple(np.float32(x) for x in normal)
    for corner, (s, t) in zip(corners, expected, strict=True):
        seen = face_at(found, tuple(np.float32(x) for x in corner), n)
        assert seen[:2] == pytest.approx((s, t), abs=1e-5)


def test_a_rim_keeps_the_colour_of_the_edge_whatever_a_pixel_covers():
    found = tables(placed(PLATE))
    at_rim = (0.6, 0.5, 0.004)
    assert np.allclose(colour(found, at_rim, (1, 0, 0), 5.0), colour(found, at_rim, (1, 0, 0)))
