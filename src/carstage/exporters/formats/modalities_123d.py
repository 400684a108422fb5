"""The modalities of 123D that a rig has, and the row that a frame adds to each.

Frames: ``global`` is east-north-up. 123D's reference on the ego, which it calls the IMU, is CARLA's
pivot of the vehicle, forward-left-up. Points of LiDARs and radars are in it, cameras are optical.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from PIL import Image

from carstage.dataset import Episode, SensorCalibration
from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.axes import (
    enu_pose,
    flu_angular_velocity,
    flu_from_optical,
    flu_pose,
    flu_vector,
    nuscenes_box,
    quaternion_from_matrix,
    radar_points,
)
from carstage.exporters.fixes import satellite_fix
from carstage.exporters.formats.files_123d import Modality
from carstage.exporters.formats.rig_123d import (
    Slot,
    camera_slots,
    lidar_slots,
    radar_slots,
)
from carstage.exporters.labels import boxed_objects, lidar_points
from carstage.exporters.lenses import opencv_matrix
from carstage.exporters.options import ExportOptions
from carstage.exporters.rigs import colour_cameras
from carstage.geometry import FloatArray, pose_matrix
from carstage.sensor_kinds.columns import Point, RcsDetection
from carstage.sensor_kinds.model import COLOUR, DETECTIONS, POINTS

EGO: Final = "ego_state_se3"
BOXES: Final = "box_detections_se3"
LABELS: Final[Mapping[str, int]] = {
    "car": 1, "van": 1, "truck": 1, "bus": 1, "train": 2, "motorcycle": 3, "bicycle": 3,
    "walker_adult": 4, "walker_child": 4, "walker_wheelchair": 4, "rider": 4,
    "traffic_sign": 6, "traffic_light": 8, "fence": 9, "guard_rail": 9, "wall": 9,
}  # fmt: skip
"""``DefaultBoxDetectionLabel`` of our classes; all others are generic objects."""
GENERIC_OBJECT: Final = 10
DEPTH_M: Final = 655.35
"""The farthest depth: 65535 centimetres."""
_VECTOR: Final = pa.list_(pa.float64(), 3)
_POSE: Final = pa.list_(pa.float64(), 7)
_BOX: Final = pa.list_(pa.float64(), 10)
_PICTURE: Final = {
    "data": pa.binary(),
    "camera_to_global_se3": _POSE,
    "exposure_factor": pa.float32(),
}


@dataclass(frozen=True, slots=True)
class Rig:
    """What a log holds of a rig.

    Attributes:
        modalities: all that there may be.
        keys: by our id of a sensor, the key of its modality.
    """

    modalities: tuple[Modality, ...]
    keys: Mapping[str, str]


def rig_of(episode: Episode, options: ExportOptions) -> Rig:
    """The modalities of an episode.

    Raises:
        BadInputError: a camera that the options name is no colour camera.
    """
    on_ego = [s.calibration for s in episode.sensors if s.calibration.on_ego]
    wanted = [c.id for c in colour_cameras(episode, options, labelled=False)] if (
        options.cameras
    ) else [s.id for s in on_ego]  # fmt: skip
    cameras = camera_slots(
        s for s in on_ego if s.content == COLOUR and s.is_pinhole and s.id in wanted
    )
    found: list[tuple[str, Modality]] = []
    for sensor in on_ego:
        if sensor.id in cameras:
            found += _camera(sensor, cameras[sensor.id])
    for lidar_id, slot in lidar_slots(s for s in on_ego if s.content == POINTS).items():
        found.append((lidar_id, _lidar(episode.sensor(lidar_id).calibration, slot)))
    for radar_id, slot in radar_slots(s for s in on_ego if s.content == DETECTIONS).items():
        found.append((radar_id, _radar(episode.sensor(radar_id).calibration, slot)))
    for kind, make in (("imu", _imu), ("gnss", partial(_gnss, episode))):
        alike = [s for s in on_ego if s.kind == kind]
        for sensor in alike:
            found.append((sensor.id, make(sensor, alone=len(alike) == 1)))
    return Rig(
        (_ego(episode), _boxes(), *(modality for _, modality in found)),
        {sensor_id: modality.key for sensor_id, modality in found},
    )


def _ego(episode: Episode) -> Modality:
    box, actors = episode.calibration.ego_box, episode.document["actors"]
    actor = actors.get(str(episode.document["ego_id"]))  # none of an agent that is no vehicle
    x, y, z = (2.0 * half for half in box["extent"])
    center = flu_pose(pose_matrix(box["location"], box["rotation_deg"]))
    return Modality(
        EGO,
        {
            "vehicle_name": str(episode.agent_name) if actor is None else actor["type_id"],
            "length": x,
            "width": y,
            "height": z,
            # A dataset does not know where a vehicle's axles are.
            "wheel_base": float("nan"),
            "center_to_imu_se3": pose_list(center),
            "rear_axle_to_imu_se3": pose_list(np.eye(4)),
        },
        {"imu_se3": _POSE, "dynamic_state_se3": pa.list_(pa.float64(), 9)},
    )


def _boxes() -> Modality:
    return Modality(
        BOXES,
        {"box_detection_label_class": "DefaultBoxDetectionLabel"},
        {
            "bounding_box_se3": pa.list_(_BOX),
            "track_token": pa.list_(pa.string()),
            "label": pa.list_(pa.uint16()),
            "velocity_3d": pa.list_(_VECTOR),
            "num_lidar_points": pa.list_(pa.int32()),
        },
    )


def _camera(camera: SensorCalibration, slot: Slot) -> Iterator[tuple[str, Modality]]:
    """A colour camera, and the depth camera of its pose."""
    (fx, skew, cx), (_, fy, cy), _ = opencv_matrix(camera).tolist()
    metadata = {
        "camera_model": "pinhole",
        "camera_name": camera.id,
        "camera_id": slot.number,
        "intrinsics": [fx, fy, cx, cy, skew],
        "distortion": None,
        "width": camera.width,
        "height": camera.height,
        "camera_to_imu_se3": pose_list(flu_from_optical(camera.ego_from_sensor)),
        "is_undistorted": True,
    }
    yield camera.id, Modality(f"camera.{slot.name}", metadata, _PICTURE)
    if camera.depth is not None:
        depth = {"camera_metadata": metadata, "max_depth": DEPTH_M, "depth_bits": 16}
        yield camera.depth, Modality(f"camera_depth.{slot.name}", depth, _PICTURE)


def _lidar(lidar: SensorCalibration, slot: Slot) -> Modality:
    metadata = {
        "lidar_name": lidar.id,
        "lidar_id": slot.number,
        "lidar_to_imu_se3": pose_list(flu_pose(lidar.ego_from_sensor)),
        "segmentation_label_class": None,
    }
    columns: dict[str, pa.DataType] = {"end_timestamp_us": pa.int64(), "data": pa.binary()}
    return Modality(f"lidar.{slot.name}", metadata, columns)


def _radar(radar: SensorCalibration, slot: Slot) -> Modality:
    metadata = {
        "radar_name": radar.id,
        "radar_id": slot.number,
        "radar_to_imu_se3": pose_list(flu_pose(radar.ego_from_sensor)),
    }
    return Modality(f"radar.{slot.name}", metadata, {"data": pa.binary()})


def _imu(imu: SensorCalibration, *, alone: bool) -> Modality:
    metadata = {
        "imu_name": imu.id,
        "imu_id": None if alone else imu.id.lower(),
        "imu_to_imu_se3": pose_list(flu_pose(imu.ego_from_sensor)),
        "has_orientation": False,
        "has_covariances": False,
    }
    columns = {"angular_velocity": _VECTOR, "linear_acceleration": _VECTOR}
    return Modality("imu" if alone else f"imu.{imu.id.lower()}", metadata, columns)


def _gnss(episode: Episode, gnss: SensorCalibration, *, alone: bool) -> Modality:
    origin = episode.geo_frame.reference
    metadata = {
        "gnss_name": gnss.id,
        "gnss_id": None if alone else gnss.id.lower(),
        "gnss_to_imu_se3": pose_list(flu_pose(gnss.ego_from_sensor)),
        "datum_lla": [origin.latitude_deg, origin.longitude_deg, origin.altitude_m],
        "has_solution_quality": False,
    }
    columns = {
        "lla": _VECTOR,
        "position_covariance": pa.list_(pa.float64(), 9),
        "position_covariance_type": pa.int32(),
        "status": pa.int32(),
        "service": pa.int32(),
    }
    return Modality("gnss" if alone else f"gnss.{gnss.id.lower()}", metadata, columns)


def frame_rows(
    frame: Frame, keys: Mapping[str, str], options: ExportOptions
) -> dict[str, Mapping[str, Any]]:
    """The row of each modality that has data of a frame, by its key.

    Raises:
        DatasetError: a file is missing or damaged, or no table holds the ego's pose.
    """
    rows: dict[str, Mapping[str, Any]] = {
        EGO: {
            "imu_se3": pose_list(enu_pose(frame.world_from_ego)),
            "dynamic_state_se3": None if frame.ego is None else _dynamics(frame.ego),
        },
        BOXES: _box_row([*boxed_objects(frame, options)]),
    }
    for sensor_id, key in keys.items():
        if frame.has(sensor_id):
            rows[key] = _ROWS[key.partition(".")[0]](frame, sensor_id)
    return rows


def _dynamics(row: Row) -> list[float]:
    """Velocity, acceleration, turn rate along the ego's axes; NaN where it is not known."""
    acceleration = row["acceleration_ego"]
    known = np.full(3, np.nan) if acceleration is None else flu_vector(acceleration)
    turn = flu_angular_velocity(row["angular_velocity_ego"])
    return [*flu_vector(row["velocity_ego"]).tolist(), *known.tolist(), *turn.tolist()]


def _box_row(rows: list[Row]) -> dict[str, Any]:
    boxes = []
    for row in rows:
        pose = pose_matrix(row["box_center"], row["box_rotation_deg"])
        box = nuscenes_box(pose, row["box_extent"])
        width, length, height = box.size.tolist()
        boxes.append([*box.translation.tolist(), *box.rotation.tolist(), length, width, height])
    return {
        "bounding_box_se3": boxes,
        "track_token": [row["instance_uid"] for row in rows],
        "label": [LABELS.get(row["class"], GENERIC_OBJECT) for row in rows],
        "velocity_3d": [flu_vector(row["velocity"]).tolist() for row in rows],
        "num_lidar_points": [lidar_points(row) for row in rows],
    }


def _picture_row(frame: Frame, camera: str) -> dict[str, Any]:
    """The dataset's own file: PNG or JPEG."""
    return {"data": frame.image_file(camera).read_bytes(), **_camera_pose(frame, camera)}


def _depth_row(frame: Frame, camera: str) -> dict[str, Any]:
    centimetres = np.rint(np.minimum(frame.read(camera), DEPTH_M) * 100.0).astype(np.uint16)
    stream = io.BytesIO()
    Image.fromarray(centimetres).save(stream, "png")
    return {"data": stream.getvalue(), **_camera_pose(frame, camera)}


def _camera_pose(frame: Frame, camera: str) -> dict[str, Any]:
    pose = flu_from_optical(frame.world_from_sensor(camera))
    return {"camera_to_global_se3": pose_list(pose), "exposure_factor": None}


def _lidar_row(frame: Frame, lidar: str) -> dict[str, Any]:
    """A CARLA sweep is of one moment; intensities are numbers of 8 bits there."""
    points = frame.read(lidar)
    intensity = np.rint(np.clip(points[:, Point.INTENSITY], 0.0, 1.0) * 255.0)
    columns = {"intensity": intensity.astype(np.uint8)}
    time_us = microseconds(frame.timestamp_s)
    places = flu_vector(points[:, :3])
    return {"end_timestamp_us": time_us, "data": _cloud(frame, lidar, places, columns)}


def _radar_row(frame: Frame, radar: str) -> dict[str, Any]:
    """Velocities are those along the rays, relative to the radar."""
    found = frame.read(radar)
    places, velocities = radar_points(found)
    rotation = flu_pose(frame.ego_from_sensor(radar))[:3, :3]
    turned = (velocities @ rotation.T).astype(np.float32)
    columns = {"velocity_x": turned[:, 0], "velocity_y": turned[:, 1]}
    if found.shape[1] > RcsDetection.RCS:
        columns["rcs"] = found[:, RcsDetection.RCS].astype(np.float32)
    return {"data": _cloud(frame, radar, places, columns)}


def _cloud(
    frame: Frame, sensor: str, places: FloatArray, columns: Mapping[str, NDArray[Any]]
) -> bytes:
    """Points ``(N, 3)`` of a sensor in the ego's axes, with columns, as an Arrow stream."""
    pose = flu_pose(frame.ego_from_sensor(sensor))
    placed = (places @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)
    named = {axis: np.ascontiguousarray(placed[:, i]) for i, axis in enumerate("xyz")}
    arrays = {name: pa.array(np.ascontiguousarray(c)) for name, c in {**named, **columns}.items()}
    batch = pa.RecordBatch.from_pydict(arrays)
    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, batch.schema, options=options) as writer:
        writer.write_batch(batch)
    return bytes(sink.getvalue().to_pybytes())


def _imu_row(frame: Frame, imu: str) -> dict[str, Any]:
    values = frame.read(imu)
    return {
        "angular_velocity": flu_angular_velocity(values[3:6]).tolist(),
        "linear_acceleration": flu_vector(values[:3]).tolist(),
    }


def _gnss_row(frame: Frame, gnss: str) -> dict[str, Any]:
    place = satellite_fix(frame, gnss)
    return {"lla": [place.latitude_deg, place.longitude_deg, place.altitude_m]}


_ROWS: Final = {
    "camera": _picture_row,
    "camera_depth": _depth_row,
    "lidar": _lidar_row,
    "radar": _radar_row,
    "imu": _imu_row,
    "gnss": _gnss_row,
}


def pose_list(pose: FloatArray) -> list[float]:
    """x, y, z, qw, qx, qy, qz of a ``(4, 4)`` pose."""
    return [*pose[:3, 3].tolist(), *quaternion_from_matrix(pose[:3, :3]).tolist()]


def microseconds(time_s: float) -> int:
    """Whole microseconds since the episode's first frame."""
    return round(time_s * 1e6)
