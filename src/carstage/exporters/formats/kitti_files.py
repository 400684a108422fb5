"""KITTI's text files: label rows, calibration, inertial rows."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.dataset import SensorCalibration
from carstage.dataset.saved_frames import Frame, Row
from carstage.errors import BadInputError
from carstage.exporters.axes import (
    flu_angular_velocity,
    flu_vector,
    imu_to_velodyne,
    velodyne_to_camera,
)
from carstage.exporters.class_map import ClassMap
from carstage.exporters.classes import CLASSES, DONT_CARE, RIDER
from carstage.exporters.labels import CameraLabel, occlusion_level
from carstage.exporters.lenses import opencv_matrix
from carstage.exporters.options import ExportOptions
from carstage.exporters.views import View
from carstage.geometry import kitti_rectangle, specific_force

_GNSS_FIX, _SATELLITES, _POSITION_MODE = 4, 12, 6
_ACCURACY_M = 0.0
_TYPE = re.compile(r"[!-~]+")


def kitti_defaults(options: ExportOptions) -> ExportOptions:
    """Boxes around what is visible, and occlusion by counted pixels.

    Raises:
        BadInputError: the class map has what KITTI cannot hold.
    """
    if options.class_map is not None:
        _check_types(options.class_map)
    return replace(options, boxes=options.boxes or "modal", occlusion=options.occlusion or "pixel")


def _check_types(class_map: ClassMap) -> None:
    for name, target in class_map.targets:
        if not _TYPE.fullmatch(target.name):
            raise BadInputError(
                f"class-map: {target.name!r} is no type for KITTI.",
                "Give ASCII letters, digits and signs, without spaces.",
            )
        if target.id is not None:
            raise BadInputError(
                f"class-map: {name} has an id, and KITTI's types have none.", "Leave out the ids."
            )
        if name == RIDER:
            raise BadInputError(
                "class-map: a rider has no 3D box.",
                "Leave out rider: KITTI's Cyclist is a bicycle with its rider.",
            )


def label_row(label: CameraLabel, camera: SensorCalibration, options: ExportOptions) -> str | None:
    """The 15 values of an object; ``None``: it is not exported to KITTI.

    ``type truncated occluded alpha left top right bottom h w l x y z rotation_y``. Positions have
    more digits than KITTI's own: two would be off by pixels at a few metres. An object without a
    valid 3D box becomes ``DontCare``.
    """
    class_map = options.class_map
    target = None if class_map is None else dict(class_map.targets)[label.name].name
    name = target or CLASSES[label.name].kitti
    if name is None:
        return None
    rectangle = kitti_rectangle(label.box, camera.width, camera.height)
    box = " ".join(f"{value:.2f}" for value in rectangle)
    if name == DONT_CARE or label.seen["location"] is None:
        return f"{DONT_CARE} -1 -1 -10 {box} -1 -1 -1 -1000 -1000 -1000 -10"
    seen = label.seen
    place = " ".join(f"{value:.6f}" for value in (*seen["dimensions"], *seen["location"]))
    return (
        f"{name} {seen['truncated']:.2f} {occlusion_level(seen, options)} {seen['alpha']:.6f} "
        f"{box} {place} {seen['rotation_y']:.6f}"
    )


def calibration_matrices(frame: Frame, view: View) -> dict[str, NDArray[np.float64]]:
    """``P0`` to ``P3``, ``R0_rect``, ``Tr_velo_to_cam``, ``Tr_imu_to_velo``.

    All four cameras are the labelled one, whose matrix is ``P2``. The IMU is the car's pivot;
    without a LiDAR, so is the velodyne.
    """
    projection = np.hstack([opencv_matrix(view.camera), np.zeros((3, 1))])
    car_from_camera = view.car_from_sensor(frame, view.camera.id)
    car_from_lidar = np.eye(4) if view.lidar is None else view.car_from_sensor(frame, view.lidar.id)
    return {
        **{f"P{index}": projection for index in range(4)},
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": velodyne_to_camera(car_from_camera, car_from_lidar)[:3],
        "Tr_imu_to_velo": imu_to_velodyne(car_from_lidar)[:3],
    }


def numbers(values: ArrayLike) -> str:
    """A matrix as KITTI writes it: row by row, twelve digits."""
    return " ".join(f"{value:.12e}" for value in np.asarray(values, np.float64).ravel().tolist())


def inertial_row(ego: Row) -> str:
    """The 30 values of ``oxts``, in the order of KITTI's ``dataformat.txt``.

    Roll is positive left side up, pitch front down, yaw counter-clockwise from east; velocities
    and accelerations forward, left, up; accelerations include gravity, as an accelerometer's.
    """
    pitch, yaw, roll = (math.radians(value) for value in ego["rotation_deg"])
    east, north, up = flu_vector(ego["velocity"])
    forward, left, _ = flu_vector(ego["velocity_ego"])
    acceleration = ego["acceleration"] or (0.0, 0.0, 0.0)
    body = flu_vector(specific_force(ego["rotation_deg"], acceleration))
    level = flu_vector(specific_force((0.0, ego["rotation_deg"][1], 0.0), acceleration))
    turning = flu_angular_velocity(ego["angular_velocity"])
    turning_body = flu_angular_velocity(ego["angular_velocity_ego"])
    values = [
        ego["latitude_deg"], ego["longitude_deg"], ego["altitude_m"], roll, -pitch, -yaw,
        north, east, forward, left, up,
        *body, *level, *turning_body, *_along(turning, -yaw),
        _ACCURACY_M, _ACCURACY_M,
    ]  # fmt: skip
    states = (_GNSS_FIX, _SATELLITES, *[_POSITION_MODE] * 3)
    return " ".join([*(f"{float(value):.12g}" for value in values), *map(str, states)])


def _along(vector: NDArray[np.float64], yaw: float) -> tuple[float, float, float]:
    """A vector in east-north-up as forward, left, up of a level vehicle with this yaw."""
    x, y, z = (float(value) for value in vector)
    return (
        x * math.cos(yaw) + y * math.sin(yaw),
        -x * math.sin(yaw) + y * math.cos(yaw),
        z,
    )
