"""Messages that Foxglove has no schema for: package ``carstage``, made here without a compiler.

docs/formats/exports.md lists their fields.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Final

from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

_Field = FieldDescriptorProto
_SCALARS: Final = {
    "double": _Field.TYPE_DOUBLE,
    "int32": _Field.TYPE_INT32,
    "bool": _Field.TYPE_BOOL,
    "string": _Field.TYPE_STRING,
}
_PARTS: Final[dict[str, type[Message]]] = {
    "Timestamp": Timestamp,
    "Vector3": Vector3,
}
_STAMP: Final = ("timestamp Timestamp", "frame_id string")
TYPES: Final[dict[str, tuple[str, ...]]] = {
    "Imu": (
        *_STAMP,
        "linear_acceleration Vector3",
        "angular_velocity Vector3",
        "compass_rad double",
    ),
    "EgoState": (
        *_STAMP,
        "acceleration Vector3",
        "speed_m_s double",
        "yaw_rate_rad_s double",
        "throttle double?",
        "steer double?",
        "brake double?",
        "hand_brake bool?",
        "reverse bool?",
        "gear int32?",
        "speed_limit_kmh double?",
        "traffic_light_state string?",
        "weather_preset string?",
        "weather string",
    ),
    "Readings": (*_STAMP, "names string*", "values double*"),
}
"""By name, the fields with their types; ``?``: may be absent; ``*``: repeated. Numbers from 1."""


@cache
def message_class(name: str) -> Any:
    """The class of a message of ``TYPES``."""
    found = _pool().FindMessageTypeByName(f"carstage.{name}")
    return message_factory.GetMessageClass(found)


@cache
def _pool() -> Any:
    """The default pool, with our file in it."""
    pool = descriptor_pool.Default()
    pool.AddSerializedFile(file_descriptor().SerializeToString())
    return pool


def file_descriptor() -> FileDescriptorProto:
    """What a compiler would make of our messages."""
    file = FileDescriptorProto(name="carstage/messages.proto", package="carstage", syntax="proto3")
    file.dependency.extend(part.DESCRIPTOR.file.name for part in _PARTS.values())
    for name, fields in TYPES.items():
        message = file.message_type.add(name=name)
        for number, line in enumerate(fields, 1):
            field, kind = line.split()
            added = message.field.add(name=field, number=number, json_name=_camel(field))
            added.label = _Field.LABEL_REPEATED if kind.endswith("*") else _Field.LABEL_OPTIONAL
            if kind.endswith("?"):
                added.proto3_optional = True
                added.oneof_index = len(message.oneof_decl)
                message.oneof_decl.add(name=f"_{field}")
            _set_type(added, kind.rstrip("?*"))
    return file


def _set_type(field: FieldDescriptorProto, kind: str) -> None:
    if kind in _SCALARS:
        field.type = _SCALARS[kind]
    else:
        field.type = _Field.TYPE_MESSAGE
        field.type_name = f".{_PARTS[kind].DESCRIPTOR.full_name}"


def _camel(name: str) -> str:
    first, *rest = name.split("_")
    return first + "".join(part.capitalize() for part in rest)
