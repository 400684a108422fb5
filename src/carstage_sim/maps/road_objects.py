"""Objects of an OpenDRIVE file that are painted on the road, and where the client puts them.

The client knows crosswalks alone, and moves them by the lane offset of their road. What else is
painted is told by RoadRunner's names (CARLA's towns are made with it), whose types of arrows are
those of California's Standard Plan A24A, or by the subtype that ASAM OpenDRIVE 1.8 gives arrows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

from lxml import etree

Place = tuple[float, float, float]
MiddleAt = Callable[[float], tuple[Place, float] | None]
"""Place and heading (rad) of the road's middle at a station, in CARLA's frame."""

_ARROW = re.compile(r"stencil_arrowtype([1-8])(?:short|medium|long)?([lrb]?)", re.IGNORECASE)
_ARROW_WAYS = re.compile(r"arrow((?:left|straight|right)+)", re.IGNORECASE)
_SIDES = {"l": {"left"}, "r": {"right"}, "b": {"left", "right"}, "": set[str]()}
_ALL_WAYS = {"left", "straight", "right"}
_NO_OFFSET_M = 1e-6
_LONGEST_ARROW_M = 30.0
_SAME_CORNER_M = 0.05


def arrow_ways(element: etree._Element) -> list[str]:
    """Where an arrow leads, of left, right and straight; empty: it is none, or of unknown shape."""
    named = _ARROW.fullmatch(element.get("name", ""))
    if named:
        side = _SIDES[named[2].lower()]
        ways = {"1": {"straight"}, "4": side, "7": side | {"straight"}, "8": _ALL_WAYS}
        return sorted(ways.get(named[1], set()))
    found = _ARROW_WAYS.fullmatch(element.get("subtype", ""))
    return sorted(way for way in _ALL_WAYS if found and way in found[1].lower())


def lane_offset_m(road: etree._Element, s_m: float) -> float:
    """How far the middle lane is to the left of the reference line."""
    value, begin = 0.0, -math.inf
    for element in road.iterfind("lanes/laneOffset"):
        s, a, b, c, d = (number_of(element, name) for name in ("s", "a", "b", "c", "d"))
        if begin <= s <= s_m:
            begin, ds = s, s_m - s
            value = a + ds * (b + ds * (c + ds * d))
    return value


def arrow(
    road: etree._Element, element: etree._Element, middle_at: MiddleAt
) -> dict[str, Any] | None:
    """The record of an arrow, see ``signals.PaintedArrow``; None: it is none that can be drawn."""
    ways = arrow_ways(element)
    sides = sorted(number_of(element, name) for name in ("width", "length"))
    middle = middle_at(number_of(element, "s"))
    if not ways or sides[0] <= 0.0 or sides[1] > _LONGEST_ARROW_M or middle is None:
        return None
    place, heading = _beside(road, element, middle)
    return {
        "ways": ways,
        "location": place,
        "yaw_deg": math.degrees(heading),
        "length_m": sides[1],
        "width_m": sides[0],
    }


def crosswalk_shifts(
    road: etree._Element, middle_at: MiddleAt
) -> list[tuple[Place, tuple[float, float]]]:
    """Of crosswalks that the client moves: where it puts the first corner, and by how much.

    It takes the road's middle for its reference line.
    """
    found = []
    for element in road.iterfind("objects/object"):
        corner = element.find("outline/cornerLocal")
        if element.get("type") != "crosswalk" or corner is None:
            continue
        s_m = number_of(element, "s")
        offset, middle = lane_offset_m(road, s_m), middle_at(s_m)
        if abs(offset) < _NO_OFFSET_M or middle is None:
            continue
        heading = middle[1]
        (x, y, z), turned = _beside(road, element, middle)
        u, v = number_of(corner, "u"), number_of(corner, "v")
        # To the left is towards negative y where the heading is that of x.
        left = (math.sin(heading), -math.cos(heading))
        shift = (offset * left[0], offset * left[1])
        c, s = math.cos(turned), math.sin(turned)
        first = (x + u * c + v * s + shift[0], y + u * s - v * c + shift[1], z)
        found.append((first, shift))
    return found


def unshifted(
    corners: Sequence[Place], shifts: Sequence[tuple[Place, tuple[float, float]]]
) -> list[Place]:
    """Closed outlines, one after the other, moved back to where OpenDRIVE has them."""
    result: list[Place] = []
    begin = 0
    for index, (x, y, _) in enumerate(corners):
        first = corners[begin]
        if index <= begin + 2 or math.dist((x, y), first[:2]) > 1e-3:
            continue
        moved = [
            shift for place, shift in shifts if math.dist(place[:2], first[:2]) < _SAME_CORNER_M
        ]
        by = moved[0] if moved else (0.0, 0.0)
        result += [(a - by[0], b - by[1], c) for a, b, c in corners[begin : index + 1]]
        begin = index + 1
    return [*result, *corners[begin:]]


def _beside(
    road: etree._Element, element: etree._Element, middle: tuple[Place, float]
) -> tuple[Place, float]:
    """Place and heading of an object, from the road's middle at its station."""
    (x, y, z), heading = middle
    to_left = number_of(element, "t") - lane_offset_m(road, number_of(element, "s"))
    place = (x + to_left * math.sin(heading), y - to_left * math.cos(heading), z)
    # OpenDRIVE turns to the left, CARLA to the right.
    return place, heading - number_of(element, "hdg")


def number_of(element: etree._Element, name: str) -> float:
    """A number of an attribute; 0 where it is none, as the client's reader has it."""
    try:
        value = float(element.get(name, "0"))
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0
