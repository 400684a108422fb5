"""Records of LiDAR and radar, and what a LiDAR sweep must hold.

Layouts and formulas: CARLA's ``RadarData.h``, ``SemanticLidarData.h`` and ``RayCastLidar.cpp``.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.errors import BadInputError
from carstage.geometry import FloatArray

LIDAR_DTYPE: Final = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
"""One point of ``sensor.lidar.ray_cast``, sensor axes (m)."""

SEMANTIC_LIDAR_DTYPE: Final = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("cos_incidence", "<f4"),
        ("object_idx", "<u4"),
        ("object_tag", "<u4"),
    ]
)
"""One point of ``sensor.lidar.ray_cast_semantic``; the last two are integers, not floats."""

RADAR_DTYPE: Final = np.dtype(
    [("velocity", "<f4"), ("azimuth", "<f4"), ("altitude", "<f4"), ("depth", "<f4")]
)
"""One detection of ``sensor.other.radar``: m/s, rad, rad, m; velocity is positive when receding."""


def radar_points(detections: NDArray[np.void]) -> FloatArray:
    """Detections as ``(N, 3)`` points in CARLA sensor axes (m).

    Args:
        detections: ``(N,)`` of ``RADAR_DTYPE``; azimuth positive to the right, altitude up.
    """
    depth = detections["depth"].astype(np.float64)
    azimuth = detections["azimuth"].astype(np.float64)
    altitude = detections["altitude"].astype(np.float64)
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
