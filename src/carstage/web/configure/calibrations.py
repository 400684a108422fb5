"""Rigs out of the calibrations of others: KITTI, nuScenes, ROS ``camera_info``, Kalibr.

What CARLA's pinhole cannot show (lens distortion, a principal point beside the middle, pixels that
are not square) becomes the camera's ``lens``. Their pixels count from the centre of the first one,
ours from its corner.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from carstage.errors import BadInputError
from carstage.web.configure.kalibr import camera_infos, first_from_others, is_camchain
from carstage.web.messages.base import Document

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

_HALF_WHEELBASE_M = 1.4
"""nuScenes counts from the rear axle, CARLA from the vehicle's middle."""
_KITTI_SIZE = (1242, 375)
"""Of the rectified pictures; the calibration does not give it."""
_KITTI_LIDAR = (0.0, 0.0, 1.73)
"""The Velodyne of KITTI's car (Geiger et al., CVPR 2012), where the preset ``kitti`` has it."""
_MOST_SENSORS = 200
_OFF_CENTRE = 0.02
"""Share of the width by which a principal point may lie beside the middle of a plain pinhole."""
_WINDSCREEN = {"x": 0.6, "y": 0.0, "z": 1.4}
_MODELS = {"plumb_bob": "brown_conrady", "rational_polynomial": "brown_conrady",
           "equidistant": "kannala_brandt", "fisheye": "kannala_brandt"}  # fmt: skip
"""Our camera models by ROS's names of a distortion."""
_COEFFICIENTS = {
    name: ("k1", "k2", "k3", "k4") if model == "kannala_brandt" else ("k1", "k2", "p1", "p2", "k3")
    for name, model in _MODELS.items()
}
_KITTI_LINE = re.compile(
    r"^\s*(P\d|P_rect_\d\d|R0_rect|R_rect_00|Tr_velo_to_cam|Tr_velo_cam)\s*:?\s"
)
Read = tuple[list[Document], list[str]]


class Calibration(NamedTuple):
    """What a calibration stands for.

    Attributes:
        sensors: entries of ``rig.sensors``.
        warnings: what could not be taken over.
        is_rig: whether it is a whole rig; else these join the rig that is there.
    """

    sensors: list[Document]
    warnings: list[str]
    is_rig: bool


def read_calibration(text: str) -> Calibration:
    """The sensors of a calibration.

    Args:
        text: KITTI's ``calib`` file; nuScenes' ``calibrated_sensor.json`` with ``sensor.json``, as
            one object by file name; a ``camera_info`` in YAML, or several; or Kalibr's camchain.

    Raises:
        BadInputError: it is none of these, or a number in it cannot be.
    """
    try:
        if any(_KITTI_LINE.match(line) for line in text.splitlines()[:50]):
            return Calibration(*_kitti(text), is_rig=True)
        stripped = text.lstrip()
        if stripped.startswith(("{", "[")):
            return _json(json.loads(text))
        return Calibration(*_camera_infos(text), is_rig=False)
    except (KeyError, TypeError, ValueError, IndexError, RecursionError) as error:
        raise BadInputError(
            f"The calibration cannot be read: {type(error).__name__}: {error}.",
            "Choose a file as KITTI, nuScenes or ROS write it.",
        ) from error


def _json(document: Any) -> Calibration:
    if isinstance(document, dict):
        names = {name.rsplit("/", 1)[-1].removesuffix(".json"): name for name in document}
        if "calibrated_sensor" in names:
            sensors = document[names["sensor"]] if "sensor" in names else []
            rig = _nuscenes(document[names["calibrated_sensor"]], sensors)
            return Calibration(*rig, is_rig=True)
        if "camera_matrix" in document or "K" in document or "k" in document:
            return Calibration(*_collected([_camera_info(document, 0)]), is_rig=False)
    if isinstance(document, list) and document and "sensor_token" in document[0]:
        return Calibration(*_nuscenes(document, []), is_rig=True)
    raise BadInputError(
        "This JSON is no calibration that is known.",
        "Choose calibrated_sensor.json and sensor.json of nuScenes together.",
    )


def _kitti(text: str) -> Read:
    import numpy as np

    from carstage.geometry import OPTICAL_FROM_SENSOR

    rows: dict[str, FloatArray] = {}
    for line in text.splitlines():
        name, _, values = line.strip().partition(":" if ":" in line else " ")
        if values and _KITTI_LINE.match(line):
            rows[name.strip()] = np.array([float(value) for value in values.split()])
    cameras = {
        int(name[-1]): values.reshape(3, 4)
        for name, values in rows.items()
        if name.startswith("P") and values.size == 12
    }
    if not cameras:
        raise BadInputError("The file has no projection P0 to P3.", "Choose a calib file of KITTI.")
    rectified = np.eye(4)
    rotation = rows.get("R0_rect", rows.get("R_rect_00"))
    if rotation is not None:
        rectified[:3, :3] = rotation.reshape(3, 3)
    warnings = [
        "KITTI's files do not say where the car is: the Velodyne is taken 1.73 m above the ground.",
        f"Pictures are taken to be {_KITTI_SIZE[0]}×{_KITTI_SIZE[1]}: the file gives no size.",
    ]
    lidar = rows.get("Tr_velo_to_cam", rows.get("Tr_velo_cam"))
    camera_from_lidar = np.eye(4)
    if lidar is None:
        # Without it the cameras stand where they stood on KITTI's car.
        camera_from_lidar[:3, :3] = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
        camera_from_lidar[:3, 3] = [0.0, -0.08, -0.27]
        warnings.append("The file has no Tr_velo_to_cam: cameras are taken 0.27 m ahead of it.")
    else:
        camera_from_lidar[:3] = lidar.reshape(3, 4)
    sensors: list[Document] = []
    flip = np.diag([1.0, -1.0, 1.0, 1.0])  # the Velodyne's y is to the left
    car_from_lidar = np.eye(4)
    car_from_lidar[:3, 3] = _KITTI_LIDAR
    car_from_camera = car_from_lidar @ flip @ np.linalg.inv(rectified @ camera_from_lidar)
    optical = np.eye(4)
    optical[:3, :3] = OPTICAL_FROM_SENSOR
    for number, projection in sorted(cameras.items()):
        moved = np.eye(4)
        moved[:3, 3] = -np.linalg.inv(projection[:, :3]) @ projection[:, 3]
        pose = _pose(car_from_camera @ moved @ optical)
        sensors.append(_camera(f"CAM_{number}", pose, _KITTI_SIZE, projection[:, :3]))
    if lidar is not None:
        sensors.append(
            {"id": "VELODYNE", "kind": "lidar", "pose": _pose(car_from_lidar), "attributes": {}}
        )
    return sensors, warnings


def _nuscenes(calibrated: list[Any], channels: list[Any]) -> Read:
    import numpy as np

    from carstage.geometry import FLU_FROM_CARLA, OPTICAL_FROM_SENSOR, matrix_from_quaternion
    from carstage.geometry.coordinates import NUSCENES_LIDAR_FROM_SENSOR

    known = {str(row["token"]): row for row in channels}
    sensors: list[Document] = []
    warnings: list[str] = []
    names: set[str] = set()
    for row in calibrated:
        channel = known.get(str(row["sensor_token"]), {})
        intrinsic = row.get("camera_intrinsic") or []
        modality = channel.get("modality", "camera" if intrinsic else "lidar")
        name = str(channel.get("channel") or f"{modality.upper()}_{len(sensors)}")
        if name in names:
            continue  # another drive's: one of each channel makes a rig
        names.add(name)
        if len(names) > _MOST_SENSORS:
            raise BadInputError(f"These are more than {_MOST_SENSORS} sensors.", "Give fewer.")
        car_from_sensor = np.eye(4)
        rotation = matrix_from_quaternion([float(value) for value in row["rotation"]])
        local = {"camera": OPTICAL_FROM_SENSOR, "lidar": NUSCENES_LIDAR_FROM_SENSOR}
        inner = local.get(modality, FLU_FROM_CARLA)
        car_from_sensor[:3, :3] = FLU_FROM_CARLA @ rotation @ inner
        x, y, z = (float(value) for value in row["translation"])
        car_from_sensor[:3, 3] = x - _HALF_WHEELBASE_M, -y, z
        pose = _pose(car_from_sensor)
        if modality == "camera":
            matrix = np.array(intrinsic, dtype=np.float64).reshape(3, 3)
            sensors.append(_camera(name, pose, (1600, 900), matrix))
        elif modality in ("lidar", "radar"):
            sensors.append({"id": name, "kind": modality, "pose": pose, "attributes": {}})
        else:
            warnings.append(f"{name}: {modality} is left out.")
    if not sensors:
        raise BadInputError("The calibration has no sensor.", "Choose calibrated_sensor.json.")
    if not known:
        warnings.append("Without sensor.json names and kinds of the sensors are not known.")
    warnings.append("nuScenes counts from the rear axle: all moved back by half a wheelbase.")
    return sensors, warnings


def _camera_infos(text: str) -> Read:
    from carstage.config.yaml_text import parse_yaml

    parts = re.split(r"(?m)^---\s*$", text)
    documents = [one for part in parts if (one := parse_yaml(part, "the file")) is not None]
    if not documents or not all(isinstance(one, dict) for one in documents):
        raise BadInputError(
            "This is no calibration that is known.",
            "Choose a calib file of KITTI, nuScenes' JSON, or a camera_info in YAML.",
        )
    if is_camchain(documents[0]):
        return _kalibr(documents[0])
    return _collected([_camera_info(one, n) for n, one in enumerate(documents[:_MOST_SENSORS])])


def _kalibr(document: Mapping[str, Any]) -> Read:
    import numpy as np

    sensors, warnings = _collected([_camera_info(one, 0) for one in camera_infos(document)])
    first = np.eye(4)
    first[:3, 3] = [_WINDSCREEN[axis] for axis in "xyz"]
    for sensor, first_from_sensor in zip(sensors, first_from_others(document), strict=True):
        sensor["pose"] = _pose(first @ first_from_sensor)
    return sensors, [
        *warnings[:-1],
        "Kalibr holds no pose on a car: cam0 stands behind the windscreen.",
    ]


def _collected(found: list[tuple[Document, list[str]]]) -> Read:
    warnings = [warning for _, said in found for warning in said]
    warnings.append("camera_info holds no pose: cameras stand behind the windscreen.")
    return [sensor for sensor, _ in found], warnings


def _camera_info(info: Mapping[str, Any], number: int) -> tuple[Document, list[str]]:
    """A camera out of a ``camera_info`` file of ``camera_calibration``, or of a message."""
    import numpy as np

    size = (
        int(info.get("image_width", info.get("width"))),
        int(info.get("image_height", info.get("height"))),
    )
    given = info.get("camera_matrix", info.get("K", info.get("k")))
    values = given["data"] if isinstance(given, dict) else given
    matrix = np.array(values, dtype=np.float64).reshape(3, 3)
    name = _name(str(info.get("camera_name") or f"CAM_{number}"))
    distortion = info.get("distortion_coefficients", info.get("D", info.get("d", ())))
    terms = distortion["data"] if isinstance(distortion, dict) else distortion
    terms = [float(term) for term in terms or ()]
    model = str(info.get("distortion_model") or "plumb_bob")
    names, warnings = _COEFFICIENTS.get(model, ()), []
    bent = dict(zip(names, terms, strict=False))
    if any(terms[len(names) :]):
        bent = {}
        warnings.append(
            f"{name}: the lens distortion is left out, as no model here has the terms of {model}."
        )
    return _camera(name, dict(_WINDSCREEN), size, matrix, model, bent), warnings


def _camera(
    name: str,
    pose: Document,
    size: tuple[int, int],
    matrix: FloatArray,
    model: str = "",
    distortion: Mapping[str, float] = MappingProxyType({}),
) -> Document:
    width, height = size
    focal_px = float(matrix[0, 0])
    if not (focal_px > 0 and 0 < width <= 20_000 and 0 < height <= 20_000):
        raise BadInputError(
            f"{name}: {width}×{height} pixels with a focal length of {focal_px} cannot be.",
            "Correct the file.",
        )
    fov_deg = math.degrees(2 * math.atan(width / (2 * focal_px)))
    attributes = {"image_size": [width, height], "fov_deg": round(fov_deg, 4)}
    camera = {"id": name, "kind": "rgb", "pose": pose, "attributes": attributes}
    bent = any(abs(term) > 1e-9 for term in distortion.values())
    if not bent and _is_plain(matrix, size):
        return camera
    fx, fy, cx, cy = (round(float(matrix[at]), 6) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    numbers = {"fx": fx, "fy": fy, "cx": cx + 0.5, "cy": cy + 0.5}
    named = _MODELS[model] if bent else "pinhole"
    lens = {"model": named, **numbers, **(distortion if bent else {})}
    return {**camera, "attributes": {"image_size": [width, height]}, "lens": lens}


def _is_plain(matrix: FloatArray, size: tuple[int, int]) -> bool:
    """Whether a pinhole with its axis in the middle and square pixels shows it."""
    width, height = size
    off = max(abs(matrix[0, 2] - width / 2), abs(matrix[1, 2] - height / 2)) / width
    square = abs(matrix[1, 1] / matrix[0, 0] - 1) <= _OFF_CENTRE
    return bool(off <= _OFF_CENTRE and square)


def _pose(car_from_sensor: FloatArray) -> Document:
    from carstage.geometry import rotation_deg

    pitch, yaw, roll = (float(angle) for angle in rotation_deg(car_from_sensor[:3, :3]))
    x, y, z = (float(value) for value in car_from_sensor[:3, 3])
    if not all(math.isfinite(value) and abs(value) < 1e6 for value in (x, y, z)):
        raise BadInputError("A position in it cannot be.", "Correct the file.")
    angles = {"roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw}
    return {
        **{key: round(value, 4) + 0.0 for key, value in zip("xyz", (x, y, z), strict=True)},
        **{key: round(value, 4) + 0.0 for key, value in angles.items()},
    }


def _name(name: str) -> str:
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_.-") else "_" for c in name)
    return plain.lstrip("_.-")[:18] or "CAM"
