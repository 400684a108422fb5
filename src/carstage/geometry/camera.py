"""The pinhole camera: intrinsics, projection, and angles seen from a camera.

Pixels: continuous coordinates; pixel (i, j) covers ``[i, i+1) x [j, j+1)``, its centre is
``(i + 0.5, j + 0.5)``. Optical axes: x right, y down, z forward.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from carstage.errors import BadInputError
from carstage.geometry.coordinates import (
    OPTICAL_FROM_SENSOR,
    FloatArray,
    arctan2,
    invert_pose,
    multiply,
    wrap_angle,
)

Z_NEAR_M: Final = 0.10
"""Points nearer than this along the optical axis are behind the camera."""


PINHOLE_ATTRIBUTES: Final = {
    "lens_circle_falloff": 5.0,
    "lens_circle_multiplier": 0.0,
    "lens_k": -1.0,
    "lens_kcube": 0.0,
    "lens_x_size": 0.08,
    "lens_y_size": 0.08,
}
"""CARLA's defaults of the lens; with any other value the image is no pinhole projection."""


def is_pinhole(attributes: Mapping[str, str]) -> bool:
    """Whether a camera with these blueprint attributes has no lens distortion.

    Raises:
        ValueError: an attribute of the lens is no number.
    """
    return all(
        float(attributes[name]) == PINHOLE_ATTRIBUTES[name]
        for name in PINHOLE_ATTRIBUTES.keys() & attributes.keys()
    )


def focal_length_px(width: int, fov_deg: float) -> float:
    """Focal length in pixels; ``fov_deg`` is the horizontal field of view (CARLA docs)."""
    if width < 1 or not 0.0 < fov_deg < 180.0:
        raise BadInputError(
            f"A camera of width {width} px and field of view {fov_deg} deg has no projection.",
            "Use a width of at least 1 and a field of view between 0 and 180 degrees.",
        )
    return width / (2.0 * math.tan(math.radians(fov_deg) / 2.0))


def intrinsics(width: int, height: int, fov_deg: float) -> FloatArray:
    """Intrinsic matrix ``K``, ``(3, 3)``: square pixels, principal point in the middle."""
    focal = focal_length_px(width, fov_deg)
    return np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])


def vertical_fov_deg(width: int, height: int, fov_deg: float) -> float:
    """Vertical field of view that follows from the horizontal one."""
    return math.degrees(2.0 * math.atan(height / (2.0 * focal_length_px(width, fov_deg))))


def optical_from_world(world_from_sensor: ArrayLike) -> FloatArray:
    """``(4, 4)`` matrix from world to optical axes of a sensor; its determinant is -1."""
    sensor_from_world = invert_pose(world_from_sensor)
    matrix = np.eye(4)
    matrix[:3] = multiply(OPTICAL_FROM_SENSOR, sensor_from_world[:3])
    return matrix


def project(points_optical: ArrayLike, k: ArrayLike, z_near_m: float = Z_NEAR_M) -> FloatArray:
    """Pixel coordinates ``(..., 2)`` of points in optical axes; NaN where ``Z < z_near_m``.

    Args:
        points_optical: ``(..., 3)`` metres.
        k: ``(3, 3)`` intrinsics.
        z_near_m: the near plane; nearer points never yield pixels.
    """
    points = np.asarray(points_optical, dtype=np.float64)
    matrix = np.asarray(k, dtype=np.float64)
    z = points[..., 2]
    depth = np.where(z >= z_near_m, z, np.nan)
    u = matrix[0, 0] * points[..., 0] / depth + matrix[0, 2]
    v = matrix[1, 1] * points[..., 1] / depth + matrix[1, 2]
    return np.stack([u, v], axis=-1)


def back_project(uv: ArrayLike, depth_m: ArrayLike, k: ArrayLike) -> FloatArray:
    """Points ``(..., 3)`` in optical axes of pixel coordinates with z-depth (m)."""
    pixels = np.asarray(uv, dtype=np.float64)
    matrix = np.asarray(k, dtype=np.float64)
    z = np.asarray(depth_m, dtype=np.float64)
    x = (pixels[..., 0] - matrix[0, 2]) / matrix[0, 0] * z
    y = (pixels[..., 1] - matrix[1, 2]) / matrix[1, 1] * z
    return np.stack([x, y, z], axis=-1)


def range_per_depth(width: int, height: int, fov_deg: float) -> FloatArray:
    """``(H, W)`` factor from z-depth to ray length (range) at each pixel's centre."""
    focal = focal_length_px(width, fov_deg)
    x = (np.arange(width) + 0.5 - width / 2.0) / focal
    y = (np.arange(height) + 0.5 - height / 2.0) / focal
    return np.asarray(np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2), dtype=np.float64)


def rotation_y(optical_from_box: ArrayLike) -> FloatArray:
    """KITTI's heading about the optical y axis, [-pi, pi) rad.

    ``atan2(-h_z, h_x)`` of the box's forward axis ``h``: right for any tilt, where the paper's
    ``yaw_object - yaw_sensor - 90 deg`` holds only if camera and object are upright.

    Args:
        optical_from_box: ``(..., 3, 3)`` box axes in the optical frame, ``P R_S^T R_B``.
    """
    forward = np.asarray(optical_from_box, dtype=np.float64)[..., :, 0]
    return wrap_angle(arctan2(-forward[..., 2], forward[..., 0]))


def observation_angle(rotation_y_rad: ArrayLike, center_optical: ArrayLike) -> FloatArray:
    """KITTI's alpha, [-pi, pi) rad: ``rotation_y - atan2(X, Z)``; continuous for ``Z < 0``.

    Args:
        rotation_y_rad: ``(...,)``.
        center_optical: ``(..., 3)`` box centre in optical axes.
    """
    center = np.asarray(center_optical, dtype=np.float64)
    bearing = arctan2(center[..., 0], center[..., 2])
    return wrap_angle(np.asarray(rotation_y_rad, dtype=np.float64) - bearing)


def proper_box_rotation(optical_from_box: ArrayLike) -> FloatArray:
    """``(..., 3, 3)`` proper rotation from forward-left-up box axes to optical axes.

    ``P R_S^T R_B S``: the improper ``P R_S^T R_B`` has no quaternion.
    """
    matrix = np.asarray(optical_from_box, dtype=np.float64)
    return np.asarray(matrix * np.array([1.0, -1.0, 1.0]), dtype=np.float64)


def velodyne_to_camera(world_from_camera: ArrayLike, world_from_lidar: ArrayLike) -> FloatArray:
    """KITTI's ``Tr_velo_to_cam`` as ``(4, 4)``: forward-left-up LiDAR axes to optical axes."""
    lidar_from_flu = np.diag([1.0, -1.0, 1.0, 1.0])
    camera_from_lidar = multiply(optical_from_world(world_from_camera), world_from_lidar)
    return multiply(camera_from_lidar, lidar_from_flu)
