"""ROS 2 message types without ROS: those of the ``rosbags`` package, and detections beside them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

_VISION: Final[Mapping[str, tuple[str, ...]]] = {
    "Point2D": ("float64 x", "float64 y"),
    "Pose2D": ("vision_msgs/Point2D position", "float64 theta"),
    "BoundingBox2D": ("vision_msgs/Pose2D center", "float64 size_x", "float64 size_y"),
    "BoundingBox3D": ("geometry_msgs/Pose center", "geometry_msgs/Vector3 size"),
    "ObjectHypothesis": ("string class_id", "float64 score"),
    "ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis",
        "geometry_msgs/PoseWithCovariance pose",
    ),
    "Detection2D": (
        "std_msgs/Header header",
        "vision_msgs/ObjectHypothesisWithPose[] results",
        "vision_msgs/BoundingBox2D bbox",
        "string id",
    ),
    "Detection3D": (
        "std_msgs/Header header",
        "vision_msgs/ObjectHypothesisWithPose[] results",
        "vision_msgs/BoundingBox3D bbox",
        "string id",
    ),
    "Detection2DArray": ("std_msgs/Header header", "vision_msgs/Detection2D[] detections"),
    "Detection3DArray": ("std_msgs/Header header", "vision_msgs/Detection3D[] detections"),
}
"""The messages of vision_msgs 4 (ROS 2 Humble and later) that we write: fields by name."""


@cache
def typestore() -> Typestore:
    """ROS 2 Humble's types, which later releases read too, and those of vision_msgs."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    found: dict[str, Any] = {}
    for name, fields in _VISION.items():
        found |= get_types_from_msg("\n".join(fields), f"vision_msgs/msg/{name}")
    store.register(found)
    return store


@cache
def message_class(name: str) -> Any:
    """The class of a message such as ``sensor_msgs/msg/Image``."""
    return typestore().types[name]


@cache
def definition(name: str) -> str:
    """The text of a message's definition, with those of all messages in it."""
    return typestore().generate_msgdef(name, ros_version=2)[0]


def serialise(message: Any, name: str) -> bytes:
    """A message as CDR, little-endian."""
    return bytes(typestore().serialize_cdr(message, name))
