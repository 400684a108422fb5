"""Places on sidewalks for people who walk side by side."""

from __future__ import annotations

import random
from typing import Any, List, Tuple

import carla

SPACING_M = 0.8
"""From one to the next; CARLA's navigation takes each for a disc of 0.6 m."""
EDGE_M = 0.4
"""Between the middle of who walks outermost and the edge of the sidewalk."""
THREES = 0.25
"""Share of the groups that are of three; the others are pairs."""


def group_sizes(people: int, rng: random.Random) -> List[int]:
    """Sizes of the groups of so many people: pairs and threes; one who is left walks alone."""
    sizes: List[int] = []
    while people >= 2:
        sizes.append(3 if people == 3 or (people > 4 and rng.random() < THREES) else 2)
        people -= sizes[-1]
    return sizes


def abreast(world_map: Any, place: Any, size: int) -> Tuple[Any, ...]:
    """Places side by side across the sidewalk at a place; none where it is too narrow.

    Args:
        world_map: ``carla.Map``.
        place: ``carla.Location`` on a sidewalk.
        size: how many places.

    Returns:
        ``carla.Location`` of each, from the middle outwards.
    """
    lane = world_map.get_waypoint(place, True, carla.LaneType.Sidewalk)
    if lane is None:
        return ()
    room_m = 0.5 * lane.lane_width - EDGE_M - 0.5 * (size - 1) * SPACING_M
    middle, right = lane.transform.location, lane.transform.get_right_vector()
    aside_m = (place.x - middle.x) * right.x + (place.y - middle.y) * right.y
    if room_m < 0.0 or abs(aside_m) > 0.5 * lane.lane_width:
        return ()
    change_m = min(max(aside_m, -room_m), room_m) - aside_m
    steps = sorted((k - 0.5 * (size - 1) for k in range(size)), key=abs)
    return tuple(
        carla.Location(
            place.x + right.x * (change_m + step * SPACING_M),
            place.y + right.y * (change_m + step * SPACING_M),
            place.z,
        )
        for step in steps
    )
