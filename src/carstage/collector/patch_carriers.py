"""Who carries patches: vehicles and people, put where the ego will see them before anybody moves.

A large vehicle is put on the ego's lane, or on one beside it, its rear at the wanted distance from
where the ego begins. A person is put on the sidewalk there, and walks towards the ego. Who moves
as a recording or a program says is left where it is.
"""

from __future__ import annotations

import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import carla

from carstage.collector.actors import DROP_M, Walker
from carstage.collector.internals.dialect import city_object_labels
from carstage.collector.scenario import Population
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec
from carstage.spec.patches import CARRIED, VEHICLE_REAR, PatchSpec

TRIES_M = (0.0, 2.0, -2.0, 4.0, -4.0, 6.0, 9.0, 12.0, 16.0, 20.0, 25.0)
"""Places along the lane, from the wanted one on."""
STEP_M = 0.5
WIDEST_M = 30.0
"""No road's edge is farther from the middle of a lane."""
LEAST_WIDTH_M = LEAST_HEIGHT_M = 2.0
"""Of vehicles that carry a board: lorries, buses and vans."""
GAP_M = 1.0
"""So far from a lane the next one of the road may begin."""
KERB_M = 3.0
"""So far from the road's edge its sidewalk may begin."""
ROOM_M = 1.0
"""Between a carrier and everybody else."""
PARKED_ROOM_M = 0.3
"""Between a carrier and a parked car of the level."""
IN_THE_WAY_M = 2.0
"""Who is nearer to the line from the ego to a board is taken to hide it."""
FARTHEST_SIDEWALK_M = 15.0
"""From the middle of the lane."""

Carriers = Dict[str, Any]
"""``carla.Actor`` by the name of the patch."""


class _Place(NamedTuple):
    """Where somebody is, ``carla.Location``, and how far they reach, seen from above."""

    at: Any
    reach_m: float

    @classmethod
    def of(cls, actor: Any) -> _Place:
        extent = actor.bounding_box.extent
        return cls(actor.get_location(), math.hypot(extent.x, extent.y))


class _Footprint(NamedTuple):
    """A box seen from above: its middle, the unit vector along it, half its length and width."""

    middle: Tuple[float, float]
    along: Tuple[float, float]
    half_m: Tuple[float, float]

    @classmethod
    def of(cls, box: Any, yaw_deg: float) -> _Footprint:
        """Of a ``carla.BoundingBox`` with its location in the world."""
        yaw = math.radians(yaw_deg)
        at, extent = box.location, box.extent
        return cls((at.x, at.y), (math.cos(yaw), math.sin(yaw)), (extent.x, extent.y))

    def reach_m(self, x: float, y: float) -> float:
        """How far it reaches from its middle along a unit vector."""
        ahead, across = self.along
        return self.half_m[0] * abs(ahead * x + across * y) + self.half_m[1] * abs(
            ahead * y - across * x
        )

    def is_apart(self, other: _Footprint, gap_m: float) -> bool:
        """Whether a line parts the two with a gap (separating axes)."""
        x, y = other.middle[0] - self.middle[0], other.middle[1] - self.middle[1]
        for a, b in (self.along, other.along):
            for u, v in ((a, b), (-b, a)):
                if abs(x * u + y * v) > self.reach_m(u, v) + other.reach_m(u, v) + gap_m:
                    return True
        return False


def large_vehicles(population: Population) -> List[Any]:
    """Those whose rear a board fits on."""
    return [
        vehicle
        for vehicle in population.vehicles
        if 2.0 * vehicle.bounding_box.extent.y >= LEAST_WIDTH_M
        and 2.0 * vehicle.bounding_box.extent.z >= LEAST_HEIGHT_M
    ]


def to_side(transform: Any, side: str) -> Tuple[float, float]:
    """Unit vector across the road towards a side."""
    yaw = math.radians(transform.rotation.yaw)
    sign = 1.0 if side == "right" else -1.0
    return -math.sin(yaw) * sign, math.cos(yaw) * sign


def places_ahead(start: Any, distance_m: float) -> Iterator[Any]:
    """Waypoints about so far along a lane, the nearest to there first; none in junctions."""
    for more_m in TRIES_M:
        ahead_m = distance_m + more_m
        places = start.next(ahead_m) if ahead_m > 0.0 else []
        if places and not places[0].is_junction:
            yield places[0]


def beyond_road(session: WorldSession, place: Any, side: str) -> Tuple[float, Optional[Any]]:
    """How far from a lane's middle the road ends, and the sidewalk's waypoint there, if any."""
    at, (x, y) = place.transform.location, to_side(place.transform, side)
    away_m = ends_m = 0.5 * float(place.lane_width)
    while away_m <= min(ends_m + KERB_M, WIDEST_M):
        spot = carla.Location(at.x + x * away_m, at.y + y * away_m, at.z)
        lane = session.map.get_waypoint(spot, False, carla.LaneType.Any)
        if lane is not None and lane.lane_type == carla.LaneType.Sidewalk:
            return ends_m, lane
        if lane is not None:
            if away_m > ends_m + GAP_M:
                break  # of another road
            ends_m = away_m + STEP_M
        away_m += STEP_M
    return ends_m, None


def place_carriers(session: WorldSession, spec: EpisodeSpec, population: Population) -> Carriers:
    """Put those who carry patches where the ego will see them.

    The world has to be stepped before anybody is set going, if there are any.

    Args:
        session: the episode's world; everybody is in its newest frame, and nobody moves.
        spec: the episode.
        population: who was spawned, and is driven by the Traffic Manager.

    Returns:
        Who was put somewhere; patches that find nobody, or no room, are left out.
    """
    eye, start = _Place.of(population.ego), _lane(session, population)
    agents = [one.actor for one in population.agents]
    people = [walker.actor for walker in population.walkers]
    others = {one.id: _Place.of(one) for one in (*agents, *population.vehicles, *people)}
    parked = _parked(session)
    carriers: Carriers = {}
    for patch in spec.patches:
        goal = start.next(max(patch.distance_m, STEP_M))
        able = large_vehicles(population) if patch.target == VEHICLE_REAR else people
        free = [actor for actor in able if actor not in carriers.values()]
        if patch.target not in CARRIED or not free or not goal:
            continue
        wanted = goal[0].transform.location
        actor = min(free, key=lambda one: _away_m(one.get_location(), wanted))
        own = others.pop(actor.id)
        for transform in _transforms(session, start, patch, actor):
            place = own._replace(at=transform.location)
            if _is_free(place, eye, list(others.values())) and _misses(actor, transform, parked):
                actor.set_transform(transform)
                carriers[patch.name], own = actor, place
                break
        others[actor.id] = own
    return carriers


def send_to_ego(session: WorldSession, population: Population, carriers: Carriers) -> List[Walker]:
    """Have people with patches walk towards where the ego is; they have been set going before.

    Returns:
        All walkers, with where they go to now.
    """
    ids, start = {actor.id for actor in carriers.values()}, _lane(session, population)
    at, (x, y) = start.transform.location, to_side(start.transform, "right")
    walkers = []
    for walker in population.walkers:
        if walker.actor.id in ids:
            here = walker.actor.get_location()
            is_right = (here.x - at.x) * x + (here.y - at.y) * y > 0.0
            _, sidewalk = beyond_road(session, start, "right" if is_right else "left")
            if sidewalk is not None:
                walker = walker._replace(target=sidewalk.transform.location)
                walker.controller.go_to_location(walker.target)
        walkers.append(walker)
    return walkers


def _parked(session: WorldSession) -> List[_Footprint]:
    """Cars of the level that are no actors."""
    return [
        _Footprint.of(found.bounding_box, found.bounding_box.rotation.yaw)
        for label in city_object_labels("parked_vehicles")
        for found in session.world.get_environment_objects(label)
    ]


def _misses(actor: Any, transform: Any, parked: Sequence[_Footprint]) -> bool:
    """Whether somebody put at a place is in no parked car."""
    box = actor.bounding_box
    middle = transform.transform(carla.Location(box.location.x, box.location.y, 0.0))
    own = _Footprint.of(carla.BoundingBox(middle, box.extent), transform.rotation.yaw)
    return all(own.is_apart(other, PARKED_ROOM_M) for other in parked)


def _lane(session: WorldSession, population: Population) -> Any:
    return session.map.get_waypoint(population.ego.get_location())


def _transforms(session: WorldSession, start: Any, patch: PatchSpec, actor: Any) -> Iterator[Any]:
    """Poses to try, the best first."""
    box = actor.bounding_box
    if patch.target == VEHICLE_REAR:
        for place in places_ahead(start, patch.distance_m - box.location.x + box.extent.x):
            for lane in _same_way(place):
                at = lane.transform
                at.location.z += DROP_M
                yield at
        return
    for place in places_ahead(start, patch.distance_m):
        away_m, sidewalk = beyond_road(session, place, patch.side)
        if sidewalk is not None and away_m <= FARTHEST_SIDEWALK_M:
            at = sidewalk.transform.location
            at.z += float(box.extent.z) + DROP_M
            yield carla.Transform(at, carla.Rotation(yaw=place.transform.rotation.yaw + 180.0))


def _same_way(place: Any) -> Iterator[Any]:
    """A lane's place, and those beside it on lanes that lead the same way."""
    yield place
    for beside in (place.get_left_lane(), place.get_right_lane()):
        is_lane = beside is not None and beside.lane_type == carla.LaneType.Driving
        if is_lane and beside.lane_id * place.lane_id > 0:
            yield beside


def _away_m(one: Any, other: Any) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


def _is_free(place: _Place, eye: _Place, others: Sequence[_Place]) -> bool:
    """Whether there is room at a place, and nobody before it, seen from above."""
    x, y = place.at.x - eye.at.x, place.at.y - eye.at.y
    length = math.hypot(x, y)
    if length < place.reach_m + eye.reach_m + ROOM_M:
        return False
    for other in others:
        if _away_m(place.at, other.at) < place.reach_m + other.reach_m + ROOM_M:
            return False
        along = ((other.at.x - eye.at.x) * x + (other.at.y - eye.at.y) * y) / length
        across = ((other.at.x - eye.at.x) * y - (other.at.y - eye.at.y) * x) / length
        if 0.0 < along < length and abs(across) < IN_THE_WAY_M:
            return False
    return True
