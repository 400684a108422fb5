"""Positions of a storyboard on the map."""

from __future__ import annotations

import math
from typing import Any, Callable, List

import carla

from carstage.collector.internals.errors import SceneError
from carstage.spec.storyboard import LanePlace, RelativeLanePlace, StoryPlace, WorldPlace

NEAR_LANE_M = 0.5
"""Beside a lane, so far from its edge, the ground is as high as the lane."""
LEVEL_M = 2.0
"""Heights at which a lane is looked for, from one to the next."""


class Places:
    """Finds positions.

    Args:
        world_map: ``carla.Map``.
        where: ``carla.Transform`` of an entity, by its name.
    """

    def __init__(self, world_map: Any, where: Callable[[str], Any]) -> None:
        self._map = world_map
        self._where = where
        self._heights_m: List[float] = []

    def transform(self, place: StoryPlace) -> Any:
        """``carla.Transform`` of a position, on the ground where the map knows it.

        Raises:
            SceneError: the map has no such lane.
        """
        if isinstance(place, WorldPlace):
            at = carla.Location(place.x_m, place.y_m, self._ground_m(place))
            return carla.Transform(at, carla.Rotation(0.0, place.yaw_deg, 0.0))
        waypoint = self._lane(place) if isinstance(place, LanePlace) else self._relative(place)
        return _aside(waypoint.transform, place.right_m, place.yaw_deg)

    def _lane(self, place: LanePlace) -> Any:
        found = self._map.get_waypoint_xodr(place.road, place.lane, place.s_m)
        if found is None:
            raise SceneError(
                "scenario.file: the map has no lane %d of road %d at s = %g m."
                % (place.lane, place.road, place.s_m),
                "Use the map that the file was written for.",
            )
        return found

    def _relative(self, place: RelativeLanePlace) -> Any:
        begin = self._map.get_waypoint(self._where(place.entity).location)
        lane = begin.lane_id + place.lanes
        beside = self._map.get_waypoint_xodr(begin.road_id, lane, begin.s)
        found = [beside]
        if beside is not None and place.ahead_m > 0.0:
            found = beside.next(place.ahead_m)
        elif beside is not None and place.ahead_m < 0.0:
            found = beside.previous(-place.ahead_m)
        if not found or found[0] is None:
            raise SceneError(
                "scenario.file: from %s there is no place %d lanes aside and %g m ahead."
                % (place.entity, place.lanes, place.ahead_m),
                "Use the map that the file was written for.",
            )
        return found[0]

    def _ground_m(self, place: WorldPlace) -> float:
        """Height of the lane at or beside a place; without one the place's own, or 0."""
        heights_m = self._all_heights_m() if place.z_m is None else [place.z_m]
        for z_m in heights_m:
            lane = self._map.get_waypoint(
                carla.Location(place.x_m, place.y_m, z_m), True, carla.LaneType.Any
            )
            if lane is None:
                continue
            middle = lane.transform.location
            aside_m = math.hypot(middle.x - place.x_m, middle.y - place.y_m)
            if aside_m <= 0.5 * lane.lane_width + NEAR_LANE_M:
                return float(middle.z)
        return place.z_m or 0.0

    def _all_heights_m(self) -> List[float]:
        """Heights of the map's roads in steps, those near 0 first.

        A client finds the lane that is nearest in space: from far below, that of another place.
        """
        if not self._heights_m:
            ends = [end.transform.location.z for pair in self._map.get_topology() for end in pair]
            low, high = min(ends, default=0.0), max(ends, default=0.0)
            steps = range(math.floor(low / LEVEL_M), math.ceil(high / LEVEL_M) + 1)
            self._heights_m = sorted((LEVEL_M * step for step in steps), key=abs)
        return self._heights_m


def _aside(transform: Any, right_m: float, yaw_deg: float) -> Any:
    at, yaw = transform.location, math.radians(transform.rotation.yaw)
    x, y = at.x - right_m * math.sin(yaw), at.y + right_m * math.cos(yaw)
    turned = carla.Rotation(transform.rotation.pitch, transform.rotation.yaw + yaw_deg, 0.0)
    return carla.Transform(carla.Location(x, y, at.z), turned)
