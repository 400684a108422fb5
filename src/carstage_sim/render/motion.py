"""Where what a camera sees was in its picture before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import Hits

_BEHIND = 1e-9
"""Stands for the depth of what was behind the camera: its motion ends at the largest value."""


@kernel
def _earlier(turn, shift, part, row, depth, x, y, half_width, half_height, out):  # type: ignore[no-untyped-def]
    for i in range(row.shape[0]):
        k = part[row[i]] if row[i] >= 0 else 0
        near = 0.0 if row[i] == NOTHING else 1.0 / depth[i]
        a, b = x[i] * half_width, y[i] * -half_height
        ahead = turn[k, 0, 0] + turn[k, 0, 1] * a + turn[k, 0, 2] * b + shift[k, 0] * near
        scale = 1.0 / max(ahead, _BEHIND)
        right = turn[k, 1, 0] + turn[k, 1, 1] * a + turn[k, 1, 2] * b + shift[k, 1] * near
        up = turn[k, 2, 0] + turn[k, 2, 1] * a + turn[k, 2, 2] * b + shift[k, 2] * near
        out[0, i] = right * scale / half_width
        out[1, i] = up * scale / -half_height


def earlier_places(
    turn: NDArray[np.float64],
    shift: NDArray[np.float64],
    part: NDArray[np.int32],
    hits: Hits,
    places: tuple[NDArray[np.float64], NDArray[np.float64]],
    half_size: tuple[float, float],
) -> NDArray[np.float64]:
    """``(2, N)`` places at which a pinhole camera saw each pixel's surface point before.

    Places are x to the right and y down from the picture's middle, in half widths and heights.

    Args:
        turn, shift: ``(K, 3, 3)`` and ``(K, 3)``: a point ``p`` of part ``k`` in today's camera
            axes (forward, right, up) was at ``turn[k] @ p + shift[k]`` in those of before. Part 0
            is the town.
        part: ``(I,)`` the part that each instance row belongs to.
        hits: of the camera's pixels; their parameter is the depth.
        places: ``(N,)`` x and y of the pixels' rays.
        half_size: half width and half height of the picture one metre ahead.
    """
    out = np.empty((2, len(hits.row)))
    _earlier(turn, shift, part, hits.row, hits.t, *places, *half_size, out)
    return out
