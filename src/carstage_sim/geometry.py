"""Poses in CARLA's frames: x forward, y right, z up (left-handed), metres and degrees.

The formula of ``rotation_matrix`` also stands in ``carstage.geometry.coordinates``: the packages
meet on the wire only, and neither imports the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def rotation_matrix(rotation_deg: ArrayLike) -> FloatArray:
    """Rotation matrices that map local coordinates to the parent's.

    Args:
        rotation_deg: ``(..., 3)`` pitch, yaw, roll in degrees, the order of ``carla.Rotation``.

    Returns:
        ``(..., 3, 3)`` float64; the columns are the forward, right and up vectors
        (LibCarla ``Transform.h``: ``Rz(yaw) Ry(-pitch) Rx(-roll)``).
    """
    radians = np.radians(np.asarray(rotation_deg, dtype=np.float64))
    cosine, sine = np.cos(radians), np.sin(radians)
    cp, cy, cr = cosine[..., 0], cosine[..., 1], cosine[..., 2]
    sp, sy, sr = sine[..., 0], sine[..., 1], sine[..., 2]
    matrix: FloatArray = np.empty((*radians.shape, 3))
    matrix[..., 0, 0] = cp * cy
    matrix[..., 0, 1] = cy * sp * sr - sy * cr
    matrix[..., 0, 2] = -cy * sp * cr - sy * sr
    matrix[..., 1, 0] = cp * sy
    matrix[..., 1, 1] = sy * sp * sr + cy * cr
    matrix[..., 1, 2] = -sy * sp * cr + cy * sr
    matrix[..., 2, 0] = sp
    matrix[..., 2, 1] = -cp * sr
    matrix[..., 2, 2] = cp * cr
    return matrix


def rotation_deg(matrix: ArrayLike) -> FloatArray:
    """Pitch, yaw, roll in degrees of ``(..., 3, 3)`` rotation matrices; ``|pitch| < 90``."""
    m = np.asarray(matrix, dtype=np.float64)
    pitch = np.arcsin(np.clip(m[..., 2, 0], -1.0, 1.0))
    yaw = np.arctan2(m[..., 1, 0], m[..., 0, 0])
    roll = np.arctan2(-m[..., 2, 1], m[..., 2, 2])
    angles: FloatArray = np.degrees(np.stack([pitch, yaw, roll], axis=-1))
    return angles


def pose_matrix(location: ArrayLike, rotation: ArrayLike) -> FloatArray:
    """``(..., 4, 4)`` homogeneous ``parent_from_local`` of locations (m) and rotations (deg)."""
    rotations = rotation_matrix(rotation)
    matrix: FloatArray = np.zeros((*rotations.shape[:-2], 4, 4), dtype=np.float64)
    matrix[..., :3, :3] = rotations
    matrix[..., :3, 3] = np.asarray(location, dtype=np.float64)
    matrix[..., 3, 3] = 1.0
    return matrix
