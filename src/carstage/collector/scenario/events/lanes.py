"""Lanes beside a place on the road."""

from __future__ import annotations

from typing import Any, List, Optional, Tuple

import carla


def lanes_beside(place: Any) -> List[Tuple[Any, int]]:
    """Lanes beside a waypoint that lead the same way: left ones (-1) first, right ones (1)."""
    found = []
    for lane, side in ((place.get_left_lane(), -1), (place.get_right_lane(), 1)):
        same_way = lane is not None and lane.lane_id * place.lane_id > 0
        if same_way and lane.lane_type == carla.LaneType.Driving:
            found.append((lane, side))
    return found


def oncoming_lane(place: Any) -> Optional[Any]:
    """The lane to the left of a waypoint if it is one of the traffic that comes towards it."""
    lane = place.get_left_lane()
    if lane is None or lane.lane_id * place.lane_id > 0:
        return None
    return lane if lane.lane_type == carla.LaneType.Driving else None
