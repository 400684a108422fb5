"""Blur of what moves while a camera's shutter is open, from each pixel's motion in that time.

Light is averaged along the motion, as in McGuire et al. 2012 ("A Reconstruction Filter for
Plausible Motion Blur"), with shares of time in place of their weights. A pixel shows what passes by
of its own surface and of what is behind that; over it goes what moves in front, for the share of
the time in which that covers it. So an edge becomes a ramp as wide as its way.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.arithmetic import exp_down
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.crew import do
from carstage_sim.render.film import Film, film_codes, light_of_codes

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_TWO: Any = np.float32(2)
_HALF: Any = np.float32(0.5)
_STEPS: Any = np.float32(8191)
_STILL: Any = np.float32(0.25)
"""Half ways, in pixels, below which nothing is blurred."""
_FAR_M: Any = np.float32(10_000)
_APART_M: Any = np.float32(0.05)
_APART: Any = np.float32(0.02)
"""How much nearer, and as a share of the distance, what lies in front is."""
_LEAST_TILE = 8
_TILES = 25
"""Tiles side by side; half of the longest way is one of them."""


@device
def _half_ways(flow, tile, last_row, height, width, half_way, most):  # type: ignore[no-untyped-def]
    """Half ways of a row of tiles' pixels, and the longest of each tile."""
    long = np.float32(tile)
    across, down = np.float32(width) * np.float32(0.25), np.float32(height) * np.float32(-0.25)
    for y in range(last_row * tile, min(last_row * tile + tile, height)):
        for x in range(width):
            i, column = y * width + x, x // tile
            u, v = flow[i, 0] * across, flow[i, 1] * down
            shorter = min(long / max(math.sqrt(u * u + v * v), _STILL), _ONE)
            u, v = u * shorter, v * shorter
            length = math.sqrt(u * u + v * v)
            half_way[i, 0], half_way[i, 1] = u, v
            if length > most[last_row, column, 2]:
                most[last_row, column, 0] = u
                most[last_row, column, 1] = v
                most[last_row, column, 2] = length


@device
def _ways_part(flow, tile, height, width, half_way, most, worker, first, last):  # type: ignore[no-untyped-def]
    for row in range(first, last):
        _half_ways(flow, tile, row, height, width, half_way, most)


@kernel
def share_ways(data, board, job, work):  # type: ignore[no-untyped-def]
    """Half ways in pixels, x right and y down, and the longest of each tile.

    The data are ``(N, 2)`` float32 flow in CARLA's units, pixels of a tile's side, height and
    width, ``(N, 2)`` float32 that receive the half ways, and ``(h, w, 3)`` float32 zeros that
    receive x, y and length of the longest of each tile. Its items are rows of tiles.
    """
    do(_ways_part, data, board, job, work)


@device
def _longest_beside(most, row, column):  # type: ignore[no-untyped-def]
    """Row and column of the longest half way of a tile and the eight around it."""
    best_row, best_column = row, column
    for v in range(max(row - 1, 0), min(row + 2, most.shape[0])):
        for u in range(max(column - 1, 0), min(column + 2, most.shape[1])):
            if most[v, u, 2] > most[best_row, best_column, 2]:
                best_row, best_column = v, u
    return best_row, best_column


@device
def _on_way(t, u, v, height, width, y, x):  # type: ignore[no-untyped-def]
    """The pixel at a part of another's way, -1 to 1; -1 outside the picture."""
    across, down = math.floor(x + _HALF + t * u), math.floor(y + _HALF + t * v)
    if across < 0 or down < 0 or across >= width or down >= height:
        return -1
    return down * width + across


@device
def _own_light(light, pixels, depth, half_way, height, width, y, x):  # type: ignore[no-untyped-def]
    """Light of a pixel's own surface, and of what is behind it, along its way."""
    i = y * width + x
    u, v = half_way[i, 0], half_way[i, 1]
    length = math.sqrt(u * u + v * v)
    blue, green, red = light[pixels[i, 0]], light[pixels[i, 1]], light[pixels[i, 2]]
    if length < _STILL:
        return False, blue, green, red
    samples = math.ceil(length + length) | 1
    nearest = min(depth[i], _FAR_M)
    nearest -= _APART_M + _APART * nearest
    count, blue, green, red = _ZERO, _ZERO, _ZERO, _ZERO
    for k in range(samples):
        t = (np.float32(2 * k + 1) / np.float32(samples)) - _ONE
        j = _on_way(t, u, v, height, width, y, x)
        if j < 0 or min(depth[j], _FAR_M) < nearest:
            continue
        blue += light[pixels[j, 0]]
        green += light[pixels[j, 1]]
        red += light[pixels[j, 2]]
        count += _ONE
    return True, blue / count, green / count, red / count


@device
def _light_in_front(light, pixels, depth, half_way, height, width, y, x, u, v, length):  # type: ignore[no-untyped-def]
    """Share of the time in which something in front covers a pixel, and its light in that time."""
    nearest = min(depth[y * width + x], _FAR_M)
    nearest -= _APART_M + _APART * nearest
    samples = math.ceil(length + length) | 1
    step = _TWO * length / np.float32(samples)
    share, blue, green, red = _ZERO, _ZERO, _ZERO, _ZERO
    for k in range(samples):
        t = (np.float32(2 * k + 1) / np.float32(samples)) - _ONE
        j = _on_way(t, u, v, height, width, y, x)
        if j < 0 or min(depth[j], _FAR_M) >= nearest:
            continue
        way = abs(half_way[j, 0] * u + half_way[j, 1] * v) / length
        if way < _STILL or abs(t) * length > way:
            continue
        part = step / (_TWO * way)
        blue += light[pixels[j, 0]] * part
        green += light[pixels[j, 1]] * part
        red += light[pixels[j, 2]] * part
        share += part
    return share, blue, green, red


@device
def _shown(codes, light):  # type: ignore[no-untyped-def]
    return codes[int((_ONE - exp_down(light)) * _STEPS + _HALF)]


@device
def _blurred(light, codes, pixels, depth, half_way, height, width, y, x, longest, out):  # type: ignore[no-untyped-def]
    """Give a pixel the light that it got while the shutter was open."""
    i = y * width + x
    moves, blue, green, red = _own_light(light, pixels, depth, half_way, height, width, y, x)
    share, over_blue, over_green, over_red = _light_in_front(
        light, pixels, depth, half_way, height, width, y, x, longest[0], longest[1], longest[2]
    )
    if not moves and share == 0:
        return
    if share > _ONE:
        over_blue, over_green, over_red = over_blue / share, over_green / share, over_red / share
        share = _ONE
    left = _ONE - share
    out[i, 0] = _shown(codes, over_blue + left * blue)
    out[i, 1] = _shown(codes, over_green + left * green)
    out[i, 2] = _shown(codes, over_red + left * red)


@device
def _blur_part(  # type: ignore[no-untyped-def]
    light, codes, pixels, depth, half_way, most, tile, height, width, out, worker, first, last
):
    for row in range(first, last):
        top, bottom = row * tile, min(row * tile + tile, height)
        for i in range(top * width, bottom * width):
            for channel in range(4):
                out[i, channel] = pixels[i, channel]
        for column in range(most.shape[1]):
            v, u = _longest_beside(most, row, column)
            longest = most[v, u, 0], most[v, u, 1], most[v, u, 2]
            if longest[2] < _STILL:
                continue
            for y in range(top, bottom):
                for x in range(column * tile, min(column * tile + tile, width)):
                    _blurred(
                        light, codes, pixels, depth, half_way, height, width, y, x, longest, out
                    )


@kernel
def share_blur(data, board, job, work):  # type: ignore[no-untyped-def]
    """Average light over the time in which the shutter is open.

    The data are light of each code, codes of display light, ``(N, 4)`` uint8 BGRA, ``(N,)`` float32
    depths, what :func:`share_ways` made, pixels of a tile's side, height and width, and what
    receives the pixels. Its items are rows of tiles.
    """
    do(_blur_part, data, board, job, work)


def blurred(
    caster: RayCaster,
    film: Film,
    pixels: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    flow: NDArray[np.float32],
) -> NDArray[np.uint8]:
    """A picture of what moves while the shutter is open, half before it and half after.

    Args:
        caster: runs the kernels.
        film: that shows the picture.
        pixels: ``(H, W, 4)`` uint8 BGRA of the middle of that time.
        depth_m: ``(H * W,)`` float32 depths.
        flow: ``(H, W, 2)`` float32 motion in that time, in the units of the optical-flow camera.
    """
    height, width = pixels.shape[:2]
    tile = max(_LEAST_TILE, width // _TILES)
    rows, columns = -(-height // tile), -(-width // tile)
    half_way = np.empty((height * width, 2), np.float32)
    most = np.zeros((rows, columns, 3), np.float32)
    caster.in_parts(share_ways, (flow.reshape(-1, 2), tile, height, width, half_way, most), rows, 1)
    out = np.empty_like(pixels)
    data = (
        light_of_codes(film.gamma), film_codes(film.gamma), pixels.reshape(-1, 4), depth_m,
        half_way, most, tile, height, width, out.reshape(-1, 4),
    )  # fmt: skip
    caster.in_parts(share_blur, data, rows, 1)
    return out
