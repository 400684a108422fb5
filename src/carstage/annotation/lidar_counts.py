"""How many LiDAR points lie in each box.

A sweep holds some hundred thousand points, a frame some dozens of boxes, and a box few points.
So the points are sorted into the cells of a ground grid once; each box tests its cells only.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, invert_pose

_CELLS: Final = 128
_TOLERANCE_M: Final = 1e-6


class PointGrid:
    """Points of one sweep, sorted by ground cell.

    Args:
        points: ``(N, 3)`` or wider, sensor axes (m); columns after the third are ignored.
    """

    def __init__(self, points: NDArray[np.float32]) -> None:
        xyz = points[:, :3]
        if len(xyz):
            self._low = xyz[:, :2].min(axis=0)
            span = float((xyz[:, :2].max(axis=0) - self._low).max())
        else:
            self._low = np.zeros(2, dtype=np.float32)
            span = 0.0
        self._per_m = _CELLS / max(span, 1e-3)
        cell = self._cells(xyz[:, :2])
        key = (cell[:, 0] * _CELLS + cell[:, 1]).astype(np.uint16)
        # A stable sort of 16-bit keys is a radix sort.
        order = np.argsort(key, kind="stable")
        self._points = xyz[order]
        self._start = np.zeros(_CELLS * _CELLS + 1, dtype=np.int64)
        np.cumsum(np.bincount(key, minlength=_CELLS * _CELLS), out=self._start[1:])

    def _cells(self, xy: NDArray[np.float32] | FloatArray) -> NDArray[np.int32]:
        cell = np.clip(np.floor((xy - self._low) * self._per_m), 0, _CELLS - 1)
        return np.asarray(cell, dtype=np.int32)

    def count(self, sensor_from_box: FloatArray, extent_m: FloatArray) -> int:
        """Points within a box: ``|p_box| <= extent + 1e-6 m`` componentwise.

        Args:
            sensor_from_box: ``(4, 4)``.
            extent_m: ``(3,)`` half sizes.
        """
        reach = np.abs(sensor_from_box[:2, :3]) @ extent_m + 1e-3
        center = sensor_from_box[:2, 3]
        (x0, y0), (x1, y1) = self._cells(np.stack([center - reach, center + reach])).tolist()
        rows = [
            self._points[self._start[x * _CELLS + y0] : self._start[x * _CELLS + y1 + 1]]
            for x in range(x0, x1 + 1)
        ]
        near = np.concatenate(rows).astype(np.float64)
        if not len(near):
            return 0
        box_from_sensor = invert_pose(sensor_from_box)
        local = near @ box_from_sensor[:3, :3].T + box_from_sensor[:3, 3]
        return int((np.abs(local) <= extent_m + _TOLERANCE_M).all(axis=1).sum())


def count_points(
    points: NDArray[np.float32], sensor_from_boxes: FloatArray, extents_m: FloatArray
) -> NDArray[np.int64]:
    """Points of a sweep in each of ``M`` boxes.

    Args:
        points: ``(N, 3)`` or wider, sensor axes (m).
        sensor_from_boxes: ``(M, 4, 4)``.
        extents_m: ``(M, 3)`` half sizes.
    """
    grid = PointGrid(points)
    counts = [
        grid.count(pose, extent) for pose, extent in zip(sensor_from_boxes, extents_m, strict=True)
    ]
    return np.array(counts, dtype=np.int64)
