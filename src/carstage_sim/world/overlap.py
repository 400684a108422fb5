"""Whether upright boxes overlap: the test that refuses a spawn onto another actor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import FloatArray


def footprint_corners(
    center: FloatArray, extent: FloatArray, yaw_deg: FloatArray
) -> NDArray[np.float64]:
    """``(..., 4, 2)`` ground corners of boxes turned by their yaw alone."""
    yaw = np.radians(yaw_deg)
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1) * extent[..., 0:1]
    right = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1) * extent[..., 1:2]
    middle = center[..., :2]
    corners: NDArray[np.float64] = np.stack(
        [
            middle + forward + right,
            middle + forward - right,
            middle - forward - right,
            middle - forward + right,
        ],
        axis=-2,
    )
    return corners


def overlaps(
    center: FloatArray,
    extent: FloatArray,
    yaw_deg: float,
    centers: FloatArray,
    extents: FloatArray,
    yaws_deg: FloatArray,
) -> NDArray[np.bool_]:
    """Which of N boxes overlap one box (separating axes in the plane, intervals in height).

    Args:
        center, extent, yaw_deg: the box: ``(3,)`` centre and half sizes in metres, degrees.
        centers, extents, yaws_deg: ``(N, 3)``, ``(N, 3)``, ``(N,)``.

    Returns:
        ``(N,)`` bool; touching is no overlap.
    """
    if not len(centers):
        return np.zeros(0, np.bool_)
    one = footprint_corners(center, extent, np.asarray(yaw_deg))[None]
    many = footprint_corners(centers, extents, yaws_deg)
    hit: NDArray[np.bool_] = np.abs(centers[:, 2] - center[2]) < extents[:, 2] + extent[2]
    axes = (one[:, 0] - one[:, 1], one[:, 0] - one[:, 3])
    axes += (many[:, 0] - many[:, 1], many[:, 0] - many[:, 3])
    for axis in axes:
        of_one = (one * axis[:, None]).sum(axis=-1)
        of_many = (many * axis[:, None]).sum(axis=-1)
        hit &= (of_one.max(axis=1) > of_many.min(axis=1)) & (
            of_many.max(axis=1) > of_one.min(axis=1)
        )
    return hit
