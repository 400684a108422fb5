"""The loops over the pixels of silhouettes and masks, compiled: the only use of numba in labels.

They do in one pass what numpy would do in some thirty, with the same float64 operations in the same
order.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.kernels import compiled

_TINY: Final = 1e-300
_LONGEST: Final = 7
"""Characters of the largest run length."""


@compiled
def classify(
    region: tuple[int, int, int, int],
    lens: tuple[float, float, float, float],
    rays: NDArray[np.float64],
    eye_box: NDArray[np.float64],
    box_from_optical: NDArray[np.float64],
    half_m: NDArray[np.float64],
    reach: tuple[int, int, int, int],
    reach_m: NDArray[np.float64],
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
        rays: ``(H, W, 3)`` of the pixels' centres, which times the depth give the point; NaN where
            the picture shows nothing. Empty: a pinhole's, of ``lens``.
        eye_box: ``(3,)`` camera position in box axes.
        box_from_optical: ``(3, 3)``.
        half_m: ``(3,)`` half sizes of the inflated box.
        reach: x0, y0, x1, y1 whole pixels about the region, where pixels outside the silhouette
            may be the object's.
        reach_m: ``(3,)`` half sizes of the space in which points with its id are its own.
        strip_top_m: height in box axes up to which a point is taken for the road.
        z_near_m: the near plane.
        gate_m: slack of the depth gate around the way through the box.
        depth_m: ``(H, W)``.
        instance_id: ``(H, W)``; empty: own pixels are found by depth alone.
        wanted_id: the object's, where ids are given.
        tag: ``(H, W)``; empty: no tags.
        allowed: ``(256,)`` tags that the object's pixels may carry.
        drop_road: whether points at the road are not the object's.
        own: ``(h, w)`` of ``reach``, all false; set where pixels are the object's.

    Returns:
        Own pixels within the silhouette and outside it, front and silhouette pixels, and the bounds
        x0, y0, x1, y1 of the own ones within ``reach``, half open.
    """
    x0, y0, x1, y1 = region
    from_x, from_y = x0 - reach[0], y0 - reach[1]
    fx, fy, cx, cy = lens
    by_id, by_tag, bent = instance_id.size > 0, tag.size > 0, rays.size > 0
    visible, outside, front, hull = 0, 0, 0, 0
    left, top, right, bottom = own.shape[1], own.shape[0], 0, 0
    low = -half_m - eye_box
    high = half_m - eye_box
    width = x1 - x0
    enters, leaves, slopes = np.empty(width), np.empty(width), np.empty(width)
    for j in range(y0, y1):
        if bent:
            _cross_box(
                rays[j, x0:x1], box_from_optical, low, high, z_near_m, enters, leaves, slopes
            )
        y = (j + 0.5 - cy) / fy
        row_x = box_from_optical[0, 1] * y + box_from_optical[0, 2]
        row_y = box_from_optical[1, 1] * y + box_from_optical[1, 2]
        row_z = box_from_optical[2, 1] * y + box_from_optical[2, 2]
        for i in range(0 if bent else width):  # without branches, so that several pixels go at once
            x = (x0 + i + 0.5 - cx) / fx
            along_x = box_from_optical[0, 0] * x + row_x
            along_y = box_from_optical[1, 0] * x + row_y
            slope = box_from_optical[2, 0] * x + row_z
            # A ray along a slab never meets its planes: infinitely far is right, NaN is not.
            inverse = 1.0 / (along_x if along_x != 0.0 else _TINY)
            a, b = inverse * low[0], inverse * high[0]
            enter, leave = max(z_near_m, min(a, b)), max(a, b)
            inverse = 1.0 / (along_y if along_y != 0.0 else _TINY)
            a, b = inverse * low[1], inverse * high[1]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
            inverse = 1.0 / (slope if slope != 0.0 else _TINY)
            a, b = inverse * low[2], inverse * high[2]
            enters[i] = max(enter, min(a, b))
            leaves[i] = min(leave, max(a, b))
            slopes[i] = slope
        for i in range(width):
            enter, leave = enters[i], leaves[i]
            if enter > leave:
                continue
            hull += 1
            depth = float(depth_m[j, x0 + i])
            slope = slopes[i]
            at_road = slope < 0.0 and eye_box[2] + depth * slope < strip_top_m
            mine = not by_tag or allowed[tag[j, x0 + i]]
            mine = mine and (not by_id or instance_id[j, x0 + i] == wanted_id)
            if mine and not enter - gate_m <= depth <= leave + gate_m:
                mine = by_id and _reached(
                    x0 + i, j, depth, lens, rays, eye_box, box_from_optical, reach_m
                )
            if mine and not (drop_road and at_road):
                u, v = i + from_x, j - y0 + from_y
                own[v, u] = True
                visible += 1
                left, right = min(left, u), max(right, u + 1)
                top, bottom = min(top, v), max(bottom, v + 1)
            elif depth < enter and not at_road:
                front += 1
    if by_id and reach_m[0] > half_m[0]:
        for v in range(own.shape[0]):
            j = reach[1] + v
            for u in range(own.shape[1]):
                i = reach[0] + u
                if instance_id[j, i] != wanted_id or own[v, u]:
                    continue
                if by_tag and not allowed[tag[j, i]]:
                    continue
                depth = float(depth_m[j, i])
                if _reached(i, j, depth, lens, rays, eye_box, box_from_optical, reach_m):
                    own[v, u] = True
                    outside += 1
                    left, right = min(left, u), max(right, u + 1)
                    top, bottom = min(top, v), max(bottom, v + 1)
    return visible, outside, front, hull, left, top, right, bottom


@compiled
def _cross_box(
    rays: NDArray[np.float64],
    box_from_optical: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    z_near_m: float,
    enters: NDArray[np.float64],
    leaves: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Where the rays of a row of a lens's pixels enter and leave a box; never, of those without."""
    for i in range(rays.shape[0]):
        enter, leave, along = z_near_m, np.inf, 0.0
        for axis in range(3):
            along = (
                box_from_optical[axis, 0] * rays[i, 0] + box_from_optical[axis, 1] * rays[i, 1]
                + box_from_optical[axis, 2] * rays[i, 2]
            )  # fmt: skip
            inverse = 1.0 / (along if along != 0.0 else _TINY)
            a, b = inverse * low[axis], inverse * high[axis]
            enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
        missing = np.isnan(rays[i, 0])
        enters[i] = np.inf if missing else enter
        leaves[i] = 0.0 if missing else leave
        slopes[i] = along


@compiled
def _reached(
    i: int,
    j: int,
    depth: float,
    lens: tuple[float, float, float, float],
    rays: NDArray[np.float64],
    eye_box: NDArray[np.float64],
    box_from_optical: NDArray[np.float64],
    reach_m: NDArray[np.float64],
) -> bool:
    """Whether what a pixel shows lies within an object's reach."""
    x, y, z = (i + 0.5 - lens[2]) / lens[0], (j + 0.5 - lens[3]) / lens[1], 1.0
    if rays.size > 0:
        x, y, z = rays[j, i, 0], rays[j, i, 1], rays[j, i, 2]
    for axis in range(3):
        along = (
            box_from_optical[axis, 0] * x + box_from_optical[axis, 1] * y
            + box_from_optical[axis, 2] * z
        )  # fmt: skip
        if not abs(eye_box[axis] + depth * along) <= reach_m[axis]:
            return False
    return True


@compiled
def encode_runs(
    crop: NDArray[np.bool_], x0: int, y0: int, width: int, height: int
) -> NDArray[np.uint8]:
    """COCO's compressed run lengths of a mask of which only a crop is set, as ASCII.

    Args:
        crop: ``(h, w)`` mask; its first pixel is (x0, y0) of the image.
        x0: column of the crop in the image.
        y0: row of the crop in the image.
        width: of the image (px).
        height: of the image (px).
    """
    rows, columns = crop.shape
    code = np.empty(_LONGEST * (crop.size + 2), dtype=np.uint8)
    size, index, last, before_last = 0, 0, 0, 0
    # One column more than there are, and below each the zeros up to the next one's crop.
    value, count = False, x0 * height + y0
    rest = width * height - count
    for column in range(columns + 1):
        for row in range(rows + 1):
            in_crop = column < columns and row < rows
            pixel = crop[row, column] if in_crop else False
            length = 1 if in_crop else (rest if column == columns else height - rows)
            if length == 0:
                continue
            rest -= length
            if pixel != value:
                size = _put(code, size, count - (before_last if index > 2 else 0))
                index, before_last, last = index + 1, last, count
                value, count = pixel, 0
            count += length
    size = _put(code, size, count - (before_last if index > 2 else 0))
    return code[:size]


@compiled
def _put(code: NDArray[np.uint8], size: int, number: int) -> int:
    """Append a number as groups of five bits, little end first; return the new size."""
    more = True
    while more:
        bits = number & 0x1F
        number >>= 5
        more = number != -1 if bits & 0x10 else number != 0
        code[size] = bits + 48 + (0x20 if more else 0)
        size += 1
    return size
