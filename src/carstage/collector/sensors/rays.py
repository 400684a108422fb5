"""Sensors that measure by rays: LiDAR, semantic LiDAR, radar. Payloads are the client's bytes."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor
from carstage.rawlog.format import Buffer


class RaySensor(Sensor):
    """A sensor that returns a record for each ray that hit something."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Every ray hits."""
        return int(float(attributes["points_per_second"]) / fps) * self.datum_bytes

    def size_bytes(self, data: Any) -> int:
        """Points by the bytes of a point."""
        return len(data) * self.datum_bytes


class Lidar(RaySensor):
    """A rotating LiDAR: points grouped by channel."""

    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta ``{"horizontal_angle_rad", "counts"}``; the payload is a view into the cloud."""
        meta = {
            "horizontal_angle_rad": data.horizontal_angle,
            "counts": [data.get_point_count(channel) for channel in range(data.channels)],
        }
        return meta, memoryview(data.raw_data)


class SweepingLidar(Lidar):
    """A LiDAR whose points have times; after its lasers, one more channel has its motion."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Every ray hits, and the motion."""
        return super().expected_bytes(attributes, fps) + self.datum_bytes


class FlashRays(Lidar):
    """Rays of a flash LiDAR, which the client takes for a LiDAR with a channel for each beam."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """Every ray hits."""
        rays = int(attributes["columns"]) * int(attributes["rows"])
        return rays * int(attributes["samples"]) ** 2 * self.datum_bytes


class Occupancy(Lidar):
    """Occupied voxels, which the client takes for points of a LiDAR with one channel."""

    def expected_bytes(self, attributes: Attributes, fps: float) -> int:
        """A quarter of the voxels is occupied: twice as many as in a street of houses."""
        sides = (("ahead", "behind"), ("left", "right"), ("up", "down"))
        voxels = 1.0
        for one, other in sides:
            length_m = float(attributes[one]) + float(attributes[other])
            voxels *= length_m / float(attributes["resolution"])
        return int(voxels / 4.0) * self.datum_bytes


class Radar(RaySensor):
    """A radar: detections in the order in which they come."""

    def encode(self, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """No meta; the payload is a view into the detections."""
        return {}, memoryview(data.raw_data)
