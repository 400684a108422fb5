"""Rotations, poses and the change between CARLA's left-handed and right-handed axes.

CARLA's frames are x forward, y right, z up (left-handed). Yaw is positive clockwise seen from
above, pitch nose up, roll right side down. Poses are named ``parent_from_local``.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def _constant(rows: list[list[float]]) -> FloatArray:
    matrix = np.array(rows, dtype=np.float64)
    matrix.flags.writeable = False
    return matrix


OPTICAL_FROM_SENSOR: Final = _constant([[0, 1, 0], [0, 0, -1], [1, 0, 0]])
"""``P``: camera optical axes (x right, y down, z forward) from CARLA sensor axes."""

FLU_FROM_CARLA: Final = _constant([[1, 0, 0], [0, -1, 0], [0, 0, 1]])
"""``S``: forward-left-up (or east-north-up) axes from CARLA axes; its own inverse."""

NUSCENES_LIDAR_FROM_SENSOR: Final = _constant([[0, 1, 0], [1, 0, 0], [0, 0, 1]])
"""``N``: nuScenes LiDAR axes (x right, y forward, z up) from CARLA sensor axes."""


_ARCTAN2 = np.vectorize(math.atan2, otypes=[np.float64])


def wrap_angle(angle_rad: ArrayLike) -> FloatArray:
    """Angles wrapped to [-pi, pi), radians."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    wrapped = np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
    # The modulo of a tiny negative number rounds up to 2 pi: keep the interval half open.
    return np.asarray(np.where(wrapped >= np.pi, -np.pi, wrapped), dtype=np.float64)


def arctan2(y: ArrayLike, x: ArrayLike) -> FloatArray:
    """Angles of ``(x, y)``, radians, with the same bits on every processor.

    numpy's own differ in the last bit between processors with and without AVX-512.
    """
    return np.asarray(_ARCTAN2(y, x), dtype=np.float64)


def rotation_matrix(rotation_deg: ArrayLike) -> FloatArray:
    """Rotation matrices that map local coordinates to the parent's.

    Args:
        rotation_deg: ``(..., 3)`` pitch, yaw, roll in degrees, the order of ``carla.Rotation``.

    Returns:
        ``(..., 3, 3)`` float64; the columns are the forward, right and up vectors
        (LibCarla ``Transform.h``: ``Rz(yaw) Ry(-pitch) Rx(-roll)``).
    """
    radians = np.radians(np.asarray(rotation_deg, dtype=np.float64))
    cp, cy, cr = np.moveaxis(np.cos(radians), -1, 0)
    sp, sy, sr = np.moveaxis(np.sin(radians), -1, 0)
    matrix: FloatArray = np.empty((*radians.shape[:-1], 3, 3), dtype=np.float64)
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
    """Pitch, yaw, roll in degrees of ``(..., 3, 3)`` rotation matrices; needs ``|pitch| < 90``."""
    m = np.asarray(matrix, dtype=np.float64)
    pitch = np.arcsin(np.clip(m[..., 2, 0], -1.0, 1.0))
    yaw = np.arctan2(m[..., 1, 0], m[..., 0, 0])
    roll = np.arctan2(-m[..., 2, 1], m[..., 2, 2])
    return np.asarray(np.degrees(np.stack([pitch, yaw, roll], axis=-1)), dtype=np.float64)


def pose_matrix(location_m: ArrayLike, rotation_deg: ArrayLike) -> FloatArray:
    """Homogeneous ``parent_from_local`` matrices, ``(..., 4, 4)``.

    Args:
        location_m: ``(..., 3)`` origin of the local frame in the parent's.
        rotation_deg: ``(..., 3)`` pitch, yaw, roll.
    """
    rotation = rotation_matrix(rotation_deg)
    location = np.asarray(location_m, dtype=np.float64)
    shape = np.broadcast_shapes(rotation.shape[:-2], location.shape[:-1])
    matrix: FloatArray = np.zeros((*shape, 4, 4), dtype=np.float64)
    matrix[..., :3, :3] = rotation
    matrix[..., :3, 3] = location
    matrix[..., 3, 3] = 1.0
    return matrix


def multiply(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """``(..., n, m)`` products of ``(..., n, k)`` and ``(..., k, m)`` matrices.

    The sums are taken term by term in double precision. ``@`` leaves their order and roundings to
    the BLAS that NumPy brings, so its last bits change with NumPy's version.
    """
    left, right = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    total: FloatArray = left[..., :, 0, None] * right[..., None, 0, :]
    for k in range(1, left.shape[-1]):
        total = total + left[..., :, k, None] * right[..., None, k, :]
    return total


def rotate(matrix: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """``(..., n)`` products of ``(..., n, k)`` matrices and ``(..., k)`` vectors, as `multiply`."""
    m, v = np.asarray(matrix, dtype=np.float64), np.asarray(vectors, dtype=np.float64)
    total: FloatArray = m[..., :, 0] * v[..., 0, None]
    for k in range(1, m.shape[-1]):
        total = total + m[..., :, k] * v[..., k, None]
    return total


def length(vectors: ArrayLike) -> FloatArray:
    """``(...)`` lengths of ``(..., 3)`` vectors, see `multiply`."""
    v = np.asarray(vectors, dtype=np.float64)
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z), dtype=np.float64)


def invert_pose(parent_from_local: ArrayLike) -> FloatArray:
    """``local_from_parent`` of ``(..., 4, 4)`` rigid poses."""
    pose = np.asarray(parent_from_local, dtype=np.float64)
    inverse = np.zeros_like(pose)
    transposed = np.swapaxes(pose[..., :3, :3], -1, -2)
    inverse[..., :3, :3] = transposed
    inverse[..., :3, 3] = -rotate(transposed, pose[..., :3, 3])
    inverse[..., 3, 3] = 1.0
    return inverse


def transform_points(target_from_source: ArrayLike, points: ArrayLike) -> FloatArray:
    """``(N, 3)`` points of the source frame in the target frame of one ``(4, 4)`` matrix."""
    matrix = np.asarray(target_from_source, dtype=np.float64)
    return rotate(matrix[:3, :3], points) + matrix[:3, 3]


def quaternion_from_matrix(matrix: ArrayLike) -> FloatArray:
    """Unit quaternions (w, x, y, z), ``w >= 0``, of proper ``(..., 3, 3)`` rotations.

    Takes the largest of the four candidates (Shepperd 1978), so that no division is by a small
    number. A rotation between frames of unlike handedness has no quaternion: conjugate it with
    ``FLU_FROM_CARLA`` first.
    """
    m = np.asarray(matrix, dtype=np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Row k holds 4 q_k q, for k = w, x, y, z.
    w = [1 + xx + yy + zz, m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0]]
    w.append(m[..., 1, 0] - m[..., 0, 1])
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    rows = np.stack(
        [
            np.stack(w, axis=-1),
            np.stack([w[1], 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([w[2], xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([w[3], xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.diagonal(rows, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q) + 0.0, dtype=np.float64)


def matrix_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """``(..., 3, 3)`` rotations of unit quaternions ``(..., 4)`` in the order w, x, y, z."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def flu_rotation(rotation: ArrayLike) -> FloatArray:
    """``(..., 3, 3)`` CARLA rotations in forward-left-up (or east-north-up) axes: ``S R S``."""
    matrix = np.asarray(rotation, dtype=np.float64)
    return multiply(multiply(FLU_FROM_CARLA, matrix), FLU_FROM_CARLA)


def flu_vector(vector: ArrayLike) -> FloatArray:
    """Polar vectors (position, velocity, acceleration) ``(..., 3)`` in forward-left-up axes."""
    flipped = np.asarray(vector, dtype=np.float64) * np.array([1.0, -1.0, 1.0])
    return np.asarray(flipped, dtype=np.float64)


def flu_angular_velocity(angular_velocity: ArrayLike) -> FloatArray:
    """Angular velocities ``(..., 3)`` in forward-left-up axes: a pseudovector, ``det(S) S w``."""
    flipped = np.asarray(angular_velocity, dtype=np.float64) * np.array([-1.0, 1.0, -1.0])
    return np.asarray(flipped, dtype=np.float64)
