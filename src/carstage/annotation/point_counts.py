"""How many points of LiDARs and radars lie in each box.

A sweep holds some hundred thousand points, a frame some dozens of boxes, and a box few points.
So the points are sorted into the cells of a ground grid once; each box tests its cells only.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, invert_pose, rotate, transform_points

_CELLS: Final = 128
_TOLERANCE_M: Final = 1e-6


class PointGrid:
    """Points of one sweep, or detections of a radar, sorted by ground cell.

    Args:
        points: ``(N, 3)`` or wider, sensor axes (m); columns after the third are ignored.
    """

    def __init__(self, points: NDArray[np.floating[Any]]) -> None:
        x, y = points[:, 0], points[:, 1]
        self._low = (float(x.min()), float(y.min())) if len(points) else (0.0, 0.0)
        span = max(float(np.ptp(x)), float(np.ptp(y)), 1e-3) if len(points) else 1.0
        # Slightly too coarse, so that the farthest point falls into the last cell.
        self._per_m = _CELLS / span * (1.0 - 1e-6)
        column, row = ((v - low) * self._per_m for v, low in zip((x, y), self._low, strict=True))
        key = column.astype(np.uint16) * np.uint16(_CELLS) + row.astype(np.uint16)
        # A stable sort of 16-bit keys is a radix sort.
        self._points = np.take(points, np.argsort(key, kind="stable"), axis=0)
        self._start = np.zeros(_CELLS * _CELLS + 1, dtype=np.int64)
        np.cumsum(np.bincount(key, minlength=_CELLS * _CELLS), out=self._start[1:])

    def _cell(self, value: float, low: float) -> int:
        return min(max(math.floor((value - low) * self._per_m), 0), _CELLS - 1)

    def count(self, sensor_from_box: FloatArray, extent_m: FloatArray) -> int:
        """Points within a box: ``|p_box| <= extent + 1e-6 m`` componentwise.

        Args:
            sensor_from_box: ``(4, 4)``.
            extent_m: ``(3,)`` half sizes.
        """
        # Wider than the box by more than float32 can be wrong about a point's cell.
        reach = rotate(np.abs(sensor_from_box[:2, :3]), extent_m) + 1e-3
        center = sensor_from_box[:2, 3]
        x0, y0 = map(self._cell, (center - reach).tolist(), self._low)
        x1, y1 = map(self._cell, (center + reach).tolist(), self._low)
        rows = [
            self._points[self._start[x * _CELLS + y0] : self._start[x * _CELLS + y1 + 1]]
            for x in range(x0, x1 + 1)
        ]
        near = np.concatenate(rows)[:, :3].astype(np.float64)
        box_from_sensor = invert_pose(sensor_from_box)
        local = transform_points(box_from_sensor, near)
        return int((np.abs(local) <= extent_m + _TOLERANCE_M).all(axis=1).sum())


def count_points(
    points: NDArray[np.floating[Any]], sensor_from_boxes: FloatArray, extents_m: FloatArray
) -> NDArray[np.int64]:
    """Points of a sweep in each of ``M`` boxes.

    Args:
        points: ``(N, 3)`` or wider, sensor axes (m).
        sensor_from_boxes: ``(M, 4, 4)``.
        extents_m: ``(M, 3)`` half sizes.
    """
    if len(extents_m) == 0:
        return np.zeros(0, dtype=np.int64)
    grid = PointGrid(points)
    counts = [
        grid.count(pose, extent) for pose, extent in zip(sensor_from_boxes, extents_m, strict=True)
    ]
    return np.array(counts, dtype=np.int64)
