"""Where what a camera sees was in its picture before."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.cast import NOTHING
from carstage_sim.render.crew import do

RIGID = -1
"""In place of a number: the surface moved as its part did."""
LARGEST: Any = np.float32(2.0)
"""Of a motion, in half widths or heights."""
_BEHIND = 1e-9
"""Stands for the depth of what was behind the camera: its motion ends at the largest value."""


class Motions(NamedTuple):
    """How everything moved since a camera's last picture.

    A point ``p`` of part ``k``, in today's camera axes (forward, right, up), was at
    ``turn[k] @ p + shift[k]`` in those of before. Part 0 is the town.

    Attributes:
        turn: ``(K, 3, 3)`` float64.
        shift: ``(K, 3)`` float64 metres.
        part: ``(I,)`` int32 the part that each instance row belongs to.
        first: ``(I,)`` int32 number of each row's first triangle.
        bent: ``(I,)`` int32 the row's first place in ``bend``, or :data:`RIGID`.
        bend: ``(D, 3, 3)`` float32 for each corner of each triangle of a figure that changed its
            pose: what is added to where it was, in the camera axes of before (m).
    """

    turn: NDArray[np.float64]
    shift: NDArray[np.float64]
    part: NDArray[np.int32]
    first: NDArray[np.int32]
    bent: NDArray[np.int32]
    bend: NDArray[np.float32]


def no_motion(instances: int) -> Motions:
    """That nothing has moved, neither the camera."""
    none = np.zeros(instances, np.int32)
    bend = np.empty((0, 3, 3), np.float32)
    return Motions(np.eye(3)[None], np.zeros((1, 3)), none, none, none + np.int32(RIGID), bend)


@device
def _earlier(  # type: ignore[no-untyped-def]
    moved, row, triangle, weights, depth, x, y, half_width, half_height, i
):
    """Where a pinhole camera saw a pixel's surface point before."""
    turn, shift = moved.turn, moved.shift
    k = moved.part[row[i]] if row[i] >= 0 else 0
    near = 0.0 if row[i] == NOTHING else 1.0 / depth[i]
    a, b = x[i] * half_width, y[i] * -half_height
    ahead = turn[k, 0, 0] + turn[k, 0, 1] * a + turn[k, 0, 2] * b + shift[k, 0] * near
    right = turn[k, 1, 0] + turn[k, 1, 1] * a + turn[k, 1, 2] * b + shift[k, 1] * near
    up = turn[k, 2, 0] + turn[k, 2, 1] * a + turn[k, 2, 2] * b + shift[k, 2] * near
    bent = moved.bent[row[i]] if row[i] >= 0 else RIGID
    if bent != RIGID:
        corners = moved.bend[bent + triangle[i] - moved.first[row[i]]]
        u, v = weights[i, 0], weights[i, 1]
        w = 1.0 - u - v
        ahead += (corners[0, 0] * u + corners[1, 0] * v + corners[2, 0] * w) * near
        right += (corners[0, 1] * u + corners[1, 1] * v + corners[2, 1] * w) * near
        up += (corners[0, 2] * u + corners[1, 2] * v + corners[2, 2] * w) * near
    scale = 1.0 / max(ahead, _BEHIND)
    return right * scale / half_width, up * scale / -half_height


@device
def _flow_part(  # type: ignore[no-untyped-def]
    moved, row, triangle, weights, depth, x, y, half_width, half_height, before, flow,
    worker, first, last,
):  # fmt: skip
    for i in range(first, last):
        x_before, y_before = _earlier(
            moved, row, triangle, weights, depth, x, y, half_width, half_height, i
        )
        if before.shape[1]:
            before[0, i], before[1, i] = x_before, y_before
        else:
            flow[i, 0] = min(max(np.float32(x[i] - x_before), -LARGEST), LARGEST)
            flow[i, 1] = min(max(np.float32(y_before - y[i]), -LARGEST), LARGEST)


@kernel
def flow_of_motions(data, board, job, work):  # type: ignore[no-untyped-def]
    """Motions of pixels, or where a pinhole camera saw their surface points before.

    The data are :class:`Motions`; the hits' rows, triangles, weights and depths; x and y of the
    pixels' rays to the right and down from the middle, in half widths and heights; half width and
    half height of the picture one metre ahead; ``(2, N)`` float64 that receives x and y of before,
    or ``(2, 0)``; and ``(N, 2)`` float32 that receives the motions otherwise.
    """
    do(_flow_part, data, board, job, work)
