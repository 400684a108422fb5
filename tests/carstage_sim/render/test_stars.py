"""Stars: at directions that never change, as wide as a pixel, none near the horizon."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.stars import starlight

WIDTH = 400


@kernel
def _shine(directions, pixel_angle, out):  # type: ignore[no-untyped-def]
    for i in range(len(directions)):
        d = directions[i]
        out[i, 0], out[i, 1], out[i, 2] = starlight(d[0], d[1], d[2], pixel_angle)


def patch(yaw: float = 0.0, rise: float = 0.5, pixel: float = 0.002) -> np.ndarray:
    """``(WIDTH, WIDTH)`` light of a patch of sky, its pixels this many radians wide."""
    turn, lift = np.meshgrid(*[(np.arange(WIDTH) - WIDTH / 2) * pixel] * 2)
    turn, lift = turn + yaw, lift + rise
    directions = np.stack(
        [np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)], axis=-1
    ).reshape(-1, 3)
    out = np.empty((WIDTH * WIDTH, 3), np.float32)
    _shine(directions.astype(np.float32), np.float32(pixel), out)
    return out.mean(axis=1).reshape(WIDTH, WIDTH)


@pytest.mark.parametrize("yaw", [0.0, 0.8, 2.4, -1.6])
@pytest.mark.parametrize("rise", [0.5, 1.1])
def test_a_part_of_the_sky_has_stars_and_most_of_it_none(yaw: float, rise: float) -> None:
    lit = patch(yaw, rise) > 0.01
    assert 0.0005 < lit.mean() < 0.02


def test_a_camera_that_turns_by_pixels_sees_the_same_stars() -> None:
    before, after = patch(0.0), patch(20 * 0.002)
    np.testing.assert_allclose(after[:, :-20], before[:, 20:], atol=0.03)


def test_a_star_keeps_its_light_as_the_camera_turns_by_parts_of_a_pixel() -> None:
    sums = [patch(0.002 * part / 8).sum() for part in range(8)]
    assert max(sums) < 1.1 * min(sums)


def test_there_are_none_at_the_horizon() -> None:
    assert patch(rise=-0.5).max() == 0.0
