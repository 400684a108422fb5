"""Which cells cameras and LiDARs see; what that means stands in docs/formats/birds-eye.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.grid import Grid, GridPose
from carstage.geometry import (
    OPTICAL_FROM_SENSOR,
    Z_NEAR_M,
    FloatArray,
    multiply,
    rotate,
)

CAMERA: Final = 1
LIDAR: Final = 2
"""Bits of the visibility grid."""
FREE_ABOVE_GROUND_M: Final = 0.2
"""A ray that gets so near to the ground counts as reaching it."""
LEAST_HEIGHT_M: Final = 1.0
"""Of a camera over the ground, for that: uphill a ray may run along the ground."""


@dataclass(frozen=True, slots=True)
class CameraView:
    """What a pinhole camera shows.

    Attributes:
        k: ``(3, 3)`` intrinsics.
        world_from_sensor: ``(4, 4)``.
        depth_m: ``(H, W)`` along the optical axis; None: not known, nothing hides anything.
        width, height: of the image (px).
    """

    k: FloatArray
    world_from_sensor: FloatArray
    depth_m: NDArray[np.floating] | None
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Cloud:
    """One sweep.

    Attributes:
        world_from_sensor: ``(4, 4)``.
        points: ``(N, 3)`` in the sensor's axes (m).
    """

    world_from_sensor: FloatArray
    points: FloatArray


def seen_by_camera(view: CameraView, ground: FloatArray) -> NDArray[np.bool_]:
    """``(N,)`` whether a camera sees places ``(N, 3)`` on the ground (world, m)."""
    world_from_optical = multiply(view.world_from_sensor[:3, :3], OPTICAL_FROM_SENSOR.T)
    origin = view.world_from_sensor[:3, 3]
    axes = world_from_optical.T
    offset = [ground[:, axis] - origin[axis] for axis in range(3)]

    def along(axis: int) -> FloatArray:
        row = axes[axis]
        total: FloatArray = row[0] * offset[0] + row[1] * offset[1] + row[2] * offset[2]
        return total

    seen = np.zeros(len(ground), np.bool_)
    depth = along(2)
    ahead = np.flatnonzero(depth > Z_NEAR_M)
    offset, depth = [part[ahead] for part in offset], depth[ahead]
    u = np.floor(view.k[0, 0] * (along(0) / depth) + view.k[0, 2])
    v = np.floor(view.k[1, 1] * (along(1) / depth) + view.k[1, 2])
    inside = (u >= 0) & (u < view.width) & (v >= 0) & (v < view.height)
    chosen = ahead[inside]
    if view.depth_m is None:
        seen[chosen] = True
        return seen
    column, row = u[inside].astype(np.int64), v[inside].astype(np.int64)
    # The ground recedes within a pixel: the one above shows what is farther on.
    surface = np.maximum(
        view.depth_m[row, column], view.depth_m[np.maximum(row - 1, 0), column]
    ).astype(np.float64)
    # A ray that is stopped at a share s of its way is (1 - s) of the camera's height up.
    above = np.maximum(np.abs(offset[2][inside]), LEAST_HEIGHT_M)
    seen[chosen] = above * (depth[inside] - surface) <= FREE_ABOVE_GROUND_M * depth[inside]
    return seen


def hit_cells(grid: Grid, pose: GridPose, cloud: Cloud) -> NDArray[np.int64]:
    """Flat numbers of the cells that points of a sweep lie in, seen from above."""
    points = rotate(cloud.world_from_sensor[:3, :3], cloud.points)
    cells, inside = grid.cells(pose.forward_right(points + cloud.world_from_sensor[:3, 3]))
    return cells[inside]
