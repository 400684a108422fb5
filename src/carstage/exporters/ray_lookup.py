"""The nearest of many rays from one place, found in a grid over azimuth and elevation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray

_FINEST_RAD = 1e-4
_NEIGHBOURS = (-1, 0, 1)


class RayLookup:
    """Rays that end at points, all from the origin.

    Args:
        ends: ``(M, 3)`` where they end (m).
        across_rad: angle between neighbours of one channel; half of it is too far.
        up_rad: angle between channels, likewise.
    """

    def __init__(self, ends: FloatArray, across_rad: float, up_rad: float) -> None:
        across, up = (max(step / 2.0, _FINEST_RAD) for step in (across_rad, up_rad))
        self._columns = max(int(2.0 * np.pi / across), 3)
        self._steps = (2.0 * np.pi / self._columns, up)
        self._directions, self._ranges_m = _directions(ends)
        cells = self._cell(*self._grid(self._directions))
        self._order = np.argsort(cells, kind="stable")
        self._cells = cells[self._order]

    def nearest(self, points: FloatArray, tolerance_m: float) -> NDArray[np.int64]:
        """``(N,)`` index of the nearest ray of each point ``(N, 3)``.

        It is -1 where the ray is more than half a step away, or its end nearer or farther than the
        point by more than ``tolerance_m``.
        """
        directions, ranges_m = _directions(points)
        found = np.full(len(points), -1, np.int64)
        least = np.full(len(points), np.inf)
        if not len(self._cells) or not len(points):
            return found
        column, row = self._grid(directions)
        for across in _NEIGHBOURS:
            for up in _NEIGHBOURS:
                cell = self._cell(column + across, row + up)
                first = np.searchsorted(self._cells, cell, "left")
                count = np.searchsorted(self._cells, cell, "right") - first
                for n in range(int(count.max(initial=0))):
                    at = np.flatnonzero(count > n)
                    ray = self._order[first[at] + n]
                    distance = np.sum((directions[at] - self._directions[ray]) ** 2, axis=1)
                    # Of equally near rays the first: the order of cells must not matter.
                    better = (distance < least[at]) | ((distance == least[at]) & (ray < found[at]))
                    least[at[better]], found[at[better]] = distance[better], ray[better]
        limit = np.sin(np.hypot(*self._steps) / 2.0) * 2.0
        known = found >= 0
        near = np.zeros(len(points), np.bool_)
        near[known] = (least[known] <= limit**2) & (
            np.abs(ranges_m[known] - self._ranges_m[found[known]]) <= tolerance_m
        )
        found[~near] = -1
        return found

    def _grid(self, directions: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        azimuth = np.arctan2(directions[:, 1], directions[:, 0])
        elevation = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
        return (
            np.floor((azimuth + np.pi) / self._steps[0]).astype(np.int64),
            np.floor((elevation + np.pi / 2.0) / self._steps[1]).astype(np.int64),
        )

    def _cell(self, column: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.int64]:
        return (row + 1) * (self._columns + 1) + np.mod(column, self._columns)


def _directions(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    ranges_m = np.linalg.norm(points, axis=1)
    return points / np.maximum(ranges_m, 1e-9)[:, None], ranges_m
