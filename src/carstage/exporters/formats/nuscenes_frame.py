"""What a frame becomes in nuScenes: files of its sensors, and on key frames labels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset import SensorCalibration
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
from carstage.exporters.class_map import ClassMap
from carstage.exporters.cloud_objects import point_objects
from carstage.exporters.clouds import (
    LabelledCloud,
    LabelledLidar,
    read_labelled,
    read_points,
    read_rings,
)
from carstage.exporters.formats.nuscenes_can_bus import Messages, can_messages
from carstage.exporters.formats.nuscenes_categories import attribute_of, category_of
from carstage.exporters.formats.nuscenes_files import lidar_file, radar_file
from carstage.exporters.formats.nuscenes_scenes import CarScene
from carstage.exporters.formats.nuscenes_segmentation import panoptic_file, point_categories
from carstage.exporters.formats.nuscenes_tables import token
from carstage.exporters.formats.occ3d import occ3d_file
from carstage.exporters.formats.pictures import copy_picture
from carstage.exporters.lenses import opencv_matrix
from carstage.exporters.road_cells import SurfaceSensors, surface_cells
from carstage.geometry import FloatArray, pose_matrix
from carstage.sensor_kinds.model import CLOUDS

VERSION: Final = "v1.0-carstage"
OCC3D: Final = "gts"
"""Folder of Occ3D's voxels."""


@dataclass(frozen=True, slots=True)
class ScenePart:
    """A frame of one scene: pose of the car, rows of sensors by id, annotations by track id.

    ``labels`` are the files of the points' labels by table. What only key frames have is empty on
    others.
    """

    pose: Mapping[str, Any]
    data: Mapping[str, Mapping[str, Any]]
    annotations: Mapping[int, Mapping[str, Any]]
    categories: Mapping[int, str]
    labels: Mapping[str, str]
    can_messages: Messages


@dataclass(frozen=True, slots=True)
class FramePart:
    """A frame: a part for each scene of the episode, and the ground that it shows."""

    k: int
    timestamp_s: float
    scenes: tuple[ScenePart, ...]
    surfaces: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class SceneWriter:
    """Writes the sensors' files of a frame, for each car.

    Attributes:
        scenes: of the episode.
        step: every how many frames one is a key frame.
        min_points: fewer LiDAR and radar points, and an object is left out; ``None``: one, where
            the car has either.
        max_distance_m: from the car; objects farther away are left out.
        shift_m: what is added to east and north, so that all are positive as nuScenes's maps are.
        numbers: of the instances in panoptic labels, by track id.
        labelled: whether points get labels.
        surfaces: sensors that tell where roads are.
        class_map: the options'.
        occupancy: name of the ego's scene, if its key frames have voxels; else ``None``.
    """

    scenes: tuple[CarScene, ...]
    step: int
    min_points: int | None
    max_distance_m: float
    shift_m: tuple[float, float]
    numbers: Mapping[int, int]
    labelled: bool
    surfaces: SurfaceSensors
    class_map: ClassMap | None
    occupancy: str | None = None

    def __call__(self, frame: Frame, folder: Path) -> FramePart:
        """Write the frame; sensors without data are left out of it."""
        return FramePart(
            frame.k,
            frame.timestamp_s,
            tuple(self._scene(scene, frame, folder) for scene in self.scenes),
            surface_cells(frame, self.surfaces, self.shift_m),
        )

    def _scene(self, scene: CarScene, frame: Frame, folder: Path) -> ScenePart:
        pose = enu_pose(scene.car.world_from_car(frame))
        pose[:2, 3] += self.shift_m
        data = {
            sensor_id: self._write(scene, frame, sensor_id, folder)
            for sensor_id in scene.channels
            if frame.has(sensor_id)
        }
        messages: Messages = {}
        if scene.car.is_ego and frame.ego is not None:
            messages = can_messages(frame.ego, frame.ego_object, pose)
        if frame.k % self.step:
            return ScenePart(_pose_row(pose), data, {}, {}, {}, messages)
        if scene.car.is_ego and self.occupancy is not None:
            self._write_voxels(scene, frame, folder)
        seen = scene.car.frame(frame)
        tracks, labels = None, {}
        if scene.lidar is not None and frame.has(scene.lidar):
            lidar = frame.episode.sensor(scene.lidar).calibration
            cloud = read_labelled(frame, LabelledLidar.of(lidar, scene.tag_source))
            tracks = point_objects(seen, cloud, frame.world_from_sensor(scene.lidar), scene.own_id)
            if self.labelled:
                labels = self._write_labels(scene, seen, cloud, tracks, folder)
        counts = _points_in_boxes(scene, seen, tracks)
        place = scene.car.world_from_car(frame)[:3, 3]
        annotations, categories = {}, {}
        for track_id, row in sorted(seen.objects.items()):
            category = category_of(row, self.class_map)
            if category is not None and self._wanted(scene, row, counts[track_id], place):
                annotations[track_id] = self._annotation(row, category, counts[track_id])
                categories[track_id] = category
        return ScenePart(_pose_row(pose), data, annotations, categories, labels, messages)

    def _write(self, scene: CarScene, frame: Frame, sensor_id: str, folder: Path) -> dict[str, Any]:
        sensor = frame.episode.sensor(sensor_id).calibration
        channel = scene.channels[sensor_id]
        kind = "sweeps" if frame.k % self.step else "samples"
        stem = folder / kind / channel / f"{scene.key}__{channel}__{frame.k:06d}"
        if sensor.is_camera:
            path = copy_picture(frame, sensor_id, stem)
        elif sensor_id == scene.lidar:
            path = stem.with_name(stem.name + ".pcd.bin")
            points, rings = read_points(frame, sensor_id), read_rings(frame, sensor_id)
            path.write_bytes(lidar_file(points, sensor.attributes, rings))
        else:
            path = stem.with_name(stem.name + ".pcd")
            velocity = radar_velocity(scene, frame, sensor)
            path.write_bytes(radar_file(frame.read(sensor_id), velocity))
        return {
            "filename": path.relative_to(folder).as_posix(),
            "fileformat": "pcd" if ".pcd" in path.name else path.suffix[1:],
            "width": sensor.width,
            "height": sensor.height,
        }

    def _write_voxels(self, scene: CarScene, frame: Frame, folder: Path) -> None:
        content = frame.occupancy()
        if content is None:
            return
        sample = token(scene.key, "sample", frame.k)
        place = folder / OCC3D / (self.occupancy or "") / sample
        place.mkdir()
        (place / "labels.npz").write_bytes(occ3d_file(content, frame))

    def _write_labels(
        self,
        scene: CarScene,
        frame: Frame,
        cloud: LabelledCloud,
        tracks: NDArray[np.int64],
        folder: Path,
    ) -> dict[str, str]:
        """Write the labels of a sweep's points; the files by table."""
        categories = point_categories(cloud, tracks, frame.objects, scene.own_id, self.class_map)
        name = data_token(scene, scene.lidar or "", frame.k)
        paths = {
            "lidarseg": f"lidarseg/{VERSION}/{name}_lidarseg.bin",
            "panoptic": f"panoptic/{VERSION}/{name}_panoptic.npz",
        }
        (folder / paths["lidarseg"]).write_bytes(categories.tobytes())
        (folder / paths["panoptic"]).write_bytes(panoptic_file(categories, tracks, self.numbers))
        return paths

    def _wanted(
        self, scene: CarScene, row: Row, points: tuple[int, int], place: FloatArray
    ) -> bool:
        least = int(scene.ranged) if self.min_points is None else self.min_points
        if row["box_center"] is None or sum(points) < least:
            return False
        distance = row["distance_ego"]
        if not scene.car.is_ego:
            distance = float(np.linalg.norm(np.array(row["box_center"]) - place))
        return bool(distance <= self.max_distance_m)

    def _annotation(self, row: Row, category: str, points: tuple[int, int]) -> dict[str, Any]:
        box = nuscenes_box(
            pose_matrix(row["box_center"], row["box_rotation_deg"]), row["box_extent"]
        )
        east, north, up = box.translation.tolist()
        visibility = row["visibility_token"]
        speed_mps = float(np.linalg.norm(row["velocity"]))
        return {
            "attribute": attribute_of(category, row["is_static"], speed_mps),
            "visibility_token": "" if visibility is None else str(visibility),
            "translation": [east + self.shift_m[0], north + self.shift_m[1], up],
            "size": box.size.tolist(),
            "rotation": box.rotation.tolist(),
            "num_lidar_pts": points[0],
            "num_radar_pts": points[1],
        }


def data_token(scene: CarScene, sensor_id: str, k: int) -> str:
    """The token of a sensor's frame in ``sample_data``."""
    return token(scene.key, "sample_data", sensor_id, k)


def _points_in_boxes(
    scene: CarScene, frame: Frame, tracks: NDArray[np.int64] | None
) -> dict[int, tuple[int, int]]:
    """Points of the scene's LiDAR and detections of its radars on each object.

    The recording counts points in boxes of ordinary LiDARs alone; a semantic LiDAR tells itself
    what it hit.
    """
    hits = Counter[int]()
    if tracks is not None and scene.lidar == scene.tag_source:
        hits.update(tracks.tolist())
    found = {}
    for track_id, row in frame.objects.items():
        by_lidar = dict(row["num_lidar_points"] or ())
        by_radar = dict(row.get("num_radar_points") or ())
        points = by_lidar.get(scene.lidar, 0) or hits[track_id]
        found[track_id] = (points, sum(by_radar.get(radar, 0) for radar in scene.radars))
    return found


def calibrated_sensor(sensor: SensorCalibration) -> dict[str, Any]:
    """Pose of a sensor on its car in nuScenes's axes, and a camera's intrinsics."""
    if sensor.is_camera:
        pose = flu_from_optical(sensor.carrier_from_sensor)
    elif sensor.content in CLOUDS:
        pose = flu_from_nuscenes_lidar(sensor.carrier_from_sensor)
    else:
        pose = flu_pose(sensor.carrier_from_sensor)
    return {
        **_pose_row(pose),
        "camera_intrinsic": opencv_matrix(sensor).tolist() if sensor.is_camera else [],
    }


def _pose_row(pose: FloatArray) -> dict[str, Any]:
    return {
        "translation": pose[:3, 3].tolist(),
        "rotation": quaternion_from_matrix(pose[:3, :3]).tolist(),
    }


def radar_velocity(scene: CarScene, frame: Frame, radar: SensorCalibration) -> FloatArray:
    """The radar's own velocity along its axes: the car's, and what its turning adds out there."""
    carrier = None if scene.car.track_id is None else frame.objects.get(scene.car.track_id)
    if carrier is not None:
        world_from_radar = frame.world_from_sensor(radar.id)
        arm = world_from_radar[:3, 3] - np.array(carrier["actor_location"])
        turning = carrier["angular_velocity"] or (0.0, 0.0, 0.0)  # walkers have none
        velocity = np.array(carrier["velocity"]) + np.cross(turning, arm)
        return flu_vector(world_from_radar[:3, :3].T @ velocity)
    if not scene.car.is_ego or frame.ego is None:
        return np.zeros(3)
    arm = radar.carrier_from_sensor[:3, 3]
    velocity = np.array(frame.ego["velocity_ego"]) + np.cross(
        frame.ego["angular_velocity_ego"], arm
    )
    return flu_vector(radar.carrier_from_sensor[:3, :3].T @ velocity)
