"""Which lights have vehicles coming or waiting: the detectors of actuated signals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples, OrientedBox, TrafficLightSite

DETECTOR_M = 25.0
"""How far before a light a vehicle is noticed: three lengths of one that waits."""
_BEYOND_M = 8.0
"""From the middle of a light's trigger to the stop line and a little more."""


class Approaches:
    """Finds the lights that vehicles are before.

    Args:
        sites: the map's lights.
        lanes: samples of all driving lanes.
    """

    def __init__(self, sites: Sequence[TrafficLightSite], lanes: LaneSamples) -> None:
        self._count = len(sites)
        self._light_of_sample = np.full(len(lanes.s_m), -1, np.int32)
        for light, site in enumerate(sites):
            for box in site.trigger:
                self._light_of_sample[_before(box, lanes)] = light

    def with_vehicles(self, samples: NDArray[np.int32]) -> NDArray[np.bool_]:
        """``(L,)`` whether anybody is before each light.

        Args:
            samples: ``(N,)`` nearest lane sample of each vehicle.
        """
        found = self._light_of_sample[samples]
        occupied = np.zeros(self._count, np.bool_)
        occupied[found[found >= 0]] = True
        return occupied


def _before(box: OrientedBox, lanes: LaneSamples) -> NDArray[np.intp]:
    """Samples of the lane that leads through a light's trigger, from the detector to the line."""
    distance_m = np.linalg.norm(lanes.location - np.array(box.center), axis=1)
    distance_m[lanes.junction_id >= 0] = np.inf
    here = int(distance_m.argmin())
    if distance_m[here] > _BEYOND_M:
        return np.zeros(0, np.intp)
    same_lane = (lanes.road_id == lanes.road_id[here]) & (lanes.lane_id == lanes.lane_id[here])
    # Lanes with negative numbers run along the road, the others against it.
    along = (lanes.s_m - lanes.s_m[here]) * (-1.0 if lanes.lane_id[here] > 0 else 1.0)
    return np.flatnonzero(same_lane & (along > -DETECTOR_M) & (along < _BEYOND_M))
