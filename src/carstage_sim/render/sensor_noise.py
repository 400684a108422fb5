"""Noise of a camera's sensor: shot and read noise, by its sensitivity.

The model is EMVA 1288's: a pixel that counts N electrons has a variance of N, and of its read
noise. At ISO 100 white are as many electrons as a pixel of 3 um holds; at ISO 1600 a sixteenth.
Each colour of each pixel is drawn by itself: no processor filters it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.crew import do
from carstage_sim.render.film import film_codes, light_of_codes

FULL_WELL = 12_000.0
"""Electrons of a pixel that is white, at ISO 100."""
READ_NOISE = 2.0
"""Standard deviation of what is read, in electrons."""
_LEVELS = 256
_PER_STOP = 8
"""Steps of sensitivity in a stop, so that few tables are made."""
_MOST_STOPS = 30.0
_ODD = (0x9E3779B1, 0x85EBCA6B, 0xC2B2AE35)
_FIRST: Any = np.uint32(_ODD[0])
_SECOND: Any = np.uint32(_ODD[1])
_THIRD: Any = np.uint32(_ODD[2])
_HIGH: Any = np.uint32(16)
_MIDDLE: Any = np.uint32(13)
_BYTE: Any = np.uint32(255)
_OF_RED: Any = np.uint32(24)
_OF_BLUE: Any = np.uint32(8)


def noise_table(iso: float, gamma: float) -> NDArray[np.uint8]:
    """``(256, 256)`` what becomes of a code, by chance.

    Args:
        iso: sensitivity.
        gamma: of the display; 2.2 is sRGB's own curve.
    """
    stops = min(max(math.log2(iso / 100.0), -_MOST_STOPS), _MOST_STOPS)
    return _table(round(stops * _PER_STOP), gamma)


@lru_cache(maxsize=16)
def _table(steps: int, gamma: float) -> NDArray[np.uint8]:
    white = FULL_WELL * 2.0 ** (-steps / _PER_STOP)
    light = light_of_codes(gamma).astype(np.float64)
    spread = np.sqrt(light * white + READ_NOISE**2) / white
    usual = NormalDist()
    chance = np.array([usual.inv_cdf((k + 0.5) / _LEVELS) for k in range(_LEVELS)])
    noisy = np.maximum(light[:, None] + spread[:, None] * (chance / chance.std()), 0.0)
    places = np.rint(-np.expm1(-noisy) * 8191.0).astype(np.int32)
    table: NDArray[np.uint8] = film_codes(gamma)[places]
    return table


def noise_key(frame: int, seed: int) -> int:
    """What the noise of one picture is drawn from; each frame of each seed has its own."""
    return (frame * _ODD[0] + seed * _ODD[1]) & 0xFFFFFFFF


@device
def _noise_part(table, key, clean, noisy, worker, first, last):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        # The finaliser of MurmurHash3 (Appleby, public domain).
        mixed = np.uint32(np.uint32(i) * _FIRST ^ key)
        mixed = np.uint32((mixed ^ (mixed >> _HIGH)) * _SECOND)
        mixed = np.uint32((mixed ^ (mixed >> _MIDDLE)) * _THIRD)
        mixed = np.uint32(mixed ^ (mixed >> _HIGH))
        noisy[i, 0] = table[clean[i, 0], (mixed >> _OF_BLUE) & _BYTE]
        noisy[i, 1] = table[clean[i, 1], (mixed >> _HIGH) & _BYTE]
        noisy[i, 2] = table[clean[i, 2], mixed >> _OF_RED]
        noisy[i, 3] = clean[i, 3]


@kernel
def draw_noise(data, board, job, work):  # type: ignore[no-untyped-def]
    """Draw the noise of pixels, whoever draws which.

    The data are a table of :func:`noise_table`, the uint32 of :func:`noise_key`, ``(N, 4)`` uint8
    BGRA without noise, and as many that receive it. Its items are the pixels.
    """
    do(_noise_part, data, board, job, work)
