"""Sensors of the ego's own state: IMU and GNSS."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor
from carstage.rawlog.format import Buffer


class Reading(Sensor):
    """The same few numbers in every frame, in the order of the table's columns."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Exact."""
        return self.datum_bytes

    def size_bytes(self, data: Any) -> int:
        """What the numbers take."""
        return self.datum_bytes

    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; the numbers."""
        return {}, self.kind.layout.pack(*self.numbers(data))

    @abstractmethod
    def numbers(self, data: Any) -> Tuple[float, ...]:
        """The numbers of a measurement."""


class Imu(Reading):
    """Accelerometer (m/s^2), gyroscope (rad/s), compass (rad)."""

    def numbers(self, data: Any) -> Tuple[float, ...]:
        """The two vectors, then the compass."""
        a, g = data.accelerometer, data.gyroscope
        return a.x, a.y, a.z, g.x, g.y, g.z, data.compass


class Gnss(Reading):
    """Latitude and longitude (deg), altitude (m)."""

    def numbers(self, data: Any) -> Tuple[float, ...]:
        """The three numbers."""
        return data.latitude, data.longitude, data.altitude
