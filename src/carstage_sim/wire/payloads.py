"""Sensor messages: a 48-byte header and a payload per type of frame, without copies of the data."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import msgpack
import numpy as np

from carstage_sim.sensors.frames import (
    FlowFrame,
    GnssFrame,
    ImageFrame,
    ImuFrame,
    LidarFrame,
    RadarFrame,
    SemanticLidarFrame,
    SensorFrame,
)
from carstage_sim.world.pose import Pose

if TYPE_CHECKING:
    from typing_extensions import Buffer

_HEADER = struct.Struct("<QQd6f")
_IMAGE = struct.Struct("<IIf")
_LIDAR = struct.Struct("<fI")

_Encoder = Callable[[Any], Sequence["Buffer"]]
_ENCODERS: dict[type, _Encoder] = {}


def _encodes(frame_type: type) -> Callable[[_Encoder], _Encoder]:
    def register(encoder: _Encoder) -> _Encoder:
        _ENCODERS[frame_type] = encoder
        return encoder

    return register


def sensor_header(sensor_type: int, frame: int, timestamp_s: float, pose: Pose) -> bytes:
    """The header of every message: registry index, frame, simulated time, the sensor's pose."""
    return _HEADER.pack(sensor_type, frame, timestamp_s, *pose.location, *pose.rotation_deg)


def encode_frame(frame: SensorFrame) -> Sequence[Buffer]:
    """The payload of a frame, in pieces that alias its arrays.

    Raises:
        KeyError: no encoder for this type of frame.
    """
    return _ENCODERS[type(frame)](frame)


@_encodes(ImageFrame)
def _image(frame: ImageFrame) -> Sequence[Buffer]:
    height, width, _ = frame.pixels.shape
    return [_IMAGE.pack(width, height, frame.fov_deg), np.ascontiguousarray(frame.pixels).data]


@_encodes(FlowFrame)
def _flow(frame: FlowFrame) -> Sequence[Buffer]:
    height, width, _ = frame.flow.shape
    pixels = np.ascontiguousarray(frame.flow, np.float32)
    return [_IMAGE.pack(width, height, frame.fov_deg), pixels.data]


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


def _packed(value: list[Any]) -> bytes:
    packed: bytes = msgpack.packb(value)
    return packed
