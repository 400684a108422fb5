"""Rigs that ship with Car-STAGE, after well-known data sets, each with its source.

All but the last two stand on CARLA's vehicle: origin on the ground at the centre, x forward, y to
the right. Those for drones and junctions look along the agent's own direction. Data sets whose
origin is the rear axle are moved forward by half a wheelbase. LiDARs make one full sweep per step
whatever the frame rate; what a data set says in points per turn becomes rays per step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from math import atan, degrees
from typing import Any, Literal

import yaml

from carstage.config.sensors import SENSOR_KINDS, Sensor

RigPreset = Literal["demo", "kitti", "nuscenes", "waymo", "paper", "drone", "junction"]

_HALF_WHEELBASE_M = 1.4


@dataclass(frozen=True)
class PresetRig:
    """A rig that ships with Car-STAGE.

    Attributes:
        title: what it is, in a few words.
        source: where its numbers are from.
        make: makes the sensors as plain values.
    """

    title: str
    source: str
    make: Callable[[], list[dict[str, Any]]]

    def sensors(self) -> tuple[Sensor, ...]:
        """Its sensors."""
        return _checked(self.make)


@cache
def _checked(make: Callable[[], list[dict[str, Any]]]) -> tuple[Sensor, ...]:
    return tuple(SENSOR_KINDS[one["kind"]].model_validate(one, strict=False) for one in make())


def _demo() -> list[dict[str, Any]]:
    text = resources.files("carstage.config").joinpath("demo.yaml").read_text("utf-8")
    sensors: list[dict[str, Any]] = yaml.safe_load(text)["rig"]["sensors"]
    return sensors


def _sensor(
    name: str, kind: str, x: float, y: float, z: float, yaw_deg: float = 0.0, **attributes: Any
) -> dict[str, Any]:
    pose = {"x": round(x, 4), "y": y, "z": z, "yaw_deg": yaw_deg}
    return {"id": name, "kind": kind, "pose": pose, "attributes": attributes}


def _fov_deg(width_px: int, focal_px: float) -> float:
    """Horizontal field of view of a pinhole camera."""
    return round(degrees(2.0 * atan(width_px / 2.0 / focal_px)), 3)


def _kitti() -> list[dict[str, Any]]:
    """Two colour cameras 0.54 m apart, HDL-64E, OXTS; the pair's focal length is 721.5 px."""
    camera: dict[str, Any] = {"image_size": [1242, 375], "fov_deg": _fov_deg(1242, 721.5377)}
    return [
        _sensor("CAM_2", "rgb", 0.27, -0.06, 1.65, **camera),
        _sensor("CAM_3", "rgb", 0.27, 0.48, 1.65, **camera),
        _sensor(
            "VELODYNE", "lidar", 0.0, 0.0, 1.73, channels=64, range_m=120.0,
            upper_fov_deg=2.0, lower_fov_deg=-24.9,
        ),
        _sensor("OXTS_IMU", "imu", -0.81, 0.32, 0.93),
        _sensor("OXTS_GNSS", "gnss", -0.81, 0.32, 0.93),
    ]  # fmt: skip


def _nuscenes() -> list[dict[str, Any]]:
    """Six cameras, LiDAR, five radars, IMU, GNSS; y of the data set points left, ours right."""
    size = [1600, 900]
    narrow, wide = _fov_deg(1600, 1266.4), _fov_deg(1600, 809.2)
    rear = _HALF_WHEELBASE_M
    radar: dict[str, Any] = {"horizontal_fov_deg": 60.0, "vertical_fov_deg": 10.0, "range_m": 250.0}
    cameras = (
        ("CAM_FRONT", 1.701, -0.016, 1.511, 0.0, narrow),
        ("CAM_FRONT_RIGHT", 1.551, 0.493, 1.496, 55.0, narrow),
        ("CAM_BACK_RIGHT", 1.015, 0.481, 1.562, 110.0, narrow),
        ("CAM_BACK", 0.028, -0.003, 1.579, 180.0, wide),
        ("CAM_BACK_LEFT", 1.036, -0.485, 1.591, -110.0, narrow),
        ("CAM_FRONT_LEFT", 1.524, -0.495, 1.509, -55.0, narrow),
    )
    radars = (
        ("RADAR_FRONT", 3.412, 0.0, 0.5, 0.0),
        ("RADAR_FRONT_RIGHT", 2.422, 0.8, 0.77, 90.0),
        ("RADAR_BACK_RIGHT", -0.562, 0.618, 0.53, 180.0),
        ("RADAR_BACK_LEFT", -0.562, -0.628, 0.53, 180.0),
        ("RADAR_FRONT_LEFT", 2.422, -0.8, 0.78, -90.0),
    )
    return [
        *(
            _sensor(name, "rgb", x - rear, y, z, yaw, image_size=size, fov_deg=fov)
            for name, x, y, z, yaw, fov in cameras
        ),
        _sensor(
            "LIDAR_TOP", "lidar", 0.944 - rear, 0.0, 1.84, channels=32, range_m=100.0,
            upper_fov_deg=10.67, lower_fov_deg=-30.67,
        ),
        *(_sensor(name, "radar", x - rear, y, z, yaw, **radar) for name, x, y, z, yaw in radars),
        _sensor("IMU", "imu", 0.0, 0.0, 0.0),
        _sensor("GNSS", "gnss", 0.0, 0.0, 0.0),
    ]  # fmt: skip


def _waymo() -> list[dict[str, Any]]:
    """Five cameras of 50.4 degrees, a roof LiDAR and four short-range ones around the car."""
    rear = _HALF_WHEELBASE_M
    front, side = [1920, 1280], [1920, 1040]
    cameras = (
        ("FRONT", 1.54, 0.0, 0.0, front),
        ("FRONT_LEFT", 1.49, -0.1, -45.0, front),
        ("FRONT_RIGHT", 1.49, 0.1, 45.0, front),
        ("SIDE_LEFT", 1.43, -0.12, -90.0, side),
        ("SIDE_RIGHT", 1.43, 0.12, 90.0, side),
    )
    near: dict[str, Any] = {
        "channels": 64,
        "range_m": 20.0,
        "upper_fov_deg": 30.0,
        "lower_fov_deg": -90.0,
    }
    short_range = (
        ("LIDAR_FRONT", 4.07, 0.0, 0.69, 0.0),
        ("LIDAR_SIDE_LEFT", 3.245, -1.025, 0.98, -90.0),
        ("LIDAR_SIDE_RIGHT", 3.245, 1.025, 0.98, 90.0),
        ("LIDAR_REAR", -1.154, 0.0, 0.47, 180.0),
    )
    return [
        *(
            _sensor(f"CAM_{name}", "rgb", x - rear, y, 2.115, yaw, image_size=size, fov_deg=50.4)
            for name, x, y, yaw, size in cameras
        ),
        _sensor(
            "LIDAR_TOP", "lidar", 1.43 - rear, 0.0, 2.184, channels=64, range_m=75.0,
            upper_fov_deg=2.4, lower_fov_deg=-17.6,
        ),
        *(_sensor(name, "lidar", x - rear, *rest, **near) for name, x, *rest in short_range),
        _sensor("IMU", "imu", 0.0, 0.0, 0.0),
        _sensor("GNSS", "gnss", 0.0, 0.0, 0.0),
    ]  # fmt: skip


def _paper() -> list[dict[str, Any]]:
    """Four colour cameras of 1280x720, the front one with all ground truth; two LiDARs."""
    size: dict[str, Any] = {"image_size": [1280, 720], "fov_deg": 90.0}
    return [
        *(
            _sensor(f"RGB_{name}", "rgb", x, y, 1.6, yaw, **size)
            for name, x, y, yaw in (
                ("FRONT", 1.5, 0.0, 0.0),
                ("RIGHT", 0.6, 0.5, 90.0),
                ("BACK", -0.6, 0.0, 180.0),
                ("LEFT", 0.6, -0.5, -90.0),
            )
        ),
        *(
            _sensor(f"{kind.upper()}_FRONT", kind, 1.5, 0.0, 1.6, **size)
            for kind in ("depth", "semantic", "instance")
        ),
        _sensor("LIDAR", "lidar", 0.0, 0.0, 1.9),
        _sensor("SEMANTIC_LIDAR", "semantic_lidar", 0.0, 0.0, 1.9),
        _sensor("IMU", "imu", 0.0, 0.0, 0.0),
        _sensor("GNSS", "gnss", 0.0, 0.0, 0.0),
    ]


def _drone() -> list[dict[str, Any]]:
    """One camera on the gimbal, of 24 mm equivalent focal length: 36 mm wide film; a receiver."""
    camera: dict[str, Any] = {"image_size": [1920, 1080], "fov_deg": _fov_deg(36, 24.0)}
    return [
        _sensor("CAM_GIMBAL", "rgb", 0.0, 0.0, 0.0, **camera),
        _sensor("GNSS", "gnss", 0.0, 0.0, 0.0),
    ]


def _junction() -> list[dict[str, Any]]:
    """One wide camera on the mast."""
    camera: dict[str, Any] = {"image_size": [1920, 1080], "fov_deg": 90.0}
    return [_sensor("CAM_MAST", "rgb", 0.0, 0.0, 0.0, **camera)]


#: Rig by the name that `rig.preset` takes.
RIG_PRESETS: Mapping[str, PresetRig] = {
    "demo": PresetRig("the demonstration's rig", "Car-STAGE", _demo),
    "kitti": PresetRig(
        "KITTI's colour stereo pair, HDL-64E and OXTS",
        "Geiger et al., Vision meets Robotics (IJRR 2013), figure 3; image size and focal length "
        "of the calibration files",
        _kitti,
    ),
    "nuscenes": PresetRig(
        "nuScenes' six cameras, roof LiDAR and five radars",
        "Caesar et al., nuScenes (CVPR 2020), table 2; positions and focal lengths of "
        "calibrated_sensor.json; radar cones are ours",
        _nuscenes,
    ),
    "waymo": PresetRig(
        "like Waymo's: five cameras, roof LiDAR, four short-range LiDARs",
        "Sun et al., Waymo Open Dataset (CVPR 2020), tables 2 and 3; short-range LiDARs are "
        "approximate",
        _waymo,
    ),
    "paper": PresetRig(
        "the benchmark rig of the Car-STAGE paper",
        "sensors and image size of the paper's first experiment; positions are ours",
        _paper,
    ),
    "drone": PresetRig(
        "a drone's camera and GNSS, for agents of kind `drone`",
        "24 mm equivalent focal length, as DJI's data sheet of the Mavic 3 says; picture size is "
        "ours",
        _drone,
    ),
    "junction": PresetRig(
        "a traffic camera, for agents of kind `junction` or `roadside`",
        "figures are ours",
        _junction,
    ),
}
