"""What goes into and comes out of a capture: requests for sensors, frames of data.

The wire encodes frames; nothing here knows bytes of the protocol.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from carstage_sim.sensors.projection import GeoProjection


@dataclass(frozen=True, slots=True)
class SensorRequest:
    """One sensor that somebody listens to in this frame.

    Attributes:
        sensor_id: actor id of the sensor.
        type_id: blueprint id, ``sensor.camera.rgb``.
        attributes: all attributes as strings, as the client set them over the blueprint's defaults.
        location, rotation_deg: the sensor's world pose in this frame (m; pitch, yaw, roll in deg).
        owner_id: actor that it is attached to, 0 for none.
        ignored: ids of the actors that it looks through.
        gravity: m/s^2 that an IMU feels at rest.
        projection: how a GNSS sensor finds its place on the globe.
    """

    sensor_id: int
    type_id: str
    attributes: Mapping[str, str]
    location: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]
    owner_id: int
    ignored: frozenset[int] = frozenset()
    gravity: float = 9.81
    projection: GeoProjection = GeoProjection.TRANSVERSE_MERCATOR


@dataclass(frozen=True, slots=True)
class ImageFrame:
    """A camera picture: ``pixels`` is ``(H, W, 4)`` uint8 in the order B, G, R, A."""

    fov_deg: float
    pixels: NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class FlowFrame:
    """Motion in a picture: ``flow`` is ``(H, W, 2)`` float32 x, y in CARLA's units.

    Current minus previous position, in halves of the width and of the height, y upwards.
    """

    fov_deg: float
    flow: NDArray[np.float32]


class Bgra(IntEnum):
    """Channels of a picture's pixels, as CARLA sends them."""

    BLUE = 0
    GREEN = 1
    RED = 2
    ALPHA = 3


class PointColumn(IntEnum):
    """Columns of a LiDAR's points after x, y, z."""

    INTENSITY = 3


class Detection(IntEnum):
    """Columns of a radar's detections."""

    VELOCITY = 0
    AZIMUTH = 1
    ALTITUDE = 2
    DEPTH = 3


DVS_EVENT = np.dtype([("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("pol", "u1")])
"""An event of the event camera, 13 bytes: pixel, simulated ns, 1 for brighter and 0 for darker."""


@dataclass(frozen=True, slots=True)
class DvsFrame:
    """Events of a picture of ``width`` by ``height``: ``(N,)`` of :data:`DVS_EVENT` by time."""

    width: int
    height: int
    fov_deg: float
    events: NDArray[np.void]


@dataclass(frozen=True, slots=True)
class LidarFrame:
    """One tick of a ray-cast LiDAR.

    Attributes:
        horizontal_angle_rad: angle of the head at the end of the tick, as CARLA's header has it.
        channel_counts: ``(channels,)`` uint32 points per channel, top laser first.
        points: ``(N, 4)`` float32 x, y, z (sensor frame, m), intensity; grouped by channel.
    """

    horizontal_angle_rad: float
    channel_counts: NDArray[np.uint32]
    points: NDArray[np.float32]


SEMANTIC_POINT = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "cos_inc_angle")),
        *((name, "<u4") for name in ("object_idx", "object_tag")),
    ]
)
"""A point of the semantic LiDAR, 24 bytes: m in the sensor's frame, actor id, semantic tag."""


@dataclass(frozen=True, slots=True)
class SemanticLidarFrame:
    """One tick of a semantic LiDAR: as :class:`LidarFrame`, with points of another kind.

    Attributes:
        points: ``(N,)`` of :data:`SEMANTIC_POINT`, grouped by channel.
    """

    horizontal_angle_rad: float
    channel_counts: NDArray[np.uint32]
    points: NDArray[np.void]


@dataclass(frozen=True, slots=True)
class RadarFrame:
    """One tick of a radar.

    Attributes:
        detections: ``(N, 4)`` float32: velocity (m/s, positive = receding), azimuth (rad, positive
            to the right), altitude (rad, positive up), depth (m along the ray).
    """

    detections: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class ImuFrame:
    """Accelerometer (m/s^2, sensor frame), gyroscope (rad/s), compass (rad, north = 0)."""

    accelerometer: tuple[float, float, float]
    gyroscope: tuple[float, float, float]
    compass_rad: float


@dataclass(frozen=True, slots=True)
class GnssFrame:
    """Latitude and longitude in degrees, altitude in metres."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class CollisionFrame:
    """One thing that a sensor's carrier touched in this tick.

    Attributes:
        actor_id: the carrier.
        other_id: what it touched, 0 for the town.
        label: semantic label of what of the town it touched, else 0.
        impulse: N s in the world that the carrier got.
    """

    actor_id: int
    other_id: int
    label: int
    impulse: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ObstacleFrame:
    """The nearest thing in a sensor's way.

    Attributes:
        actor_id: the sensor itself, as CARLA has it.
        other_id: what stands there, 0 for the town.
        label: semantic label of what of the town stands there, else 0.
        distance_m: how far the sensor's ball can go until it touches it.
    """

    actor_id: int
    other_id: int
    label: int
    distance_m: float


@dataclass(frozen=True, slots=True)
class V2xFrame:
    """What a V2X sensor received in a tick.

    Attributes:
        messages: ``(N,)`` of :data:`carstage_sim.sensors.cam.CAM_DATA` or ``CUSTOM_DATA``.
    """

    messages: NDArray[np.void]


SensorFrame = (
    ImageFrame
    | FlowFrame
    | DvsFrame
    | LidarFrame
    | SemanticLidarFrame
    | RadarFrame
    | ImuFrame
    | GnssFrame
    | CollisionFrame
    | ObstacleFrame
    | V2xFrame
)
