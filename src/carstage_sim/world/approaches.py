"""How many vehicles wait or come before each light: the detectors of actuated signals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples, OrientedBox, TrafficLightSite
from carstage_sim.world.traffic_lights import Queues

QUEUE_M = 60.0
"""How far before a light a vehicle counts: eight lengths of one that waits."""
NEAR_M = 25.0
"""Nearer than this it uses the light's green."""
_BEYOND_M = 8.0
"""From the middle of a light's trigger to the stop line and a little more."""


class Approaches:
    """Counts the vehicles before lights.

    Args:
        sites: the map's lights.
        lanes: samples of all driving lanes.
    """

    def __init__(self, sites: Sequence[TrafficLightSite], lanes: LaneSamples) -> None:
        self._count = len(sites)
        self._junction_of_light = np.array([site.junction_id for site in sites], np.int32)
        self._junction_of_sample = lanes.junction_id
        self._light_of_sample = np.full(len(lanes.s_m), -1, np.int32)
        self._is_near = np.zeros(len(lanes.s_m), np.bool_)
        for light, site in enumerate(sites):
            for box in site.trigger:
                samples, distance_m = _before(box, lanes)
                self._light_of_sample[samples] = light
                self._is_near[samples] = distance_m < NEAR_M

    def queues(self, samples: NDArray[np.int32]) -> Queues:
        """What the detectors see.

        Args:
            samples: ``(N,)`` nearest lane sample of each vehicle.
        """
        light = self._light_of_sample[samples]
        counted = light >= 0
        near = light[counted & self._is_near[samples]]
        return Queues(
            count=np.bincount(light[counted], minlength=self._count),
            near=np.bincount(near, minlength=self._count) > 0,
            beyond=np.isin(self._junction_of_light, self._junction_of_sample[samples]),
        )


def _before(box: OrientedBox, lanes: LaneSamples) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Samples of the lane that leads through a light's trigger, and their metres before it."""
    distance_m = np.linalg.norm(lanes.location - np.array(box.center), axis=1)
    distance_m[lanes.junction_id >= 0] = np.inf
    here = int(distance_m.argmin())
    if distance_m[here] > _BEYOND_M:
        return np.zeros(0, np.intp), np.zeros(0)
    same_lane = (lanes.road_id == lanes.road_id[here]) & (lanes.lane_id == lanes.lane_id[here])
    # Lanes with negative numbers run along the road, the others against it.
    before_m = (lanes.s_m[here] - lanes.s_m) * (-1.0 if lanes.lane_id[here] > 0 else 1.0)
    samples = np.flatnonzero(same_lane & (before_m < QUEUE_M) & (before_m > -_BEYOND_M))
    return samples, before_m[samples]
