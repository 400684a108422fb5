"""Where everybody was in the last step, and how far and how near they came."""

from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, NamedTuple, Tuple

from carstage.spec.storyboard import EUCLIDEAN, LONGITUDINAL

STANDS_M_S = 0.1
"""Who is slower stands."""

Point = Tuple[float, float]


class Body(NamedTuple):
    """A road user on the ground: its origin, heading, velocity and box.

    ``middle``: of the box. ``half_m``: half its length and half its width. ``yaw``: radians.
    """

    at: Point
    yaw: float
    velocity: Point
    middle: Point
    half_m: Point

    @property
    def corners(self) -> List[Point]:
        """Of the box, one after the other."""
        length, width = self.half_m
        signs = ((1, 1), (1, -1), (-1, -1), (-1, 1))
        return [_beside(self.middle, self.yaw, a * length, b * width) for a, b in signs]

    @property
    def speed_m_s(self) -> float:
        """How fast."""
        return math.hypot(*self.velocity)


def body_of(actor: Any) -> Body:
    """What the client knows of an actor since the last step."""
    transform, velocity, box = actor.get_transform(), actor.get_velocity(), actor.bounding_box
    at = (transform.location.x, transform.location.y)
    yaw = math.radians(transform.rotation.yaw)
    middle = _beside(at, yaw, box.location.x, box.location.y)
    return Body(at, yaw, (velocity.x, velocity.y), middle, (box.extent.x, box.extent.y))


def body_at(transform: Any) -> Body:
    """A place, as a body without extent that stands."""
    at = (transform.location.x, transform.location.y)
    return Body(at, math.radians(transform.rotation.yaw), (0.0, 0.0), at, (0.0, 0.0))


class RoadUsers:
    """All entities of a storyboard.

    Args:
        actors: ``carla.Actor`` by name.
        step_s: simulated time of a step.
    """

    def __init__(self, actors: Mapping[str, Any], step_s: float) -> None:
        self._actors = actors
        self._step_s = step_s
        self._bodies: Dict[str, Body] = {}
        self._traveled_m = dict.fromkeys(actors, 0.0)
        self._still_s = dict.fromkeys(actors, 0.0)

    def look(self) -> None:
        """Take in the last step; called once after each."""
        for name, actor in self._actors.items():
            body, before = body_of(actor), self._bodies.get(name)
            self._bodies[name] = body
            if before is not None:
                self._traveled_m[name] += math.dist(body.at, before.at)
                stands = body.speed_m_s < STANDS_M_S
                self._still_s[name] = self._still_s[name] + self._step_s if stands else 0.0

    def body(self, name: str) -> Body:
        """Where somebody is."""
        return self._bodies[name]

    def transform(self, name: str) -> Any:
        """``carla.Transform`` of somebody."""
        return self._actors[name].get_transform()

    def traveled_m(self, name: str) -> float:
        """How far somebody came since the first step."""
        return self._traveled_m[name]

    def still_s(self, name: str) -> float:
        """How long somebody has stood."""
        return self._still_s[name]


def distance_m(one: Body, other: Body, measure: str, freespace: bool) -> float:
    """How far it is from one to another.

    Args:
        one: along whose heading, or across it, is measured.
        other: to whom.
        measure: ``euclidean``, ``longitudinal`` or ``lateral``.
        freespace: between the boxes; else between the origins.
    """
    if measure == EUCLIDEAN:
        return _gap_m(one, other) if freespace else math.dist(one.at, other.at)
    if not freespace:
        return abs(_along(one, other.at, measure))
    reach_m = one.half_m[0 if measure == LONGITUDINAL else 1]
    ends = [_along(one._replace(at=one.middle), corner, measure) for corner in other.corners]
    return max(min(ends) - reach_m, -max(ends) - reach_m, 0.0)


def closing_m_s(one: Body, other: Body, measure: str) -> float:
    """How fast one comes nearer to another by that measure; below 0: it goes away."""
    apart = (other.at[0] - one.at[0], other.at[1] - one.at[1])
    relative = (other.velocity[0] - one.velocity[0], other.velocity[1] - one.velocity[1])
    if measure == EUCLIDEAN:
        length_m = math.hypot(*apart)
        return -(apart[0] * relative[0] + apart[1] * relative[1]) / max(length_m, 1e-6)
    moved = (one.at[0] + relative[0], one.at[1] + relative[1])
    return -_along(one, moved, measure) * math.copysign(1.0, _along(one, other.at, measure))


def _along(one: Body, point: Point, measure: str) -> float:
    """How far a point is ahead of somebody, or to the right."""
    x, y = point[0] - one.at[0], point[1] - one.at[1]
    cos, sin = math.cos(one.yaw), math.sin(one.yaw)
    return x * cos + y * sin if measure == LONGITUDINAL else y * cos - x * sin


def _beside(at: Point, yaw: float, ahead_m: float, right_m: float) -> Point:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return at[0] + ahead_m * cos - right_m * sin, at[1] + ahead_m * sin + right_m * cos


def _gap_m(one: Body, other: Body) -> float:
    """Between two boxes on the ground; 0 where they overlap.

    They do where no side of either separates them (separating axis theorem).
    """
    first, second = one.corners, other.corners
    separated = False
    for yaw in (one.yaw, one.yaw + 0.5 * math.pi, other.yaw, other.yaw + 0.5 * math.pi):
        axis = (math.cos(yaw), math.sin(yaw))
        low, high = ([x * axis[0] + y * axis[1] for x, y in each] for each in (first, second))
        separated = separated or max(low) < min(high) or max(high) < min(low)
    if not separated:
        return 0.0
    pairs = [(corner, second) for corner in first] + [(corner, first) for corner in second]
    return min(
        _to_side_m(corner, box[i - 1], box[i]) for corner, box in pairs for i in range(len(box))
    )


def _to_side_m(point: Point, begin: Point, end: Point) -> float:
    side = (end[0] - begin[0], end[1] - begin[1])
    square = side[0] ** 2 + side[1] ** 2
    share = (point[0] - begin[0]) * side[0] + (point[1] - begin[1]) * side[1]
    share = min(max(share / square, 0.0), 1.0) if square > 0.0 else 0.0
    return math.dist(point, (begin[0] + share * side[0], begin[1] + share * side[1]))
