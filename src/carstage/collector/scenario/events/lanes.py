"""Lanes beside a place on the road."""

from __future__ import annotations

from typing import Any, List, Optional, Tuple

import carla

MOST_LANES = 12


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


def lane_beside(lane: Any, side: str, place: Any) -> Any:
    """The lane beside; the side is that of ``place``, whose direction the lane may not have."""
    turned = lane.lane_id * place.lane_id < 0
    to_the_right = (side == "right") != turned
    return lane.get_right_lane() if to_the_right else lane.get_left_lane()


def lanes_over(place: Any, left: int, number: Optional[int] = None) -> Optional[Tuple[Any, float]]:
    """A lane some lanes from a waypoint, and how far to the right its middle is.

    Args:
        place: the waypoint; sides are those of its direction.
        left: so many lanes to the left; below 0: to the right.
        number: of the lane on its road; ``left`` does not count then.

    Returns:
        None where there is no such lane.
    """
    if number == place.lane_id or (number is None and left == 0):
        return place, 0.0
    sides = ("left", "right") if number is not None else ("left" if left > 0 else "right",)
    for side in sides:
        lane, over_m = place, 0.0
        for count in range(1, MOST_LANES):
            beside = lane_beside(lane, side, place)
            if beside is None:
                break
            over_m += 0.5 * float(lane.lane_width + beside.lane_width)
            lane = beside
            if lane.lane_id == number or (number is None and count == abs(left)):
                return lane, over_m if side == "right" else -over_m
    return None
