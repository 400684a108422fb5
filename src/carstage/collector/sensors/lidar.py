"""Ray-cast LiDAR."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from carstage.collector.sensors.base import Attributes, Sensor, register
from carstage.rawlog.format import Buffer

BYTES_PER_POINT = 16


@register("lidar")
class Lidar(Sensor):
    """``sensor.lidar.ray_cast``: float32 x, y, z, intensity per point, grouped by channel."""

    @classmethod
    def defaults(cls, fps: float) -> Dict[str, str]:
        """One full sweep per tick, 100 m, 64 channels, no drop-off.

        CARLA's own defaults (10 m, 10 Hz, 45 % drop-off) give half sweeps and thinned clouds.
        """
        attributes = super().defaults(fps)
        attributes.update(
            {
                "channels": "64",
                "range": "100.0",
                "points_per_second": str(round(64 * 1024 * fps)),
                "rotation_frequency": repr(float(fps)),
                "upper_fov": "10.0",
                "lower_fov": "-30.0",
                "dropoff_general_rate": "0.0",
                "dropoff_intensity_limit": "1.0",
                "dropoff_zero_intensity": "0.0",
            }
        )
        return attributes

    @classmethod
    def expected_bytes(cls, attributes: Attributes, fps: float) -> int:
        """Every ray hits."""
        return int(float(attributes["points_per_second"]) / fps) * BYTES_PER_POINT

    @classmethod
    def size_bytes(cls, data: Any) -> int:
        """Sixteen bytes per point."""
        return len(data) * BYTES_PER_POINT

    @classmethod
    def encode(cls, data: Any) -> Tuple[Dict[str, Any], Buffer]:
        """Meta ``{"horizontal_angle_rad", "counts"}``; the payload is a view into the cloud."""
        meta = {
            "horizontal_angle_rad": data.horizontal_angle,
            "counts": [data.get_point_count(channel) for channel in range(data.channels)],
        }
        return meta, memoryview(data.raw_data)
