"""Records of LiDAR and radar, and what a LiDAR sweep must hold.

Layouts and formulas: CARLA's ``RadarData.h``, ``SemanticLidarData.h`` and ``RayCastLidar.cpp``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.errors import BadInputError
from carstage.geometry import FloatArray
from carstage.sensor_kinds import sensor_kind


def record_dtype(kind: str) -> np.dtype[np.void]:
    """A point as a record of a kind holds it; integers stay integers."""
    columns = sensor_kind(kind).columns
    return np.dtype([(column.name, column.dtype) for column in columns])


def radar_points(detections: NDArray[Any]) -> FloatArray:
    """Detections as ``(N, 3)`` points in CARLA sensor axes (m).

    Args:
        detections: ``(N, 4)`` range rate (m/s), azimuth (rad, positive to the right), altitude
            (rad, positive up), depth (m).
    """
    _, azimuth, altitude, depth = detections.astype(np.float64).T
    flat = depth * np.cos(altitude)
    return np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), depth * np.sin(altitude)], axis=-1
    )


def closing_speed(radar_velocity_m_s: ArrayLike) -> FloatArray:
    """Speed towards the sensor (m/s): CARLA's radar velocity is the range rate."""
    return -np.asarray(radar_velocity_m_s, dtype=np.float64)


def lidar_rays_per_channel(points_per_second: float, dt_s: float, channels: int) -> int:
    """Rays that each laser casts in one tick; halves round away from zero, as in the source."""
    return math.floor(points_per_second * dt_s / channels + 0.5)


def ticks_per_sweep(rotation_frequency_hz: float, dt_s: float) -> int:
    """Ticks that a full turn takes; 1 when each tick holds a whole sweep.

    Raises:
        BadInputError: when it turns more than once per tick, or a turn does not end with a tick.
    """
    turns = rotation_frequency_hz * dt_s
    if turns <= 0.0 or turns > 1.0 + 1e-6:
        raise BadInputError(
            f"A LiDAR at {rotation_frequency_hz} Hz turns {turns:.3g} times per tick of {dt_s} s.",
            f"Set rotation_frequency to {1.0 / dt_s:.6g} for one full sweep per tick.",
        )
    ticks = round(1.0 / turns)
    if abs(ticks * turns - 1.0) > 1e-6:
        raise BadInputError(
            f"A LiDAR at {rotation_frequency_hz} Hz needs {1.0 / turns:.3g} ticks for a sweep.",
            f"Set rotation_frequency to {1.0 / dt_s:.6g} divided by a whole number.",
        )
    return ticks
