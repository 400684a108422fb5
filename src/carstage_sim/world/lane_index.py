"""The nearest lane sample of a point, remembered per cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.jit import device, kernel
from carstage_sim.maps.cell_index import cell_grid
from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.cell_walk import cell_along, cells_along

_CELL_M = 1.0
_MARGIN_M = 50.0
_UNKNOWN = -1
_NEAR_M = 4.0
"""Who drives on a road finds a sample within this."""
_BUCKET_M = 4.0


class LaneIndex:
    """Finds the lane sample nearest to a cell's centre; each cell is searched once.

    Args:
        lanes: samples of all driving lanes, at least one.
    """

    def __init__(self, lanes: LaneSamples) -> None:
        self._lanes = lanes
        self._xy = np.ascontiguousarray(lanes.location[:, :2])
        self._low = self._xy.min(axis=0) - _MARGIN_M
        span = self._xy.max(axis=0) + _MARGIN_M - self._low
        self._shape = np.ceil(span / _CELL_M).astype(np.intp) + 1
        self._nearest: NDArray[np.int32] = np.full(tuple(self._shape), _UNKNOWN, np.int32)
        self._buckets = cell_grid(np.repeat(self._xy[:, None], 3, axis=1), _BUCKET_M)

    def nearest(self, location: NDArray[np.float64]) -> NDArray[np.int32]:
        """Index of the nearest sample of ``(N, 2 or 3)`` points, to within a cell of one metre."""
        found = np.empty(len(location), np.int32)
        places = np.ascontiguousarray(location, np.float64)
        _look_up(places, self._low, self._nearest, self._xy, self._buckets, found)
        return found

    def speed_limit_kmh(self, location: NDArray[np.float64]) -> NDArray[np.float32]:
        """``(N,)`` speed limits at ``(N, 3)`` locations."""
        limits: NDArray[np.float32] = self._lanes.speed_limit_kmh[self.nearest(location)]
        return limits


@kernel
def _look_up(  # type: ignore[no-untyped-def]
    location, low, nearest, xy, buckets, found
):
    """Writes the nearest sample of each point, and into ``nearest`` what was not known yet."""
    for point in range(location.shape[0]):
        i = cell_along(location[point, 0], low[0], _CELL_M, nearest.shape[0])
        j = cell_along(location[point, 1], low[1], _CELL_M, nearest.shape[1])
        if nearest[i, j] == _UNKNOWN:
            x, y = low[0] + (i + 0.5) * _CELL_M, low[1] + (j + 0.5) * _CELL_M
            nearest[i, j] = _search(x, y, xy, buckets)
        found[point] = nearest[i, j]


@device
def _search(x, y, xy, buckets):  # type: ignore[no-untyped-def]
    """The nearest sample of a place, the first of equally near ones."""
    best, least = -1, _NEAR_M * _NEAR_M
    first_x, last_x = cells_along(buckets, 0, x - _NEAR_M, x + _NEAR_M)
    first_y, last_y = cells_along(buckets, 1, y - _NEAR_M, y + _NEAR_M)
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = i * buckets.shape[1] + j
            for entry in range(buckets.start[cell], buckets.start[cell + 1]):
                sample = buckets.entries[entry]
                squared = (xy[sample, 0] - x) ** 2 + (xy[sample, 1] - y) ** 2
                if squared < least or (squared == least and (best < 0 or sample < best)):
                    best, least = sample, squared
    if best >= 0:
        return best
    least = np.inf
    for sample in range(xy.shape[0]):
        squared = (xy[sample, 0] - x) ** 2 + (xy[sample, 1] - y) ** 2
        if squared < least:
            best, least = sample, squared
    return best
