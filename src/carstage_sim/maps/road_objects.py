"""Objects of an OpenDRIVE file that are painted on the road.

The client knows crosswalks alone, and of those not all: it moves them by the lane offset of their
road, and does not say where an outline ends that is not closed. Arrows are told by RoadRunner's
names (CARLA's towns are made with it), whose types are those of California's Standard Plan A24A, or
by the subtype that ASAM OpenDRIVE 1.8 gives arrows.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from lxml import etree

Place = tuple[float, float, float]
ReferenceAt = Callable[[float], tuple[Place, float] | None]
"""Place and heading (rad) of a road's reference line at a station, in CARLA's frame."""

_ARROW = re.compile(r"stencil_arrowtype([1-8])(?:short|medium|long)?([lrb]?)", re.IGNORECASE)
_ARROW_WAYS = re.compile(r"arrow((?:left|straight|right)+)", re.IGNORECASE)
_SIDES = {"l": {"left"}, "r": {"right"}, "b": {"left", "right"}, "": set[str]()}
_ALL_WAYS = {"left", "straight", "right"}
_LONGEST_ARROW_M = 30.0
_CORNERS = ("cornerLocal", "cornerRoad")


def arrow_ways(element: etree._Element) -> list[str]:
    """Where an arrow leads, of left, right and straight; empty: it is none, or of unknown shape."""
    named = _ARROW.fullmatch(element.get("name", ""))
    if named:
        side = _SIDES[named[2].lower()]
        ways = {"1": {"straight"}, "4": side, "7": side | {"straight"}, "8": _ALL_WAYS}
        return sorted(ways.get(named[1], set()))
    found = _ARROW_WAYS.fullmatch(element.get("subtype", ""))
    return sorted(way for way in _ALL_WAYS if found and way in found[1].lower())


def lane_offset(road: etree._Element, s_m: float) -> tuple[float, float]:
    """How far the middle lane is to the left of the reference line (m), and its slope."""
    value, slope, begin = 0.0, 0.0, -math.inf
    for element in road.iterfind("lanes/laneOffset"):
        s, a, b, c, d = (number_of(element, name) for name in ("s", "a", "b", "c", "d"))
        if begin <= s <= s_m:
            begin, ds = s, s_m - s
            value = a + ds * (b + ds * (c + ds * d))
            slope = b + ds * (2.0 * c + ds * 3.0 * d)
    return value, slope


def arrow(element: etree._Element, reference_at: ReferenceAt) -> dict[str, Any] | None:
    """The record of an arrow, see ``signals.PaintedArrow``; None: it is none that can be drawn."""
    ways = arrow_ways(element)
    sides = sorted(number_of(element, name) for name in ("width", "length"))
    pose = _beside(element, reference_at)
    if not ways or sides[0] <= 0.0 or sides[1] > _LONGEST_ARROW_M or pose is None:
        return None
    place, heading = pose
    return {
        "ways": ways,
        "location": place,
        "yaw_deg": math.degrees(heading),
        "length_m": sides[1],
        "width_m": sides[0],
    }


def crosswalk(element: etree._Element, reference_at: ReferenceAt) -> list[Place]:
    """The corners of a crosswalk: of its first outline, else of its length and width."""
    pose = _beside(element, reference_at)
    if element.get("type", "").lower() != "crosswalk" or pose is None:
        return []
    outlines = [*element.iterfind("outline"), *element.iterfind("outlines/outline")]
    corners = [corner for outline in outlines[:1] for corner in outline.iter(*_CORNERS)]
    if not corners:
        u, v = number_of(element, "length") / 2, number_of(element, "width") / 2
        return [_turned(pose, a * u, b * v, 0.0) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    found = []
    for corner in corners:
        if corner.tag == "cornerLocal":
            found.append(_turned(pose, *(number_of(corner, name) for name in "uvz")))
        elif (there := _beside(corner, reference_at)) is not None:
            (x, y, z), _ = there
            found.append((x, y, z + number_of(corner, "dz")))
    return found


def _beside(element: etree._Element, reference_at: ReferenceAt) -> tuple[Place, float] | None:
    """Place and heading of what has a station and a distance from the reference line."""
    reference = reference_at(number_of(element, "s"))
    if reference is None:
        return None
    place, heading = reference
    # OpenDRIVE turns to the left, CARLA to the right.
    return to_left(place, heading, number_of(element, "t")), heading - number_of(element, "hdg")


def to_left(place: Place, heading: float, distance_m: float) -> Place:
    """A place at the left of another one, in CARLA's frame."""
    x, y, z = place
    return x + distance_m * math.sin(heading), y - distance_m * math.cos(heading), z


def _turned(pose: tuple[Place, float], u: float, v: float, above: float) -> Place:
    """A corner of an object, ``u`` ahead of its place, ``v`` to the left."""
    (x, y, z), heading = pose
    c, s = math.cos(heading), math.sin(heading)
    return x + u * c + v * s, y + u * s - v * c, z + above


def number_of(element: etree._Element, name: str) -> float:
    """A number of an attribute; 0 where it is none, as the client's reader has it."""
    try:
        value = float(element.get(name, "0"))
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0
