"""Sensors of the ego's own state: IMU and GNSS."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor, register
from carstage.rawlog.format import GNSS_PAYLOAD, IMU_PAYLOAD, Buffer


@register("imu")
class Imu(Sensor):
    """``sensor.other.imu``: accelerometer (m/s^2), gyroscope (rad/s), compass (rad)."""

    @classmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Seven float64."""
        return IMU_PAYLOAD.size

    @classmethod
    def size_bytes(cls, data: Any) -> int:
        """Seven float64."""
        return IMU_PAYLOAD.size

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; accelerometer, gyroscope, compass."""
        a, g = data.accelerometer, data.gyroscope
        return {}, IMU_PAYLOAD.pack(a.x, a.y, a.z, g.x, g.y, g.z, data.compass)


@register("gnss")
class Gnss(Sensor):
    """``sensor.other.gnss``: latitude and longitude (deg), altitude (m)."""

    @classmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Three float64."""
        return GNSS_PAYLOAD.size

    @classmethod
    def size_bytes(cls, data: Any) -> int:
        """Three float64."""
        return GNSS_PAYLOAD.size

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; latitude, longitude, altitude."""
        return {}, GNSS_PAYLOAD.pack(data.latitude, data.longitude, data.altitude)
