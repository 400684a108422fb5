"""Which of 123D's sensor ids the sensors of a rig get: 123D knows sensors by where they look.

The numbers are those of py123d's ``CameraID``, ``LidarID`` and ``RadarID``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from carstage.dataset import SensorCalibration
from carstage.exporters.axes import flu_pose

_CAMERAS: Final[Mapping[str, tuple[tuple[str, int], ...]]] = {
    "front": (("pcam_f0", 0),),
    "back": (("pcam_b0", 1),),
    "left": (("pcam_l0", 2), ("pcam_l1", 3), ("pcam_l2", 4)),
    "right": (("pcam_r0", 5), ("pcam_r1", 6), ("pcam_r2", 7)),
    "down": (("pcam_d0", 19),),
}
"""By side, the ids from the front to the back."""
_LIDARS: Final[Mapping[str, tuple[str, int]]] = {
    "top": ("lidar_top", 2),
    "front": ("lidar_front", 3),
    "left": ("lidar_side_left", 4),
    "right": ("lidar_side_right", 5),
    "back": ("lidar_back", 6),
    "down": ("lidar_down", 7),
}
_RADARS: Final = (
    ("radar_front", 2),
    ("radar_front_left", 3),
    ("radar_side_left", 5),
    ("radar_back_left", 7),
    ("radar_back", 9),
    ("radar_back_right", 8),
    ("radar_side_right", 6),
    ("radar_front_right", 4),
)
"""Every 45 degrees, counterclockwise from the front."""
_FRONT_DEG, _BACK_DEG, _DOWN_DEG = 30.0, 150.0, -60.0


@dataclass(frozen=True, slots=True)
class Slot:
    """A sensor's place in 123D: the name of its id and the id's number."""

    name: str
    number: int


def camera_slots(cameras: Iterable[SensorCalibration]) -> dict[str, Slot]:
    """123D's ids of colour cameras on the ego, by our ids; those for whom none is left have none.

    Ahead is within 30 degrees of the ego's forward axis, behind beyond 150. Cameras of a side are
    numbered from the front to the back.
    """
    sides: dict[str, list[tuple[float, str]]] = {side: [] for side in _CAMERAS}
    for camera in cameras:
        yaw_deg, pitch_deg = _direction(camera)
        sides[_side(yaw_deg, pitch_deg)].append((abs(yaw_deg), camera.id))
    slots = {}
    for side, found in sides.items():
        ordered = sorted(found, key=lambda entry: entry[0])
        for (_, camera_id), slot in zip(ordered, _CAMERAS[side], strict=False):
            slots[camera_id] = Slot(*slot)
    return slots


def lidar_slots(lidars: Iterable[SensorCalibration]) -> dict[str, Slot]:
    """Likewise of LiDARs: the highest is the top one, the others are where they look."""
    ordered = sorted(lidars, key=lambda lidar: -lidar.ego_from_sensor[2, 3])
    slots: dict[str, Slot] = {}
    for index, lidar in enumerate(ordered):
        slot = Slot(*_LIDARS[_side(*_direction(lidar)) if index else "top"])
        if slot not in slots.values():
            slots[lidar.id] = slot
    return slots


def radar_slots(radars: Iterable[SensorCalibration]) -> dict[str, Slot]:
    """Likewise of radars: the nearest of eight directions."""
    slots: dict[str, Slot] = {}
    for radar in radars:
        slot = Slot(*_RADARS[round(_direction(radar)[0] / 45.0) % len(_RADARS)])
        if slot not in slots.values():
            slots[radar.id] = slot
    return slots


def _direction(sensor: SensorCalibration) -> tuple[float, float]:
    """Yaw to the left and pitch up of a sensor's forward axis on the ego (deg)."""
    x, y, z = flu_pose(sensor.ego_from_sensor)[:3, 0].tolist()
    return math.degrees(math.atan2(y, x)), math.degrees(math.asin(max(-1.0, min(1.0, z))))


def _side(yaw_deg: float, pitch_deg: float) -> str:
    if pitch_deg < _DOWN_DEG:
        return "down"
    if abs(yaw_deg) < _FRONT_DEG:
        return "front"
    if abs(yaw_deg) > _BACK_DEG:
        return "back"
    return "left" if yaw_deg > 0.0 else "right"
