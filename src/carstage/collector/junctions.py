"""Masts at junctions: beside the road that leads to a junction of the map, towards its middle."""

from __future__ import annotations

from math import atan2, degrees, hypot
from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

import carla

from carstage.collector.internals.errors import SceneError
from carstage.spec.agents import JunctionSpec

_BEFORE_M = 2.0
"""A mast stands so far before the junction begins."""
_FROM_KERB_M = 0.75
_LEAST_ARMS = 3
"""Places where lanes part or meet without a crossing are junctions of OpenDRIVE, too."""
_SAME_ARM_DEG = 20.0


class _Junction(NamedTuple):
    """A junction, and the lanes that lead to it: one ``carla.Waypoint`` before it for each arm."""

    id: int
    middle: Any
    arms: Sequence[Any]


def junction_transform(opendrive_map: Any, spec: JunctionSpec, start: Any, path: str) -> Any:
    """Where a mast stands and looks, as ``carla.Transform``.

    Args:
        opendrive_map: ``carla.Map``.
        spec: which junction, which of its arms, how high.
        start: ``carla.Transform`` where the ego begins.
        path: of the agent, as errors begin with it.

    Raises:
        SceneError: the map has no such junction, or that one no such arm.
    """
    junction = _chosen(_junctions(opendrive_map), spec, start, path)
    if spec.arm >= len(junction.arms):
        raise SceneError(
            "%s.arm: junction %d has no road %d." % (path, junction.id, spec.arm),
            "It has %d that lead to it, counted from 0." % len(junction.arms),
        )
    place = _roadside(junction.arms[spec.arm])
    place.z += spec.height_m
    middle = junction.middle
    ahead = (middle.x - place.x, middle.y - place.y)
    return carla.Transform(
        place,
        carla.Rotation(
            pitch=degrees(atan2(middle.z - place.z, hypot(*ahead))),
            yaw=degrees(atan2(ahead[1], ahead[0])),
        ),
    )


def _chosen(found: Sequence[_Junction], spec: JunctionSpec, start: Any, path: str) -> _Junction:
    if spec.id is not None:
        for junction in found:
            if junction.id == spec.id:
                return junction
    crossings = [one for one in found if len(one.arms) >= _LEAST_ARMS]
    if spec.id is not None or not crossings:
        raise SceneError(
            "%s.junction: the map has no such junction." % path,
            "It has: %s." % (", ".join(str(one.id) for one in crossings) or "none"),
        )
    if spec.draw is not None:
        return crossings[min(int(spec.draw * len(crossings)), len(crossings) - 1)]
    here = start.location
    return min(crossings, key=lambda one: (here.distance(one.middle), one.id))


def _junctions(opendrive_map: Any) -> List[_Junction]:
    """All junctions that lanes for cars lead to, by id; their arms clockwise from +x."""
    inside: Dict[int, List[Any]] = {}
    for begin, _ in opendrive_map.get_topology():
        if begin.is_junction:
            inside.setdefault(int(begin.get_junction().id), []).append(begin)
    return [_junction(number, inside[number]) for number in sorted(inside)]


def _junction(number: int, begins: Sequence[Any]) -> _Junction:
    places = [begin.transform.location for begin in begins]
    middle = carla.Location(
        *(sum(getattr(place, axis) for place in places) / len(places) for axis in "xyz")
    )
    arms: List[Tuple[float, Any]] = []
    for begin in sorted(begins, key=lambda one: (one.road_id, one.lane_id, one.s)):
        before = begin.previous(_BEFORE_M)
        if not before or before[0].is_junction:
            continue
        place = before[0].transform.location
        angle = degrees(atan2(place.y - middle.y, place.x - middle.x)) % 360.0
        if all(_between_deg(angle, other) > _SAME_ARM_DEG for other, _ in arms):
            arms.append((angle, before[0]))
    return _Junction(number, middle, [one for _, one in sorted(arms, key=lambda arm: arm[0])])


def _roadside(waypoint: Any) -> Any:
    """``carla.Location`` beside the last lane to the right that cars drive on."""
    lane = waypoint
    right = lane.get_right_lane()
    while right is not None and right.lane_type & carla.LaneType.Driving:
        if right.lane_id * waypoint.lane_id < 0:
            break  # it leads the other way
        lane, right = right, right.get_right_lane()
    side = lane.transform.get_right_vector()
    away_m = lane.lane_width / 2.0 + _FROM_KERB_M
    place = lane.transform.location
    return carla.Location(place.x + side.x * away_m, place.y + side.y * away_m, place.z)


def _between_deg(one: float, other: float) -> float:
    return abs((one - other + 180.0) % 360.0 - 180.0)
