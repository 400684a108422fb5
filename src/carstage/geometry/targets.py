"""Boxes in the conventions of KITTI and nuScenes, there and back.

The one place where CARLA's boxes meet those of right-handed datasets; exporters write what these
functions return.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from carstage.geometry.camera import observation_angle, optical_from_world, rotation_y
from carstage.geometry.coordinates import (
    FloatArray,
    flu_rotation,
    flu_vector,
    matrix_from_quaternion,
    multiply,
    quaternion_from_matrix,
    rotate,
    rotation_deg,
    transform_points,
)
from carstage.geometry.polygons import Rectangle


@dataclass(frozen=True, slots=True)
class KittiBox:
    """A box as a KITTI label row holds it.

    Attributes:
        location: centre of the bottom face, optical axes (m).
        dimensions: height, width, length (m).
        rotation_y: heading about the optical y axis (rad).
        alpha: observation angle (rad).
    """

    location: FloatArray
    dimensions: FloatArray
    rotation_y: float
    alpha: float


def kitti_box(
    world_from_box: ArrayLike, extent_m: ArrayLike, world_from_camera: ArrayLike
) -> KittiBox:
    """A CARLA box in KITTI's camera convention; keeps the box's centre, loses its tilt.

    Args:
        world_from_box: ``(4, 4)``.
        extent_m: ``(3,)`` half length, width, height.
        world_from_camera: ``(4, 4)`` pose of the camera (CARLA sensor axes).
    """
    box = np.asarray(world_from_box, dtype=np.float64)
    ex, ey, ez = (float(value) for value in np.asarray(extent_m, dtype=np.float64))
    optical = optical_from_world(world_from_camera)
    center = transform_points(optical, box[None, :3, 3])[0]
    heading = float(rotation_y(multiply(optical[:3, :3], box[:3, :3])))
    return KittiBox(
        location=center + np.array([0.0, ez, 0.0]),
        dimensions=np.array([2.0 * ez, 2.0 * ey, 2.0 * ex]),
        rotation_y=heading,
        alpha=float(observation_angle(heading, center)),
    )


def carla_box_from_kitti(
    box: KittiBox, world_from_camera: ArrayLike, camera_yaw_deg: float
) -> tuple[FloatArray, float, FloatArray]:
    """Centre (world, m), yaw (deg) and half extents (m) of a KITTI box; upright cameras only."""
    height, width, length = (float(value) for value in box.dimensions)
    center = np.asarray(box.location, dtype=np.float64) - np.array([0.0, height / 2.0, 0.0])
    optical = optical_from_world(world_from_camera)
    # Orthogonal, not proper: the inverse is the transpose all the same.
    center_world = rotate(optical[:3, :3].T, center - optical[:3, 3])
    yaw_deg = float(np.degrees(box.rotation_y)) + camera_yaw_deg + 90.0
    return center_world, yaw_deg, np.array([length / 2.0, width / 2.0, height / 2.0])


@dataclass(frozen=True, slots=True)
class NuscenesBox:
    """A box as nuScenes' ``sample_annotation`` holds it.

    Attributes:
        translation: centre in the global frame, east-north-up (m).
        size: width, length, height (m).
        rotation: quaternion w, x, y, z.
    """

    translation: FloatArray
    size: FloatArray
    rotation: FloatArray


def nuscenes_box(world_from_box: ArrayLike, extent_m: ArrayLike) -> NuscenesBox:
    """A CARLA box ``(4, 4)`` with half extents ``(3,)`` in nuScenes' global frame."""
    box = np.asarray(world_from_box, dtype=np.float64)
    ex, ey, ez = (float(value) for value in np.asarray(extent_m, dtype=np.float64))
    return NuscenesBox(
        translation=flu_vector(box[:3, 3]),
        size=np.array([2.0 * ey, 2.0 * ex, 2.0 * ez]),
        rotation=quaternion_from_matrix(flu_rotation(box[:3, :3])),
    )


def carla_box_from_nuscenes(box: NuscenesBox) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centre (world, m), pitch-yaw-roll (deg) and half extents (m) of a nuScenes box."""
    width, length, height = (float(value) for value in box.size)
    rotation = flu_rotation(matrix_from_quaternion(box.rotation))
    return (
        flu_vector(box.translation),
        rotation_deg(rotation),
        np.array([length / 2.0, width / 2.0, height / 2.0]),
    )


def kitti_rectangle(box: Rectangle, width: int, height: int) -> Rectangle:
    """KITTI's left, top, right, bottom: 0-based pixel indices, the last ones included."""
    x0, y0, x1, y1 = box
    return x0, y0, min(x1, float(width)) - 1.0, min(y1, float(height)) - 1.0


def coco_rectangle(box: Rectangle) -> Rectangle:
    """COCO's x, y, width, height."""
    x0, y0, x1, y1 = box
    return x0, y0, x1 - x0, y1 - y0


def yolo_rectangle(box: Rectangle, width: int, height: int) -> Rectangle:
    """YOLO's centre x, centre y, width, height, as shares of the image."""
    x0, y0, x1, y1 = box
    return (x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height
