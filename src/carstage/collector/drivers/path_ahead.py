"""The way that a driver follows: places by road, made longer as the ego goes on."""

from __future__ import annotations

import math
from typing import Any, List, NamedTuple, Sequence, Tuple

from carstage.spec.drivers import LEFT, RIGHT, STRAIGHT

SPACING_M = 2.0
"""Between the places of a path."""
LOOK_BACK = 10
LOOK_AHEAD = 30
"""So many places before and after the last known one, the nearest is looked for."""

Place = Tuple[float, float]

_WANTED_DEG = {LEFT: -90.0, STRAIGHT: 0.0, RIGHT: 90.0}


class Nearby(NamedTuple):
    """Where somebody is on the path: the number of the nearest place, and how far from it (m)."""

    place: int
    distance_m: float


class PathAhead:
    """Places ``(x, y)`` that follow each other by road (m, CARLA's world axes).

    Args:
        world_map: ``carla.Map``.
        begin: ``carla.Location`` where it begins, unless places are given.
        places: ``carla.Location`` by road, such as a route's; the path goes on after them.
        turns: which way to take at the forks after that, one after the other; then straight on.
    """

    def __init__(
        self, world_map: Any, begin: Any, places: Sequence[Any], turns: Sequence[str]
    ) -> None:
        self._turns = list(turns)
        self._end = world_map.get_waypoint(places[-1] if places else begin)
        self._at = 0
        at = self._end.transform.location
        self.places = _spaced([(place.x, place.y) for place in places]) or [(at.x, at.y)]

    def reach(self, count: int) -> None:
        """Make the path so many places longer than where the ego is, where the road goes on."""
        while len(self.places) < self._at + count:
            following = self._end.next(SPACING_M)
            if not following:
                return
            self._end = following[0] if len(following) == 1 else self._branch(following)
            at = self._end.transform.location
            self.places.append((at.x, at.y))

    def follow(self, x: float, y: float) -> int:
        """Note that the ego is here; the number of the place that it is at."""
        first = max(0, self._at - LOOK_BACK)
        self._at = self.nearest(x, y, first, self._at + LOOK_AHEAD).place
        return self._at

    def nearest(self, x: float, y: float, first: int, last: int) -> Nearby:
        """The place nearest to somewhere, among those from ``first`` to before ``last``."""
        found = [
            (math.hypot(px - x, py - y), first + i)
            for i, (px, py) in enumerate(self.places[first:last])
        ]
        distance_m, index = min(found)
        return Nearby(index, distance_m)

    def _branch(self, following: List[Any]) -> Any:
        """The lane to take at a fork: the one that turns most nearly as is wanted."""
        wanted_deg = _WANTED_DEG[self._turns.pop(0) if self._turns else STRAIGHT]
        here_deg = self._end.transform.rotation.yaw
        return min(
            following,
            key=lambda one: (abs(_turned(here_deg, one) - wanted_deg), one.road_id, one.lane_id),
        )


def _spaced(corners: Sequence[Place]) -> List[Place]:
    """Places on a line through others, a spacing apart."""
    found = list(corners[:1])
    left_m = SPACING_M
    for (ax, ay), (bx, by) in zip(corners, corners[1:]):
        length_m = math.hypot(bx - ax, by - ay)
        while left_m <= length_m:
            share = left_m / length_m
            found.append((ax + share * (bx - ax), ay + share * (by - ay)))
            left_m += SPACING_M
        left_m -= length_m
    return found


def _turned(from_deg: float, lane: Any) -> float:
    """How far a lane turns to the right until its end, from -180 to 180 degrees."""
    end = lane.next_until_lane_end(SPACING_M)
    to_deg = (end[-1] if end else lane).transform.rotation.yaw
    return float((to_deg - from_deg + 180.0) % 360.0 - 180.0)
