"""The records of a frame as ROS 2 messages (CDR), made without ROS.

Only messages that come with ROS 2 itself, and those of vision_msgs: so a file can be played back
wherever these are installed. Topics are ``/tf``, ``/objects``, ``/ego/WHAT`` and ``/SENSOR/WHAT``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.exporters.axes import quaternion_from_matrix
from carstage.exporters.formats import mcap_records as records
from carstage.exporters.formats.mcap_messages import (
    EGO_SIGNALS,
    OBJECT_FACTS,
    Stamped,
    nanoseconds,
)
from carstage.exporters.formats.ros2_types import definition, message_class, serialise
from carstage.exporters.lenses import (
    FIRST_CENTRE_PX,
    ROS_MODELS,
    named_distortion,
    opencv_matrix,
)
from carstage.geometry import FloatArray
from carstage.report.drawing import class_colour

PROFILE = "ros2"
_POINT_NUMBERS: Final = {"<f4": 7, "<u4": 6}  # PointField.FLOAT32, UINT32
_NO_COVARIANCE: Final = np.zeros(9)
_NO_ORIENTATION: Final = np.array([-1.0, *[0.0] * 8])
"""``sensor_msgs/Imu``: a first element of -1 says that there is no estimate."""
_NO_DISTORTION: Final = ("plumb_bob", [0.0] * 5)
_CUBE, _ADD, _DELETE_ALL = 1, 0, 3  # of visualization_msgs/Marker

_Made = Iterator[tuple[str, Any]]


def messages(record: records.Record, time_s: float) -> Iterator[Stamped]:
    """The messages of a record, all at one time."""
    seconds, rest = divmod(nanoseconds(time_s), 10**9)
    time = message_class("builtin_interfaces/msg/Time")(sec=seconds, nanosec=rest)
    for topic, message in _MAKERS[type(record)](record, time):
        name = message.__msgtype__
        yield Stamped(topic_name(topic), name, serialise(message, name))


def topic_name(topic: str) -> str:
    """A topic as ROS 2 takes it: letters, digits, ``_``; no part begins with a digit.

    Source of the rule: ``rmw_validate_full_topic_name``. Ids of sensors have ``.`` and ``-``, too.
    """
    return re.sub("/(?=[0-9])", "/_", re.sub("[^A-Za-z0-9_/]", "_", topic))


def schema(name: str) -> tuple[str, str, bytes]:
    """How messages of a type are coded, how its schema is, and the schema: all that it is of."""
    return "cdr", "ros2msg", definition(name).encode()


def _transforms(record: records.Transforms, time: Any) -> _Made:
    transforms = [
        _make(
            "geometry_msgs/msg/TransformStamped", header=_header(time, parent),
            child_frame_id=child,
            transform=_make(
                "geometry_msgs/msg/Transform", translation=_vector(pose[:3, 3]),
                rotation=_quaternion(quaternion_from_matrix(pose[:3, :3])),
            ),
        )
        for parent, child, pose in record.poses
    ]  # fmt: skip
    yield "/tf", _make("tf2_msgs/msg/TFMessage", transforms=transforms)


def _objects(record: records.Objects, time: Any) -> _Made:
    header = _header(time, records.MAP)
    detections = [
        _make(
            "vision_msgs/msg/Detection3D", header=header, results=[_hypothesis(found.name)],
            bbox=_make("vision_msgs/msg/BoundingBox3D", center=_box_pose(found), size=_size(found)),
            id=str(found.row["track_id"]),
        )
        for found in record.boxes
    ]  # fmt: skip
    yield (
        "/objects",
        _make("vision_msgs/msg/Detection3DArray", header=header, detections=detections),
    )
    markers = [_marker(header, 0, _DELETE_ALL)]
    markers += [
        _marker(
            header, number, _ADD, ns=found.name, pose=_box_pose(found), scale=_size(found),
            color=_colour(found.row["class"]), text=_facts(found),
        )
        for number, found in enumerate(record.boxes)
    ]  # fmt: skip
    yield "/objects/markers", _make("visualization_msgs/msg/MarkerArray", markers=markers)


def _facts(found: records.ObjectBox) -> str:
    """What a marker has no field for, a line each."""
    row = found.row
    facts = {"track_id": row["track_id"]} | {key: row.get(key) for key in OBJECT_FACTS}
    return "\n".join(f"{key}: {value}" for key, value in facts.items() if value not in (None, ""))


def _marker(header: Any, number: int, action: int, **given: Any) -> Any:
    fields: dict[str, Any] = {
        "ns": "", "pose": _pose(np.zeros(3), (1.0, 0.0, 0.0, 0.0)), "scale": _vector(np.ones(3)),
        "color": _make("std_msgs/msg/ColorRGBA", r=0.0, g=0.0, b=0.0, a=0.0), "text": "",
    }  # fmt: skip
    none = _make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    nobytes = np.zeros(0, np.uint8)
    return _make(
        "visualization_msgs/msg/Marker", header=header, id=number, type=_CUBE, action=action,
        lifetime=_make("builtin_interfaces/msg/Duration", sec=0, nanosec=0), frame_locked=False,
        points=[], colors=[], texture_resource="",
        texture=_make(
            "sensor_msgs/msg/CompressedImage", header=_header(none, ""), format="", data=nobytes
        ),
        uv_coordinates=[], mesh_resource="",
        mesh_file=_make("visualization_msgs/msg/MeshFile", filename="", data=nobytes),
        mesh_use_embedded_materials=False, **{**fields, **given},
    )  # fmt: skip


def _ego(record: records.EgoState, time: Any) -> _Made:
    pose, on_map, on_ego = record.pose, _header(time, records.MAP), _header(time, records.EGO)
    yield "/ego/odometry", _make(
        "nav_msgs/msg/Odometry", header=on_map, child_frame_id=records.EGO,
        pose=_with_covariance(_pose(pose[:3, 3], quaternion_from_matrix(pose[:3, :3]))),
        twist=_make(
            "geometry_msgs/msg/TwistWithCovariance", covariance=np.zeros(36),
            twist=_make(
                "geometry_msgs/msg/Twist", linear=_vector(record.velocity),
                angular=_vector(record.angular_velocity),
            ),
        ),
    )  # fmt: skip
    if record.acceleration is not None:
        yield "/ego/acceleration", _make(
            "geometry_msgs/msg/AccelStamped", header=on_ego,
            accel=_make(
                "geometry_msgs/msg/Accel", linear=_vector(record.acceleration),
                angular=_vector(np.zeros(3)),
            ),
        )  # fmt: skip
    row = record.row
    place = (row["latitude_deg"], row["longitude_deg"], row["altitude_m"])
    yield "/ego/fix", _fix(on_ego, *place)
    signals = {"speed_m_s": row["speed"], "yaw_rate_rad_s": row["yaw_rate_flu"]}
    signals |= {name: row[name] for name in EGO_SIGNALS if row[name] is not None}
    yield "/ego/signals", _named_values(on_ego, "ego", signals)


def _coded_picture(record: records.CodedPicture, time: Any) -> _Made:
    yield f"/{record.sensor}/image/compressed", _make(
        "sensor_msgs/msg/CompressedImage", header=_header(time, record.sensor),
        format=record.format, data=np.frombuffer(record.data, np.uint8),
    )  # fmt: skip


def _pixels(record: records.Pixels, time: Any) -> _Made:
    pixels = np.ascontiguousarray(record.pixels)
    height, width = pixels.shape[:2]
    yield f"/{record.sensor}/{record.what}", _make(
        "sensor_msgs/msg/Image", header=_header(time, record.sensor), height=height, width=width,
        encoding=record.encoding, is_bigendian=0, step=pixels.nbytes // height,
        data=np.frombuffer(pixels.tobytes(), np.uint8),
    )  # fmt: skip


def _camera(record: records.CameraModel, time: Any) -> _Made:
    camera = record.camera
    matrix = opencv_matrix(camera)
    model, coefficients = named_distortion(camera, ROS_MODELS)
    if not model:  # image_geometry takes a camera without a model for one of unknown distortion
        model, coefficients = _NO_DISTORTION
    whole = _make(
        "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0,
        do_rectify=False,
    )  # fmt: skip
    yield f"/{camera.id}/camera_info", _make(
        "sensor_msgs/msg/CameraInfo", header=_header(time, camera.id), height=camera.height,
        width=camera.width, distortion_model=model, d=np.array(coefficients, np.float64),
        k=matrix.ravel(),
        r=np.eye(3).ravel(), p=np.hstack([matrix, np.zeros((3, 1))]).ravel(), binning_x=0,
        binning_y=0, roi=whole,
    )  # fmt: skip


def _labels(record: records.Labels, time: Any) -> _Made:
    header = _header(time, record.sensor)
    detections = []
    for name, label in record.labels:
        x0, y0, x1, y1 = label.box
        middle = _make(
            "vision_msgs/msg/Point2D",
            x=(x0 + x1) / 2 - FIRST_CENTRE_PX, y=(y0 + y1) / 2 - FIRST_CENTRE_PX,
        )  # fmt: skip
        box = _make(
            "vision_msgs/msg/BoundingBox2D", size_x=x1 - x0, size_y=y1 - y0,
            center=_make("vision_msgs/msg/Pose2D", position=middle, theta=0.0),
        )  # fmt: skip
        detections.append(
            _make(
                "vision_msgs/msg/Detection2D", header=header, results=[_hypothesis(name)],
                bbox=box, id=str(label.seen["track_id"]),
            )
        )  # fmt: skip
    yield (
        f"/{record.sensor}/annotations",
        _make("vision_msgs/msg/Detection2DArray", header=header, detections=detections),
    )


def _cloud(record: records.Cloud, time: Any) -> _Made:
    kind = record.points.dtype
    columns: Mapping[str, Any] = kind.fields or {}
    fields = [
        _make(
            "sensor_msgs/msg/PointField", name=name, offset=columns[name][1],
            datatype=_POINT_NUMBERS[columns[name][0].str], count=1,
        )
        for name in kind.names or ()
    ]  # fmt: skip
    yield f"/{record.sensor}/points", _make(
        "sensor_msgs/msg/PointCloud2", header=_header(time, record.sensor), height=1,
        width=len(record.points), fields=fields, is_bigendian=False, point_step=kind.itemsize,
        row_step=record.points.nbytes, data=np.frombuffer(record.points.tobytes(), np.uint8),
        is_dense=True,
    )  # fmt: skip


def _inertial(record: records.Inertial, time: Any) -> _Made:
    yield f"/{record.sensor}/imu", _make(
        "sensor_msgs/msg/Imu", header=_header(time, record.sensor),
        orientation=_quaternion((1.0, 0.0, 0.0, 0.0)), orientation_covariance=_NO_ORIENTATION,
        angular_velocity=_vector(record.angular_velocity),
        angular_velocity_covariance=_NO_COVARIANCE,
        linear_acceleration=_vector(record.acceleration),
        linear_acceleration_covariance=_NO_COVARIANCE,
    )  # fmt: skip
    yield f"/{record.sensor}/compass", _make("std_msgs/msg/Float64", data=record.compass_rad)


def _position(record: records.Position, time: Any) -> _Made:
    place = (record.latitude_deg, record.longitude_deg, record.altitude_m)
    yield f"/{record.sensor}/fix", _fix(_header(time, record.sensor), *place)


def _values(record: records.Values, time: Any) -> _Made:
    named = dict(zip(record.names, record.values, strict=True))
    yield (
        f"/{record.sensor}/readings",
        _named_values(_header(time, record.sensor), record.sensor, named),
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


def _make(name: str, /, **fields: Any) -> Any:
    return message_class(name)(**fields)


def _header(time: Any, frame_id: str) -> Any:
    return _make("std_msgs/msg/Header", stamp=time, frame_id=frame_id)


def _hypothesis(name: str) -> Any:
    """A class that is known for sure; where the object is stands in its box."""
    return _make(
        "vision_msgs/msg/ObjectHypothesisWithPose",
        hypothesis=_make("vision_msgs/msg/ObjectHypothesis", class_id=name, score=1.0),
        pose=_with_covariance(_pose(np.zeros(3), (1.0, 0.0, 0.0, 0.0))),
    )


def _with_covariance(pose: Any) -> Any:
    return _make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36))


def _fix(header: Any, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Any:
    status = _make("sensor_msgs/msg/NavSatStatus", status=0, service=1)  # STATUS_FIX, SERVICE_GPS
    return _make(
        "sensor_msgs/msg/NavSatFix", header=header, status=status, latitude=latitude_deg,
        longitude=longitude_deg, altitude=altitude_m, position_covariance=_NO_COVARIANCE,
        position_covariance_type=0,
    )  # fmt: skip


def _named_values(header: Any, name: str, values: Mapping[str, Any]) -> Any:
    """Numbers and words with names; ``repr`` of a number reads back as the same number."""
    pairs = [
        _make("diagnostic_msgs/msg/KeyValue", key=key, value=_text(value))
        for key, value in values.items()
    ]
    status = _make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=0, name=name, message="", hardware_id="", values=pairs,
    )  # fmt: skip
    return _make("diagnostic_msgs/msg/DiagnosticArray", header=header, status=[status])


def _text(value: Any) -> str:
    return value if isinstance(value, str) else repr(value)


def _box_pose(found: records.ObjectBox) -> Any:
    return _pose(found.box.translation, found.box.rotation)


def _size(found: records.ObjectBox) -> Any:
    width, length, height = found.box.size
    return _vector((length, width, height))


def _pose(place: NDArray[Any], rotation: Iterable[float]) -> Any:
    x, y, z = (float(value) for value in place)
    point = _make("geometry_msgs/msg/Point", x=x, y=y, z=z)
    return _make("geometry_msgs/msg/Pose", position=point, orientation=_quaternion(rotation))


def _vector(values: Iterable[float]) -> Any:
    x, y, z = (float(value) for value in values)
    return _make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _quaternion(wxyz: Iterable[float] | FloatArray) -> Any:
    w, x, y, z = (float(value) for value in wxyz)
    return _make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def _colour(name: str) -> Any:
    red, green, blue = class_colour(name)
    return _make("std_msgs/msg/ColorRGBA", r=red / 255, g=green / 255, b=blue / 255, a=0.5)
