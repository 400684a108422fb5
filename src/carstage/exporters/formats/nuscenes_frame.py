"""What a frame becomes in nuScenes: files of its sensors, a sample, annotations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.axes import (
    enu_pose,
    flu_from_nuscenes_lidar,
    flu_from_optical,
    flu_pose,
    flu_vector,
    nuscenes_box,
    quaternion_from_matrix,
)
from carstage.exporters.classes import nuscenes_category
from carstage.exporters.formats.nuscenes_files import lidar_file, radar_file
from carstage.exporters.formats.pictures import copy_picture
from carstage.exporters.labels import lidar_points, radar_points
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras, main_lidar
from carstage.geometry import FloatArray, pose_matrix
from carstage.sensor_kinds.model import DETECTIONS, POINTS

_MOVING_MPS, _WALKING_MPS = 0.2, 0.1


def channels(episode: Episode, options: ExportOptions) -> dict[str, str]:
    """nuScenes's channel of each sensor that is exported, by sensor id.

    The LiDAR is ``LIDAR_TOP``, whatever its id: the devkit finds the ego by that name.
    """
    lidar = main_lidar(episode, options)
    found = {} if lidar is None else {lidar.id: "LIDAR_TOP"}
    cameras = (camera for camera in colour_cameras(episode, options) if camera.on_ego)
    radars = (
        sensor.calibration
        for sensor in episode.sensors
        if sensor.content == DETECTIONS and sensor.calibration.on_ego
    )
    for prefix, sensors in (("CAM_", cameras), ("RADAR_", radars)):
        for sensor in sensors:
            name = sensor.id.upper()
            found[sensor.id] = name if name.startswith(prefix) else prefix + name
    return found


@dataclass(frozen=True, slots=True)
class SamplePart:
    """A frame: pose of the ego, rows of sensors by id, rows of annotations by track id."""

    k: int
    timestamp_s: float
    ego_pose: Mapping[str, Any]
    data: Mapping[str, Mapping[str, Any]]
    annotations: Mapping[int, Mapping[str, Any]]
    categories: Mapping[int, str]


@dataclass(frozen=True, slots=True)
class SampleWriter:
    """Writes the sensors' files of a frame.

    Attributes:
        options: the choices, with the most distance set.
        channels: of the sensors, by id.
        min_points: fewer LiDAR and radar points, and an object is left out.
        shift_m: what is added to east and north, so that all are positive as nuScenes's maps are.
    """

    options: ExportOptions
    channels: Mapping[str, str]
    min_points: int
    shift_m: tuple[float, float]

    def __call__(self, frame: Frame, folder: Path) -> SamplePart:
        """Write the frame; sensors without data are left out of it."""
        data = {
            sensor_id: self._write(frame, sensor_id, channel, folder)
            for sensor_id, channel in self.channels.items()
            if frame.has(sensor_id)
        }
        pose = enu_pose(frame.world_from_ego)
        annotations, categories = {}, {}
        for track_id, row in sorted(frame.objects.items()):
            category = nuscenes_category(row)
            if category is not None and self._wanted(row):
                annotations[track_id] = self._annotation(row)
                categories[track_id] = category
        return SamplePart(
            frame.k, frame.timestamp_s, _pose_row(pose, self.shift_m), data, annotations, categories
        )

    def _write(self, frame: Frame, sensor_id: str, channel: str, folder: Path) -> dict[str, Any]:
        sensor = frame.episode.sensor(sensor_id).calibration
        stem = folder / "samples" / channel / f"{frame.episode.id}__{channel}__{frame.k:06d}"
        if sensor.is_camera:
            path = copy_picture(frame, sensor_id, stem)
        elif sensor.content == POINTS:
            path = stem.with_name(stem.name + ".pcd.bin")
            path.write_bytes(lidar_file(frame.read(sensor_id), sensor.attributes))
        else:
            path = stem.with_name(stem.name + ".pcd")
            path.write_bytes(radar_file(frame.read(sensor_id), _radar_velocity(frame, sensor)))
        return {
            "filename": path.relative_to(folder).as_posix(),
            "fileformat": "pcd" if ".pcd" in path.name else path.suffix[1:],
            "width": sensor.width,
            "height": sensor.height,
        }

    def _wanted(self, row: Row) -> bool:
        return (
            row["box_center"] is not None
            and row["distance_ego"] <= (self.options.max_distance_m or np.inf)
            and lidar_points(row) + radar_points(row) >= self.min_points
        )

    def _annotation(self, row: Row) -> dict[str, Any]:
        box = nuscenes_box(
            pose_matrix(row["box_center"], row["box_rotation_deg"]), row["box_extent"]
        )
        east, north, up = box.translation.tolist()
        token = row["visibility_token"]
        return {
            "attribute": attribute(row),
            "visibility_token": "" if token is None else str(token),
            "translation": [east + self.shift_m[0], north + self.shift_m[1], up],
            "size": box.size.tolist(),
            "rotation": box.rotation.tolist(),
            "num_lidar_pts": lidar_points(row),
            "num_radar_pts": radar_points(row),
        }


def attribute(row: Row) -> str:
    """nuScenes's attribute of an object: what it is doing."""
    speed = float(np.linalg.norm(row["velocity"]))
    if row["class"] in ("motorcycle", "bicycle"):
        return "cycle.without_rider" if row["is_static"] else "cycle.with_rider"
    if row["class"].startswith("walker"):
        return "pedestrian.moving" if speed > _WALKING_MPS else "pedestrian.standing"
    if row["is_static"]:
        return "vehicle.parked"
    return "vehicle.moving" if speed > _MOVING_MPS else "vehicle.stopped"


def calibrated_sensor(sensor: SensorCalibration) -> dict[str, Any]:
    """Pose of a sensor on the ego in nuScenes's axes, and a camera's intrinsics."""
    if sensor.is_camera:
        pose = flu_from_optical(sensor.ego_from_sensor)
    elif sensor.content == POINTS:
        pose = flu_from_nuscenes_lidar(sensor.ego_from_sensor)
    else:
        pose = flu_pose(sensor.ego_from_sensor)
    return {
        **_pose_row(pose, (0.0, 0.0)),
        "camera_intrinsic": sensor.k.tolist() if sensor.is_camera else [],
    }


def _pose_row(pose: FloatArray, shift_m: tuple[float, float]) -> dict[str, Any]:
    x, y, z = pose[:3, 3].tolist()
    return {
        "translation": [x + shift_m[0], y + shift_m[1], z],
        "rotation": quaternion_from_matrix(pose[:3, :3]).tolist(),
    }


def _radar_velocity(frame: Frame, radar: SensorCalibration) -> FloatArray:
    """The radar's own velocity along its axes, from the ego's; its turning is left out."""
    if frame.ego is None:
        return np.zeros(3)
    return flu_vector(radar.ego_from_sensor[:3, :3].T @ np.array(frame.ego["velocity_ego"]))
