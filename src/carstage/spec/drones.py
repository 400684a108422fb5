"""Drones: agents that fly a path, and where on it they are at a time.

Nothing here has dynamics: a path gives a place for each time, and a gimbal a direction. Angles and
places are in CARLA's left-handed world axes, metres and degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import atan2, cos, degrees, hypot, radians, sin
from typing import Dict, List, NamedTuple, Optional, Tuple, Type, Union

from carstage.spec.fields import Fields, SpecError
from carstage.spec.plain import LEFT_OUT
from carstage.spec.values import Value

Point = Tuple[float, float, float]
"""x, y, z (m)."""

WAYPOINTS = "waypoints"
ORBIT = "orbit"
FOLLOW_EGO = "follow"
FASTEST_DRONE_M_S = 100.0
HEADING_AHEAD_S = 1.0
"""A drone on a path of waypoints heads for where it will be after this time.

Where that is straight above or below, it heads as on the next level leg, else the last one.
"""
STEEPEST_DEG = 89.9
"""Of a gimbal: at 90 degrees yaw and roll turn about one axis, which servers tell differently."""
_LEVEL_M = 1e-6


class EgoPlace(NamedTuple):
    """Where the ego is: m, and degrees of its heading."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float


class Wanted(NamedTuple):
    """Where a path wants its drone: place (m) and heading (degrees)."""

    place: Point
    heading_deg: float


@dataclass(frozen=True, eq=False, repr=False)
class WaypointsSpec(Value):
    """Straight legs from point to point at one speed; at the last one the drone hovers.

    Attributes:
        points: at least two, none as the one before it.
        speed_m_s: along the legs.
        loop: from the last point back to the first, again and again.
    """

    points: Tuple[Point, ...]
    speed_m_s: float
    loop: bool = field(default=False, metadata=LEFT_OUT)
    kind: str = WAYPOINTS

    @classmethod
    def read(cls, fields: Fields) -> WaypointsSpec:
        """Check and read the section."""
        points = tuple(_point(fields, "points", i) for i in range(len(fields.list("points"))))
        if len(points) < 2 or any(_apart(*leg) == 0.0 for leg in zip(points, points[1:])):
            raise SpecError("%s: must be two different points or more." % fields.path("points"))
        return cls(points, _speed(fields), "loop" in fields and fields.flag("loop"))

    @property
    def follows_ego(self) -> bool:
        """Whether the path depends on where the ego is."""
        return False

    def at(self, time_s: float, ego: Optional[EgoPlace] = None) -> Wanted:
        """Where the drone is after a time; ``ego`` is not looked at."""
        del ego
        here = self._along(self.speed_m_s * time_s)
        there = self._along(self.speed_m_s * (time_s + HEADING_AHEAD_S))
        if hypot(there[0] - here[0], there[1] - here[1]) > _LEVEL_M:
            return Wanted(here, _heading_deg(here, there))
        legs, (now, _) = self._legs, self._leg_at(self.speed_m_s * time_s)
        nearest = [*legs[now:], *(legs[:now] if self.loop else reversed(legs[:now]))]
        level = [leg for leg in nearest if hypot(leg[1][0] - leg[0][0], leg[1][1] - leg[0][1])]
        return Wanted(here, _heading_deg(*level[0]) if level else 0.0)

    @property
    def _legs(self) -> List[Tuple[Point, Point]]:
        closing = [(self.points[-1], self.points[0])] if self.loop else []
        return [*zip(self.points, self.points[1:]), *closing]

    def _leg_at(self, way_m: float) -> Tuple[int, float]:
        """The leg at a length of the path, and which share of it is behind the drone."""
        lengths = [_apart(*leg) for leg in self._legs]
        if self.loop:
            way_m %= sum(lengths)
        for number, length in enumerate(lengths):
            if way_m < length:
                return number, way_m / length
            way_m -= length
        return len(lengths) - 1, 1.0

    def _along(self, way_m: float) -> Point:
        """The point at a length of the path."""
        number, share = self._leg_at(way_m)
        begin, end = self._legs[number]
        if share == 1.0:
            return end
        x, y, z = (a + share * (b - a) for a, b in zip(begin, end))
        return (x, y, z)


@dataclass(frozen=True, eq=False, repr=False)
class OrbitSpec(Value):
    """A circle in one height around a point of the map, or around the ego.

    Attributes:
        radius_m: of the circle.
        height_m: above the point or the ego.
        speed_m_s: along the circle, as seen from its middle.
        start_deg: where it begins: 0 is +x of the map, 90 is +y.
        clockwise: as seen from above; else against it.
        center: the point; None: the ego.
    """

    radius_m: float
    height_m: float
    speed_m_s: float
    start_deg: float = 0.0
    clockwise: bool = True
    center: Optional[Point] = field(default=None, metadata=LEFT_OUT)
    kind: str = ORBIT

    @classmethod
    def read(cls, fields: Fields) -> OrbitSpec:
        """Check and read the section."""
        return cls(
            radius_m=fields.number("radius_m", 0.0),
            height_m=fields.number("height_m"),
            speed_m_s=_speed(fields),
            start_deg=fields.number("start_deg"),
            clockwise=fields.flag("clockwise"),
            center=_point(fields, "center") if "center" in fields else None,
        )

    @property
    def follows_ego(self) -> bool:
        """Whether the path depends on where the ego is."""
        return self.center is None

    def at(self, time_s: float, ego: Optional[EgoPlace] = None) -> Wanted:
        """Where the drone is after a time, with the ego there."""
        middle = self.center
        if middle is None:
            assert ego is not None
            middle = (ego.x_m, ego.y_m, ego.z_m)
        # +y is to the right of +x, so angles grow clockwise as seen from above.
        turn = 1.0 if self.clockwise else -1.0
        angle_deg = self.start_deg + turn * degrees(self.speed_m_s * time_s / self.radius_m)
        angle = radians(angle_deg)
        place = (
            middle[0] + self.radius_m * cos(angle),
            middle[1] + self.radius_m * sin(angle),
            middle[2] + self.height_m,
        )
        return Wanted(place, (angle_deg + turn * 90.0) % 360.0)


@dataclass(frozen=True, eq=False, repr=False)
class FollowSpec(Value):
    """A place that goes along with the ego.

    Attributes:
        x_m: ahead of the ego; negative: behind it.
        y_m: to its right.
        height_m: above it.
    """

    x_m: float
    y_m: float
    height_m: float
    kind: str = FOLLOW_EGO

    @classmethod
    def read(cls, fields: Fields) -> FollowSpec:
        """Check and read the section."""
        return cls(
            x_m=fields.number("x_m"), y_m=fields.number("y_m"), height_m=fields.number("height_m")
        )

    @property
    def follows_ego(self) -> bool:
        """Whether the path depends on where the ego is."""
        return True

    def at(self, time_s: float, ego: Optional[EgoPlace] = None) -> Wanted:
        """Where the drone is wanted, with the ego there; ``time_s`` does not matter."""
        del time_s
        assert ego is not None
        yaw = radians(ego.yaw_deg)
        place = (
            ego.x_m + self.x_m * cos(yaw) - self.y_m * sin(yaw),
            ego.y_m + self.x_m * sin(yaw) + self.y_m * cos(yaw),
            ego.z_m + self.height_m,
        )
        return Wanted(place, ego.yaw_deg)


DronePath = Union[WaypointsSpec, OrbitSpec, FollowSpec]
DRONE_PATHS: Dict[str, Type[DronePath]] = {
    WAYPOINTS: WaypointsSpec,
    ORBIT: OrbitSpec,
    FOLLOW_EGO: FollowSpec,
}


@dataclass(frozen=True, eq=False, repr=False)
class GimbalSpec(Value):
    """Where what carries the sensors is turned to; it is always level from side to side.

    Attributes:
        pitch_deg: positive: up.
        yaw_deg: from the drone's heading, positive: to the right.
        look_at_ego: it is turned to the ego, whatever the angles.
        look_at: or to a point of the map.
    """

    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    look_at_ego: bool = field(default=False, metadata=LEFT_OUT)
    look_at: Optional[Point] = field(default=None, metadata=LEFT_OUT)

    @classmethod
    def read(cls, fields: Fields) -> GimbalSpec:
        """Check and read the section."""
        return cls(
            pitch_deg=fields.number("pitch_deg", least=-90.0, most=90.0),
            yaw_deg=fields.number("yaw_deg"),
            look_at_ego="look_at_ego" in fields and fields.flag("look_at_ego"),
            look_at=_point(fields, "look_at") if "look_at" in fields else None,
        )

    def direction(
        self, place: Point, heading_deg: float, ego: Optional[EgoPlace]
    ) -> Tuple[float, float]:
        """Pitch and yaw (degrees) at a place, for a drone of that heading."""
        target = self.look_at
        if self.look_at_ego:
            assert ego is not None
            target = (ego.x_m, ego.y_m, ego.z_m)
        if target is None:
            return _not_upright(self.pitch_deg), heading_deg + self.yaw_deg
        level_m = hypot(target[0] - place[0], target[1] - place[1])
        yaw_deg = _heading_deg(place, target) if level_m > _LEVEL_M else heading_deg
        return _not_upright(degrees(atan2(target[2] - place[2], level_m))), yaw_deg


@dataclass(frozen=True, eq=False, repr=False)
class DroneSpec(Value):
    """How a drone flies and where its gimbal is turned to.

    Attributes:
        path: where it is wanted at each time; the clock begins with the first recorded step.
        gimbal: what carries the sensors.
        max_speed_m_s: over ground; it lags behind where its path asks for more.
    """

    path: DronePath
    gimbal: GimbalSpec
    max_speed_m_s: float

    @classmethod
    def read(cls, fields: Fields) -> DroneSpec:
        """Check and read the section."""
        path = fields.object("path")
        kind = DRONE_PATHS[path.text("kind", tuple(DRONE_PATHS))]
        return cls(
            path=kind.read(path),
            gimbal=GimbalSpec.read(fields.object("gimbal")),
            max_speed_m_s=fields.number("max_speed_m_s", 0.0, most=FASTEST_DRONE_M_S),
        )

    @property
    def looks_at_ego(self) -> bool:
        """Whether path or gimbal need to know where the ego is."""
        return self.path.follows_ego or self.gimbal.look_at_ego


def _point(fields: Fields, name: str, index: Optional[int] = None) -> Point:
    values, path = fields.list(name), fields.path(name)
    if index is not None:
        values, path = values[index], "%s[%d]" % (path, index)
    if not isinstance(values, list) or len(values) != 3:
        raise SpecError("%s: must be [x, y, z]." % path)
    given = Fields({"[%d]" % i: value for i, value in enumerate(values)}, path)
    return given.number("[0]"), given.number("[1]"), given.number("[2]")


def _speed(fields: Fields) -> float:
    return fields.number("speed_m_s", 0.0, most=FASTEST_DRONE_M_S)


def _apart(one: Point, other: Point) -> float:
    return hypot(hypot(other[0] - one[0], other[1] - one[1]), other[2] - one[2])


def _not_upright(pitch_deg: float) -> float:
    return max(-STEEPEST_DEG, min(STEEPEST_DEG, pitch_deg))


def _heading_deg(here: Point, there: Point) -> float:
    return degrees(atan2(there[1] - here[1], there[0] - here[0]))
