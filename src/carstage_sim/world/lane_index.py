"""The nearest lane sample of a point, remembered per cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.cell_index import CellIndex
from carstage_sim.maps.town import LaneSamples

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
        self._buckets = CellIndex(np.repeat(self._xy[:, None], 3, axis=1), _BUCKET_M)

    def nearest(self, location: NDArray[np.float64]) -> NDArray[np.int32]:
        """Index of the nearest sample of ``(N, 2 or 3)`` points, to within a cell of one metre."""
        cells = ((location[:, :2] - self._low) / _CELL_M).astype(np.intp)
        cells = np.clip(cells, 0, self._shape - 1)
        found: NDArray[np.int32] = self._nearest[cells[:, 0], cells[:, 1]]
        unknown = np.flatnonzero(found == _UNKNOWN)
        if len(unknown):
            centres = self._low + (cells[unknown] + 0.5) * _CELL_M
            found[unknown] = self._search(centres)
            self._nearest[cells[unknown, 0], cells[unknown, 1]] = found[unknown]
        return found

    def _search(self, places: NDArray[np.float64]) -> NDArray[np.int32]:
        """The nearest samples of places, the first of equally near ones."""
        best = np.full(len(places), _UNKNOWN, np.int32)
        owner, sample = self._buckets.within(places - _NEAR_M, places + _NEAR_M)
        if len(owner):
            squared = ((self._xy[sample] - places[owner]) ** 2).sum(axis=1)
            order = np.lexsort((sample, squared, owner))
            first = np.unique(owner[order], return_index=True)[1]
            sure = squared[order[first]] <= _NEAR_M**2
            chosen = order[first[sure]]
            best[owner[chosen]] = sample[chosen]
        for index in np.flatnonzero(best == _UNKNOWN):
            best[index] = np.argmin(((self._xy - places[index]) ** 2).sum(axis=1))
        return best

    def speed_limit_kmh(self, location: NDArray[np.float64]) -> NDArray[np.float32]:
        """``(N,)`` speed limits at ``(N, 3)`` locations."""
        limits: NDArray[np.float32] = self._lanes.speed_limit_kmh[self.nearest(location)]
        return limits
