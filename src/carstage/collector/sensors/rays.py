"""Sensors that measure by rays: LiDAR, semantic LiDAR, radar. Payloads are the client's bytes."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor, register
from carstage.rawlog.format import Buffer


class RaySensor(Sensor):
    """A sensor that returns a record for each ray that hit something."""

    bytes_per_point = 16

    @classmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Every ray hits."""
        return int(float(attributes["points_per_second"]) / fps) * cls.bytes_per_point

    @classmethod
    def size_bytes(cls, data: Any) -> int:
        """Points by the bytes of a point."""
        return len(data) * cls.bytes_per_point


@register("lidar")
class Lidar(RaySensor):
    """``sensor.lidar.ray_cast``: float32 x, y, z, intensity per point, grouped by channel."""

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta ``{"horizontal_angle_rad", "counts"}``; the payload is a view into the cloud."""
        meta = {
            "horizontal_angle_rad": data.horizontal_angle,
            "counts": [data.get_point_count(channel) for channel in range(data.channels)],
        }
        return meta, memoryview(data.raw_data)


@register("semantic_lidar")
class SemanticLidar(Lidar):
    """``sensor.lidar.ray_cast_semantic``: float32 x, y, z, cosine; uint32 object id, tag."""

    bytes_per_point = 24


@register("radar")
class Radar(RaySensor):
    """``sensor.other.radar``: float32 range rate (m/s), azimuth, altitude (rad), depth (m)."""

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; the payload is a view into the detections."""
        return {}, memoryview(data.raw_data)
