"""STAGE-VO: occlusion from the eight vertices of a box and a depth image, as the paper has it.

Every vertex is behind the near plane, outside the image, occluded (the depth image holds
something nearer there) or visible. The paper's truncation, (8 - visible) / 8, counts occluded
vertices too; it is kept for comparison, ``truncated`` is the one to train on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.geometry import Z_NEAR_M, FloatArray, length

VERTICES: Final = 8
LEVEL_UNKNOWN: Final = 3

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class VertexCounts:
    """Vertices of ``N`` boxes by class; each field ``(N,)`` int64, their sum is 8."""

    visible: IntArray
    occluded: IntArray
    outside: IntArray
    behind: IntArray


def within_distance(
    centers: FloatArray, origin: FloatArray, max_distance_m: float
) -> NDArray[np.bool_]:
    """Which ``(N, 3)`` box centres are at most ``max_distance_m`` from ``(3,)`` (equality kept)."""
    return np.asarray(length(centers - origin) <= max_distance_m)


def count_vertices(
    corners_uv: FloatArray,
    corners_z: FloatArray,
    depth_m: NDArray[np.float32],
    *,
    tolerance_m: float = 0.0,
    z_near_m: float = Z_NEAR_M,
    vote: bool = False,
) -> VertexCounts:
    """Classify the vertices of ``N`` boxes against a depth image.

    Args:
        corners_uv: ``(N, 8, 2)`` pixel coordinates; anything where ``Z < z_near_m``.
        corners_z: ``(N, 8)`` optical z (m).
        depth_m: ``(H, W)`` z-depth of a camera with the same pose and intrinsics.
        tolerance_m: how much nearer the depth must be to occlude; 0 is the paper.
        z_near_m: the near plane.
        vote: a vertex is occluded only if all of its diagonal neighbour pixels in the image are
            nearer (what the paper's ancestors do) instead of its own pixel.
    """
    height, width = depth_m.shape
    behind = corners_z < z_near_m
    u, v = corners_uv[..., 0], corners_uv[..., 1]
    inside = ~behind & (u >= 0.0) & (u < width) & (v >= 0.0) & (v < height)
    column = np.floor(u[inside]).astype(np.int64)
    row = np.floor(v[inside]).astype(np.int64)
    limit = corners_z[inside] - tolerance_m
    nearer = (
        _all_neighbours_nearer(depth_m, row, column, limit)
        if vote
        else (depth_m[row, column] < limit)
    )
    occluded = np.zeros_like(inside)
    occluded[inside] = nearer
    return VertexCounts(
        visible=(inside & ~occluded).sum(axis=-1),
        occluded=occluded.sum(axis=-1),
        outside=(~inside & ~behind).sum(axis=-1),
        behind=behind.sum(axis=-1),
    )


def _all_neighbours_nearer(
    depth_m: NDArray[np.float32], row: IntArray, column: IntArray, limit: FloatArray
) -> NDArray[np.bool_]:
    height, width = depth_m.shape
    rows = row[:, None] + np.array([-1, -1, 1, 1])
    columns = column[:, None] + np.array([-1, 1, -1, 1])
    exists = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    depth = depth_m[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)]
    nearer = (depth < limit[:, None]) | ~exists
    return np.asarray(nearer.all(axis=-1) & exists.any(axis=-1))


def occlusion_level(counts: VertexCounts, *, strict: bool = False) -> IntArray:
    """KITTI's ``occluded`` per box: 0 from 6 visible vertices, 1 for 4 or 5, 2 below.

    No vertex in the image is no evidence: 3 (KITTI's unknown), or the paper's 2 when ``strict``.
    """
    level = np.where(counts.visible >= 6, 0, np.where(counts.visible >= 4, 1, 2))
    if not strict:
        level = np.where(counts.visible + counts.occluded == 0, LEVEL_UNKNOWN, level)
    return level.astype(np.int64)


def truncation_paper(n_visible: ArrayLike) -> FloatArray:
    """The paper's truncation: the share of vertices that are not visible, 0 to 1."""
    return (VERTICES - np.asarray(n_visible, dtype=np.float64)) / VERTICES
