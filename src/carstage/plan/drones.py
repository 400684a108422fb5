"""Drones as their specification says them."""

from __future__ import annotations

from carstage.config.drones import DroneFlight, FollowPath, Gimbal, MapPoint, WaypointsPath
from carstage.spec import DroneSpec, FollowSpec, GimbalSpec, OrbitSpec, WaypointsSpec
from carstage.spec.drones import DronePath

_PITCH_DEG = -45.0


def plan_drone(asked: DroneFlight) -> DroneSpec:
    """How a drone flies, as the specification has it."""
    return DroneSpec(
        path=_path(asked), gimbal=_gimbal(asked.gimbal), max_speed_m_s=asked.max_speed_m_s
    )


def _path(asked: DroneFlight) -> DronePath:
    path = asked.path
    if isinstance(path, WaypointsPath):
        points = tuple(_point(point) for point in path.points)
        return WaypointsSpec(points=points, speed_m_s=path.speed_m_s, loop=path.loop)
    if isinstance(path, FollowPath):
        return FollowSpec(x_m=path.x + 0.0, y_m=path.y + 0.0, height_m=path.height_m + 0.0)
    return OrbitSpec(
        radius_m=path.radius_m,
        height_m=path.height_m + 0.0,
        speed_m_s=path.speed_m_s,
        start_deg=path.start_deg + 0.0,
        clockwise=path.clockwise,
        center=None if path.center == "ego" else _point(path.center),
    )


def _gimbal(asked: Gimbal) -> GimbalSpec:
    target = asked.look_at
    if target is None:
        pitch_deg = _PITCH_DEG if asked.pitch_deg is None else asked.pitch_deg
        return GimbalSpec(pitch_deg + 0.0, (asked.yaw_deg or 0.0) + 0.0)
    if target == "ego":
        return GimbalSpec(look_at_ego=True)
    return GimbalSpec(look_at=_point(target))


def _point(point: MapPoint) -> tuple[float, float, float]:
    """A place with 0.0 for -0.0: one place must not have two ids."""
    x, y, z = (value + 0.0 for value in point)
    return (x, y, z)
