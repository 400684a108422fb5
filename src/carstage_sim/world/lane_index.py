"""The nearest lane sample of a point, remembered per cell where there is but one road."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import brief_kernel, device
from carstage_sim.maps.cell_index import cell_grid
from carstage_sim.maps.town import LaneSamples
from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.cell_walk import cell_along, cells_along

_CELL_M = 1.0
_MARGIN_M = 50.0
_UNKNOWN = -1
_SEVERAL_LEVELS = -2
_NEAR_M = 4.0
"""Who drives on a road finds a sample within this."""
_SAME_LEVEL_M = 3.0
"""Lower than any bridge, higher than a vehicle's pivot ever is above its lane."""
_BESIDE_LANE_M = 1.0
_BUCKET_M = 4.0


class LaneIndex:
    """Finds the lane sample nearest to a cell's centre; each cell is searched once.

    Under and on bridges it depends on the height, and each point is searched for.

    Args:
        lanes: samples of all driving lanes, at least one.
    """

    def __init__(self, lanes: LaneSamples) -> None:
        self._lanes = lanes
        self._places = np.ascontiguousarray(lanes.location)
        self._low = self._places[:, :2].min(axis=0) - _MARGIN_M
        span = self._places[:, :2].max(axis=0) + _MARGIN_M - self._low
        self._shape = np.ceil(span / _CELL_M).astype(np.intp) + 1
        self._nearest: NDArray[np.int32] = np.full(tuple(self._shape), _UNKNOWN, np.int32)
        self._buckets = cell_grid(np.repeat(self._places[:, None, :2], 3, axis=1), _BUCKET_M)

    def nearest(self, location: NDArray[np.float64]) -> NDArray[np.int32]:
        """Index of the nearest sample of ``(N, 3)`` points, in plan to within a cell of one metre.

        Of roads above each other it is the one at the point's height.
        """
        found = np.empty(len(location), np.int32)
        places = np.ascontiguousarray(location, np.float64)
        _look_up(places, self._low, self._nearest, self._places, self._buckets, found)
        return found

    def is_on_lane(
        self, location: NDArray[np.float64], samples: NDArray[np.int32]
    ) -> NDArray[np.bool_]:
        """Which of ``(N, 3)`` points are on the lanes of their nearest samples, or hardly beside.

        A vehicle that is parked at the kerb is not, one that changes lanes is.
        """
        offset = location - self._lanes.location[samples]
        yaw_rad = np.radians(self._lanes.rotation_deg[samples, Rotation.YAW])
        aside_m = np.abs(offset[:, 1] * np.cos(yaw_rad) - offset[:, 0] * np.sin(yaw_rad))
        limit_m = self._lanes.width_m[samples] / 2.0 + _BESIDE_LANE_M
        return np.asarray(aside_m <= limit_m)


@brief_kernel
def _look_up(  # type: ignore[no-untyped-def]
    location, low, nearest, places, buckets, found
):
    """Writes the nearest sample of each point, and into ``nearest`` what was not known yet."""
    for point in range(location.shape[0]):
        i = cell_along(location[point, 0], low[0], _CELL_M, nearest.shape[0])
        j = cell_along(location[point, 1], low[1], _CELL_M, nearest.shape[1])
        known = nearest[i, j]
        x, y = low[0] + (i + 0.5) * _CELL_M, low[1] + (j + 0.5) * _CELL_M
        if known == _UNKNOWN:
            known = _search(x, y, np.nan, places, buckets)
            if _has_other_level(x, y, places[known, 2], places, buckets):
                known = _SEVERAL_LEVELS
            nearest[i, j] = known
        if known == _SEVERAL_LEVELS:
            known = _search(x, y, location[point, 2], places, buckets)
        found[point] = known


@device
def _search(x, y, z, places, buckets):  # type: ignore[no-untyped-def]
    """The nearest sample of a place in plan, the first of equally near ones.

    Samples at the height ``z`` come first; all are if it is not known (NaN).
    """
    best, least, is_level = -1, np.inf, False
    first_x, last_x = cells_along(buckets, 0, x - _NEAR_M, x + _NEAR_M)
    first_y, last_y = cells_along(buckets, 1, y - _NEAR_M, y + _NEAR_M)
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = i * buckets.shape[1] + j
            for entry in range(buckets.start[cell], buckets.start[cell + 1]):
                sample = buckets.entries[entry]
                squared = (places[sample, 0] - x) ** 2 + (places[sample, 1] - y) ** 2
                if squared >= _NEAR_M * _NEAR_M:
                    continue
                level = not abs(places[sample, 2] - z) > _SAME_LEVEL_M
                if is_level and not level:
                    continue
                nearer = squared < least or (squared == least and sample < best)
                if nearer or (level and not is_level):
                    best, least, is_level = sample, squared, level
    if best >= 0:
        return best
    for sample in range(places.shape[0]):
        squared = (places[sample, 0] - x) ** 2 + (places[sample, 1] - y) ** 2
        if squared < least:
            best, least = sample, squared
    return best


@device
def _has_other_level(x, y, z, places, buckets):  # type: ignore[no-untyped-def]
    """Whether a sample near a place is at another height than ``z``."""
    first_x, last_x = cells_along(buckets, 0, x - _NEAR_M, x + _NEAR_M)
    first_y, last_y = cells_along(buckets, 1, y - _NEAR_M, y + _NEAR_M)
    for i in range(first_x, last_x + 1):
        for j in range(first_y, last_y + 1):
            cell = i * buckets.shape[1] + j
            for entry in range(buckets.start[cell], buckets.start[cell + 1]):
                sample = buckets.entries[entry]
                squared = (places[sample, 0] - x) ** 2 + (places[sample, 1] - y) ** 2
                if squared < _NEAR_M * _NEAR_M and abs(places[sample, 2] - z) > _SAME_LEVEL_M:
                    return True
    return False
