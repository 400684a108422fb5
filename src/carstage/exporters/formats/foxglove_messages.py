"""The records of a frame as messages of Foxglove's schemas (protobuf), and ours where it has none.

Topics are ``/tf``, ``/objects``, ``/ego/WHAT`` and ``/SENSOR/WHAT``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from foxglove_schemas_protobuf.Odometry_pb2 import Odometry
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from carstage.exporters.axes import quaternion_from_matrix
from carstage.exporters.formats import mcap_records as records
from carstage.exporters.formats.foxglove_types import TYPES, message_class
from carstage.exporters.formats.mcap_messages import (
    EGO_SIGNALS,
    OBJECT_FACTS,
    Stamped,
    nanoseconds,
)
from carstage.exporters.labels import CameraLabel
from carstage.exporters.lenses import FOXGLOVE_MODELS, named_distortion
from carstage.geometry import FloatArray
from carstage.report.drawing import class_colour

PROFILE = ""
_SCHEMAS: dict[str, type[Message]] = {
    kind.DESCRIPTOR.full_name: kind
    for kind in (
        CameraCalibration, CompressedImage, FrameTransforms, ImageAnnotations, LocationFix,
        Odometry, PointCloud, RawImage, SceneUpdate,
    )
}  # fmt: skip
_NUMBERS = {"<f4": PackedElementField.FLOAT32, "<u4": PackedElementField.UINT32}


def messages(record: records.Record, time_s: float) -> Iterator[Stamped]:
    """The messages of a record, all at one time."""
    stamp = Timestamp(seconds=nanoseconds(time_s) // 10**9, nanos=nanoseconds(time_s) % 10**9)
    for topic, message in _MAKERS[type(record)](record, stamp):
        data = message.SerializeToString(deterministic=True)
        yield Stamped(topic, message.DESCRIPTOR.full_name, data)


def schema(name: str) -> tuple[str, str, bytes]:
    """How messages of a type are coded, how its schema is, and the schema: all that it is of."""
    found: dict[str, Any] = {}

    def collect(file: Any) -> None:
        for dependency in file.dependencies:
            collect(dependency)
        found.setdefault(file.name, file)

    own = name.removeprefix("carstage.")
    kind = message_class(own) if own in TYPES else _SCHEMAS[name]
    collect(kind.DESCRIPTOR.file)
    descriptors = FileDescriptorSet()
    for file in found.values():
        file.CopyToProto(descriptors.file.add())
    return "protobuf", "protobuf", descriptors.SerializeToString()


_Made = Iterator[tuple[str, Message]]


def _transforms(record: records.Transforms, time: Timestamp) -> _Made:
    yield "/tf", FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=time, parent_frame_id=parent, child_frame_id=child,
                translation=_vector(pose[:3, 3]), rotation=_quaternion(pose),
            )
            for parent, child, pose in record.poses
        ]
    )  # fmt: skip


def _objects(record: records.Objects, time: Timestamp) -> _Made:
    everything = SceneEntityDeletion(timestamp=time, type=SceneEntityDeletion.ALL)
    entities = [_entity(box, time) for box in record.boxes]
    yield "/objects", SceneUpdate(deletions=[everything], entities=entities)


def _entity(found: records.ObjectBox, time: Timestamp) -> SceneEntity:
    row, box = found.row, found.box
    width, length, height = box.size.tolist()
    w, x, y, z = box.rotation.tolist()
    cube = CubePrimitive(
        pose=Pose(position=_vector(box.translation), orientation=Quaternion(x=x, y=y, z=z, w=w)),
        size=Vector3(x=length, y=width, z=height),
        color=_colour(row["class"], 0.5),
    )
    facts = {"name": found.name} | {key: row[key] for key in OBJECT_FACTS if row.get(key)}
    return SceneEntity(
        timestamp=time,
        frame_id=records.MAP,
        id=str(row["track_id"]),
        metadata=[KeyValuePair(key=key, value=value) for key, value in facts.items()],
        cubes=[cube],
    )


def _ego(record: records.EgoState, time: Timestamp) -> _Made:
    row = record.row
    yield "/ego/odometry", Odometry(
        timestamp=time, frame_id=records.MAP, body_frame_id=records.EGO, pose=_pose(record.pose),
        linear_velocity=_vector(record.velocity),
        angular_velocity=_vector(record.angular_velocity),
    )  # fmt: skip
    yield "/ego/fix", LocationFix(
        timestamp=time, frame_id=records.EGO, latitude=row["latitude_deg"],
        longitude=row["longitude_deg"], altitude=row["altitude_m"],
    )  # fmt: skip
    state = message_class("EgoState")(
        timestamp=time, frame_id=records.EGO, speed_m_s=row["speed"],
        yaw_rate_rad_s=row["yaw_rate_flu"],
    )  # fmt: skip
    if record.acceleration is not None:
        state.acceleration.CopyFrom(_vector(record.acceleration))
    for name in EGO_SIGNALS:
        if row[name] is not None:
            setattr(state, name, row[name])
    yield "/ego/state", state


def _coded_picture(record: records.CodedPicture, time: Timestamp) -> _Made:
    yield (
        f"/{record.sensor}/image",
        CompressedImage(
            timestamp=time, frame_id=record.sensor, data=record.data, format=record.format
        ),
    )


def _pixels(record: records.Pixels, time: Timestamp) -> _Made:
    pixels = np.ascontiguousarray(record.pixels)
    height, width = pixels.shape[:2]
    yield f"/{record.sensor}/{record.what}", RawImage(
        timestamp=time, frame_id=record.sensor, width=width, height=height,
        encoding=record.encoding, step=pixels.nbytes // height, data=pixels.tobytes(),
    )  # fmt: skip


def _camera(record: records.CameraModel, time: Timestamp) -> _Made:
    camera = record.camera
    projection = np.hstack([camera.k, np.zeros((3, 1))])
    model, coefficients = named_distortion(camera, FOXGLOVE_MODELS)
    yield f"/{camera.id}/calibration", CameraCalibration(
        timestamp=time, frame_id=camera.id, width=camera.width, height=camera.height,
        distortion_model=model, D=coefficients, K=camera.k.ravel().tolist(),
        R=np.eye(3).ravel().tolist(), P=projection.ravel().tolist(),
    )  # fmt: skip


def _labels(record: records.Labels, time: Timestamp) -> _Made:
    annotations = ImageAnnotations()
    for name, label in record.labels:
        _annotate(annotations, name, label, time)
    yield f"/{record.sensor}/annotations", annotations


def _annotate(
    annotations: ImageAnnotations, name: str, label: CameraLabel, time: Timestamp
) -> None:
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
            text=f"{name} {label.seen['track_id']}",
        )
    )  # fmt: skip


def _cloud(record: records.Cloud, time: Timestamp) -> _Made:
    kind = record.points.dtype
    fields: Mapping[str, Any] = kind.fields or {}
    yield (
        f"/{record.sensor}/points",
        PointCloud(
            timestamp=time,
            frame_id=record.sensor,
            pose=_pose(np.eye(4)),
            point_stride=kind.itemsize,
            fields=[
                PackedElementField(
                    name=name, offset=fields[name][1], type=_NUMBERS[fields[name][0].str]
                )
                for name in kind.names or ()
            ],
            data=record.points.tobytes(),
        ),
    )


def _inertial(record: records.Inertial, time: Timestamp) -> _Made:
    yield f"/{record.sensor}/imu", message_class("Imu")(
        timestamp=time, frame_id=record.sensor, linear_acceleration=_vector(record.acceleration),
        angular_velocity=_vector(record.angular_velocity), compass_rad=record.compass_rad,
    )  # fmt: skip


def _position(record: records.Position, time: Timestamp) -> _Made:
    yield f"/{record.sensor}/fix", LocationFix(
        timestamp=time, frame_id=record.sensor, latitude=record.latitude_deg,
        longitude=record.longitude_deg, altitude=record.altitude_m,
    )  # fmt: skip


def _values(record: records.Values, time: Timestamp) -> _Made:
    yield (
        f"/{record.sensor}/readings",
        message_class("Readings")(
            timestamp=time, frame_id=record.sensor, names=record.names, values=record.values
        ),
    )


_MAKERS: dict[type, Any] = {
    records.Transforms: _transforms,
    records.Objects: _objects,
    records.EgoState: _ego,
    records.CodedPicture: _coded_picture,
    records.Pixels: _pixels,
    records.CameraModel: _camera,
    records.Labels: _labels,
    records.Cloud: _cloud,
    records.Inertial: _inertial,
    records.Position: _position,
    records.Values: _values,
}


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
