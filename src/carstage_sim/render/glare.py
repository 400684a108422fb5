"""Bloom and flare of a lens: the light that glass scatters around what is brighter than white.

A lens sends a small share of what it gets beside its place. It shows where something outshines
its surroundings: lamps by night, the sun and its reflections. The share falls off in octaves, as
glare in eyes and lenses does: each ring twice as wide gets less (Vos 1984). Ghosts are what two
faces of glass mirror: spots on the line through what is bright and the middle.

Both work on the codes of a picture, so they are the same whoever made it. Codes tell light apart up
to 5.4 times white; what fills the film counts as seven. Real lamps outshine a street by night a
thousandfold, the sun more; here it is sevenfold. So what is beyond white counts squared, and the
share that is scattered is larger than that of a clean lens: chosen by eye.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.arithmetic import exp_down
from carstage_sim.render.caster import BAND, RayCaster
from carstage_sim.render.crew import Shared, do, do_step
from carstage_sim.render.film import Film, display_of_codes, film_codes, light_of_codes

WHITE = 2.0
"""Exposed light from which it is scattered visibly, where codes have their four upper bits."""
BLOOM_SHARE = 0.4
"""Share of the squared light beyond white that is scattered, at ``bloom_intensity`` 1."""
GHOST_SHARE = 0.02
"""Share that ghosts show together, at ``lens_flare_intensity`` 1."""
_BLOCK = 4
_LEAST_OCTAVES, _MOST_OCTAVES = 4, 8
_NARROW_PX = 560
"""Width that doubles with each further octave, so that rings are as wide as the picture asks."""
_FALL = 0.85
"""Share of a ring's light that the next one gets."""
_TOP_CODE = 240
_GHOST_OCTAVE = 2
_GHOSTS: Any = np.array(
    [(-0.55, 1.4, 0.8, 0.8), (-1.2, 0.8, 1.3, 0.9), (0.4, 0.6, 0.9, 1.5)], np.float32
)
"""How far from the middle each ghost is, for its light's one, negative if opposite; and its shares
of blue, green and red."""
_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_STEPS: Any = np.float32(8191)
_NEAR: Any = np.float32(0.75)
_FAR: Any = np.float32(0.25)
_INNER: Any = np.float32(0.375)
_OUTER: Any = np.float32(0.125)
_LEAST: Any = np.float32(3e-4)
"""Scattered light that no code shows."""
_IN_BLOCK: Any = np.array([-0.375, -0.125, 0.125, 0.375], np.float32)
"""Places of a block's pixels beside its middle."""
_TOPS: Any = np.uint32(0x00101010)


@device
def _source_part(beyond, words, pixels, source, lit, worker, first, last):  # type: ignore[no-untyped-def]
    height, width = words.shape
    for row in range(first, last):
        top, bottom = row * _BLOCK, min(row * _BLOCK + _BLOCK, height)
        found = np.uint32(0)
        for y in range(top, bottom):
            for x in range(width):
                # A code of 240 and more has its four upper bits.
                pairs = words[y, x] & (words[y, x] >> np.uint32(1))
                found |= pairs & (pairs >> np.uint32(2))
        if not found & _TOPS:
            continue
        lit[row] = 1
        for y in range(top, bottom):
            for x in range(width):
                pairs = words[y, x] & (words[y, x] >> np.uint32(1))
                if pairs & (pairs >> np.uint32(2)) & _TOPS:
                    for channel in range(3):
                        source[row, x // _BLOCK, channel] += beyond[pixels[y, x, channel]]


@device
def _between_four(fine, y, u, before, after, channel):  # type: ignore[no-untyped-def]
    """Weighted mean of four pixels in a row, of which ``u`` and the next are in the middle."""
    outer = fine[y, before, channel] + fine[y, after, channel]
    return (fine[y, u, channel] + fine[y, u + 1, channel]) * _INNER + outer * _OUTER


@device
def _halve_part(fine, coarse, worker, first, last):  # type: ignore[no-untyped-def]
    high, wide = fine.shape[0], fine.shape[1]
    for y in range(first, last):
        v, above, below = 2 * y, max(2 * y - 1, 0), min(2 * y + 2, high - 1)
        for x in range(coarse.shape[1]):
            u, before, after = 2 * x, max(2 * x - 1, 0), min(2 * x + 2, wide - 1)
            for channel in range(3):
                inner = _between_four(fine, v, u, before, after, channel)
                inner += _between_four(fine, v + 1, u, before, after, channel)
                outer = _between_four(fine, above, u, before, after, channel)
                outer += _between_four(fine, below, u, before, after, channel)
                coarse[y, x, channel] = inner * _INNER + outer * _OUTER


@device
def _add_part(share, coarse, fine, worker, first, last):  # type: ignore[no-untyped-def]
    high, wide = coarse.shape[0], coarse.shape[1]
    for y in range(first, last):
        v = y // 2
        beside_v = min(max(v + (y % 2) * 2 - 1, 0), high - 1)
        for x in range(fine.shape[1]):
            u = x // 2
            beside_u = min(max(u + (x % 2) * 2 - 1, 0), wide - 1)
            for channel in range(3):
                here = coarse[v, u, channel] * _NEAR + coarse[v, beside_u, channel] * _FAR
                there = (
                    coarse[beside_v, u, channel] * _NEAR
                    + coarse[beside_v, beside_u, channel] * _FAR
                )
                fine[y, x, channel] = fine[y, x, channel] * share + here * _NEAR + there * _FAR


@device
def _drop(out, ghost, x, y, red, green, blue):  # type: ignore[no-untyped-def]
    """Add light to the four pixels around a place."""
    u, v = math.floor(x), math.floor(y)
    for down in range(2):
        for right in range(2):
            if not (0 <= v + down < out.shape[0] and 0 <= u + right < out.shape[1]):
                continue
            part = abs(_ONE - np.float32(right) - (x - np.float32(u)))
            part *= abs(_ONE - np.float32(down) - (y - np.float32(v)))
            out[v + down, u + right, 0] += blue * ghost[1] * part
            out[v + down, u + right, 1] += green * ghost[2] * part
            out[v + down, u + right, 2] += red * ghost[3] * part


@device
def _ghost_part(ghosts, share, middle, bright, out, worker, first, last):  # type: ignore[no-untyped-def]
    for y in range(first, last):
        for x in range(bright.shape[1]):
            blue, green, red = bright[y, x, 0], bright[y, x, 1], bright[y, x, 2]
            if blue + green + red == 0:
                continue
            right, down = np.float32(x) + _HALF - middle[0], np.float32(y) + _HALF - middle[1]
            for g in range(ghosts.shape[0]):
                u = right * ghosts[g, 0] + middle[0] - _HALF
                v = down * ghosts[g, 0] + middle[1] - _HALF
                _drop(out, ghosts[g], u, v, red * share, green * share, blue * share)


@device
def _scale(light, share, out):  # type: ignore[no-untyped-def]
    for y in range(light.shape[0]):
        for x in range(light.shape[1]):
            for channel in range(3):
                out[y, x, channel] = light[y, x, channel] * share


@device
def _in_coarse_octaves(octaves, shares, ghosts, ghost_share, middle, bright):  # type: ignore[no-untyped-def]
    """From the second octave, which is halved, to its sum with those that are coarser."""
    last = shares.shape[0] - 1
    for k in range(1, last):
        _halve_part(octaves[k], octaves[k + 1], 0, 0, octaves[k + 1].shape[0])
    _scale(octaves[_GHOST_OCTAVE], _ONE, bright)
    _scale(octaves[last], shares[last], octaves[last])
    for k in range(last - 1, 0, -1):
        _add_part(shares[k], octaves[k + 1], octaves[k], 0, 0, octaves[k].shape[0])
        if k == _GHOST_OCTAVE and ghost_share > 0:
            _ghost_part(ghosts, ghost_share, middle, bright, octaves[k], 0, 0, bright.shape[0])


@kernel
def share_scattered(data, board, job, work):  # type: ignore[no-untyped-def]
    """Sum up the light beyond white of each block of four by four pixels, and spread it.

    The data are ``(256,)`` float32 of each code, for each pixel's share of a block, ``(H, W)``
    uint32 of BGRA, the same as ``(H, W, 4)`` uint8, the octaves, ``(h, w, 3)`` float32 zeros, of
    which the first receives the light, ``(h,)`` uint8 zeros that tell which rows have any,
    ``(n,)`` float32 share of each octave, ``_GHOSTS``, the share of each of them, the picture's
    middle, ``(2,)`` float32 x and y in the octave of ghosts, and what receives a copy of that
    octave. Its items are rows of blocks.

    The coarse octaves, a quarter of all, are done by the caller: to call the crew takes longer.
    """
    beyond, words, pixels, octaves, lit, shares, ghosts, ghost_share, middle, bright = data
    do(_source_part, (beyond, words, pixels, octaves[0], lit), board, job, work)
    if not lit.any():
        return
    halves = (octaves[0], octaves[1])
    do_step(_halve_part, halves, board, job, work, 1, octaves[1].shape[0], work[2])
    _in_coarse_octaves(octaves, shares, ghosts, ghost_share, middle, bright)
    sums = (shares[0], octaves[1], octaves[0])
    do_step(_add_part, sums, board, job, work, 2, octaves[0].shape[0], work[2])


@device
def _left_part(scattered, seen, worker, first, last):  # type: ignore[no-untyped-def]
    for y in range(first, last):
        for x in range(scattered.shape[1]):
            most = _ZERO
            for channel in range(3):
                most = max(most, scattered[y, x, channel])
            seen[y, x] = 1 if most > _LEAST else 0
            for channel in range(3):
                light = scattered[y, x, channel]
                scattered[y, x, channel] = exp_down(light) if most > _LEAST else _ONE


@device
def _shows(seen, row, column):  # type: ignore[no-untyped-def]
    """Whether there is scattered light in a block or beside it."""
    for y in range(max(row - 1, 0), min(row + 2, seen.shape[0])):
        for x in range(max(column - 1, 0), min(column + 2, seen.shape[1])):
            if seen[y, x]:
                return True
    return False


@device
def _in_block(display, codes, left, row, column, y, pixels, out):  # type: ignore[no-untyped-def]
    """Give one row of a block's pixels their scattered light."""
    down = _IN_BLOCK[y - row * _BLOCK]
    beside_row = min(max(row + (1 if down > 0 else -1), 0), left.shape[0] - 1)
    down = abs(down)
    begin, end = column * _BLOCK, min(column * _BLOCK + _BLOCK, pixels.shape[1])
    for channel in range(3):
        before, after = max(column - 1, 0), min(column + 1, left.shape[1] - 1)
        here = left[row, column, channel]
        here += (left[beside_row, column, channel] - here) * down
        first = left[row, before, channel]
        first += (left[beside_row, before, channel] - first) * down
        last = left[row, after, channel]
        last += (left[beside_row, after, channel] - last) * down
        for x in range(begin, end):
            across = _IN_BLOCK[x - begin]
            share = here + ((last if across > 0 else first) - here) * abs(across)
            dark = _ONE - display[pixels[y, x, channel]]
            out[y, x, channel] = codes[int((_ONE - dark * share) * _STEPS + _HALF)]


@device
def _glare_part(display, codes, left, seen, pixels, words, out, out_words, worker, first, last):  # type: ignore[no-untyped-def]
    height, width = words.shape
    for row in range(first, last):
        top, bottom = row * _BLOCK, min(row * _BLOCK + _BLOCK, height)
        for y in range(top, bottom):
            for x in range(width):
                out_words[y, x] = words[y, x]
        for column in range((width + _BLOCK - 1) // _BLOCK):
            if _shows(seen, row, column):
                for y in range(top, bottom):
                    _in_block(display, codes, left, row, column, y, pixels, out)


@kernel
def share_glare(data, board, job, work):  # type: ignore[no-untyped-def]
    """Give pixels the scattered light of their blocks.

    The data are display light of each code, codes of display light, ``(h, w, 3)`` float32 light,
    which becomes the share of the film's darkness that it leaves, ``(h, w)`` uint8 that receive
    where it shows, the picture as bytes and as words, and so what receives it. Its items are rows
    of the light, and then of blocks.
    """
    display, codes, light, seen, pixels, words, out, out_words = data
    do(_left_part, (light, seen), board, job, work)
    rows = (words.shape[0] + _BLOCK - 1) // _BLOCK
    glare = (display, codes, light, seen, pixels, words, out, out_words)
    do_step(_glare_part, glare, board, job, work, 1, rows, work[2])


@lru_cache(maxsize=8)
def _beyond_white(gamma: float) -> NDArray[np.float32]:
    """``(256,)`` float32 what a pixel adds to the mean of its block."""
    beyond = np.maximum(light_of_codes(gamma) - np.float32(WHITE), np.float32(0))
    beyond[:_TOP_CODE] = 0.0
    mean: NDArray[np.float32] = beyond * beyond / np.float32(_BLOCK * _BLOCK)
    return mean


def scattered_light(
    caster: RayCaster, film: Film, pixels: NDArray[np.uint8], bloom: float, flare: float
) -> NDArray[np.float32] | None:
    """``(h, w, 3)`` float32 light that each block of 4x4 pixels gets; None for none.

    Args:
        caster: runs the kernels.
        film: that shows the picture.
        pixels: ``(H, W, 4)`` uint8 BGRA.
        bloom, flare: CARLA's ``bloom_intensity`` and ``lens_flare_intensity``.
    """
    height, width = pixels.shape[:2]
    count = min(_LEAST_OCTAVES + (width // _NARROW_PX).bit_length(), _MOST_OCTAVES)
    widest = _BLOCK << count - 1
    rows, columns = -(-height // widest), -(-width // widest)
    sizes = [(rows << k, columns << k, 3) for k in range(count - 1, -1, -1)]
    # As many as ever, so that kernels are compiled once.
    sizes += [(0, 0, 3)] * (_MOST_OCTAVES - count)
    octaves = tuple(np.zeros(size, np.float32) for size in sizes)
    lit = np.zeros(-(-height // _BLOCK), np.uint8)
    shares = np.array([_FALL**k for k in range(count)])
    shares = (shares * (bloom * BLOOM_SHARE / shares.sum())).astype(np.float32)
    middle = np.array([width, height], np.float32) / np.float32(2 * _BLOCK << _GHOST_OCTAVE)
    ghost_share = np.float32(flare * GHOST_SHARE / len(_GHOSTS))
    bright = np.empty_like(octaves[_GHOST_OCTAVE])
    data = (
        _beyond_white(film.gamma), _words(pixels), pixels, octaves, lit, shares,
        _GHOSTS, ghost_share, middle, bright,
    )  # fmt: skip
    _in_rows(caster, share_scattered, data, len(lit), width)
    return octaves[0] if lit.any() else None


def with_glare(
    caster: RayCaster, film: Film, pixels: NDArray[np.uint8], bloom: float, flare: float
) -> NDArray[np.uint8]:
    """A picture with the light that its lens scatters; the picture itself if there is none.

    Args:
        caster, film, pixels, bloom, flare: as for :func:`scattered_light`.
    """
    light = scattered_light(caster, film, pixels, bloom, flare)
    if light is None:
        return pixels
    seen, out = np.empty(light.shape[:2], np.uint8), np.empty_like(pixels)
    data = (
        display_of_codes(film.gamma), film_codes(film.gamma), light, seen,
        pixels, _words(pixels), out, _words(out),
    )  # fmt: skip
    _in_rows(caster, share_glare, data, len(light), pixels.shape[1])
    return out


def _in_rows(
    caster: RayCaster, shared: Shared, data: tuple[Any, ...], rows: int, width: int
) -> None:
    """Have the crew do rows of blocks."""
    caster.in_parts(shared, data, rows, max(BAND // (_BLOCK * width), 1))


def _words(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """``(H, W)`` of ``(H, W, 4)``."""
    return pixels.reshape(len(pixels), -1).view(np.uint32)
