"""The one module of the exporters where CARLA's left-handed axes become those of other formats.

``S = diag(1, -1, 1)`` leads to forward-left-up (KITTI's velodyne and imu, nuScenes's ego, ROS) and
to east-north-up; ``P`` to a camera's optical axes; ``N`` to nuScenes's LiDAR. A pose changes by
similarity on the side of each frame; see docs/conventions.md. Boxes are those of
``carstage.geometry.targets``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.geometry import (
    FLU_FROM_CARLA,
    NUSCENES_LIDAR_FROM_SENSOR,
    OPTICAL_FROM_SENSOR,
    FloatArray,
    NuscenesBox,
    flu_angular_velocity,
    flu_vector,
    invert_pose,
    nuscenes_box,
    quaternion_from_matrix,
    velodyne_to_camera,
)

OPTICAL_FROM_FLU: FloatArray = OPTICAL_FROM_SENSOR @ FLU_FROM_CARLA + 0.0
"""``(3, 3)``: a camera's optical axes from forward-left-up ones at the same place."""

__all__ = [
    "OPTICAL_FROM_FLU",
    "NuscenesBox",
    "enu_pose",
    "flu_angular_velocity",
    "flu_from_nuscenes_lidar",
    "flu_from_optical",
    "flu_points",
    "flu_pose",
    "flu_vector",
    "imu_to_velodyne",
    "nuscenes_box",
    "nuscenes_lidar_points",
    "quaternion_from_matrix",
    "radar_points",
    "velodyne_to_camera",
]


def _pose(left: FloatArray, pose: ArrayLike, right: FloatArray) -> FloatArray:
    """``left R right^T`` and ``left t`` of a pose."""
    matrix = np.asarray(pose, dtype=np.float64)
    result = np.eye(4)
    result[:3, :3] = left @ matrix[:3, :3] @ right.T
    result[:3, 3] = left @ matrix[:3, 3]
    return result


def flu_pose(parent_from_local: ArrayLike) -> FloatArray:
    """A ``(4, 4)`` CARLA pose with both frames in forward-left-up axes: ``S R S``, ``S t``."""
    return _pose(FLU_FROM_CARLA, parent_from_local, FLU_FROM_CARLA)


def enu_pose(world_from_local: ArrayLike) -> FloatArray:
    """A ``(4, 4)`` pose on CARLA's map: local forward-left-up axes in east-north-up."""
    return _pose(FLU_FROM_CARLA, world_from_local, FLU_FROM_CARLA)


def flu_from_optical(parent_from_camera: ArrayLike) -> FloatArray:
    """The ``(4, 4)`` pose of a camera: its optical axes in the parent's forward-left-up ones."""
    return _pose(FLU_FROM_CARLA, parent_from_camera, OPTICAL_FROM_SENSOR)


def flu_from_nuscenes_lidar(parent_from_lidar: ArrayLike) -> FloatArray:
    """The ``(4, 4)`` pose of a LiDAR: nuScenes's LiDAR axes in the parent's forward-left-up."""
    return _pose(FLU_FROM_CARLA, parent_from_lidar, NUSCENES_LIDAR_FROM_SENSOR)


def imu_to_velodyne(ego_from_lidar: ArrayLike) -> FloatArray:
    """KITTI's ``Tr_imu_to_velo`` as ``(4, 4)``, with the ego's pivot for the IMU."""
    return flu_pose(invert_pose(ego_from_lidar))


def flu_points(points: NDArray[np.float32]) -> NDArray[np.float32]:
    """LiDAR points ``(N, 4)`` x, y, z, intensity of CARLA sensor axes in forward-left-up."""
    return np.asarray(points * np.array([1, -1, 1, 1], np.float32), dtype=np.float32)


def nuscenes_lidar_points(
    points: NDArray[np.float32], rings: NDArray[np.float32]
) -> NDArray[np.float32]:
    """LiDAR points ``(N, 4)`` as nuScenes's ``(N, 5)``: right, forward, up, intensity, ring."""
    return np.column_stack([points[:, [1, 0, 2, 3]], rings]).astype(np.float32)


def radar_points(detections: NDArray[Any]) -> tuple[FloatArray, FloatArray]:
    """Detections of a radar as points and velocities in forward-left-up axes.

    Args:
        detections: ``(N, 4 or more)`` range rate (m/s, positive: receding), azimuth to the
            right (rad), altitude (rad), depth (m).

    Returns:
        ``(N, 3)`` points (m) and ``(N, 3)`` velocities along the rays (m/s), relative to the radar.
    """
    rate, azimuth, altitude, depth = np.asarray(detections[:, :4], dtype=np.float64).T
    level = np.cos(altitude)
    rays = flu_vector(
        np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(altitude)], axis=-1)
    )
    return depth[:, None] * rays, rate[:, None] * rays
