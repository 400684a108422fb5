"""Records of LiDAR and radar.

Layouts: CARLA's ``RadarData.h`` and ``SemanticLidarData.h``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.columns import Detection


def record_dtype(kind: str) -> np.dtype[np.void]:
    """A point as a record of a kind holds it; integers stay integers."""
    columns = sensor_kind(kind).columns
    return np.dtype([(column.name, column.dtype) for column in columns])


def radar_detections(kind: str, payload: bytes | memoryview) -> NDArray[np.float32]:
    """``(N, columns)`` float32 of a radar's record."""
    return np.frombuffer(payload, "<f4").reshape(-1, len(sensor_kind(kind).columns))


def radar_points(detections: NDArray[Any]) -> FloatArray:
    """Detections as ``(N, 3)`` points in CARLA sensor axes (m).

    Args:
        detections: ``(N, 4 or more)`` range rate (m/s), azimuth (rad, positive to the right),
            altitude (rad, positive up), depth (m).
    """
    _, azimuth, altitude, depth = detections[:, : len(Detection)].astype(np.float64).T
    flat = depth * np.cos(altitude)
    return np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), depth * np.sin(altitude)], axis=-1
    )
