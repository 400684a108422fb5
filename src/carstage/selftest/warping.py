"""Where the surface that a camera sees at one tick appears in its picture of another tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import (
    FloatArray,
    back_project,
    invert_pose,
    optical_from_world,
    project,
    transform_points,
)

FAR_M = 120.0
"""Farther surfaces hardly move in the picture between two ticks: they would hide the rest."""

AGREES = 0.02
"""Two depths of one surface point agree within this share: pixels are not points."""


def sampled_pixels(height: int, width: int, stride: int) -> NDArray[np.int64]:
    """``(N, 2)`` rows and columns of every ``stride``-th pixel both ways."""
    rows, columns = np.mgrid[0:height:stride, 0:width:stride]
    return np.stack([rows.ravel(), columns.ravel()], axis=-1)


def optical_points(depth_m: FloatArray, pixels: NDArray[np.int64], k: FloatArray) -> FloatArray:
    """``(N, 3)`` points in optical axes that pixels of a depth picture show."""
    return back_project(pixels[:, ::-1] + 0.5, depth_m[pixels[:, 0], pixels[:, 1]], k)


def in_world(points_optical: FloatArray, world_from_camera: FloatArray) -> FloatArray:
    """``(N, 3)`` points of optical axes in the world."""
    return transform_points(np.linalg.inv(optical_from_world(world_from_camera)), points_optical)


@dataclass(frozen=True, slots=True)
class Warp:
    """Where ``N`` surface points seen at one tick lie in the picture of another.

    Attributes:
        source: ``(N, 2)`` row and column of the pixels of the first picture.
        uv: ``(N, 2)`` their coordinates in the second picture.
        target: ``(N, 2)`` row and column of the pixels there.
        depth_m: ``(N,)`` distance along the second camera's axis.
    """

    source: NDArray[np.int64]
    uv: FloatArray
    target: NDArray[np.int64]
    depth_m: FloatArray


def warp(
    source: NDArray[np.int64],
    points_world: FloatArray,
    world_from_camera: FloatArray,
    k: FloatArray,
    shape: tuple[int, int],
) -> Warp:
    """Look at the points of a picture from another pose of the camera; keep those in its view.

    Args:
        source: ``(N, 2)`` pixels of the first picture.
        points_world: ``(N, 3)`` what they show.
        world_from_camera: ``(4, 4)`` the other pose.
        k: ``(3, 3)`` intrinsics.
        shape: height and width of the pictures.
    """
    optical = transform_points(optical_from_world(world_from_camera), points_world)
    uv = project(optical, k)
    inside = (uv >= 0.0).all(axis=-1) & (uv[:, 0] < shape[1]) & (uv[:, 1] < shape[0])
    target = np.floor(uv[inside][:, ::-1]).astype(np.int64)
    return Warp(source[inside], uv[inside], target, optical[inside, 2])


def agreement(found: Warp, depth_m: FloatArray) -> float:
    """Share of warped points whose depth the second picture shows, 0 when there are none."""
    if not len(found.target):
        return 0.0
    seen = depth_m[found.target[:, 0], found.target[:, 1]]
    return float(np.mean(np.abs(seen - found.depth_m) <= AGREES * found.depth_m))


def inside_box(
    points_world: FloatArray, world_from_box: FloatArray, extent: FloatArray, margin_m: float
) -> NDArray[np.bool_]:
    """``(N,)`` whether points lie in a box grown by a margin (negative: shrunk)."""
    local = transform_points(invert_pose(world_from_box), points_world)
    return np.asarray((np.abs(local) <= extent + margin_m).all(axis=-1), dtype=np.bool_)
