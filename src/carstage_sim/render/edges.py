"""Which pixels one ray does not do justice to: edges of objects, of sides, and of contrast."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.caster import Hits
from carstage_sim.render.scene import Frame

_BENT = np.float32(0.9)
"""Cosine between the normals of two neighbours below which they show different sides."""


@device
def _apart(codes, y, x, v, u):  # type: ignore[no-untyped-def]
    """Largest difference of two pixels' codes."""
    most = np.int32(0)
    for channel in range(3):
        # As signed numbers: the compiler takes the difference of unsigned ones for unsigned.
        one, other = np.int32(codes[y, x, channel]), np.int32(codes[v, u, channel])
        most = np.maximum(most, abs(one - other))
    return most


@device
def _unlike(static, actors, row, triangle, i, j):  # type: ignore[no-untyped-def]
    """Whether two hits are on different objects, materials or sides."""
    if row[i] != row[j]:
        return True
    if triangle[i] == triangle[j]:
        return False
    surfaces = static if row[i] < 0 else actors
    a, b = triangle[i], triangle[j]
    if surfaces.object_id[a] != surfaces.object_id[b]:
        return True
    if surfaces.material[a] != surfaces.material[b]:
        return True
    f = surfaces.flat
    return f[a, 0] * f[b, 0] + f[a, 1] * f[b, 1] + f[a, 2] * f[b, 2] < _BENT


@kernel
def _mark(static, actors, row, triangle, codes, strong, weak, marked):  # type: ignore[no-untyped-def]
    height, width = codes.shape[0], codes.shape[1]
    for y in range(height):
        for x in range(width):
            i = y * width + x
            for below in range(2):
                v, u = y + below, x + 1 - below
                if v >= height or u >= width:
                    continue
                apart = _apart(codes, y, x, v, u)
                if apart > strong or (
                    apart > weak and _unlike(static, actors, row, triangle, i, v * width + u)
                ):
                    marked[i] = True
                    marked[v * width + u] = True


def rough_pixels(
    frame: Frame, hits: Hits, codes: NDArray[np.uint8], *, strong: int, weak: int
) -> NDArray[np.intp]:
    """Pixels to sample again, ascending.

    Args:
        frame: what was seen.
        hits: of the pixel centres, row by row.
        codes: ``(H, W, 3)`` uint8 of the pixel centres.
        strong: difference to a neighbour, in codes, above which both pixels count.
        weak: the same for neighbours on different objects, materials or sides.
    """
    marked = np.zeros(len(hits.row), np.bool_)
    _mark(frame.static, frame.actors, hits.row, hits.triangle, codes, strong, weak, marked)
    return np.flatnonzero(marked)
