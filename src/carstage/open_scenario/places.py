"""Positions: in the world, of a lane, along the road from somebody."""

from __future__ import annotations

import math
from collections.abc import Container
from dataclasses import dataclass

from carstage.open_scenario.document import Element
from carstage.spec.storyboard import (
    MOST_LANES,
    LanePlace,
    RelativeLanePlace,
    StoryPlace,
    WorldPlace,
)

_KNOWN = ("WorldPosition", "LanePosition", "RelativeLanePosition")
_LONGEST_ROAD_M = 1e6
_MOST_ROADS = 1 << 31


@dataclass(frozen=True, slots=True)
class Axes:
    """Whose axes the file's numbers are in.

    CARLA's y points to the right of x and angles are clockwise; OpenSCENARIO's to the left of it.
    A description that begins with ``CARLA:`` means the former, as scenario_runner reads it.
    """

    is_carla: bool

    @property
    def sign(self) -> float:
        """Of y and of angles, from the file to CARLA."""
        return 1.0 if self.is_carla else -1.0

    def right_m(self, offset_m: float, lane: int) -> float:
        """To the right of a lane's direction of travel.

        Args:
            offset_m: in the file; OpenSCENARIO's is to the left of the road's reference line,
                whose direction lanes with numbers above 0 have not.
            lane: its number.
        """
        return offset_m if self.is_carla or lane > 0 else -offset_m


def read_position(position: Element, axes: Axes, entities: Container[str]) -> StoryPlace:
    """``Position``.

    Args:
        position: the element.
        axes: whose the file's are.
        entities: names of those that there are.

    Raises:
        ConfigError: it is of another kind, or wrong.
    """
    place = position.only(_KNOWN)
    if place.tag == "WorldPosition":
        place.allow("x y z h p r")
        for angle in ("p", "r"):
            if place.number(angle, 0.0) != 0.0:
                place.refuse(f"{angle} is not 0; the road decides how who stands on it leans")
        z_m = place.number("z") if place.text("z", "") else None
        y_m = axes.sign * place.number("y")
        return WorldPlace(place.number("x"), y_m, z_m, _degrees(place, axes))
    turned = place.maybe("Orientation")
    yaw_deg = 0.0 if turned is None else _turned_deg(turned, axes)
    if place.tag == "LanePosition":
        place.allow("roadId laneId s offset", "Orientation")
        lane = place.whole("laneId", -MOST_LANES, MOST_LANES)
        return LanePlace(
            place.whole("roadId", 0, _MOST_ROADS),
            lane,
            place.number("s", least=0.0, most=_LONGEST_ROAD_M),
            axes.right_m(place.number("offset", 0.0), lane),
            yaw_deg,
        )
    place.allow("entityRef dLane ds offset", "Orientation")
    other = entity_of(place, entities)
    offset_m = place.number("offset", 0.0)
    if offset_m != 0.0 and not axes.is_carla:
        place.refuse("its offset has a side only where the lane is known")
    return RelativeLanePlace(
        other,
        place.whole("dLane", -MOST_LANES, MOST_LANES),
        place.number("ds"),
        offset_m,
        yaw_deg,
    )


def entity_of(element: Element, entities: Container[str]) -> str:
    """``entityRef`` of an element: the name of somebody who is there.

    Raises:
        ConfigError: nobody has that name.
    """
    name = element.name("entityRef")
    if name not in entities:
        what = f"{name[:80]!r} cannot do that, is not there, or has no place yet"
        element.refuse(what, "Name another one of Entities, or one that is placed before.")
    return name


def _turned_deg(orientation: Element, axes: Axes) -> float:
    orientation.allow("type h p r")
    if orientation.text("type", "relative") != "relative":
        orientation.refuse("only a relative one is known to Car-STAGE here")
    return _degrees(orientation, axes)


def _degrees(element: Element, axes: Axes) -> float:
    return axes.sign * math.degrees(element.number("h", 0.0, least=-100.0, most=100.0))
