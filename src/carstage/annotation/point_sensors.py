"""Records of LiDAR and radar.

Layouts: CARLA's ``RadarData.h`` and ``SemanticLidarData.h``.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

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
