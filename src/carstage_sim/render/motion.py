"""Where what a camera sees was in its picture before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.jit import kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.caster import Hits

_BEHIND = 1e-9
"""Stands for the depth of what was behind the camera: its motion ends at the largest value."""


@kernel
def _earlier(turn, shift, part, row, depth, right, up, out):  # type: ignore[no-untyped-def]
    for i in range(row.shape[0]):
        k = part[row[i]] if row[i] >= 0 else 0
        near = 0.0 if row[i] == NOTHING else 1.0 / depth[i]
        a, b = right[i], up[i]
        ahead = turn[k, 0, 0] + turn[k, 0, 1] * a + turn[k, 0, 2] * b + shift[k, 0] * near
        ahead = max(ahead, _BEHIND)
        for axis in range(2):
            out[axis, i] = (
                turn[k, axis + 1, 0]
                + turn[k, axis + 1, 1] * a
                + turn[k, axis + 1, 2] * b
                + shift[k, axis + 1] * near
            ) / ahead


def earlier_slopes(
    turn: NDArray[np.float64],
    shift: NDArray[np.float64],
    part: NDArray[np.int32],
    hits: Hits,
    right: NDArray[np.float64],
    up: NDArray[np.float64],
) -> NDArray[np.float64]:
    """``(2, N)`` right and up slopes under which each pixel's surface point was seen before.

    Args:
        turn, shift: ``(K, 3, 3)`` and ``(K, 3)``: a point ``p`` of part ``k`` in today's camera
            axes (forward, right, up) was at ``turn[k] @ p + shift[k]`` in those of before. Part 0
            is the town.
        part: ``(I,)`` the part that each instance row belongs to.
        hits: of the camera's pixels; their parameter is the depth.
        right, up: ``(N,)`` slopes of the pixels' rays.
    """
    out = np.empty((2, len(hits.row)))
    _earlier(turn, shift, part, hits.row, hits.t, right, up, out)
    return out
