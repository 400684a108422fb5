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
SHOP, DOOR, ROOM = int(Detail.SHOP), int(Detail.DOOR), int(Detail.ROOM)
KERB, GUTTER = int(Detail.KERB), int(Detail.GUTTER)
TACTILE, COVER = int(Detail.TACTILE), int(Detail.COVER)

_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_ZERO: Any = np.float32(0)
FAR_M: Any = np.float32(100)
"""Stands for an edge of a wall that nobody knows of."""
_STREAKED_M: Any = np.float32(2.2)
"""Rain marks end so far below the edge that they come from."""


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
def stones(x, y, seed):  # type: ignore[no-untyped-def]
    """The height of :func:`noise`, and how it rises along x and y for each unit."""
    fx, fy = np.floor(x), np.floor(y)
    i, j = int(fx), int(fy)
    u, v = x - fx, y - fy
    rise_u, rise_v = np.float32(6) * u * (_ONE - u), np.float32(6) * v * (_ONE - v)
    u = u * u * (np.float32(3) - (u + u))
    v = v * v * (np.float32(3) - (v + v))
    a, b = hash_unit(i, j, seed), hash_unit(i + 1, j, seed)
    c, d = hash_unit(i, j + 1, seed), hash_unit(i + 1, j + 1, seed)
    along, beyond = b - a, d - c
    low, high = a + along * u, c + beyond * u
    value = low + (high - low) * v
    rise_x, rise_y = (along + (beyond - along) * v) * rise_u, (high - low) * rise_v
    return value + value - _ONE, rise_x + rise_x, rise_y + rise_y


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
def _six_noises(x, y, a, b, c, d, e, f, seed):  # type: ignore[no-untyped-def]
    return (
        noise(x / a, y / a, seed),
        noise(x / b, y / b, seed + 1),
        noise(x / c, y / c, seed + 2),
        noise(x / d, y / d, seed + 3),
        noise(x / e, y / e, seed + 4),
        noise(x / f, y / f, seed + 5),
    )


six_noises = side_by_side(_six_noises)
"""Noise with bumps of six sizes, of seeds that follow each other, for the price of one."""


@device
def asphalt(x, y, pixel):  # type: ignore[no-untyped-def]
    """Chippings, worn patches and long stains."""
    chips, patches, stains, slow, seam, gravel = six_noises(
        x, y, np.float32(0.025), np.float32(0.16), np.float32(1.3), np.float32(7.0),
        np.float32(4.3), np.float32(0.06), 1,
    )  # fmt: skip
    slow *= _layer(np.float32(7.0), pixel)
    value = (
        _ONE
        + np.float32(0.28) * chips * _layer(np.float32(0.025), pixel)
        # Stones lie by chance: a mean over more of them varies as one over its width.
        + np.float32(0.12) * gravel * _layer(np.float32(0.06), pixel)
        + np.float32(0.17) * patches * _layer(np.float32(0.16), pixel)
        + np.float32(0.15) * stains * _layer(np.float32(1.3), pixel)
        + np.float32(0.17) * slow
    )
    # Dripped oil is darker than the worn places around it.
    value *= _ONE - np.float32(0.6) * min(max(stains - np.float32(0.42), _ZERO), np.float32(0.4))
    # Poured tar: pieces of the zero lines of a slow noise.
    line, width = abs(seam), np.float32(0.009) + pixel * np.float32(0.2)
    if line < width and slow + stains > np.float32(0.2):
        deep = min(np.float32(2) * (_ONE - line / width), _ONE)
        value *= _ONE - np.float32(0.5) * deep * min(
            np.float32(0.035) / (pixel + np.float32(0.006)), _ONE
        )
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
    width = np.float32(0.018) + pixel * np.float32(0.9)
    if line > width:
        return _ONE
    deep = (_ONE - line / width) * min(np.float32(0.018) / (pixel + np.float32(0.006)), _ONE)
    return _ONE - np.float32(0.55) * deep * min((bend - np.float32(0.1)) * np.float32(5), _ONE)


@device
def grass(x, y, pixel):  # type: ignore[no-untyped-def]
    """Colour factors of grass: blades, tufts, and places where it is dry or thin."""
    fine, tuft, clump, slow, field, _ = six_noises(
        x, y, np.float32(0.03), np.float32(0.13), np.float32(0.55), np.float32(3.1),
        np.float32(19.0), np.float32(1.0), 71,
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
    mean = joint / wide + joint / high
    if pixel >= high * _HALF:
        return _ZERO, mean
    row = np.floor(y / high)
    along = x / wide + (_HALF if int(row) & 1 else np.float32(0)) * shift
    column = np.floor(along)
    tint = hash_unit(int(column), int(row), seed) * np.float32(2) - _ONE
    coarse = pixel / (high * _HALF)
    dx = (_HALF - abs(along - column - _HALF)) * wide
    dy = (_HALF - abs(y / high - row - _HALF)) * high
    edge = min(dx, dy)
    soft = max(pixel, np.float32(0.002))
    seam = min(max((joint * _HALF + soft * _HALF - edge) / soft, np.float32(0)), _ONE)
    return tint * (_ONE - coarse), seam + (mean - seam) * coarse


@device
def marking(x, y, pixel):  # type: ignore[no-untyped-def]
    """Worn paint: thin where wheels cross it, flaked off in places."""
    wear = faded(x, y, np.float32(2.7), pixel, 7)
    fine = faded(x, y, np.float32(0.07), pixel, 6)
    flakes = faded(x, y, np.float32(0.26), pixel, 10)
    value = np.float32(0.9) + np.float32(0.1) * fine + np.float32(0.12) * wear
    bare = flakes + np.float32(0.7) * fine + np.float32(0.8) * wear - np.float32(0.86)
    bare = min(max(bare * np.float32(5), _ZERO), _ONE)
    return value + (np.float32(0.16) - value) * bare


@device
def _litter(x, y, pixel, share, seed):  # type: ignore[no-untyped-def]
    """Whether a fallen leaf or other litter lies at a place, and its tone; -1 for none."""
    if pixel > np.float32(0.03):
        return -_ONE
    fx, fy = np.floor(x * np.float32(2.5)), np.floor(y * np.float32(2.5))
    chance = hash_unit(int(fx), int(fy), seed)
    if chance > share:
        return -_ONE
    turn = hash_unit(int(fx), int(fy), seed + 1)
    dx = x - (fx + np.float32(0.2) + np.float32(0.6) * turn) * np.float32(0.4)
    dy = y - (fy + np.float32(0.8) - np.float32(0.6) * turn) * np.float32(0.4)
    along, across = dx + (turn - _HALF) * dy, dy - (turn - _HALF) * dx
    if along * along + np.float32(3) * across * across > np.float32(0.0016):
        return -_ONE
    return turn


@device
def paving(x, y, s, t, pixel):  # type: ignore[no-untyped-def]
    """Colour factors of slabs in a half bond: some replaced, seams with moss, stains, leaves."""
    tint, seam = tiles(s, t, np.float32(0.6), np.float32(0.4), np.float32(0.011), _ONE, pixel, 3)
    worn = faded(x, y, np.float32(2.3), pixel, 8)
    value = (_ONE + np.float32(0.1) * tint) * (_ONE - np.float32(0.42) * seam)
    if tint > np.float32(0.86):
        value *= np.float32(0.84)
    value += np.float32(0.09) * worn + np.float32(0.08) * faded(x, y, np.float32(0.05), pixel, 9)
    moss = seam * max(worn, _ZERO) * np.float32(0.4)
    leaf = _litter(x, y, pixel, np.float32(0.035), 81)
    if leaf >= 0:
        return np.float32(0.5) + leaf, np.float32(0.36) + np.float32(0.5) * leaf, np.float32(0.16)
    return value - moss, value, value - moss


@device
def kerbside(kind, x, y, s, nz, pixel):  # type: ignore[no-untyped-def]
    """Colour factors of kerb stones, gutters, studded stones and covers."""
    value = _ONE + np.float32(0.12) * faded(x, y, np.float32(0.06), pixel, 1)
    value += np.float32(0.12) * faded(x, y, np.float32(1.1), pixel, 2)
    if kind == KERB:
        if abs(nz) < _HALF:
            off = abs(s - np.floor(s) - _HALF)
            joint = (np.float32(0.012) + pixel * _HALF - _HALF + off) / max(
                pixel, np.float32(0.004)
            )
            value *= np.float32(0.84) - np.float32(0.45) * min(max(joint, _ZERO), _ONE) * min(
                np.float32(0.03) / max(pixel, np.float32(0.01)), _ONE
            )
        return value, value, value
    if kind == GUTTER:
        value *= _ONE + np.float32(0.24) * faded(x, y, np.float32(0.5), pixel, 83)
        leaf = _litter(x, y, pixel, np.float32(0.12), 84)
        if leaf >= 0:
            return np.float32(0.8) + leaf, np.float32(0.5) + np.float32(0.7) * leaf, _HALF * _HALF
        return value, value * np.float32(0.98), value * np.float32(0.94)
    size = np.float32(16) if kind == TACTILE else np.float32(20)
    near = max(_ONE - pixel * size * np.float32(1.4), _ZERO)
    u, v = x * size, y * size
    u, v = u - np.floor(u) - _HALF, v - np.floor(v) - _HALF
    stud = _ONE if u * u + v * v < np.float32(0.09) else np.float32(-0.4)
    value *= _ONE + np.float32(0.22) * stud * near
    return value, value, value


@device
def _wall_tint(number):  # type: ignore[no-untyped-def]
    """Colour factors that tell one building's walls from the next one's."""
    bright = np.float32(0.72) + np.float32(0.5) * hash_unit(number, 11, 1)
    warm = (hash_unit(number, 13, 2) - np.float32(0.5)) * np.float32(0.30)
    green = (hash_unit(number, 17, 3) - np.float32(0.5)) * np.float32(0.10)
    return bright * (_ONE + warm), bright * (_ONE + green), bright * (_ONE - warm)


@device
def _repaired(s, t, owner):  # type: ignore[no-untyped-def]
    """Brightness of a place of a wall beside that of the wall: where it was plastered anew."""
    u, v = s * np.float32(0.31), t * np.float32(0.42)
    fx, fy = np.floor(u), np.floor(v)
    chance = hash_unit(int(fx), int(fy) + owner * 7, 45)
    if chance > np.float32(0.08):
        return _ONE
    u, v, grown = u - fx - np.float32(0.15), v - fy - np.float32(0.2), chance * np.float32(6)
    if u < 0 or v < 0 or u > np.float32(0.12) + grown or v > np.float32(0.5) - grown * _HALF:
        return _ONE
    return np.float32(0.9) + grown * np.float32(0.33)


@device
def _plaster(s, t, edges, owner, pixel):  # type: ignore[no-untyped-def]
    """Colour factors of plaster and concrete: roughcast, boards or formwork, repairs, rain marks.

    Args:
        s, t: place along the wall and up, metres.
        edges: metres below an edge that rain drips from, and above the foot that it splashes.
        owner: level object.
        pixel: a pixel's side, metres.
    """
    hang, foot = edges
    grain, mottle, cloud, slow, _, _ = six_noises(
        s, t, np.float32(0.03), np.float32(0.12), np.float32(0.55), np.float32(2.6),
        np.float32(8.0), np.float32(1.0), 41,
    )  # fmt: skip
    column = noise(s * np.float32(2.65), t * np.float32(0.29), 4)
    column *= _layer(np.float32(0.38), pixel)
    cloud *= _layer(np.float32(0.55), pixel)
    value = (
        _ONE
        + np.float32(0.08) * grain * _layer(np.float32(0.03), pixel)
        + np.float32(0.05) * mottle * _layer(np.float32(0.12), pixel)
        + np.float32(0.05) * cloud
        + np.float32(0.06) * slow * _layer(np.float32(2.6), pixel)
        + np.float32(0.07) * column
    )
    style = hash_unit(owner, 19, 6)
    if style < np.float32(0.55):
        # Boards of insulation below the plaster, or formwork.
        wide, high = np.float32(1.0), np.float32(0.5)
        if style < np.float32(0.2):
            wide, high = np.float32(2.7), np.float32(1.35)
        tint, seam = tiles(s, t, wide, high, np.float32(0.012), _ONE, pixel, 44)
        value += np.float32(0.014) * tint - np.float32(0.09) * seam
    value *= _repaired(s, t, owner)
    dirt = _ZERO
    if hang < _STREAKED_M:
        drip = np.float32(0.4)
        if pixel < np.float32(0.1):
            fine = noise(s * np.float32(12), hang * np.float32(0.35), 46)
            drip += (_HALF + _HALF * fine) * _layer(np.float32(0.1), pixel)
        drip *= max(column + np.float32(0.12), _ZERO)
        reach = np.float32(1.2) + column
        dirt = drip * max(_ONE - hang / reach, _ZERO) * min(hang * np.float32(6), _ONE)
    if foot < np.float32(0.6):
        splashed = np.float32(0.42) + np.float32(0.2) * cloud + np.float32(0.1) * mottle
        dirt = max(_ONE - foot / splashed, _ZERO)
    return (
        value * (_ONE - np.float32(0.42) * dirt),
        value * (_ONE - np.float32(0.45) * dirt),
        value * (_ONE - np.float32(0.5) * dirt),
    )


@device
def pattern(kind, x, y, z, nx, ny, nz, edges, owner, number, pixel):  # type: ignore[no-untyped-def]
    """Colour factors (red, green, blue) of a procedural pattern at a place of a surface.

    ``edges``: of a wall, as :func:`carstage_sim.render.panes.wall_edges` gives them.
    """
    if abs(nz) > np.float32(0.6):
        s, t = x, y
    else:
        flat = max(math.sqrt(nx * nx + ny * ny), np.float32(1e-4))
        s, t = (x * -ny + y * nx) / flat, z
    if kind == ASPHALT:
        value = asphalt(x, y, pixel) * cracks(x, y, pixel)
        return value, value, value
    if kind == PAVING:
        return paving(x, y, s, t, pixel)
    if kind == BRICK:
        r, g, b = _wall_tint(owner)
        tint, seam = tiles(
            s, t, np.float32(0.25), np.float32(0.083), np.float32(0.012), _ONE, pixel, 5
        )
        value = (_ONE + np.float32(0.22) * tint) * (_ONE - seam)
        fired, soot, cloud, slow, field, several = six_noises(
            s, t, np.float32(0.21), np.float32(0.6), np.float32(1.6), np.float32(4.0),
            np.float32(11.0), np.float32(0.42), 47,
        )  # fmt: skip
        # Where single bricks fade, a mean of two of them is left of their tones.
        faint = min(pixel * np.float32(1 / 0.0415), _ONE)
        tones = np.float32(0.08) + np.float32(0.125) * faint
        weathered = tones * fired * _layer(np.float32(0.21), pixel)
        # Tones are by chance: the mean of n bricks varies as one over the root of n.
        weathered += np.float32(0.17) * faint * several * _layer(np.float32(0.42), pixel)
        weathered += np.float32(0.08) * soot * _layer(np.float32(0.6), pixel)
        weathered += np.float32(0.07) * cloud * _layer(np.float32(1.6), pixel)
        weathered += np.float32(0.07) * slow + np.float32(0.05) * field
        value += weathered * (_ONE - seam)
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
        value = marking(x, y, pixel)
        return value, value, value
    if kind == PLASTER:
        r, g, b = _wall_tint(owner)
        red, green, blue = _plaster(s, t, edges, owner, pixel)
        return red * r, green * g, blue * b
    if kind == BARK:
        value = _ONE + np.float32(0.25) * faded(s * np.float32(4), t, np.float32(0.22), pixel, 1)
        return value, value, value
    if kind >= KERB:
        return kerbside(kind, x, y, s, nz, pixel)
    if kind != NONE:
        value = (
            _ONE
            + np.float32(0.16) * faded(s, t, np.float32(0.06), pixel, 1)
            + np.float32(0.12) * faded(s, t, np.float32(1.1), pixel, 2)
        )
        return value, value, value
    return _ONE, _ONE, _ONE
