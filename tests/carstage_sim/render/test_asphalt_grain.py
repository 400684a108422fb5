"""Asphalt: its grain fades with the size of a pixel as that of stones does, without a gap."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.detail import asphalt

pytestmark = pytest.mark.xdist_group("kernels")


@kernel
def _look(x, y, pixel, out):
    for i in range(x.shape[0]):
        out[i, 0] = asphalt(x[i], y[i], pixel)
        out[i, 1] = asphalt(x[i] + pixel, y[i], pixel)


def looked_at(pixel_m):
    """``(N, 2)`` brightness of places, and of those a pixel beside them."""
    x, y = np.random.default_rng(5).uniform(0.0, 90.0, (2, 40_000)).astype(np.float32)
    out = np.empty((len(x), 2), np.float32)
    _look(x, y, np.float32(pixel_m), out)
    return out


@pytest.mark.parametrize("pixel_m", [0.02, 0.025, 0.03, 0.035])
def test_neighbouring_pixels_differ_where_a_pixel_is_wider_than_a_stone(pixel_m):
    seen = looked_at(pixel_m)
    step = np.sqrt(np.mean((seen[:, 1] - seen[:, 0]) ** 2))
    # Stones that lie by chance: the mean over a pixel varies as one over its width.
    near = looked_at(0.0125)
    grain = np.sqrt(np.mean((near[:, 1] - near[:, 0]) ** 2))
    assert 0.85 < step / (grain * 0.0125 / pixel_m) < 1.7


def test_grain_leaves_the_mean_as_it_is():
    means = [looked_at(pixel).mean() for pixel in (0.005, 0.02, 0.04, 0.08, 0.3)]
    assert means == pytest.approx([means[0]] * 5, abs=0.015)
