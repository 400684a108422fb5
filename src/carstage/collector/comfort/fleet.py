"""Who of an episode drives comfortably: the ego and agents that are planned to."""

from __future__ import annotations

from typing import Any, Dict, Mapping, Sequence, Tuple

from carstage.collector.comfort.driving import USUAL_DISTANCE_M, ComfortableDriving, Streets
from carstage.collector.comfort.road import StopLines
from carstage.collector.comfort.road_users import RoadUsers
from carstage.collector.world import WorldSession
from carstage.spec import ComfortSpec

_CARELESS = ("ignore_lights_percent", "ignore_vehicles_percent", "ignore_walkers_percent")


def comfortable(
    manager: Any,
    session: WorldSession,
    step_s: float,
    planned: Sequence[Tuple[Any, ComfortSpec, Mapping[str, float]]],
) -> Dict[int, ComfortableDriving]:
    """Their driving by actor id, each to be asked ahead of each step.

    Args:
        manager: ``carla.TrafficManager``.
        session: the episode's world.
        step_s: simulated time of a step.
        planned: ``carla.Vehicle``, what is comfortable, and the values that the Traffic Manager
            was given. Who at times ignores lights or others is left to it.
    """
    careful = [one for one in planned if not any(one[2].get(name, 0.0) for name in _CARELESS)]
    if not careful:
        return {}
    streets = Streets(
        manager,
        session.world,
        session.map,
        StopLines(session.world.get_actors().filter("traffic.traffic_light")),
        RoadUsers(session.world),
        step_s,
    )
    return {
        int(vehicle.id): ComfortableDriving(
            streets,
            vehicle,
            comfort,
            values.get("speed_difference_percent", 0.0),
            values.get("distance_m", USUAL_DISTANCE_M),
        )
        for vehicle, comfort, values in careful
    }
