"""What a LiDAR's rays brought back, put together in one pass."""

from __future__ import annotations

from carstage_sim.kernels import kernel
from carstage_sim.sensors.measurements import PointColumn

_INTENSITY = int(PointColumn.INTENSITY)


@kernel
def write_points(local, channel, distance, intensity, kept, points, counts):  # type: ignore[no-untyped-def]
    """Points of the returns that are kept: x, y, z, intensity; and how many each laser has."""
    count = 0
    for number in range(kept.shape[0]):
        if kept[number]:
            for axis in range(3):
                points[count, axis] = local[number, axis] * distance[number]
            points[count, _INTENSITY] = intensity[number]
            counts[channel[number]] += 1
            count += 1
