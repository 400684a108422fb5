"""Panes of buildings: windows, shop windows and doors, with what is seen behind the glass.

A room is not there as triangles. The ray goes on from its place on the pane into a box behind it
(van Dongen 2008, interior mapping), and meets a wall, the ceiling or the floor, shelves, a display,
curtains. What a room holds follows from the pane's number. Places on a pane are metres from its
lower left corner, seen along the wall; depths are metres behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from carstage_sim.kernels import device, inlined
from carstage_sim.render.detail import DOOR, FAR_M, SHOP, hash_unit

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_DECIMETRE: Any = np.float32(0.1)
_SIZES, _WIDTH_BIT, _HEIGHT_BIT = 127, 4, 512
"""A pane's number of a half is ``half + 4 * width + 512 * height``, sizes in decimetres."""
PLINTH_DM = 6
"""Height of plinths of buildings, decimetres."""
_STRIP_M: Any = np.float32(4.0)
_BELOW_WINDOW_M: Any = np.float32(1.3)
"""Strips of wall wider than the first or lower than the second lie below windows or a roof."""
_STEEPEST: Any = np.float32(0.04)
"""Least part of a direction across the pane with which a ray enters a room."""
_COARSE_M: Any = np.float32(0.35)
"""Pixels from which a room has one colour."""
_DOOR_M: Any = np.float32(1.7)
"""Shop windows narrower than this are doors."""
_DAYLIGHT: Any = np.float32(0.2)
"""Share of the light outside that comes to the inside of a window."""
_FASHION: Any = np.float32(0.3)
_CAFE: Any = np.float32(0.55)
"""Kinds of shops: clothes below the first number, cafes below the second, else shelves."""
_DRAWN: Any = np.float32(0.17)
"""Share of a room's lamps that comes through curtains, which the daylight reaches first."""
_SHELF_M: Any = np.float32(0.42)
_GOODS_M: Any = np.float32(0.24)
_DISPLAY_M: Any = np.float32(0.5)
_FIGURE_M: Any = np.float32(0.92)
"""From one figure of a display to the next."""


@inlined
def half_of(packed):  # type: ignore[no-untyped-def]
    """Which half of a pane's rectangle a triangle is: 1 or 2, 0 for none."""
    return packed & 3


@inlined
def size_of(packed):  # type: ignore[no-untyped-def]
    """Width and height of a pane, metres."""
    wide, high = (packed // _WIDTH_BIT) & _SIZES, (packed // _HEIGHT_BIT) & _SIZES
    return np.float32(wide) * _DECIMETRE, np.float32(high) * _DECIMETRE


@inlined
def wall_edges(packed, u, v):  # type: ignore[no-untyped-def]
    """Metres below the upper edge of a strip of wall, from which rain drips, and above its foot.

    A strip from wall to wall ends at sills or at the roof, one below a window at the sill. A plinth
    stands on the ground and is as high as nothing else.

    Args:
        packed: size and half of its rectangle, 0 for a wall of which nothing is known.
        u, v: weights of the triangle's first and second corner.
    """
    if packed == 0:
        return FAR_M, FAR_M
    wide, high = size_of(packed)
    up = _ONE - u if half_of(packed) == 2 else _ONE - u - v
    if (packed // _HEIGHT_BIT) == PLINTH_DM:
        return FAR_M, up * high
    if wide > _STRIP_M or high < _BELOW_WINDOW_M:
        return (_ONE - up) * high, FAR_M
    return FAR_M, FAR_M


@inlined
def _bar(off, half, pixel):  # type: ignore[no-untyped-def]
    """Share of a pixel that a bar covers whose middle is ``off`` metres away."""
    soft = max(pixel, np.float32(0.004))
    return min(max((half - abs(off)) / soft + _HALF, _ZERO), _ONE) * min((half + half) / soft, _ONE)


@inlined
def _rim(x, y, wide, high, width, pixel):  # type: ignore[no-untyped-def]
    """Share of a pixel that a frame covers, ``width`` metres of it around a pane."""
    edge = min(min(x, wide - x), min(y, high - y))
    soft = max(pixel, np.float32(0.004))
    return min(max((width - edge) / soft + _HALF, _ZERO), _ONE)


@device
def _goods(along, up, number, pixel):  # type: ignore[no-untyped-def]
    """Colour of a wall of shelves with goods; ``up`` is above the floor."""
    row, column = np.floor(up / _SHELF_M), np.floor(along / _GOODS_M)
    i, j = int(column), int(row)
    v, u = up / _SHELF_M - row, along / _GOODS_M - column
    chance = hash_unit(i + number * 7, j, 211)
    # A shop has two colours of its own, and what is black, brown or white.
    kept = hash_unit(i // 2 + number * 7, j, 212)
    value = np.float32(0.05) + np.float32(0.55) * chance
    r, g, b = value, value * np.float32(0.92), value * np.float32(0.8)
    if kept < _HALF:
        which = 0 if kept < np.float32(0.28) else 3
        r = value * (np.float32(0.25) + hash_unit(number, which, 213))
        g = value * (np.float32(0.2) + hash_unit(number, which + 1, 214))
        b = value * (np.float32(0.15) + hash_unit(number, which + 2, 215))
    high = np.float32(0.45) + np.float32(0.45) * hash_unit(i // 3 + number, j, 216)
    if v > high or u < np.float32(0.07):
        r, g, b = np.float32(0.06), np.float32(0.052), np.float32(0.045)
    if v < np.float32(0.08):
        r, g, b = np.float32(0.42), np.float32(0.36), np.float32(0.29)
    near = max(_ONE - pixel / np.float32(0.16), _ZERO)
    m = np.float32(0.2)
    return m + (r - m) * near, m + (g - m) * near, m + (b - m) * near


@device
def _hall(along, above, depth, kind, number, pixel):  # type: ignore[no-untyped-def]
    """Colour of a wall of a shop, ``above`` its floor: bare, with a bar, or with shelves."""
    tone = hash_unit(number, 19, 202)
    warm = np.float32(0.4) + np.float32(0.25) * tone
    r, g, b = warm, warm * np.float32(0.9), warm * (np.float32(0.6) + np.float32(0.3) * tone)
    if kind > _CAFE:
        if above < np.float32(2.12):
            return _goods(along, above, number, pixel)
    elif kind > _FASHION:
        # A bar before a dark wall with bottles.
        if above < np.float32(1.1):
            r, g, b = np.float32(0.2), np.float32(0.12), np.float32(0.07)
            if above > np.float32(1.04):
                r, g, b = _HALF, np.float32(0.45), np.float32(0.38)
        elif above > np.float32(1.35) and above < np.float32(2.2):
            return _goods(along * np.float32(2), above, number, pixel * np.float32(2))
        else:
            r, g, b = r * np.float32(0.5), g * np.float32(0.42), b * np.float32(0.36)
    else:
        # Clothes on a rail, and mirrors.
        place = along / np.float32(0.09)
        i = int(np.floor(place))
        if (
            above > np.float32(0.55)
            and above < np.float32(1.5)
            and hash_unit(i // 16, number, 217) < np.float32(0.7)
        ):
            coat = hash_unit(i // 2, number, 218)
            fold = np.float32(0.05) + np.float32(0.45) * coat
            r = fold * (np.float32(0.4) + hash_unit(i // 5, number, 219))
            g, b = fold * (np.float32(0.4) + _HALF * tone), fold * (_ONE - _HALF * tone)
        elif (
            above > np.float32(1.75)
            and above < np.float32(2.3)
            and hash_unit(i // 11, number, 220) < _HALF
        ):
            r, g, b = r * np.float32(0.3), g * np.float32(0.3), b * np.float32(0.32)
    if above > np.float32(2.3) and above < np.float32(2.6):
        r, g, b = _HALF * tone, np.float32(0.1), _HALF - _HALF * tone
    return r, g, b


@device
def _box_room(x, y, sides, view, deep):  # type: ignore[no-untyped-def]
    """Where a ray meets the box behind a pane.

    Args:
        x, y: where it enters.
        sides: least and largest x, floor and ceiling of the box.
        view: the ray's direction along the pane, up, and into the room.
        deep: depth of the box.

    Returns:
        ``(side, x, y, depth)``: side 0 is the back, 1 a wall, 2 the floor, 3 the ceiling.
    """
    slope_x, slope_y = view[0] / view[2], view[1] / view[2]
    beside = sides[1] - x if slope_x > 0 else x - sides[0]
    above = sides[3] - y if slope_y > 0 else y - sides[2]
    to_side = beside / max(abs(slope_x), np.float32(1e-4))
    to_level = above / max(abs(slope_y), np.float32(1e-4))
    depth = min(min(to_side, to_level), deep)
    side = 0
    if depth < deep:
        side = 1
        if to_level < to_side:
            side = 3 if slope_y > 0 else 2
    return side, x + slope_x * depth, y + slope_y * depth, depth


@device
def _in_display(x, y, number, kind, pixel):  # type: ignore[no-untyped-def]
    """What stands right behind a shop window: ``(whether, red, green, blue)``.

    ``y`` is above the display's floor.
    """
    dark = np.float32(0.1)
    if y < np.float32(0.1):
        return True, np.float32(0.5), np.float32(0.46), np.float32(0.4)
    if kind < _FASHION:
        cell = np.floor(x / _FIGURE_M)
        i = int(cell)
        chance = hash_unit(i, number, 221)
        u = x - (cell + _HALF + np.float32(0.2) * (chance - _HALF)) * _FIGURE_M
        v, side = y - dark, abs(u)
        coat, skirt = hash_unit(i, number, 222), hash_unit(i, number, 223)
        if chance < np.float32(0.16):
            return False, _ZERO, _ZERO, _ZERO
        if u * u + (v - np.float32(1.58)) * (v - np.float32(1.58)) < np.float32(0.0125):
            return True, np.float32(0.62), np.float32(0.58), np.float32(0.54)
        wide = np.float32(0.13) + np.float32(0.1) * max(v - np.float32(0.9), _ZERO)
        if skirt > _HALF:
            wide += np.float32(0.1) * max(np.float32(0.9) - v, _ZERO)
        torso = v > np.float32(0.82) and v < np.float32(1.44) and side < wide
        arms = (
            v > np.float32(0.8)
            and v < np.float32(1.4)
            and abs(side - np.float32(0.24)) < dark * _HALF
        )
        if torso or arms:
            return (
                True,
                np.float32(0.08) + np.float32(0.6) * coat,
                np.float32(0.1) + np.float32(0.4) * chance,
                np.float32(0.12) + np.float32(0.5) * skirt,
            )
        if v < np.float32(0.82) and side < wide and (skirt > _HALF or side > np.float32(0.02)):
            if (
                v < np.float32(0.45)
                and skirt > _HALF
                and abs(side - np.float32(0.07)) > np.float32(0.05)
            ):
                return False, _ZERO, _ZERO, _ZERO
            return (
                True,
                np.float32(0.06) + np.float32(0.3) * skirt,
                np.float32(0.07) + np.float32(0.2) * coat,
                np.float32(0.1) + np.float32(0.3) * chance,
            )
        return False, _ZERO, _ZERO, _ZERO
    if kind < _CAFE:
        # Tables, the backs of chairs, a lamp that hangs above.
        cell = np.floor(x / np.float32(1.5))
        u = abs(x - (cell + _HALF) * np.float32(1.5))
        wood = np.float32(0.08) + np.float32(0.14) * hash_unit(int(cell), number, 227)
        top = abs(y - np.float32(0.68)) < np.float32(0.025) and u < np.float32(0.36)
        foot = y < np.float32(0.68) and u < np.float32(0.03)
        chair = y < np.float32(0.84) and abs(u - np.float32(0.52)) < np.float32(0.13)
        if top or foot or (chair and (y > np.float32(0.5) or y < np.float32(0.36))):
            return True, wood * np.float32(1.5), wood, wood * np.float32(0.6)
        lamp = (y - np.float32(1.72)) * (y - np.float32(1.72)) + u * u * _HALF
        if lamp < np.float32(0.014):
            return True, np.float32(2.4), np.float32(1.9), np.float32(1.3)
        return False, _ZERO, _ZERO, _ZERO
    # Goods in heaps and rows, higher here and lower there.
    size = np.float32(0.2) + np.float32(0.24) * kind
    column, row = np.floor(x / size), np.floor(y / (size * np.float32(0.8)))
    i, j = int(column), int(row)
    if row > np.floor(np.float32(3.6) * hash_unit(i // 2, number, 224)):
        return False, _ZERO, _ZERO, _ZERO
    tone, other = hash_unit(i, j + number, 225), hash_unit(i // 2, number, 226)
    edge = min(x / size - column, y / (size * np.float32(0.8)) - row)
    shade = np.float32(0.55) if edge < np.float32(0.1) and pixel < np.float32(0.05) else _ONE
    return (
        True,
        shade * (np.float32(0.05) + np.float32(0.55) * tone),
        shade * (np.float32(0.05) + np.float32(0.45) * other * (_ONE - _HALF * tone)),
        shade * (np.float32(0.04) + np.float32(0.35) * (_ONE - other)),
    )


@device
def _shop(x, y, wide, high, number, pixel, night, view):  # type: ignore[no-untyped-def]
    """Behind a shop's glass: ``(red, green, blue, lamps)``."""
    kind, tone = hash_unit(number, 17, 201), hash_unit(number, 19, 202)
    open_ = (
        np.float32(0.5)
        + night * np.float32(0.3)
        - night
        * np.float32(0.74)
        * (_ONE if hash_unit(number, 23, 203) < np.float32(0.4) else _ZERO)
    )
    floor = np.float32(-0.45) if wide > _DOOR_M else _ZERO
    if wide > _DOOR_M:
        # A poster on the glass, then what is displayed.
        place = wide * (np.float32(0.16) + np.float32(0.6) * tone)
        if (
            hash_unit(number, 29, 204) < np.float32(0.45)
            and abs(x - place) < np.float32(0.34)
            and abs(y - np.float32(1.05)) < np.float32(0.48)
        ):
            band = y > np.float32(1.2) or (
                abs(x - place) < np.float32(0.22) and y < np.float32(0.78)
            )
            red = np.float32(0.75) if band else np.float32(0.12) + np.float32(0.5) * kind
            return (
                red,
                np.float32(0.7) if band else np.float32(0.15) + np.float32(0.4) * tone,
                np.float32(0.64) if band else np.float32(0.5) - np.float32(0.4) * kind,
                open_ * _HALF,
            )
        near_x = x + view[0] / view[2] * _DISPLAY_M
        near_y = y + view[1] / view[2] * _DISPLAY_M
        if near_x > _DECIMETRE and near_x < wide - _DECIMETRE:
            met, r, g, b = _in_display(near_x, near_y - np.float32(0.02), number, kind, pixel)
            if met:
                return r, g, b, open_
    sides = (np.float32(-0.3), wide + np.float32(0.3), floor, high + np.float32(0.25))
    deep = np.float32(3.2) + np.float32(3) * tone
    side, px, py, depth = _box_room(x, y, sides, view, deep)
    dim = _ONE / (_ONE + np.float32(0.16) * depth)
    if side == 3:
        # Panels of lamps in the ceiling.
        fx, fy = np.floor(px / np.float32(1.5)), np.floor(depth / np.float32(1.4))
        u, v = px / np.float32(1.5) - fx, depth / np.float32(1.4) - fy
        if abs(u - _HALF) < np.float32(0.3) and abs(v - _HALF) < np.float32(0.14):
            return _ONE, _ONE, np.float32(0.96), open_ * np.float32(3)
        return np.float32(0.6) * dim, np.float32(0.58) * dim, np.float32(0.55) * dim, open_
    if side == 2:
        wood = np.float32(0.2) + np.float32(0.2) * kind
        return wood * dim, wood * np.float32(0.8) * dim, wood * np.float32(0.62) * dim, open_
    along = px if side == 0 else depth
    r, g, b = _hall(along, py - floor, depth, kind, number + side, pixel)
    return r * dim, g * dim, b * dim, open_


@device
def _home(x, y, wide, high, number, pixel, lit, view):  # type: ignore[no-untyped-def]
    """Behind a window's glass: ``(red, green, blue, lamps)``."""
    drawn, reach = hash_unit(number, 29, 2), hash_unit(number, 31, 4)
    tone, hue = hash_unit(number, 41, 6), hash_unit(number, 43, 8)
    near_x = x + view[0] / view[2] * np.float32(0.1)
    near_y = y + view[1] / view[2] * np.float32(0.1)
    white = np.float32(1.3) + np.float32(0.7) * hue
    if drawn < np.float32(0.42):
        # Curtains leave the middle open, and fall in folds.
        off = abs(near_x - wide * _HALF) / wide
        if off > np.float32(0.17) + np.float32(0.26) * reach:
            fold = near_x * np.float32(9.0)
            fold = abs(fold - np.floor(fold) - _HALF) - np.float32(0.25)
            fold *= max(_ONE - pixel * np.float32(12), _ZERO)
            cloth = white * (_ONE + np.float32(0.6) * fold)
            warm = np.float32(0.95) - np.float32(0.45) * tone * (
                _ONE if tone > np.float32(0.6) else _ZERO
            )
            return (
                cloth,
                cloth * (np.float32(0.72) + np.float32(0.24) * warm),
                cloth * warm,
                lit * _DRAWN,
            )
    elif drawn < np.float32(0.66) and near_y > high * (np.float32(0.15) + np.float32(0.8) * reach):
        slat = near_y * np.float32(20.0)
        slat = (slat - np.floor(slat) - _HALF) * max(_ONE - pixel * np.float32(26), _ZERO)
        cloth = white * (_ONE + np.float32(0.4) * slat)
        return cloth, cloth * np.float32(0.97), cloth * np.float32(0.88), lit * _DRAWN
    sides = (
        np.float32(-0.5) - tone, wide + np.float32(0.4) + hue,
        np.float32(-0.9), high + np.float32(0.3),
    )  # fmt: skip
    deep = np.float32(2.6) + np.float32(2.2) * reach
    side, px, py, depth = _box_room(x, y, sides, view, deep)
    dim = _ONE / (_ONE + np.float32(0.32) * depth)
    if side == 3:
        r, g, b = np.float32(0.74), np.float32(0.72), np.float32(0.68)
    elif side == 2:
        r, g, b = np.float32(0.3), np.float32(0.21), np.float32(0.14)
    else:
        r = np.float32(0.5) + np.float32(0.25) * tone
        g = r * (np.float32(0.82) + np.float32(0.16) * hue)
        b = r * (np.float32(0.62) + np.float32(0.3) * reach)
        along = px if side == 0 else depth
        # A picture, a wardrobe or a door against the wall.
        off = abs(along - np.float32(0.3) - wide * hue)
        if off < np.float32(0.42) and py < np.float32(1.05) and drawn > np.float32(0.7):
            r, g, b = np.float32(0.24), np.float32(0.15), np.float32(0.09)
        elif off < np.float32(0.34) and py > np.float32(0.45) and py < np.float32(0.95):
            r, g, b = (
                np.float32(0.1) + np.float32(0.5) * reach,
                np.float32(0.28),
                np.float32(0.4) * hue,
            )
    # A plant on the sill of one in six.
    if drawn > np.float32(0.84):
        near = wide * (np.float32(0.25) + _HALF * hue)
        off_x, off_y = near_x - near, near_y - np.float32(0.26)
        if off_x * off_x + off_y * off_y * _HALF < np.float32(0.022):
            return np.float32(0.1), np.float32(0.2), np.float32(0.06), lit * _HALF
    return r * dim, g * dim, b * dim, lit


@device
def _door(x, y, wide, high, number, pixel):  # type: ignore[no-untyped-def]
    """A door's leaf: ``(red, green, blue)``, two panels, a light above, a handle."""
    tone = hash_unit(number, 5, 231)
    r = np.float32(0.05) + np.float32(0.2) * tone
    g = np.float32(0.05) + np.float32(0.1) * hash_unit(number, 7, 232)
    b = np.float32(0.04) + np.float32(0.12) * (_ONE - tone)
    frame = _rim(x, y, wide, high, np.float32(0.07), pixel)
    light = high - np.float32(0.5)
    frame = max(frame, _bar(y - light, np.float32(0.035), pixel))
    if y > light:
        r, g, b = np.float32(0.03), np.float32(0.034), np.float32(0.04)
    else:
        u = abs(x - wide * _HALF)
        for k in range(2):
            low = np.float32(0.25) + np.float32(0.9) * np.float32(k)
            inside = min(wide * np.float32(0.33) - u, min(y - low, low + np.float32(0.74) - y))
            groove = _bar(inside, np.float32(0.016), pixel) * np.float32(0.55)
            r, g, b = r * (_ONE - groove), g * (_ONE - groove), b * (_ONE - groove)
        metal = _bar(x - wide * np.float32(0.87), np.float32(0.02), pixel) * _bar(
            y - np.float32(1.03), np.float32(0.13), pixel
        )
        r, g, b = r + (_HALF - r) * metal, g + (_HALF - g) * metal, b + (_HALF - b) * metal
        kick = _bar(y - np.float32(0.1), np.float32(0.1), pixel) * np.float32(0.35)
        r, g, b = r * (_ONE - kick), g * (_ONE - kick), b * (_ONE - kick)
    m = np.float32(0.42) if hash_unit(number, 11, 233) < _HALF else np.float32(0.09)
    return r + (m - r) * frame, g + (m - g) * frame, b + (m - b) * frame


@device
def _bars(kind, x, y, wide, high, number, pixel):  # type: ignore[no-untyped-def]
    """Share of a pixel that frames and bars of a pane cover."""
    if kind != SHOP:
        cover = _rim(x, y, wide, high, np.float32(0.055), pixel)
        style = hash_unit(number, 17, 3)
        if style < np.float32(0.72) and wide > np.float32(0.9):
            cover = max(cover, _bar(x - wide * _HALF, np.float32(0.035), pixel))
        if style > _HALF:
            cover = max(cover, _bar(y - high * np.float32(0.7), np.float32(0.022), pixel))
        return cover
    if wide < _DOOR_M:
        cover = _rim(x, y, wide, high, np.float32(0.085), pixel)
        cover = max(cover, _bar(y - np.float32(2.22), np.float32(0.05), pixel))
        cover = max(cover, _bar(y - np.float32(0.12), np.float32(0.14), pixel))
        handle = _bar(x - wide * np.float32(0.84), np.float32(0.018), pixel)
        return max(cover, handle * _bar(y - np.float32(1.1), np.float32(0.3), pixel))
    cover = _rim(x, y, wide, high, np.float32(0.06), pixel)
    count = max(np.floor(wide * np.float32(0.6)), _ONE)
    place = x * count / wide
    off = (place - np.floor(place + _HALF)) * wide / count
    cover = max(cover, _bar(off, np.float32(0.028), pixel))
    if hash_unit(number, 13, 205) < _HALF:
        cover = max(cover, _bar(y - high + np.float32(0.55), np.float32(0.025), pixel))
    return cover


@device
def pane_colour(kind, s, t, size, number, pixel, night, view):  # type: ignore[no-untyped-def]
    """A pane, with what is behind it.

    Args:
        kind: ``WINDOW``, ``SHOP`` or ``DOOR``.
        s, t: place on it, 0-1 along the wall and up.
        size: width and height, metres.
        number: of the pane.
        pixel: a pixel's side on it, metres.
        night: 0-1.
        view: the ray's unit direction along the wall, up, and into the room.

    Returns:
        ``(opaque, red, green, blue, lit red, lit green, lit blue)``: the share that is no glass, a
        linear colour under the light of the sky, and the light of lamps behind the glass.
    """
    wide, high = size
    x, y = s * wide, t * high
    if kind == DOOR:
        r, g, b = _door(x, y, wide, high, number, pixel)
        return _ONE, r, g, b, _ZERO, _ZERO, _ZERO
    cover = _bars(kind, x, y, wide, high, number, pixel)
    into = (view[0], view[1], max(view[2], _STEEPEST))
    lamps = _ZERO
    if kind == SHOP:
        r, g, b, lamps = _shop(x, y, wide, high, number, pixel, night, into)
    else:
        if night > 0 and hash_unit(number, 3, 7) < np.float32(0.36):
            lamps = (np.float32(0.55) + np.float32(1.1) * hash_unit(number, 9, 1)) * night
        r, g, b, lamps = _home(x, y, wide, high, number, pixel, lamps, into)
    far = min(pixel / _COARSE_M, _ONE)
    r += (np.float32(0.34) - r) * far
    g += (np.float32(0.31) - g) * far
    b += (np.float32(0.28) - b) * far
    shade = np.float32(0.6) if hash_unit(number >> 7, 5, 1) < np.float32(0.6) else np.float32(0.05)
    glass = _ONE - cover
    inside, shine = glass * _DAYLIGHT, glass * lamps
    return (
        cover,
        r * inside + shade * cover,
        g * inside + shade * cover,
        b * inside + shade * np.float32(0.97) * cover,
        r * shine,
        g * shine * np.float32(0.88),
        b * shine * np.float32(0.7),
    )
