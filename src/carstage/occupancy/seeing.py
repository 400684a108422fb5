"""What a sensor saw of the voxels: where its rays end, and what they pass on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.visibility import CAMERA, LIDAR, CameraView, Cloud
from carstage.geometry import OPTICAL_FROM_SENSOR, Z_NEAR_M, FloatArray, multiply, rotate
from carstage.occupancy.grid import VoxelGrid

FINE: Final = 2
"""Cells to a voxel's side in which surfaces are gathered; a frame adds one point to each."""
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Picture:
    """What a pinhole camera shows.

    Attributes:
        view: with its depth image.
        tags: ``(H, W)`` uint8 semantic tags; None: not known, the picture adds no surface.
    """

    view: CameraView
    tags: NDArray[np.uint8] | None


@dataclass(frozen=True, slots=True)
class Sweep:
    """What a LiDAR measures.

    Attributes:
        cloud: its points.
        tags: ``(N,)`` uint8 semantic tags; None: not known, the sweep adds no surface.
    """

    cloud: Cloud
    tags: NDArray[np.uint8] | None


@dataclass(frozen=True, slots=True)
class Surface:
    """Where the rays of a sensor end, in voxels from the grid's lower corner.

    Attributes:
        origin: ``(3,)`` of the rays.
        points: ``(N, 3)`` in the grid, one of each cell of a half side.
        tags: ``(N,)`` uint8, or None.
        beyond: ``(M, 3)`` ends of a LiDAR's rays outside of the grid.
    """

    origin: FloatArray
    points: FloatArray
    tags: NDArray[np.uint8] | None
    beyond: FloatArray


def surface(grid: VoxelGrid, matrix: FloatArray, seen: Picture | Sweep) -> Surface:
    """Where the rays of a sensor end.

    Args:
        grid: the voxels.
        matrix: ``(4, 4)`` of the grid's frame from the world.
        seen: what the sensor measured.
    """
    if isinstance(seen, Sweep):
        return _of_sweep(
            grid, grid.units_from(multiply(matrix, seen.cloud.world_from_sensor)), seen
        )
    return _of_picture(grid, grid.units_from(multiply(matrix, seen.view.world_from_sensor)), seen)


def _of_sweep(grid: VoxelGrid, units: FloatArray, seen: Sweep) -> Surface:
    from carstage.occupancy.ray_kernel import ends_within

    points = np.ascontiguousarray(seen.cloud.points, np.float64)
    numbers: NDArray[np.int32] = np.empty(len(points), np.int32)
    ends: FloatArray = np.empty((3, len(points)), np.float64)
    count = ends_within(units, points, grid.shape, numbers, ends)
    kept = _one_per_cell(grid, ends[:, :count])
    tags = None if seen.tags is None else seen.tags[numbers[kept]]
    return Surface(units[:, 3], ends[:, kept].T, tags, ends[:, count:][:, ::-1].T)


def _of_picture(grid: VoxelGrid, units: FloatArray, seen: Picture) -> Surface:
    """A pixel's surface is where the ray through its centre ends."""
    from carstage.occupancy.ray_kernel import shown_places

    view = seen.view
    assert view.depth_m is not None
    depth = np.ascontiguousarray(view.depth_m, np.float32)
    pixels: NDArray[np.int32] = np.empty(depth.size, np.int32)
    places: NDArray[np.float32] = np.empty((3, depth.size), np.float32)
    rays = _pixel_rays(units, view)
    count = shown_places(*rays, depth, np.float32(Z_NEAR_M), grid.shape, pixels, places)
    near = places[:, :count]
    kept = _one_per_cell(grid, near)
    return Surface(
        units[:, 3],
        near[:, kept].T.astype(np.float64),
        None if seen.tags is None else seen.tags.ravel()[pixels[kept]],
        np.zeros((0, 3)),
    )


def _one_per_cell(grid: VoxelGrid, units: NDArray[Any]) -> Indices:
    """Which of ``N`` places to keep, the last in each cell of a half side, in their order.

    Args:
        grid: the voxels.
        units: ``(3, N)`` float32 or float64, all within the grid.
    """
    from carstage.occupancy.ray_kernel import mark_last

    x, y, z = units
    kept = np.zeros(len(x), np.bool_)
    # Only what is written is read: the rest of it costs no memory.
    last: NDArray[np.int32] = np.empty(grid.count * FINE**3, np.int32)
    mark_last(x, y, z, FINE, grid.shape, last, kept)
    return np.flatnonzero(kept)


def seen_voxels(
    grid: VoxelGrid,
    matrix: FloatArray,
    seen: Sequence[Picture | Sweep],
    found: Sequence[Surface | None],
) -> NDArray[np.uint8]:
    """``(X, Y, Z)`` bits of the sensors that see each voxel.

    All see the voxels in which their rays end. A camera sees a voxel if the ray through its centre
    goes on behind it, a LiDAR if a ray passes it. Of the rays from one place, those that leave the
    grid are followed first, then those to voxels that none has passed yet.

    Args:
        grid: the voxels.
        matrix: ``(4, 4)`` of the grid's frame from the world.
        seen: what the sensors measured.
        found: by :func:`surface`, of the same; of pictures None will do.
    """
    mask: NDArray[np.uint8] = np.zeros(grid.count, np.uint8)
    rays: dict[bytes, list[Surface]] = {}
    for one, ends in zip(seen, found, strict=True):
        if isinstance(one, Picture):
            mask |= _seen_by_camera(grid, matrix, one.view, ends).ravel() * np.uint8(CAMERA)
        elif ends is not None:
            rays.setdefault(ends.origin.tobytes(), []).append(ends)
    for sweeps in rays.values():
        ends_there = [one.beyond for one in sweeps] + [one.points for one in sweeps]
        passed = passed_voxels(grid, sweeps[0].origin, np.concatenate(ends_there))
        mask |= passed.ravel() * np.uint8(LIDAR)
    return mask.reshape(grid.shape)


def passed_voxels(grid: VoxelGrid, origin: FloatArray, ends: FloatArray) -> NDArray[np.bool_]:
    """``(X, Y, Z)`` the voxels that rays from one place ``(3,)`` to ``(N, 3)`` pass or end in.

    No ray is followed to a voxel that an earlier one has passed: it goes nearly the same way.
    """
    # Half a second to import, which only processes that make voxels shall need.
    from carstage.occupancy.ray_kernel import mark_passed

    seen: NDArray[np.bool_] = np.zeros(grid.shape, np.bool_)
    mark_passed(origin, np.ascontiguousarray(ends), seen)
    return seen


def _seen_by_camera(
    grid: VoxelGrid, matrix: FloatArray, view: CameraView, ends: Surface | None
) -> NDArray[np.bool_]:
    """``(X, Y, Z)`` the voxels that pixels show, and those whose centres are before that."""
    from carstage.occupancy.ray_kernel import mark_before, mark_shown

    units = grid.units_from(multiply(matrix, view.world_from_sensor))
    optical = multiply(OPTICAL_FROM_SENSOR, units[:, :3].T) * (grid.side_m * grid.side_m)
    start = -rotate(optical, units[:, 3])
    steps = []
    for axis, count in enumerate(grid.shape):
        centres = np.arange(count) + 0.5
        steps.append(np.stack([(centres * row[axis]).astype(np.float32) for row in optical]))
    steps[1] += start.astype(np.float32)[:, None]
    assert view.depth_m is not None
    depth = np.ascontiguousarray(view.depth_m, np.float32)
    nearest, seen = np.float32(Z_NEAR_M), np.zeros(grid.shape, np.bool_)
    mark_before(*steps, view.k.astype(np.float32), depth, nearest, seen)
    if ends is not None:
        x, y, z = ends.points.T.astype(np.int64)
        seen[x, y, z] = True  # a surface has a point in each voxel that pixels show
        return seen
    from_camera, origin, u, v = _pixel_rays(units, view)
    mark_shown(from_camera, origin, u, v, depth, nearest, seen)
    return seen


def _pixel_rays(units: FloatArray, view: CameraView) -> tuple[NDArray[np.float32], ...]:
    """The camera's axes and place in voxels, slopes of its columns and of its rows."""
    optical = multiply(units[:, :3], OPTICAL_FROM_SENSOR.T)
    u = (np.arange(view.width) + 0.5 - view.k[0, 2]) / view.k[0, 0]
    v = (np.arange(view.height) + 0.5 - view.k[1, 2]) / view.k[1, 1]
    return tuple(part.astype(np.float32) for part in (optical, units[:, 3], u, v))
