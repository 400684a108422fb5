"""The loops that re-project pictures, compiled.

Each takes stacked source pictures, and for each pixel of the result which of them shows it and
where: ``face`` ``(H, W)`` uint8, :data:`NOTHING` where the lens shows nothing, and ``place``
``(H, W, 2)`` float64 pixel coordinates.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.kernels import compiled

NOTHING: Final = 255
FAR_CODE: Final = 2**24 - 1
FAR_FROM: Final = 0.9999
"""Share of the largest depth from which on nothing was hit."""
_MOST_SLOPE: Final = 0.5
"""Share of one over its depth by which that may grow to the next pixel: more is an edge."""
_MOST_TURN: Final = 2.0
"""Times the slope behind a neighbour that a slope may be: more is an edge between surfaces."""


@compiled
def sample_colours(
    sources: NDArray[np.uint8],
    face: NDArray[np.uint8],
    place: NDArray[np.float64],
    out: NDArray[np.uint8],
) -> None:
    """Bilinear colours; ``sources`` ``(F, h, w, 4)``, ``out`` ``(H, W, 4)``, zero at first."""
    rows, columns = sources.shape[1], sources.shape[2]
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            which = face[j, i]
            if which == NOTHING:
                continue
            x = min(max(place[j, i, 0] - 0.5, 0.0), columns - 1.0)
            y = min(max(place[j, i, 1] - 0.5, 0.0), rows - 1.0)
            left, top = min(int(x), columns - 2), min(int(y), rows - 2)
            a, b = x - left, y - top
            for c in range(4):
                upper = (1.0 - a) * sources[which, top, left, c]
                upper += a * sources[which, top, left + 1, c]
                lower = (1.0 - a) * sources[which, top + 1, left, c]
                lower += a * sources[which, top + 1, left + 1, c]
                out[j, i, c] = int((1.0 - b) * upper + b * lower + 0.5)


@compiled
def pick_nearest(
    sources: NDArray[np.uint8],
    face: NDArray[np.uint8],
    place: NDArray[np.float64],
    out: NDArray[np.uint8],
) -> None:
    """Bytes of the nearest source pixel; ``(F, h, w, n)`` and ``(H, W, n)``, filled at first."""
    rows, columns = sources.shape[1], sources.shape[2]
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            which = face[j, i]
            if which == NOTHING:
                continue
            x = min(max(int(place[j, i, 0]), 0), columns - 1)
            y = min(max(int(place[j, i, 1]), 0), rows - 1)
            for c in range(out.shape[2]):
                out[j, i, c] = sources[which, y, x, c]


@compiled
def sample_depths(
    sources: NDArray[np.uint8],
    face: NDArray[np.uint8],
    place: NDArray[np.float64],
    factor: NDArray[np.float64],
    out: NDArray[np.uint8],
) -> None:
    """Depth codes from z-depths of the sources; the surface of the nearest pixel, never a mixture.

    One over the depth of a plane is linear in a pinhole's picture. So from the nearest pixel it is
    followed along the smaller of the slopes to its two neighbours, and not at all where they
    disagree in sign: at an edge that is the object's own slope. Nor where that slope does not go on
    behind the neighbour, or is steeper than surfaces are: what is one pixel wide has edges on both
    sides. ``factor`` ``(H, W)``
    makes a source's z-depth the depth of the result.
    """
    rows, columns = sources.shape[1], sources.shape[2]
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            which = face[j, i]
            if which == NOTHING:
                continue
            x = min(max(int(place[j, i, 0]), 0), columns - 1)
            y = min(max(int(place[j, i, 1]), 0), rows - 1)
            here = depth_code(sources, which, y, x)
            code = FAR_CODE
            if here < FAR_FROM * FAR_CODE:
                inverse = 1.0 / max(here, 1.0)
                inverse += _slope(sources, which, y, x, 0, 1) * (place[j, i, 0] - x - 0.5)
                inverse += _slope(sources, which, y, x, 1, 0) * (place[j, i, 1] - y - 0.5)
                code = int(min(factor[j, i] / inverse + 0.5, float(FAR_CODE)))
            out[j, i, 0] = code >> 16
            out[j, i, 1] = (code >> 8) & 255
            out[j, i, 2] = code & 255
            out[j, i, 3] = 255


@compiled
def depth_code(sources: NDArray[np.uint8], which: int, row: int, column: int) -> float:
    """CARLA's depth code of a pixel, ``R + 256 G + 65536 B`` of bytes B, G, R, A."""
    blue, green = sources[which, row, column, 0], sources[which, row, column, 1]
    red = sources[which, row, column, 2]
    return 65536.0 * float(blue) + 256.0 * float(green) + float(red)


@compiled
def _inverse(sources: NDArray[np.uint8], which: int, row: int, column: int) -> float:
    """One over a pixel's depth code."""
    code = float(depth_code(sources, which, row, column))
    return 1.0 / max(code, 1.0)


@compiled
def _slope(
    sources: NDArray[np.uint8], which: int, row: int, column: int, down: int, right: int
) -> float:
    """By how much one over the depth grows to the next pixel on a pixel's own surface."""
    last_row, last_column = sources.shape[1] - 1, sources.shape[2] - 1
    if not (down <= row <= last_row - down and right <= column <= last_column - right):
        return 0.0
    middle = _inverse(sources, which, row, column)
    before = middle - _inverse(sources, which, row - down, column - right)
    after = _inverse(sources, which, row + down, column + right) - middle
    if before * after <= 0.0:
        return 0.0
    step = -1 if abs(before) < abs(after) else 1
    slope: float = before if step < 0 else after
    if abs(slope) > _MOST_SLOPE * middle:
        return 0.0
    y, x = row + 2 * step * down, column + 2 * step * right
    if 0 <= y <= last_row and 0 <= x <= last_column:
        beside = _inverse(sources, which, row + step * down, column + step * right)
        if abs(slope) > _MOST_TURN * abs(_inverse(sources, which, y, x) - beside):
            return 0.0
    return slope
