"""Crosswalks of a map: where their ends are, which way they lead, and which lights they have."""

from __future__ import annotations

import math
import random
from typing import Any, Iterator, List, NamedTuple, Sequence, Set, Tuple

import carla

SIGNAL_M = 15.0
"""From a crosswalk to the stop line of its own arm, at most."""
VIEW_M = 60.0
"""Crosswalks that near the ego's start are in its view."""
VIEW_COSINE = 0.5
MOST_NEAR = 5
MOST_AT_AN_END = 5
"""Pedestrians of the ways over a crosswalk that begin at the same end."""
BEYOND_M = (0.5, 4.0)
"""Between the end of a crosswalk and who is about to use it, over the road."""
BESIDE_M = 12.0
"""And along the road, at most."""
_SAME_M = 1e-3


class Crosswalk(NamedTuple):
    """A rectangle over a road, in CARLA's x and y (m).

    Attributes:
        middle: of the rectangle.
        z_m: height of the road there.
        across: unit vector over the road.
        half_m: half its length over the road.
        half_width_m: half its width along the road.
        lights: ``carla.TrafficLight`` of the vehicles that come to it on its own road.
        inbound: 1 or -1: which way along the road these vehicles drive; 0 without lights.
    """

    middle: Tuple[float, float]
    z_m: float
    across: Tuple[float, float]
    half_m: float
    half_width_m: float
    lights: Tuple[Any, ...] = ()
    inbound: float = 0.0

    def own(self, x: float, y: float) -> Tuple[float, float]:
        """A place in the crosswalk's axes: m from its middle over the road and along it."""
        return self.turned(x - self.middle[0], y - self.middle[1])

    def turned(self, x: float, y: float) -> Tuple[float, float]:
        """A vector in the crosswalk's axes."""
        return (
            x * self.across[0] + y * self.across[1],
            -x * self.across[1] + y * self.across[0],
        )


def crosswalks(world_map: Any, lights: Sequence[Any] = ()) -> List[Crosswalk]:
    """All crosswalks of a map, in its order.

    Args:
        world_map: ``carla.Map``.
        lights: ``carla.TrafficLight`` of all that some crosswalk may have.
    """
    stops = [(light, stop) for light in lights for stop in light.get_stop_waypoints()]
    found = []
    for outline in outlines(world_map.get_crosswalks()):
        x = sum(corner.x for corner in outline) / len(outline)
        y = sum(corner.y for corner in outline) / len(outline)
        z = sum(corner.z for corner in outline) / len(outline)
        lane = world_map.get_waypoint(carla.Location(x, y, z))
        if lane is None:
            continue
        yaw = math.radians(lane.transform.rotation.yaw)
        plain = Crosswalk((x, y), z, (-math.sin(yaw), math.cos(yaw)), 0.0, 0.0)
        reaches = [plain.own(corner.x, corner.y) for corner in outline]
        own_stops = [
            (light, stop)
            for light, stop in stops
            if stop.road_id == lane.road_id
            and stop.transform.location.distance(carla.Location(x, y, z)) < SIGNAL_M
        ]
        inbound = 0.0
        for _, stop in own_stops[:1]:
            ahead = stop.transform.get_forward_vector()
            inbound = math.copysign(1.0, plain.turned(ahead.x, ahead.y)[1])
        found.append(
            plain._replace(
                half_m=max(abs(over_m) for over_m, _ in reaches),
                half_width_m=max(abs(along_m) for _, along_m in reaches),
                lights=tuple({light.id: light for light, _ in own_stops}.values()),
                inbound=inbound,
            )
        )
    return found


def outlines(corners: List[Any]) -> List[List[Any]]:
    """Split ``carla.Map.get_crosswalks()``: an outline ends with its own first corner.

    OpenDRIVE lets a closed outline leave that corner out, and the client tells corners as they are
    in the file. What lies between two outlines that end so is taken for rectangles; where it can
    be none, it is one outline, or left out if it is too long for that.

    Returns:
        ``carla.Location`` of the corners of each, without the repeated one.
    """
    found: List[List[Any]] = []
    outline: List[Any] = []
    for corner in corners:
        for first in range(len(outline) - 3, -1, -1):
            if corner.distance(outline[first]) < _SAME_M:
                found += [*_unrepeated(outline[:first]), outline[first:]]
                outline = []
                break
        else:
            outline.append(corner)
    return found + _unrepeated(outline)


def _unrepeated(corners: List[Any]) -> List[List[Any]]:
    """Outlines, one after the other, that do not repeat their first corner."""
    if len(corners) % 4 == 0:
        return [corners[first : first + 4] for first in range(0, len(corners), 4)]
    return [corners] if 2 < len(corners) < 8 else []


def crossing_ways(
    found: Sequence[Crosswalk], places: Sequence[Any], start: Any, rng: random.Random
) -> Iterator[Tuple[Any, Any]]:
    """Ways over the crosswalks that the ego sees at its start, one after the other.

    Nearer crosswalks come first, each from both sides, and who is nearest to an end first. They
    end when no place is left; there are none where no crosswalk is near.

    Args:
        found: all crosswalks.
        places: ``carla.Location`` where pedestrians may stand.
        start: the ego's ``carla.Transform``.
        rng: chooses where they go to.

    Yields:
        ``carla.Location`` where a pedestrian begins, and where it goes to.
    """
    sides: List[Tuple[List[Any], List[Any]]] = []
    for crosswalk in _seen(found, start):
        beside = {side: _beside(crosswalk, side, places) for side in (1.0, -1.0)}
        if all(beside.values()):
            sides += [(beside[side][:MOST_AT_AN_END], beside[-side]) for side in (1.0, -1.0)]
    taken: Set[Tuple[float, float]] = set()
    for row in range(MOST_AT_AN_END):
        for begins, ends in sides:
            place = begins[row] if row < len(begins) else None
            if place is not None and (place.x, place.y) not in taken:
                taken.add((place.x, place.y))
                yield place, rng.choice(ends)


def _seen(found: Sequence[Crosswalk], start: Any) -> List[Crosswalk]:
    """The nearest crosswalks before the ego; around it where none is before it."""
    here, ahead = start.location, start.get_forward_vector()

    def distance_m(crosswalk: Crosswalk) -> float:
        return math.hypot(crosswalk.middle[0] - here.x, crosswalk.middle[1] - here.y)

    def is_ahead(crosswalk: Crosswalk) -> bool:
        x, y = crosswalk.middle[0] - here.x, crosswalk.middle[1] - here.y
        return bool(x * ahead.x + y * ahead.y > VIEW_COSINE * math.hypot(x, y))

    near = sorted((one for one in found if distance_m(one) < VIEW_M), key=distance_m)
    before = [one for one in near if is_ahead(one)]
    return (before or near)[:MOST_NEAR]


def _beside(crosswalk: Crosswalk, side: float, places: Sequence[Any]) -> List[Any]:
    """Places near one of its ends, the nearest first."""
    near = []
    for place in places:
        over_m, along_m = crosswalk.own(place.x, place.y)
        beyond_m = side * over_m - crosswalk.half_m
        if BEYOND_M[0] < beyond_m < BEYOND_M[1] and abs(along_m) < BESIDE_M:
            near.append((math.hypot(beyond_m, along_m), place.x, place.y, place))
    return [place for _, _, _, place in sorted(near, key=lambda one: one[:3])]
