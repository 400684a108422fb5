"""How many vehicles wait or come before each light: the detectors of actuated signals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.town import LaneSamples, OrientedBox, TrafficLightSite
from carstage_sim.world.signals.lane_graph import LaneGraph
from carstage_sim.world.signals.traffic_lights import Queues

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
        nearest_m = np.full(len(lanes.s_m), np.inf)
        graph = LaneGraph(lanes)
        for light, site in enumerate(sites):
            for box in site.trigger:
                samples, before_m = _before(box, lanes, graph)
                first = before_m < nearest_m[samples]  # where a lane forks, the nearer light counts
                samples, before_m = samples[first], before_m[first]
                nearest_m[samples] = before_m
                self._light_of_sample[samples] = light
                self._is_near[samples] = before_m < NEAR_M

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


def _before(
    box: OrientedBox, lanes: LaneSamples, graph: LaneGraph
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Samples of the lanes that lead through a light's trigger, and their metres before it."""
    distance_m = np.linalg.norm(lanes.location - np.array(box.center), axis=1)
    distance_m[lanes.junction_id >= 0] = np.inf
    here = int(distance_m.argmin())
    if distance_m[here] > _BEYOND_M:
        return np.zeros(0, np.int64), np.zeros(0)
    return graph.before(here, QUEUE_M, _BEYOND_M)
