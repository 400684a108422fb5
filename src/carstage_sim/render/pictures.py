"""Clients' pictures on surfaces: where a place lies in a picture, and its colour there.

A picture is spread over the faces of a box. Each place takes that face to which its normal points
most; on a thin box (a board, a sign) it takes the large faces, so that its rim shows no squeezed
picture. From outside a picture is never mirrored. On the sides its top is at the box's top; on top
it is where the box's x axis points.

Pictures are stored with halves of themselves (Williams, "Pyramidal Parametrics", SIGGRAPH 1983),
and read between two of them by the size of a pixel on the surface, so that far ones do not flicker.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device
from carstage_sim.world.pictures import PlacedPicture, halved

_ZERO: Any = np.float32(0)
_ONE: Any = np.float32(1)
_HALF: Any = np.float32(0.5)
_TWO: Any = np.float32(2)
_THIN = 0.5
"""A box whose least side is below this share of its second is a board."""
_ROW = 20
_THIN_AT, _FIRST_AT = 15, 16


class PictureTables(NamedTuple):
    """All pictures of a frame.

    Attributes:
        pictures: ``(N, 20)`` float32, at least one row: centre of the box, its three axes one
            after the other, half sizes, axis of its least side if it is a board and else -1, first
            texel, width, height, levels.
        texels: ``(K, 3)`` float32 linear colours, at least one: level after level, row by row.
    """

    pictures: NDArray[np.float32]
    texels: NDArray[np.float32]


def picture_tables(placed: Sequence[PlacedPicture]) -> PictureTables:
    """Pictures and their halves one after the other; a picture's row is its place."""
    rows = np.zeros((max(len(placed), 1), _ROW), np.float32)
    texels: list[NDArray[np.float32]] = []
    first = 0
    for row, one in zip(rows, placed, strict=False):
        height, width = one.texels.shape[:2]
        levels = [one.texels]
        while max(levels[-1].shape[:2]) > 1:
            levels.append(halved(levels[-1]))
        order = np.argsort(one.extent, kind="stable")
        thin = one.extent[order[0]] < _THIN * one.extent[order[1]]
        row[:3], row[3:12], row[12:15] = one.center, one.axes.T.reshape(9), one.extent
        row[_THIN_AT] = order[0] if thin else -1
        row[_FIRST_AT:] = first, width, height, len(levels)
        texels += [level.reshape(-1, 3) for level in levels]
        first += sum(level.size // 3 for level in levels)
    held = np.concatenate(texels) if texels else np.zeros((1, 3), np.float32)
    return PictureTables(rows, np.ascontiguousarray(held, np.float32))


@device
def _read(texels, first, width, height, s, t):  # type: ignore[no-untyped-def]
    """Colour of one level at a place, 0-1 from left and from below, between four texels."""
    x = min(max(s * np.float32(width) - _HALF, _ZERO), np.float32(width - 1))
    y = min(max(t * np.float32(height) - _HALF, _ZERO), np.float32(height - 1))
    left, low = int(x), int(y)
    right, high = min(left + 1, width - 1), min(low + 1, height - 1)
    fx, fy = x - np.float32(left), y - np.float32(low)
    a, b = first + low * width + left, first + low * width + right
    c, d = first + high * width + left, first + high * width + right
    wa, wb = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy)
    wc, wd = (_ONE - fx) * fy, fx * fy
    return (
        texels[a, 0] * wa + texels[b, 0] * wb + texels[c, 0] * wc + texels[d, 0] * wd,
        texels[a, 1] * wa + texels[b, 1] * wb + texels[c, 1] * wc + texels[d, 1] * wd,
        texels[a, 2] * wa + texels[b, 2] * wb + texels[c, 2] * wc + texels[d, 2] * wd,
    )


@device
def _face(row, number, p, n):  # type: ignore[no-untyped-def]
    """Place in a picture, 0-1 from left and from below, and the sizes of the face, metres."""
    x, y, z = p[0] - row[number, 0], p[1] - row[number, 1], p[2] - row[number, 2]
    qx = x * row[number, 3] + y * row[number, 4] + z * row[number, 5]
    qy = x * row[number, 6] + y * row[number, 7] + z * row[number, 8]
    qz = x * row[number, 9] + y * row[number, 10] + z * row[number, 11]
    mx = n[0] * row[number, 3] + n[1] * row[number, 4] + n[2] * row[number, 5]
    my = n[0] * row[number, 6] + n[1] * row[number, 7] + n[2] * row[number, 8]
    mz = n[0] * row[number, 9] + n[1] * row[number, 10] + n[2] * row[number, 11]
    axis = int(row[number, 15])
    if axis < 0:
        axis = 2
        if abs(mx) >= abs(my) and abs(mx) >= abs(mz):
            axis = 0
        elif abs(my) >= abs(mz):
            axis = 1
    hx, hy, hz = row[number, 12], row[number, 13], row[number, 14]
    if axis == 0:
        across, up, wide, tall = (-qy if mx > _ZERO else qy), qz, hy, hz
    elif axis == 1:
        across, up, wide, tall = (qx if my > _ZERO else -qx), qz, hx, hz
    else:
        across, up, wide, tall = (qy if mz > _ZERO else -qy), qx, hy, hx
    wide, tall = max(wide, np.float32(1e-3)), max(tall, np.float32(1e-3))
    return (across / wide + _ONE) * _HALF, (up / tall + _ONE) * _HALF, wide * _TWO, tall * _TWO


@device
def picture_colour(pictures, texels, number, p, n, pixel):  # type: ignore[no-untyped-def]
    """Linear colour of a picture at a place of the surface that it is on.

    Args:
        pictures, texels: of :class:`PictureTables`.
        number: row of the picture.
        p, n: place and unit normal, in the frame of the picture's box.
        pixel: a pixel's side on the surface, metres.
    """
    s, t, wide, tall = _face(pictures, number, p, n)
    first, levels = int(pictures[number, 16]), int(pictures[number, 19])
    width, height = int(pictures[number, 17]), int(pictures[number, 18])
    covered = pixel * max(np.float32(width) / wide, np.float32(height) / tall)
    thin = int(pictures[number, 15])
    if thin >= 0:
        # Rims are narrow and seen at a slant: their pixels would take in all of the picture.
        k = 3 + 3 * thin
        facing = (
            n[0] * pictures[number, k] + n[1] * pictures[number, k + 1]
            + n[2] * pictures[number, k + 2]
        )  # fmt: skip
        covered = covered if abs(facing) > _HALF else _ZERO
    for _level in range(levels - 1):
        if covered >= _TWO:
            first += width * height
            width, height = (width + 1) // 2, (height + 1) // 2
            covered *= _HALF
    r, g, b = _read(texels, first, width, height, s, t)
    share = min(max(covered - _ONE, _ZERO), _ONE)
    if share > _ZERO and width * height > 1:
        after = first + width * height
        fr, fg, fb = _read(texels, after, (width + 1) // 2, (height + 1) // 2, s, t)
        r, g, b = r + (fr - r) * share, g + (fg - g) * share, b + (fb - b) * share
    return r, g, b


@device
def picture_colour_of_actor(q, at, pictures, texels, hit, p, n, pixel):  # type: ignore[no-untyped-def]
    """As :func:`picture_colour`, of an instance's picture; ``p`` and ``n`` are in the world.

    ``q, at``: rotations and positions of the instances. ``hit``: instance row, and the picture's.
    """
    hit_actor, number = hit
    x, y, z = p[0] - at[hit_actor, 0], p[1] - at[hit_actor, 1], p[2] - at[hit_actor, 2]
    place = (
        x * q[hit_actor, 0, 0] + y * q[hit_actor, 1, 0] + z * q[hit_actor, 2, 0],
        x * q[hit_actor, 0, 1] + y * q[hit_actor, 1, 1] + z * q[hit_actor, 2, 1],
        x * q[hit_actor, 0, 2] + y * q[hit_actor, 1, 2] + z * q[hit_actor, 2, 2],
    )
    normal = (
        n[0] * q[hit_actor, 0, 0] + n[1] * q[hit_actor, 1, 0] + n[2] * q[hit_actor, 2, 0],
        n[0] * q[hit_actor, 0, 1] + n[1] * q[hit_actor, 1, 1] + n[2] * q[hit_actor, 2, 1],
        n[0] * q[hit_actor, 0, 2] + n[1] * q[hit_actor, 1, 2] + n[2] * q[hit_actor, 2, 2],
    )
    return picture_colour(pictures, texels, number, place, normal, pixel)
