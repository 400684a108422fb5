"""The nearest lane sample of a point, remembered per cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples

_CELL_M = 1.0
_MARGIN_M = 50.0
_UNKNOWN = -1


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

    def nearest(self, location: NDArray[np.float64]) -> NDArray[np.int32]:
        """Index of the nearest sample of ``(N, 2 or 3)`` points, to within a cell of one metre."""
        cells = ((location[:, :2] - self._low) / _CELL_M).astype(np.intp)
        cells = np.clip(cells, 0, self._shape - 1)
        found: NDArray[np.int32] = self._nearest[cells[:, 0], cells[:, 1]]
        for index in np.flatnonzero(found == _UNKNOWN):
            cell = cells[index]
            centre = self._low + (cell + 0.5) * _CELL_M
            nearest = np.argmin(((self._xy - centre) ** 2).sum(axis=1))
            self._nearest[cell[0], cell[1]] = found[index] = nearest
        return found

    def speed_limit_kmh(self, location: NDArray[np.float64]) -> NDArray[np.float32]:
        """``(N,)`` speed limits at ``(N, 3)`` locations."""
        limits: NDArray[np.float32] = self._lanes.speed_limit_kmh[self.nearest(location)]
        return limits
