"""Driver ``route``: a small controller that follows a path by road and stops for others.

It steers by pure pursuit (Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm",
CMU-RI-TR-92-01) and drives as fast as limit, curves, lights and whoever is ahead allow.
"""

from __future__ import annotations

import math
from typing import Any, List, Optional, Sequence

import carla

from carstage.collector.drivers.base import Driver, Observation
from carstage.collector.drivers.path_ahead import SPACING_M, PathAhead
from carstage.collector.internals.errors import DriverError
from carstage.collector.scenario.routing import RoadGraph

PLACES_AHEAD = 40
"""Of the path that are looked at: 80 m."""
KMH_PER_M_S = 3.6
DEFAULT_M_S = 30.0 / KMH_PER_M_S
"""Where no speed limit is known."""
WHEELBASE_SHARE = 0.6
"""Of a car's length."""
SIDEWAYS_M_S2 = 2.0
BRAKING_M_S2 = 2.5
GAP_M = 4.0
"""To whoever is ahead, when the ego stands."""
LANE_HALF_M = 1.8
AROUND_M = 60.0
LOOK_AHEAD_S, SHORTEST_LOOK_M, LONGEST_LOOK_M = 0.7, 5.0, 18.0
_DIGITS = 4
"""Of what is commanded: the last bits of sines and roots differ between processors."""


class RouteDriver(Driver):
    """Follows the scenario's route, then the road.

    Args:
        speed_m_s: at most so fast; None: as the speed limit allows.
        turns: which way to take at the forks after the route.
    """

    def __init__(self, speed_m_s: Optional[float], turns: Sequence[str]) -> None:
        self._speed_m_s = speed_m_s
        self._turns = turns
        self._path: Any = None
        self._wheelbase_m = 0.0
        self._most_steer_rad = 0.0

    def start(self, observation: Observation) -> None:
        """Find the way.

        Raises:
            DriverError: no road leads from one place to the next.
        """
        here = observation.transform.location
        places: List[Any] = []
        graph = RoadGraph(observation.map) if observation.goals else None
        for index, goal in enumerate(observation.goals):
            assert graph is not None
            way = graph.places_to(here, goal)
            if way is None:
                raise DriverError(
                    "scenario.through[%d]: no road leads there from the place before." % index,
                    "Choose a place that can be reached; roads have directions.",
                )
            places += way
            here = goal
        self._path = PathAhead(observation.map, observation.transform.location, places, self._turns)
        physics = observation.ego.get_physics_control()
        self._most_steer_rad = math.radians(max(w.max_steer_angle for w in physics.wheels))
        self._wheelbase_m = WHEELBASE_SHARE * 2.0 * observation.ego.bounding_box.extent.x

    def drive(self, observation: Observation) -> Any:
        """Steer along the path, at the speed that it allows."""
        here = observation.transform.location
        at = self._path.follow(here.x, here.y)
        self._path.reach(PLACES_AHEAD)
        speed_m_s = math.hypot(observation.velocity.x, observation.velocity.y)
        change = self._allowed_m_s(observation, at) - speed_m_s
        throttle = min(max(0.3 * change + 0.02 * speed_m_s, 0.0), 0.75) if change > -0.2 else 0.0
        brake = min(-0.35 * change, 1.0) if change < -0.5 else 0.0
        if speed_m_s < 0.2 and change <= 0.0:
            brake = 1.0
        return carla.VehicleControl(
            throttle=round(throttle, _DIGITS),
            steer=round(self._steer(observation, at, speed_m_s), _DIGITS),
            brake=round(brake, _DIGITS),
        )

    def _steer(self, observation: Observation, at: int, speed_m_s: float) -> float:
        """From -1 to 1, towards a place some way ahead on the path."""
        look_m = min(max(LOOK_AHEAD_S * speed_m_s, SHORTEST_LOOK_M), LONGEST_LOOK_M)
        here, yaw = observation.transform.location, observation.transform.rotation.yaw
        ahead = self._path.places[at:]
        x, y = next(
            (p for p in ahead if math.hypot(p[0] - here.x, p[1] - here.y) >= look_m), ahead[-1]
        )
        dx, dy = x - here.x, y - here.y
        far_m = max(math.hypot(dx, dy), 1.0)
        right_m = dy * math.cos(math.radians(yaw)) - dx * math.sin(math.radians(yaw))
        wheel_rad = math.atan(2.0 * self._wheelbase_m * right_m / far_m**2)
        return min(max(wheel_rad / self._most_steer_rad, -1.0), 1.0)

    def _allowed_m_s(self, observation: Observation, at: int) -> float:
        """How fast the ego may drive here."""
        limit_m_s = observation.speed_limit_kmh / KMH_PER_M_S or DEFAULT_M_S
        if self._speed_m_s is not None:
            limit_m_s = min(limit_m_s, self._speed_m_s)
        ego = observation.ego
        stops = (carla.TrafficLightState.Red, carla.TrafficLightState.Yellow)
        if ego.is_at_traffic_light() and ego.get_traffic_light_state() in stops:
            return 0.0
        gap_m = self._free_m(observation, at)
        limit_m_s = min(limit_m_s, _braked(max(gap_m - GAP_M, 0.0)))
        for number, radius_m in enumerate(_radii(self._path.places[at:])):
            curve_m_s = math.sqrt(SIDEWAYS_M_S2 * radius_m)
            limit_m_s = min(limit_m_s, math.hypot(curve_m_s, _braked(number * SPACING_M)))
        return limit_m_s

    def _free_m(self, observation: Observation, at: int) -> float:
        """How far the path is free of others, from the ego's front; where it ends, too."""
        ego, here = observation.ego, observation.transform.location
        last = len(self._path.places)
        front_m = float(ego.bounding_box.extent.x)
        free_m = (last - at) * SPACING_M - front_m
        actors = observation.world.get_actors()
        for other in (*actors.filter("vehicle.*"), *actors.filter("walker.pedestrian.*")):
            place = other.get_location()
            if other.id == ego.id or place.distance(here) > AROUND_M:
                continue
            near = self._path.nearest(place.x, place.y, at, last)
            if near.place > at and near.distance_m < LANE_HALF_M:
                half_m = float(other.bounding_box.extent.x)
                free_m = min(free_m, (near.place - at) * SPACING_M - front_m - half_m)
        return free_m


def _braked(distance_m: float) -> float:
    """The speed from which one comes to a stop within a distance."""
    return math.sqrt(2.0 * BRAKING_M_S2 * distance_m)


def _radii(places: Sequence[Any]) -> List[float]:
    """Radius of the circle through each place and those two before and after it, m."""
    radii = []
    for (ax, ay), (bx, by), (cx, cy) in zip(places, places[2:], places[4:]):
        sides = (
            math.hypot(bx - ax, by - ay),
            math.hypot(cx - bx, cy - by),
            math.hypot(cx - ax, cy - ay),
        )
        area = abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
        product = sides[0] * sides[1] * sides[2]
        radii.append(product / (2.0 * area) if area > 1e-3 else 1e4)
    return radii
