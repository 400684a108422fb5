"""The shortest way by road between two places, over the map's topology."""

from __future__ import annotations

import heapq
import itertools
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

SPACING_M = 4.0
"""Distance between the places of a lane that are looked at."""

Lane = Tuple[int, int, int]


class _Lanes(NamedTuple):
    """Lanes that follow each other, from a place of the first to one of the last."""

    lanes: List[Lane]
    at: int
    to: int


class RoadGraph:
    """The lanes of a map, between junctions and through them, and which lane follows which.

    Changes of lane are not edges: the Traffic Manager changes lanes by itself where it has to.

    Args:
        world_map: ``carla.Map``.
    """

    def __init__(self, world_map: Any) -> None:
        self._map = world_map
        self._next: Dict[Lane, List[Lane]] = {}
        self._places: Dict[Lane, List[Any]] = {}
        self._in_junction: Dict[Lane, bool] = {}
        # CARLA's topology pairs the first waypoint of a lane with that of each lane after it.
        for begin, successor in world_map.get_topology():
            lane = _lane(begin)
            if lane not in self._places:
                waypoints = [begin, *begin.next_until_lane_end(SPACING_M)]
                self._places[lane] = [waypoint.transform.location for waypoint in waypoints]
                self._in_junction[lane] = bool(begin.is_junction)
            self._next.setdefault(lane, []).append(_lane(successor))

    def way(self, start: Any, goal: Any) -> Optional[List[Any]]:
        """Places for ``TrafficManager.set_path`` from ``start`` to ``goal``; None: no road leads.

        One place near the begin of each lane behind a junction, and the goal. Where a road forks,
        the Traffic Manager takes the branch whose *end* is nearest to the next place of its path
        (LibCarla, ``LocalizationStage::ImportPath``): a place within a junction would mislead it.

        Args:
            start, goal: ``carla.Location``; the nearest lanes count.
        """
        route = self._route(start, goal)
        if route is None:
            return None
        marked = [lane for lane in route.lanes[1:] if not self._in_junction[lane]]
        return [self._places[lane][:2][-1] for lane in marked] + [goal]

    def places_to(self, start: Any, goal: Any) -> Optional[List[Any]]:
        """Places by road from ``start`` to ``goal``, four metres apart; None: no road leads.

        Args:
            start, goal: ``carla.Location``; the nearest places of the nearest lanes count.
        """
        route = self._route(start, goal)
        if route is None:
            return None
        places = [place for lane in route.lanes[:-1] for place in self._places[lane]]
        places += self._places[route.lanes[-1]][: route.to + 1]
        return places[route.at :]

    def _route(self, start: Any, goal: Any) -> Optional[_Lanes]:
        first, last = (_lane(self._map.get_waypoint(place)) for place in (start, goal))
        if first not in self._places or last not in self._places:
            return None
        at, to = _nearest(self._places[first], start), _nearest(self._places[last], goal)
        if first == last and at < to:
            return _Lanes([first], at, to)
        lanes = self._shortest(first, last)
        return None if lanes is None else _Lanes([first, *lanes], at, to)

    def _shortest(self, first: Lane, last: Lane) -> Optional[List[Lane]]:
        """The lanes between two, by Dijkstra's algorithm; ties go to the older entry."""
        order = itertools.count()
        came_from: Dict[Lane, Lane] = {}
        queue = [(0.0, next(order), lane, first) for lane in self._next.get(first, ())]
        while queue:
            length_m, _, lane, before = heapq.heappop(queue)
            if lane in came_from or lane not in self._places:
                continue
            came_from[lane] = before
            if lane == last:
                return _back(came_from, first, last)
            length_m += _length_m(self._places[lane])
            for following in self._next.get(lane, ()):
                heapq.heappush(queue, (length_m, next(order), following, lane))
        return None


def _back(came_from: Dict[Lane, Lane], first: Lane, last: Lane) -> List[Lane]:
    lanes = []
    lane = came_from[last]
    while lane != first:
        lanes.append(lane)
        lane = came_from[lane]
    return lanes[::-1]


def _length_m(places: List[Any]) -> float:
    return float(sum(a.distance(b) for a, b in zip(places, places[1:])))


def _nearest(places: List[Any], here: Any) -> int:
    flat = [(place.x - here.x) ** 2 + (place.y - here.y) ** 2 for place in places]
    return flat.index(min(flat))


def _lane(waypoint: Any) -> Lane:
    return (waypoint.road_id, waypoint.section_id, waypoint.lane_id)
