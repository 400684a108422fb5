"""The road that the Traffic Manager will take: how it bends, and where lights and signs are."""

from __future__ import annotations

import math
from typing import Any, Dict, Iterable, List, NamedTuple, Sequence, Tuple

from carstage.collector.comfort.pedals import KMH_PER_M_S

SPACING_M = 2.0
_PLACES_AHEAD = 45
_LOOK_BACK, _LOOK_AHEAD = 2, 6
"""So many places before and after the last known one, the nearest is looked for."""
_BESIDE_M = 1.7
"""Who is farther from the path has another lane: the path begins anew there."""
_MOST_BEHIND, _LEFT_BEHIND = 200, 10
_AT_LINE_M = SPACING_M / 2.0 + 0.05
_LEAST_M = 0.5
_BENDS_PER_M = 0.01
_DIGITS = 3
"""Of what is read from the map: the last bits of sines differ between processors."""

# OpenDRIVE's types of signals, and what CARLA's MotionPlanStage.cpp makes of them.
_SPEED_LIMIT = "274"
_SIGN_KMH = {"1000001": 15.0, "206": 10.0, "205": 10.0}

Lane = Tuple[int, int]
"""Road and lane, by OpenDRIVE's ids."""


class Place(NamedTuple):
    """A place of the road ahead.

    Attributes:
        x, y: in CARLA's world axes, m.
        curvature: 1/m, not negative.
        light: ``carla.TrafficLight`` whose stop line is here, or None.
    """

    x: float
    y: float
    curvature: float
    light: Any


class StopLines:
    """Where lights stop whom.

    Args:
        lights: ``carla.TrafficLight``.
    """

    def __init__(self, lights: Iterable[Any]) -> None:
        self._of_lane: Dict[Lane, List[Tuple[Any, Any]]] = {}
        for light in sorted(lights, key=lambda one: int(one.id)):
            for stop in light.get_stop_waypoints():
                lane = stop.road_id, stop.lane_id
                self._of_lane.setdefault(lane, []).append((stop.transform.location, light))

    def light_at(self, lane: Lane, x: float, y: float) -> Any:
        """The light whose stop line is at a place of a lane, or None."""
        for line, light in self._of_lane.get(lane, ()):
            if _distance(line.x - x, line.y - y) <= _AT_LINE_M:
                return light
        return None


class RoadAhead:
    """Places that follow each other by road, from a vehicle on.

    Args:
        world_map: ``carla.Map``.
        stop_lines: of its lights.

    Attributes:
        places: :data:`SPACING_M` apart.
        at: number of the place that is nearest to the vehicle.
        forks: whether it ends where the road forks, and nobody knows yet how it goes on.
    """

    def __init__(self, world_map: Any, stop_lines: StopLines) -> None:
        self._map = world_map
        self._stop_lines = stop_lines
        self._waypoints: List[Any] = []
        self._beyond_m = 0.0
        self._special: List[int] = []
        self.places: List[Place] = []
        self.at = 0
        self.forks = False

    def begin(self, location: Any) -> None:
        """Begin anew at a ``carla.Location``."""
        self.places, self._waypoints, self._special = [], [], []
        self.at, self.forks = 0, False
        self._add(self._map.get_waypoint(location))
        self._beyond_m = 0.0

    def follow(self, x: float, y: float) -> bool:
        """Note that the vehicle is here; whether that is still on the path."""
        if not self.places:
            return False
        first = max(0, self.at - _LOOK_BACK)
        beside_m, self.at = self.nearest(x, y, first, self.at + _LOOK_AHEAD)
        if self.at > _MOST_BEHIND:
            gone = self.at - _LEFT_BEHIND
            del self.places[:gone], self._waypoints[:gone]
            self._special = [number - gone for number in self._special if number >= gone]
            self.at -= gone
        self._beyond_m = self._past_m(x, y, self.at)
        return beside_m < _BESIDE_M

    def reach(self, chosen: Sequence[Lane]) -> None:
        """Make the path longer; at forks by the lane that is among the chosen ones."""
        self.forks = False
        while len(self.places) < self.at + _PLACES_AHEAD:
            following = self._waypoints[-1].next(SPACING_M)
            if len(following) > 1:
                following = [one for one in following if (one.road_id, one.lane_id) in chosen]
                self.forks = len(following) != 1
            if not following or self.forks:
                return
            self._add(following[0])

    def bends_and_lights(self, within_m: float) -> List[int]:
        """Numbers of places that bend or have a stop line, from one back to a distance ahead."""
        first, last = self.at - 1, self.at + int(within_m / SPACING_M)
        return [number for number in self._special if first <= number <= last]

    def nearest(self, x: float, y: float, first: int, last: int) -> Tuple[float, int]:
        """How far the nearest place is (m), of ``first`` to before ``last``, and its number."""
        least, index = math.inf, first
        for number, place in enumerate(self.places[first:last], first):
            dx, dy = place.x - x, place.y - y
            squared = dx * dx + dy * dy
            if squared < least:
                least, index = squared, number
        return math.sqrt(least), index

    def distance_m(self, number: int) -> float:
        """From the vehicle to a place, along the path."""
        return (number - self.at) * SPACING_M - self._beyond_m

    def gap_m(self, x: float, y: float, number: int) -> float:
        """From the vehicle to who is nearest to a place, along the path."""
        return self.distance_m(number) + self._past_m(x, y, number)

    def along(self, number: int) -> Tuple[float, float]:
        """Where the path leads at a place: a unit vector."""
        here = min(number, len(self.places) - 2)
        if here < 0:
            return 1.0, 0.0
        a, b = self.places[here], self.places[here + 1]
        length_m = max(_distance(b.x - a.x, b.y - a.y), _LEAST_M)
        return (b.x - a.x) / length_m, (b.y - a.y) / length_m

    def signs(self, within_m: float) -> List[Tuple[float, float, float]]:
        """What the Traffic Manager slows down for: x, y (m), and the speed that it has there (m/s).

        Args:
            within_m: along the road, from where the vehicle is.
        """
        found = []
        for mark in self._waypoints[self.at].get_landmarks(within_m, False):
            speed_kmh = mark.value if mark.type == _SPEED_LIMIT else _SIGN_KMH.get(mark.type)
            if speed_kmh is not None and mark.waypoint is not None:
                there = mark.waypoint.transform.location
                place = round(there.x, _DIGITS), round(there.y, _DIGITS)
                found.append((*place, speed_kmh / KMH_PER_M_S))
        return found

    def _past_m(self, x: float, y: float, number: int) -> float:
        along, place = self.along(number), self.places[number]
        return (x - place.x) * along[0] + (y - place.y) * along[1]

    def _add(self, waypoint: Any) -> None:
        pose = waypoint.transform
        x, y = round(pose.location.x, _DIGITS), round(pose.location.y, _DIGITS)
        curvature = 0.0
        if self.places:
            before, last = self.places[-1], self._waypoints[-1].transform
            turned_deg = (pose.rotation.yaw - last.rotation.yaw + 180.0) % 360.0 - 180.0
            far_m = max(_distance(x - before.x, y - before.y), _LEAST_M)
            curvature = abs(math.radians(round(turned_deg, _DIGITS))) / far_m
        self._waypoints.append(waypoint)
        light = self._stop_lines.light_at((waypoint.road_id, waypoint.lane_id), x, y)
        if curvature > _BENDS_PER_M or light is not None:
            self._special.append(len(self.places))
        self.places.append(Place(x, y, curvature, light))


def _distance(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)
