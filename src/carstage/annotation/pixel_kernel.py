"""The loop over the pixels of a silhouette, compiled: the only use of numba in the labels.

It does what numpy could do in some thirty passes over the same pixels, in one, with the same
float64 operations in the same order. Machine code is kept by numba beside this file or, where that
cannot be written, in the user's cache; nothing here calls another file, whose changes numba would
not notice.
"""

from __future__ import annotations

from typing import Any, Final

import numba
import numpy as np
from numpy.typing import NDArray

_TINY: Final = 1e-300


@numba.njit(cache=True, error_model="numpy")
def classify(
    region: tuple[int, int, int, int],
    lens: tuple[float, float, float, float],
    eye_box: NDArray[np.float64],
    box_from_optical: NDArray[np.float64],
    half_m: NDArray[np.float64],
    strip_top_m: float,
    z_near_m: float,
    gate_m: float,
    depth_m: NDArray[np.float32],
    instance_id: NDArray[np.uint16],
    wanted_id: int,
    tag: NDArray[np.uint8],
    allowed: NDArray[np.bool_],
    drop_road: bool,
    own: NDArray[np.bool_],
) -> Any:
    """Find an object's own pixels and count those of its silhouette and those in front of it.

    Args:
        region: x0, y0, x1, y1 whole pixels.
        lens: f_x, f_y, c_x, c_y (px).
        eye_box: ``(3,)`` camera position in box axes.
        box_from_optical: ``(3, 3)``.
        half_m: ``(3,)`` half sizes of the inflated box.
        strip_top_m: height in box axes up to which a point is taken for the road.
        z_near_m: the near plane.
        gate_m: slack of the depth gate around the way through the box.
        depth_m: ``(H, W)``.
        instance_id: ``(H, W)``; empty: own pixels are found by depth alone.
        wanted_id: the object's, where ids are given.
        tag: ``(H, W)``; empty: no tags.
        allowed: ``(256,)`` tags that the object's pixels may carry.
        drop_road: whether points at the road are not the object's.
        own: ``(h, w)`` of the region, all false; set where pixels are the object's.

    Returns:
        Own, front and silhouette pixels, and the bounds x0, y0, x1, y1 of the own ones within the
        region, half open.
    """
    x0, y0, x1, y1 = region
    fx, fy, cx, cy = lens
    by_id, by_tag = instance_id.size > 0, tag.size > 0
    visible, front, hull = 0, 0, 0
    left, top, right, bottom = x1 - x0, y1 - y0, 0, 0
    low = -half_m - eye_box
    high = half_m - eye_box
    for j in range(y0, y1):
        y = (j + 0.5 - cy) / fy
        row_x = box_from_optical[0, 1] * y + box_from_optical[0, 2]
        row_y = box_from_optical[1, 1] * y + box_from_optical[1, 2]
        row_z = box_from_optical[2, 1] * y + box_from_optical[2, 2]
        for i in range(x0, x1):
            x = (i + 0.5 - cx) / fx
            slope = box_from_optical[2, 0] * x + row_z
            # A ray along a slab never meets its planes: infinitely far is right, NaN is not.
            along_x = box_from_optical[0, 0] * x + row_x
            along_y = box_from_optical[1, 0] * x + row_y
            inverse = 1.0 / (along_x if along_x != 0.0 else _TINY)
            a, b = inverse * low[0], inverse * high[0]
            enter, leave = max(z_near_m, min(a, b)), max(a, b)
            inverse = 1.0 / (along_y if along_y != 0.0 else _TINY)
            a, b = inverse * low[1], inverse * high[1]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            inverse = 1.0 / (slope if slope != 0.0 else _TINY)
            a, b = inverse * low[2], inverse * high[2]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            if enter > leave:
                continue
            hull += 1
            depth = float(depth_m[j, i])
            at_road = slope < 0.0 and eye_box[2] + depth * slope < strip_top_m
            mine = enter - gate_m <= depth <= leave + gate_m
            if by_tag:
                mine = mine and allowed[tag[j, i]]
            if by_id:
                mine = mine and instance_id[j, i] == wanted_id
            if mine and not (drop_road and at_road):
                own[j - y0, i - x0] = True
                visible += 1
                left, right = min(left, i - x0), max(right, i - x0 + 1)
                top, bottom = min(top, j - y0), max(bottom, j - y0 + 1)
            elif depth < enter and not at_road:
                front += 1
    return visible, front, hull, left, top, right, bottom
