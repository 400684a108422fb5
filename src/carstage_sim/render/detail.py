"""Procedural detail: patterns that vary a material's colour, faded where pixels are too coarse.

All are functions of a place on the surface in metres, so that nothing swims when the camera moves.
Each pattern returns a factor for the colour; ``pixel`` is the size of a pixel on the surface
(metres), and a pattern finer than that returns its mean.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from carstage_sim.kernels import device
from carstage_sim.render.materials import Detail
from carstage_sim.render.noise_lanes import side_by_side

NONE, ASPHALT, PAVING = int(Detail.NONE), int(Detail.ASPHALT), int(Detail.PAVING)
BRICK, GRASS, LEAVES = int(Detail.BRICK), int(Detail.GRASS), int(Detail.LEAVES)
MARKING, WINDOW, PLASTER = int(Detail.MARKING), int(Detail.WINDOW), int(Detail.PLASTER)
BARK, GLAZING, PICTURE = int(Detail.BARK), int(Detail.GLAZING), int(Detail.PICTURE)

_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_PER_PATCH: Any = np.float32(1 / 9.5)
_PER_COVER: Any = np.float32(1 / 13.0)
"""Squares for each metre in which a repaired patch, or the cover of a manhole, may lie."""


@device
def hash_unit(i, j, seed):  # type: ignore[no-untyped-def]
    """A number in [0, 1) for a cell of a lattice."""
    h = np.uint32(
        np.uint32(i) * np.uint32(374761393)
        + np.uint32(j) * np.uint32(668265263)
        + np.uint32(seed) * np.uint32(2246822519)
    )
    h = np.uint32((h ^ (h >> np.uint32(13))) * np.uint32(1274126177))
    h = np.uint32((h ^ (h >> np.uint32(16))) * np.uint32(2654435761))
    return np.float32(h >> np.uint32(8)) * np.float32(1.0 / 16777216.0)


@device
def noise(x, y, seed):  # type: ignore[no-untyped-def]
    """Smooth noise with mean 0 in about [-1, 1], one bump per unit."""
    fx, fy = np.floor(x), np.floor(y)
    i, j = int(fx), int(fy)
    u, v = x - fx, y - fy
    u = u * u * (np.float32(3) - (u + u))
    v = v * v * (np.float32(3) - (v + v))
    a, b = hash_unit(i, j, seed), hash_unit(i + 1, j, seed)
    c, d = hash_unit(i, j + 1, seed), hash_unit(i + 1, j + 1, seed)
    low = a + (b - a) * u
    value = low + (c + (d - c) * u - low) * v
    return value + value - _ONE


@device
def faded(x, y, size, pixel, seed):  # type: ignore[no-untyped-def]
    """Noise with bumps of ``size`` metres, zero where a pixel is larger than a bump."""
    share = _ONE - pixel / size
    if share <= 0:
        return np.float32(0)
    return noise(x / size, y / size, seed) * min(share + share, _ONE)


@device
def _layer(size, pixel):  # type: ignore[no-untyped-def]
    """What is left of noise with bumps of a size; see :func:`faded`."""
    share = max(_ONE - pixel / size, np.float32(0))
    return min(share + share, _ONE)


@device
def _five_noises(x, y, a, b, c, d, e, seed):  # type: ignore[no-untyped-def]
    return (
        noise(x / a, y / a, seed),
        noise(x / b, y / b, seed + 1),
        noise(x / c, y / c, seed + 2),
        noise(x / d, y / d, seed + 3),
        noise(x / e, y / e, seed + 4),
    )


five_noises = side_by_side(_five_noises)
"""Noise with bumps of five sizes, of seeds that follow each other, for the price of one."""


@device
def asphalt(x, y, pixel):  # type: ignore[no-untyped-def]
    """Chippings, worn patches and long stains."""
    chips, patches, stains, slow, seam = five_noises(
        x, y, np.float32(0.025), np.float32(0.16), np.float32(1.3), np.float32(7.0),
        np.float32(4.3), 1,
    )  # fmt: skip
    value = (
        _ONE
        + np.float32(0.28) * chips * _layer(np.float32(0.025), pixel)
        + np.float32(0.19) * patches * _layer(np.float32(0.16), pixel)
        + np.float32(0.12) * stains * _layer(np.float32(1.3), pixel)
        + np.float32(0.09) * slow * _layer(np.float32(7.0), pixel)
    )
    # Repaired seams: the zero lines of a slow noise.
    line = abs(seam)
    width = np.float32(0.004) + pixel * np.float32(0.12)
    if line < width:
        value *= _ONE - np.float32(0.28) * (_ONE - line / width) * min(
            np.float32(0.02) / (pixel + np.float32(0.004)), _ONE
        )
    return value


@device
def repairs(x, y, pixel):  # type: ignore[no-untyped-def]
    """Patches of newer asphalt with tar along their edges, cracks, and covers of manholes."""
    value = _ONE
    soft = pixel * _HALF + np.float32(0.006)
    # A patch may lie in each square of the plan.
    fx, fy = np.floor(x * _PER_PATCH), np.floor(y * _PER_PATCH)
    i, j = int(fx), int(fy)
    chance = hash_unit(i, j, 61)
    if chance < np.float32(0.3):
        wide = np.float32(0.6) + np.float32(4.0) * chance
        deep = np.float32(0.5) + np.float32(2.2) * hash_unit(i, j, 62)
        dx = abs(x - (fx + _HALF) / _PER_PATCH) - wide
        dy = abs(y - (fy + _HALF) / _PER_PATCH) - deep
        edge = max(dx, dy)
        if edge < np.float32(0.03):
            value *= np.float32(0.74) + np.float32(0.5) * hash_unit(i, j, 63)
            tar = max(_ONE - (abs(edge) - np.float32(0.015)) / soft, np.float32(0))
            value *= _ONE - np.float32(0.34) * min(tar, _ONE) * min(np.float32(0.03) / soft, _ONE)
    fx, fy = np.floor(x * _PER_COVER), np.floor(y * _PER_COVER)
    i, j = int(fx), int(fy)
    chance = hash_unit(i, j, 64)
    if chance < np.float32(0.24):
        dx = x - (fx + np.float32(0.3) + chance) / _PER_COVER
        dy = y - (fy + np.float32(0.2) + np.float32(0.6) * hash_unit(i, j, 65)) / _PER_COVER
        away = dx * dx + dy * dy
        if away < np.float32(0.16):
            ring = away > np.float32(0.1)
            value = np.float32(0.62) if ring else np.float32(0.84)
            if not ring and pixel < np.float32(0.04):
                bump = (int(np.floor(dx * np.float32(22))) + int(np.floor(dy * np.float32(22)))) & 1
                value += np.float32(0.2) * np.float32(bump)
    return value


@device
def cracks(x, y, pixel):  # type: ignore[no-untyped-def]
    """Thin dark lines where the asphalt is old."""
    if pixel > np.float32(0.06):
        return _ONE
    bend = noise(x * np.float32(1.1), y * np.float32(1.1), 66)
    if bend < np.float32(0.1):
        return _ONE
    line = abs(noise(x * np.float32(0.9) + bend, y * np.float32(0.9), 67))
    width = np.float32(0.012) + pixel * np.float32(0.9)
    if line > width:
        return _ONE
    deep = (_ONE - line / width) * min(np.float32(0.018) / (pixel + np.float32(0.006)), _ONE)
    return _ONE - np.float32(0.42) * deep * min((bend - np.float32(0.1)) * np.float32(5), _ONE)


@device
def grass(x, y, pixel):  # type: ignore[no-untyped-def]
    """Colour factors of grass: blades, tufts, and places where it is dry or thin."""
    fine, tuft, clump, slow, field = five_noises(
        x, y, np.float32(0.03), np.float32(0.13), np.float32(0.55), np.float32(3.1),
        np.float32(19.0), 71,
    )  # fmt: skip
    tuft *= _layer(np.float32(0.13), pixel)
    clump *= _layer(np.float32(0.55), pixel)
    slow *= _layer(np.float32(3.1), pixel)
    field *= _layer(np.float32(19.0), pixel)
    value = _ONE + np.float32(0.3) * fine * _layer(np.float32(0.03), pixel)
    value += np.float32(0.26) * tuft + np.float32(0.2) * clump + np.float32(0.08) * slow
    if pixel < np.float32(0.016):
        # Blades lie one way in one tuft and another way in the next.
        lean = np.float32(0.8) if clump + tuft > 0 else np.float32(-0.6)
        blade = noise((x + lean * y) * np.float32(90), (y - lean * x) * np.float32(11), 76)
        value += np.float32(0.34) * blade * (_ONE - pixel * np.float32(60))
    dry = np.float32(0.14) * slow + np.float32(0.2) * field + np.float32(0.1) * clump
    if pixel < np.float32(0.03) and tuft > np.float32(0.1):
        fx, fy = np.floor(x * np.float32(3)), np.floor(y * np.float32(3))
        chance = hash_unit(int(fx), int(fy), 77)
        dx = x * np.float32(3) - fx - np.float32(0.3) - np.float32(8) * chance
        dy = y * np.float32(3) - fy - _HALF
        if chance < np.float32(0.05) and dx * dx + dy * dy < np.float32(0.0036):
            bright = np.float32(6)
            return bright, bright, bright * (_ONE if chance < np.float32(0.03) else _HALF)
    return value * (_ONE + dry + dry), value * (_ONE + dry * np.float32(0.5)), value


@device
def tiles(x, y, wide, high, joint, shift, pixel, seed):  # type: ignore[no-untyped-def]
    """Courses of tiles: (brightness of the tile, share of joint in the pixel)."""
    row = np.floor(y / high)
    along = x / wide + (_HALF if int(row) & 1 else np.float32(0)) * shift
    column = np.floor(along)
    tint = hash_unit(int(column), int(row), seed) * np.float32(2) - _ONE
    coarse = min(pixel / (high * _HALF), _ONE)
    dx = (_HALF - abs(along - column - _HALF)) * wide
    dy = (_HALF - abs(y / high - row - _HALF)) * high
    edge = min(dx, dy)
    soft = max(pixel, np.float32(0.002))
    seam = min(max((joint * _HALF + soft * _HALF - edge) / soft, np.float32(0)), _ONE)
    mean = joint / wide + joint / high
    return tint * (_ONE - coarse), seam + (mean - seam) * coarse


@device
def window(s, t, number, pixel, night):  # type: ignore[no-untyped-def]
    """A window's pane at ``s, t`` (0-1 across and up).

    Returns:
        ``(kind, red, green, blue, light)``: kind 0 is glass over a dark room, 1 is an opaque part
        (frame, curtain behind glass counts as 2); colours are linear; light is emitted by lit
        rooms.
    """
    fine = pixel < np.float32(0.12)
    edge_s = min(s, _ONE - s)
    edge_t = min(t, _ONE - t)
    kind_of = hash_unit(number, 17, 3)
    if fine and (
        edge_s < np.float32(0.05)
        or edge_t < np.float32(0.035)
        or (kind_of < np.float32(0.7) and abs(s - _HALF) < np.float32(0.022))
        or (kind_of > np.float32(0.55) and abs(t - np.float32(0.70)) < np.float32(0.016))
    ):
        shade = (
            np.float32(0.62) if hash_unit(number >> 7, 5, 1) < np.float32(0.6) else np.float32(0.06)
        )
        return 1, shade, shade, shade * np.float32(0.97), np.float32(0)
    lit = np.float32(0)
    if night > 0 and hash_unit(number, 3, 7) < np.float32(0.36):
        lit = (np.float32(0.35) + np.float32(0.65) * hash_unit(number, 9, 1)) * night
    drawn = hash_unit(number, 29, 2)
    reach = hash_unit(number, 31, 4)
    cloth = np.float32(0)
    if drawn < np.float32(0.30):
        # Curtains leave the middle open; blinds hang from the top.
        if abs(s - _HALF) > np.float32(0.14) + np.float32(0.30) * reach:
            cloth = np.float32(0.46) + np.float32(0.05) * math.sin(s * np.float32(70.0))
    elif drawn < np.float32(0.55) and t > np.float32(0.35) + np.float32(0.6) * reach:
        cloth = np.float32(0.50) + np.float32(0.04) * math.sin(t * np.float32(120.0))
    if cloth > 0:
        return 2, cloth, cloth * np.float32(0.97), cloth * np.float32(0.88), lit * _HALF
    room = np.float32(0.012) + np.float32(0.05) * hash_unit(number, 41, 6) * (_ONE - t)
    return 0, room, room * np.float32(0.98), room * np.float32(0.94), lit


@device
def _wall_tint(number):  # type: ignore[no-untyped-def]
    """Colour factors that tell one building's walls from the next one's."""
    bright = np.float32(0.72) + np.float32(0.5) * hash_unit(number, 11, 1)
    warm = (hash_unit(number, 13, 2) - np.float32(0.5)) * np.float32(0.30)
    green = (hash_unit(number, 17, 3) - np.float32(0.5)) * np.float32(0.10)
    return bright * (_ONE + warm), bright * (_ONE + green), bright * (_ONE - warm)


@device
def pattern(kind, x, y, z, nx, ny, nz, owner, number, pixel):  # type: ignore[no-untyped-def]
    """Colour factors (red, green, blue) of a procedural pattern at a place of a surface."""
    if abs(nz) > np.float32(0.6):
        s, t = x, y
    else:
        flat = max(math.sqrt(nx * nx + ny * ny), np.float32(1e-4))
        s, t = (x * -ny + y * nx) / flat, z
    if kind == ASPHALT:
        value = asphalt(x, y, pixel) * repairs(x, y, pixel) * cracks(x, y, pixel)
        return value, value, value
    if kind == PAVING:
        tint, seam = tiles(
            s, t, np.float32(0.6), np.float32(0.6), np.float32(0.012), _ONE, pixel, 3
        )
        value = (_ONE + np.float32(0.07) * tint) * (_ONE - np.float32(0.42) * seam)
        value += np.float32(0.06) * faded(x, y, np.float32(2.3), pixel, 8)
        value += np.float32(0.07) * faded(x, y, np.float32(0.05), pixel, 9)
        return value, value, value
    if kind == BRICK:
        r, g, b = _wall_tint(owner)
        tint, seam = tiles(
            s, t, np.float32(0.25), np.float32(0.083), np.float32(0.012), _ONE, pixel, 5
        )
        value = (_ONE + np.float32(0.22) * tint) * (_ONE - seam)
        value += np.float32(0.05) * faded(s, t, np.float32(3.0), pixel, 8) * (_ONE - seam)
        return (
            value * r + seam * np.float32(1.3),
            value * g + seam * np.float32(2.0),
            (value * b + seam * np.float32(2.4)),
        )
    if kind == GRASS:
        return grass(x, y, pixel)
    if kind == LEAVES:
        tree = hash_unit(owner, 3, 5)
        leaf = hash_unit(number >> 1, 7, 9)
        # Leaflets of a hand's size with dark gaps between them; blurred to their mean from afar.
        bunch = np.float32(0.55) * faded(s + x, t + y, np.float32(0.11), pixel, 14)
        bunch += np.float32(0.30) * faded(s - y, t + x, np.float32(0.05), pixel, 15)
        value = np.float32(0.72) + np.float32(0.45) * leaf + np.float32(0.2) * (tree - _HALF)
        value *= max(_ONE + bunch, np.float32(0.3))
        return (
            value * (np.float32(0.75) + np.float32(0.65) * tree * leaf),
            value,
            (value * np.float32(0.9)),
        )
    if kind == MARKING:
        value = (
            _ONE
            + np.float32(0.10) * faded(x, y, np.float32(0.08), pixel, 6)
            + np.float32(0.10) * faded(x, y, np.float32(0.9), pixel, 7)
        )
        return value, value, value
    if kind == PLASTER:
        r, g, b = _wall_tint(owner)
        value = (
            _ONE
            + np.float32(0.05) * faded(s, t, np.float32(0.12), pixel, 1)
            + np.float32(0.06) * faded(s * np.float32(2.0), t, np.float32(2.6), pixel, 2)
            + np.float32(0.07) * faded(s * np.float32(9.0), t, np.float32(3.4), pixel, 4)
        )
        return value * r, value * g, value * b
    if kind == BARK:
        value = _ONE + np.float32(0.25) * faded(s * np.float32(4), t, np.float32(0.22), pixel, 1)
        return value, value, value
    if kind != NONE:
        value = (
            _ONE
            + np.float32(0.08) * faded(s, t, np.float32(0.06), pixel, 1)
            + np.float32(0.06) * faded(s, t, np.float32(1.1), pixel, 2)
        )
        return value, value, value
    return _ONE, _ONE, _ONE
