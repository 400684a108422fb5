"""Sensor messages: a 48-byte header and a payload per type of frame, without copies of the data."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import msgpack
import numpy as np

from carstage_sim.sensors.measurements import (
    CollisionFrame,
    DvsFrame,
    FlowFrame,
    GnssFrame,
    ImageFrame,
    ImuFrame,
    LidarFrame,
    ObstacleFrame,
    RadarFrame,
    SemanticLidarFrame,
    SensorFrame,
    V2xFrame,
)
from carstage_sim.world.pose import Pose

if TYPE_CHECKING:
    from typing_extensions import Buffer

_HEADER = struct.Struct("<QQd6f")
_IMAGE = struct.Struct("<IIf")
_LIDAR = struct.Struct("<fI")

Describe = Callable[[int, int], list[Any]]
"""Gives an ``Actor`` by its id, or for id 0 the part of the town that has a semantic label."""

_Encoder = Callable[[Any], Sequence["Buffer"]]
_EventEncoder = Callable[[Any, Describe], Sequence["Buffer"]]
_ENCODERS: dict[type, _EventEncoder] = {}


def _encodes(frame_type: type) -> Callable[[_Encoder], _Encoder]:
    def register(encoder: _Encoder) -> _Encoder:
        _ENCODERS[frame_type] = lambda frame, _describe: encoder(frame)
        return encoder

    return register


def _encodes_event(frame_type: type) -> Callable[[_EventEncoder], _EventEncoder]:
    def register(encoder: _EventEncoder) -> _EventEncoder:
        _ENCODERS[frame_type] = encoder
        return encoder

    return register


def sensor_header(sensor_type: int, frame: int, timestamp_s: float, pose: Pose) -> bytes:
    """The header of every message: registry index, frame, simulated time, the sensor's pose."""
    return _HEADER.pack(sensor_type, frame, timestamp_s, *pose.location, *pose.rotation_deg)


def encode_frame(frame: SensorFrame, describe: Describe) -> Sequence[Buffer]:
    """The payload of a frame, in pieces that alias its arrays.

    Args:
        frame: what a sensor sends.
        describe: asked for the actors of an event, which go out whole.

    Raises:
        KeyError: no encoder for this type of frame.
    """
    return _ENCODERS[type(frame)](frame, describe)


@_encodes(ImageFrame)
def _image(frame: ImageFrame) -> Sequence[Buffer]:
    height, width, _ = frame.pixels.shape
    return [_IMAGE.pack(width, height, frame.fov_deg), np.ascontiguousarray(frame.pixels).data]


@_encodes(FlowFrame)
def _flow(frame: FlowFrame) -> Sequence[Buffer]:
    height, width, _ = frame.flow.shape
    pixels = np.ascontiguousarray(frame.flow, np.float32)
    return [_IMAGE.pack(width, height, frame.fov_deg), pixels.data]


@_encodes(DvsFrame)
def _dvs(frame: DvsFrame) -> Sequence[Buffer]:
    header = _IMAGE.pack(frame.width, frame.height, frame.fov_deg)
    return [header, np.ascontiguousarray(frame.events).view(np.uint8).data]


@_encodes(LidarFrame)
def _lidar(frame: LidarFrame) -> Sequence[Buffer]:
    counts = np.ascontiguousarray(frame.channel_counts, np.uint32)
    header = _LIDAR.pack(frame.horizontal_angle_rad, len(counts))
    return [header, counts.data, np.ascontiguousarray(frame.points, np.float32).data]


@_encodes(SemanticLidarFrame)
def _semantic_lidar(frame: SemanticLidarFrame) -> Sequence[Buffer]:
    counts = np.ascontiguousarray(frame.channel_counts, np.uint32)
    header = _LIDAR.pack(frame.horizontal_angle_rad, len(counts))
    return [header, counts.data, np.ascontiguousarray(frame.points).view(np.uint8).data]


@_encodes(RadarFrame)
def _radar(frame: RadarFrame) -> Sequence[Buffer]:
    return [np.ascontiguousarray(frame.detections, np.float32).data]


@_encodes(ImuFrame)
def _imu(frame: ImuFrame) -> Sequence[Buffer]:
    return [_packed([list(frame.accelerometer), list(frame.gyroscope), frame.compass_rad])]


@_encodes(GnssFrame)
def _gnss(frame: GnssFrame) -> Sequence[Buffer]:
    return [_packed([frame.latitude_deg, frame.longitude_deg, frame.altitude_m])]


@_encodes_event(CollisionFrame)
def _collision(frame: CollisionFrame, describe: Describe) -> Sequence[Buffer]:
    other = describe(frame.other_id, frame.label)
    return [_packed([describe(frame.actor_id, 0), other, list(frame.impulse)])]


@_encodes_event(ObstacleFrame)
def _obstacle(frame: ObstacleFrame, describe: Describe) -> Sequence[Buffer]:
    other = describe(frame.other_id, frame.label)
    return [_packed([describe(frame.actor_id, 0), other, frame.distance_m])]


@_encodes(V2xFrame)
def _v2x(frame: V2xFrame) -> Sequence[Buffer]:
    return [np.ascontiguousarray(frame.messages).view(np.uint8).data]


def _packed(value: list[Any]) -> bytes:
    packed: bytes = msgpack.packb(value)
    return packed
