"""Functions made of sums, products and roots against those of the C library."""

from __future__ import annotations

import math

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.render.arithmetic import elevation, exp_down, exp_of, power_of_slant, turns
from carstage_sim.render.detail import noise, six_noises

pytestmark = pytest.mark.xdist_group("kernels")


@kernel
def each(x, y, out):
    for i in range(x.shape[0]):
        out[i, 0] = exp_down(abs(x[i]))
        out[i, 1] = exp_of(x[i])
        out[i, 2] = power_of_slant(min(abs(x[i]), np.float32(1)))
        out[i, 3] = turns(y[i], x[i])
        out[i, 4] = elevation(min(abs(x[i]), np.float32(1)))


@kernel
def layers(x, y, together, alone):
    for i in range(x.shape[0]):
        a, b, c, d, e, f = six_noises(
            x[i], y[i], np.float32(0.025), np.float32(0.16), np.float32(1.3), np.float32(7.0),
            np.float32(4.3), np.float32(0.06), 1,
        )  # fmt: skip
        together[i, 0], together[i, 1], together[i, 2] = a, b, c
        together[i, 3], together[i, 4], together[i, 5] = d, e, f
        alone[i, 0] = noise(x[i] / np.float32(0.025), y[i] / np.float32(0.025), 1)
        alone[i, 1] = noise(x[i] / np.float32(0.16), y[i] / np.float32(0.16), 2)
        alone[i, 2] = noise(x[i] / np.float32(1.3), y[i] / np.float32(1.3), 3)
        alone[i, 3] = noise(x[i] / np.float32(7.0), y[i] / np.float32(7.0), 4)
        alone[i, 4] = noise(x[i] / np.float32(4.3), y[i] / np.float32(4.3), 5)
        alone[i, 5] = noise(x[i] / np.float32(0.06), y[i] / np.float32(0.06), 6)


def test_all_are_as_near_as_they_say():
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(-50, 50, 3000), rng.uniform(-1, 1, 3000), [0.0, 1.0, -1.0]])
    x = x.astype(np.float32)
    y = rng.permutation(x)
    out = np.empty((len(x), 5), np.float32)
    each(x, y, out)
    wide, high = x.astype(np.float64), np.minimum(np.abs(x.astype(np.float64)), 1.0)
    assert np.abs(out[:, 0] - np.exp(-np.abs(wide))).max() < 2e-5
    assert np.abs(out[:, 1] / np.exp(wide) - 1.0)[np.abs(wide) < 10].max() < 5e-5
    slant = high >= 0.06
    assert np.abs(out[slant, 2] - high[slant] ** 0.7).max() < 2e-4
    away = np.abs(out[:, 3] - np.arctan2(y.astype(np.float64), wide) / (2 * math.pi))
    assert np.minimum(away, 1.0 - away).max() < 3e-6
    assert np.abs(out[:, 4] - np.arcsin(high) * 2 / math.pi).max() < 4e-7


def test_six_noises_are_the_same_bits_as_one_after_the_other():
    rng = np.random.default_rng(2)
    x, y = (rng.uniform(-900, 900, 4000).astype(np.float32) for _ in range(2))
    together, alone = (np.empty((len(x), 6), np.float32) for _ in range(2))
    layers(x, y, together, alone)
    assert together.tobytes() == alone.tobytes()
    assert np.abs(together).max() <= 1.0
    assert np.all(together.std(axis=0) > 0.2)
