"""A frame as messages of Foxglove's schemas (protobuf), in right-handed axes.

Frames of reference: ``map`` (east-north-up), ``ego`` (forward-left-up), and one per sensor: optical
axes for cameras, forward-left-up for the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.KeyValuePair_pb2 import KeyValuePair
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.axes import (
    enu_pose,
    flu_from_optical,
    flu_points,
    flu_pose,
    nuscenes_box,
    quaternion_from_matrix,
)
from carstage.exporters.labels import CameraLabel, camera_labels
from carstage.exporters.options import ExportOptions
from carstage.geometry import FloatArray, GeoPoint, pose_matrix
from carstage.report.drawing import class_colour
from carstage.sensor_kinds.model import COLOUR, POINTS

MAP, EGO = "map", "ego"
MESSAGES: dict[str, type[Message]] = {
    kind.DESCRIPTOR.full_name: kind
    for kind in (
        CameraCalibration, CompressedImage, FrameTransforms, ImageAnnotations, LocationFix,
        PointCloud, SceneUpdate,
    )
}  # fmt: skip
_POINT_FIELDS = ("x", "y", "z", "intensity")


@dataclass(frozen=True, slots=True)
class Stamped:
    """A message as it goes into the file.

    Attributes:
        topic: its topic.
        schema: full name of its type, a key of ``MESSAGES``.
        data: its bytes.
    """

    topic: str
    schema: str
    data: bytes


def frame_messages(frame: Frame, options: ExportOptions) -> Iterator[Stamped]:
    """All messages of a frame; sensors without data are left out."""
    time = timestamp(frame.timestamp_s)
    yield _stamped("/tf", _transforms(frame, time))
    yield _stamped("/objects", _scene(frame, time))
    for sensor in frame.episode.sensors:
        if not frame.has(sensor.id):
            continue
        if sensor.content == COLOUR:
            yield from _camera(frame, sensor.id, time, options)
        elif sensor.content == POINTS:
            yield _stamped(f"/{sensor.id}/points", _cloud(frame, sensor.id, time))
        elif sensor.kind == "gnss":
            reading = GeoPoint(*(float(value) for value in frame.read(sensor.id)))
            globe = frame.episode.geo_frame
            place = globe.place(globe.gnss_location(reading))
            yield _stamped(
                f"/{sensor.id}/fix",
                LocationFix(
                    timestamp=time, frame_id=sensor.id, latitude=place.latitude_deg,
                    longitude=place.longitude_deg, altitude=place.altitude_m,
                ),
            )  # fmt: skip


def timestamp(time_s: float) -> Timestamp:
    """Time since the episode's first frame."""
    return Timestamp(seconds=nanoseconds(time_s) // 10**9, nanos=nanoseconds(time_s) % 10**9)


def nanoseconds(time_s: float) -> int:
    """Whole nanoseconds."""
    return round(time_s * 1e9)


def _stamped(topic: str, message: Message) -> Stamped:
    data = message.SerializeToString(deterministic=True)
    return Stamped(topic, message.DESCRIPTOR.full_name, data)


def _camera(
    frame: Frame, camera_id: str, time: Timestamp, options: ExportOptions
) -> Iterator[Stamped]:
    camera = frame.episode.sensor(camera_id).calibration
    path = frame.image_file(camera_id)
    image = CompressedImage(
        timestamp=time, frame_id=camera_id, data=path.read_bytes(),
        format="jpeg" if path.suffix == ".jpg" else path.suffix[1:],
    )  # fmt: skip
    yield _stamped(f"/{camera_id}/image", image)
    projection = np.hstack([camera.k, np.zeros((3, 1))])
    calibration = CameraCalibration(
        timestamp=time, frame_id=camera_id, width=camera.width, height=camera.height,
        distortion_model="", D=[], K=camera.k.ravel().tolist(), R=np.eye(3).ravel().tolist(),
        P=projection.ravel().tolist(),
    )  # fmt: skip
    yield _stamped(f"/{camera_id}/calibration", calibration)
    if camera.labelled:
        annotations = ImageAnnotations()
        for label in camera_labels(frame, camera_id, options):
            _annotate(annotations, label, time)
        yield _stamped(f"/{camera_id}/annotations", annotations)


def _annotate(annotations: ImageAnnotations, label: CameraLabel, time: Timestamp) -> None:
    x0, y0, x1, y1 = label.box
    colour = _colour(label.name, 1.0)
    annotations.points.append(
        PointsAnnotation(
            timestamp=time,
            type=PointsAnnotation.LINE_LOOP,
            points=[Point2(x=x, y=y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))],
            outline_color=colour,
            thickness=2.0,
        )
    )
    annotations.texts.append(
        TextAnnotation(
            timestamp=time, position=Point2(x=x0, y=y0), font_size=12.0, text_color=colour,
            text=f"{label.name} {label.seen['track_id']}",
        )
    )  # fmt: skip


def _cloud(frame: Frame, lidar_id: str, time: Timestamp) -> PointCloud:
    points = flu_points(frame.read(lidar_id))
    return PointCloud(
        timestamp=time,
        frame_id=lidar_id,
        pose=_pose(np.eye(4)),
        point_stride=16,
        fields=[
            PackedElementField(name=name, offset=4 * index, type=PackedElementField.FLOAT32)
            for index, name in enumerate(_POINT_FIELDS)
        ],
        data=points.astype("<f4").tobytes(),
    )


def _transforms(frame: Frame, time: Timestamp) -> FrameTransforms:
    poses = [(MAP, EGO, enu_pose(frame.world_from_ego))]
    for sensor in frame.episode.sensors:
        if sensor.id in frame.sensor_poses:
            turned = flu_from_optical if sensor.calibration.is_camera else flu_pose
            poses.append((EGO, sensor.id, turned(frame.ego_from_sensor(sensor.id))))
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=time, parent_frame_id=parent, child_frame_id=child,
                translation=_vector(pose[:3, 3]), rotation=_quaternion(pose),
            )
            for parent, child, pose in poses
        ]
    )  # fmt: skip


def _scene(frame: Frame, time: Timestamp) -> SceneUpdate:
    boxed = (row for _, row in sorted(frame.objects.items()) if row["box_center"] is not None)
    everything = SceneEntityDeletion(timestamp=time, type=SceneEntityDeletion.ALL)
    return SceneUpdate(deletions=[everything], entities=[_entity(row, time) for row in boxed])


def _entity(row: Row, time: Timestamp) -> SceneEntity:
    box = nuscenes_box(pose_matrix(row["box_center"], row["box_rotation_deg"]), row["box_extent"])
    width, length, height = box.size.tolist()
    w, x, y, z = box.rotation.tolist()
    cube = CubePrimitive(
        pose=Pose(position=_vector(box.translation), orientation=Quaternion(x=x, y=y, z=z, w=w)),
        size=Vector3(x=length, y=width, z=height),
        color=_colour(row["class"], 0.5),
    )
    facts = {"class": row["class"], "blueprint": row["blueprint"], "role_name": row["role_name"]}
    if row.get("traffic_light_state"):
        facts["traffic_light_state"] = row["traffic_light_state"]
    return SceneEntity(
        timestamp=time,
        frame_id=MAP,
        id=str(row["track_id"]),
        metadata=[KeyValuePair(key=key, value=value) for key, value in facts.items()],
        cubes=[cube],
    )


def _pose(matrix: FloatArray) -> Pose:
    return Pose(position=_vector(matrix[:3, 3]), orientation=_quaternion(matrix))


def _vector(values: Any) -> Vector3:
    x, y, z = (float(value) for value in values)
    return Vector3(x=x, y=y, z=z)


def _quaternion(matrix: FloatArray) -> Quaternion:
    w, x, y, z = quaternion_from_matrix(matrix[:3, :3]).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)


def _colour(name: str, alpha: float) -> Color:
    red, green, blue = class_colour(name)
    return Color(r=red / 255, g=green / 255, b=blue / 255, a=alpha)
