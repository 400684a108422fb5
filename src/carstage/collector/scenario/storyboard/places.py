"""Positions of a storyboard on the map."""

from __future__ import annotations

import math
from typing import Any, Callable

import carla

from carstage.collector.internals.errors import SceneError
from carstage.spec.storyboard import LanePlace, RelativeLanePlace, StoryPlace, WorldPlace

NEAR_LANE_M = 0.5
"""Beside a lane, so far from its edge, the ground is as high as the lane."""


class Places:
    """Finds positions.

    Args:
        world_map: ``carla.Map``.
        where: ``carla.Transform`` of an entity, by its name.
    """

    def __init__(self, world_map: Any, where: Callable[[str], Any]) -> None:
        self._map = world_map
        self._where = where

    def transform(self, place: StoryPlace) -> Any:
        """``carla.Transform`` of a position, on the ground where the map knows it.

        Raises:
            SceneError: the map has no such lane.
        """
        if isinstance(place, WorldPlace):
            at = carla.Location(place.x_m, place.y_m, place.z_m)
            at.z = self._ground_m(at)
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

    def _ground_m(self, at: Any) -> float:
        """Height of the lane at or beside a place; without one the place's own."""
        lane = self._map.get_waypoint(at, True, carla.LaneType.Any)
        if lane is None:
            return float(at.z)
        middle = lane.transform.location
        aside_m = math.hypot(middle.x - at.x, middle.y - at.y)
        is_near = aside_m <= 0.5 * lane.lane_width + NEAR_LANE_M
        return float(middle.z if is_near else at.z)


def _aside(transform: Any, right_m: float, yaw_deg: float) -> Any:
    at, yaw = transform.location, math.radians(transform.rotation.yaw)
    x, y = at.x - right_m * math.sin(yaw), at.y + right_m * math.cos(yaw)
    turned = carla.Rotation(transform.rotation.pitch, transform.rotation.yaw + yaw_deg, 0.0)
    return carla.Transform(carla.Location(x, y, at.z), turned)
