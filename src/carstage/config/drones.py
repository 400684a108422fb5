"""How drones fly, and where their gimbals are turned to."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Strict, model_validator

from carstage.config.fields import Section, problem, setting
from carstage.spec.drones import FASTEST_DRONE_M_S

_FARTHEST_M = 100_000.0
_Coordinate = Annotated[float, Field(ge=-_FARTHEST_M, le=_FARTHEST_M)]
MapPoint = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], Strict(strict=False)]
"""x, y, z on the map (m)."""


def _speed() -> float:
    number: float = setting(
        8.0, title="Speed", description="Along the path.", unit="m/s", group="rig",
        gt=0, le=FASTEST_DRONE_M_S,
    )  # fmt: skip
    return number


def _height(sentence: str) -> float:
    number: float = setting(
        40.0, title="Height", description=sentence, unit="m", group="rig",
        ge=-_FARTHEST_M, le=_FARTHEST_M,
    )  # fmt: skip
    return number


class WaypointsPath(Section):
    """Straight legs from point to point at one speed; the drone hovers at the last one."""

    kind: Literal["waypoints"] = setting(
        title="Path", description="From point to point.", group="rig"
    )
    points: Annotated[tuple[MapPoint, ...], Strict(strict=False)] = setting(
        title="Points",
        description="At least two places `[x, y, z]` on the map, in CARLA's axes.",
        unit="m",
        group="rig",
        min_length=2,
        max_length=10_000,
    )
    speed_m_s: float = _speed()
    loop: bool = setting(
        False,
        title="Loop",
        description="From the last point back to the first, again and again.",
        group="rig",
    )

    @model_validator(mode="after")
    def _check_legs(self) -> WaypointsPath:
        for position, (one, other) in enumerate(zip(self.points, self.points[1:], strict=False)):
            if one == other:
                raise problem("is the point before it.", "Leave it out.", "points", position + 1)
        if self.loop and self.points[0] == self.points[-1]:
            raise problem(
                "a loop flies back to the first point by itself.",
                "Leave the last one out.",
                "points",
                len(self.points) - 1,
            )
        return self


class OrbitPath(Section):
    """A circle in one height."""

    kind: Literal["orbit"] = setting(title="Path", description="A circle.", group="rig")
    center: Literal["ego"] | MapPoint = setting(
        "ego",
        title="Middle",
        description="`ego`, or a place `[x, y, z]` on the map.",
        group="rig",
    )
    radius_m: float = setting(
        30.0, title="Radius", description="Of the circle.", unit="m", group="rig", gt=0, le=10_000
    )
    height_m: float = _height("Above the middle.")
    speed_m_s: float = _speed()
    start_deg: float = setting(
        0.0,
        title="Begin",
        description="Where on the circle it begins: 0 is +x of the map, 90 is +y.",
        unit="deg",
        group="rig",
        ge=-360,
        le=360,
    )
    clockwise: bool = setting(
        True, title="Clockwise", description="As seen from above.", group="rig"
    )


class FollowPath(Section):
    """A place that goes along with the ego, as far as the greatest speed allows."""

    kind: Literal["follow"] = setting(title="Path", description="With the ego.", group="rig")
    x: float = setting(
        -15.0, title="x", description="Ahead of the ego; negative: behind it.", unit="m",
        group="rig", ge=-10_000, le=10_000,
    )  # fmt: skip
    y: float = setting(
        0.0, title="y", description="To its right.", unit="m", group="rig", ge=-10_000, le=10_000
    )
    height_m: float = _height("Above the ego.")


DronePath = Annotated[WaypointsPath | OrbitPath | FollowPath, Discriminator("kind")]
DRONE_PATH_KINDS = ("waypoints", "orbit", "follow")


class Gimbal(Section):
    """Where a drone's sensors are turned to; always level from side to side."""

    pitch_deg: float | None = setting(
        None,
        title="Pitch",
        description="Positive: up; left out: -45, or what look_at makes it.",
        unit="deg",
        group="rig",
        ge=-90,
        le=90,
    )
    yaw_deg: float | None = setting(
        None,
        title="Yaw",
        description="From the heading, positive: to the right; left out: 0, or as look_at.",
        unit="deg",
        group="rig",
        ge=-360,
        le=360,
    )
    look_at: Literal["ego"] | MapPoint | None = setting(
        None,
        title="Look at",
        description="`ego`, or a place `[x, y, z]` on the map, in place of the angles.",
        group="rig",
    )

    @model_validator(mode="after")
    def _check_target(self) -> Gimbal:
        for name in ("pitch_deg", "yaw_deg"):
            if self.look_at is not None and getattr(self, name) is not None:
                raise problem("look_at says where to.", "Leave one of them out.", name)
        return self


class DroneFlight(Section):
    """How a drone flies."""

    path: DronePath = setting(
        title="Path", description="`waypoints`, `orbit` or `follow`.", group="rig"
    )
    gimbal: Gimbal = setting(
        Gimbal, title="Gimbal", description="Where the sensors are turned to.", group="rig"
    )
    max_speed_m_s: float = setting(
        20.0,
        title="Greatest speed",
        description="Over ground; the drone lags behind where its path asks for more.",
        unit="m/s",
        group="rig",
        gt=0,
        le=FASTEST_DRONE_M_S,
    )

    @model_validator(mode="after")
    def _check_speed(self) -> DroneFlight:
        path = self.path
        if not isinstance(path, FollowPath) and path.speed_m_s > self.max_speed_m_s:
            raise problem(
                f"{path.speed_m_s:g} m/s is more than max_speed_m_s, {self.max_speed_m_s:g}.",
                "Fly slower, or give a larger max_speed_m_s.",
                "path", "speed_m_s",
            )  # fmt: skip
        return self
