"""What a LiDAR's rays brought back, put together in one pass each."""

from __future__ import annotations

from carstage_sim.kernels import kernel
from carstage_sim.sensors.measurements import PointColumn

_INTENSITY = int(PointColumn.INTENSITY)


@kernel
def gather_returns(row, t, nothing, local, channel, met, kept_local, kept_channel, distance):  # type: ignore[no-untyped-def]
    """Rays that met something, one behind the other; how many.

    Args:
        row, t: ``(N,)`` what each ray met, ``nothing`` for none, and how far it is.
        local, channel: ``(N, 3)`` and ``(N,)`` direction and laser of each ray.
        met: ``(N,)`` bool receives which met something.
        kept_local, kept_channel, distance: receive the directions, lasers and distances of those.
    """
    count = 0
    for ray in range(row.shape[0]):
        met[ray] = row[ray] != nothing
        if met[ray]:
            for axis in range(3):
                kept_local[count, axis] = local[ray, axis]
            kept_channel[count] = channel[ray]
            distance[count] = t[ray]
            count += 1
    return count


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
