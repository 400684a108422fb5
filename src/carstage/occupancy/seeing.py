"""What a sensor saw of the voxels: where its rays end, and what they pass on the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.birds_eye.grid import runs
from carstage.birds_eye.visibility import CAMERA, LIDAR, CameraView, Cloud
from carstage.geometry import OPTICAL_FROM_SENSOR, Z_NEAR_M, FloatArray, multiply
from carstage.occupancy.grid import VoxelGrid, placed

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

    @property
    def bit(self) -> int:
        """Of cameras, in masks."""
        return CAMERA


@dataclass(frozen=True, slots=True)
class Sweep:
    """What a LiDAR measures.

    Attributes:
        cloud: its points.
        tags: ``(N,)`` uint8 semantic tags; None: not known, the sweep adds no surface.
    """

    cloud: Cloud
    tags: NDArray[np.uint8] | None

    @property
    def bit(self) -> int:
        """Of LiDARs, in masks."""
        return LIDAR


@dataclass(frozen=True, slots=True)
class Surface:
    """Where the rays of a sensor end, in voxels from the grid's lower corner.

    Attributes:
        origin: ``(3,)`` of the rays.
        points: ``(N, 3)`` in the grid, one of each cell of a half side.
        tags: ``(N,)`` uint8, or None.
        beyond: ``(M, 3)`` ends of rays outside of the grid.
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
    points = placed(units, seen.cloud.points)
    inside = ((points >= 0.0) & (points < np.array(grid.shape))).all(axis=1)
    chosen = np.flatnonzero(inside)
    chosen = chosen[_one_per_cell(grid, points[chosen].T)]
    tags = None if seen.tags is None else seen.tags[chosen]
    return Surface(units[:, 3], points[chosen], tags, points[~inside])


def _of_picture(grid: VoxelGrid, units: FloatArray, seen: Picture) -> Surface:
    """A pixel's surface is where the ray through its centre ends."""
    view = seen.view
    assert view.depth_m is not None
    optical = multiply(units[:, :3], OPTICAL_FROM_SENSOR.T).astype(np.float32)
    origin = units[:, 3]
    depth = view.depth_m.astype(np.float32)
    u = ((np.arange(view.width) + 0.5 - view.k[0, 2]) / view.k[0, 0]).astype(np.float32)
    v = ((np.arange(view.height) + 0.5 - view.k[1, 2]) / view.k[1, 1]).astype(np.float32)
    inside = depth > Z_NEAR_M
    parts = []
    for axis, most in enumerate(grid.shape):
        across, down, along = optical[axis]
        part = (across * u)[None, :] + (down * v + along)[:, None]
        part *= depth
        part += np.float32(origin[axis])
        inside &= (part >= 0) & (part < most)
        parts.append(part)
    chosen = np.flatnonzero(inside)
    near = [part.ravel()[chosen] for part in parts]
    kept = _one_per_cell(grid, near)
    # Rays that leave the grid are as many as it takes not to miss a voxel of its far side.
    far = np.maximum(np.abs(origin), np.abs(np.array(grid.shape) - origin))
    step = max(1, int(view.k[0, 0] / float(np.sqrt((far * far).sum()))))
    left = ~inside[::step, ::step]
    beyond = np.stack([part[::step, ::step][left] for part in parts], axis=-1)
    return Surface(
        origin,
        np.stack([part[kept] for part in near], axis=-1).astype(np.float64),
        None if seen.tags is None else seen.tags.ravel()[chosen[kept]],
        beyond.astype(np.float64),
    )


def _one_per_cell(grid: VoxelGrid, units: FloatArray | list[NDArray[np.float32]]) -> Indices:
    """Which of ``N`` places to keep, one in each cell of a half side, in their order.

    Args:
        grid: the voxels.
        units: three arrays ``(N,)``, all within the grid.
    """
    x, y, z = ((part * FINE).astype(np.int64) for part in units)
    _, rows, layers = grid.shape
    cells = (x * (rows * FINE) + y) * (layers * FINE) + z
    # Only what is written is read: the rest of it costs no memory.
    last: NDArray[np.int32] = np.empty(grid.count * FINE**3, np.int32)
    numbers = np.arange(len(cells), dtype=np.int32)
    last[cells] = numbers
    return np.flatnonzero(last[cells] == numbers)


def seen_voxels(grid: VoxelGrid, found: Surface) -> NDArray[np.bool_]:
    """``(X, Y, Z)`` the voxels that rays pass or end in.

    To each voxel in which rays end, one of them is followed; rays that leave the grid are followed
    to where they do.
    """
    starts, ends = _within(grid, found.origin, np.concatenate([found.points, found.beyond]))
    last = np.minimum(ends.astype(np.int64), np.array(grid.shape) - 1)
    flat = grid.flat(*last.T)
    number: NDArray[np.int32] = np.empty(grid.count, np.int32)
    order = np.arange(len(flat), dtype=np.int32)
    number[flat] = order
    chosen = np.flatnonzero(number[flat] == order)
    seen: NDArray[np.bool_] = np.zeros(grid.count, np.bool_)
    seen[flat[chosen]] = True
    for cells in _passed(grid, starts[chosen], ends[chosen], last[chosen]):
        seen[cells] = True
    return seen.reshape(grid.shape)


def _within(grid: VoxelGrid, origin: FloatArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(N, 3)`` first and last points in the grid of rays; those that miss it are left out."""
    shape = np.array(grid.shape, np.float64)
    way = ends - origin
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = -origin / way, (shape - origin) / way
    level = way == 0.0
    inside = (origin >= 0.0) & (origin <= shape)
    one[level], other[level] = np.where(inside, -np.inf, np.inf)[np.nonzero(level)[1]], np.inf
    enters = np.maximum(np.minimum(one, other).max(axis=1), 0.0)
    leaves = np.minimum(np.maximum(one, other).min(axis=1), 1.0)
    hits = enters < leaves
    way, enters, leaves = way[hits], enters[hits, None], leaves[hits, None]
    return (
        np.clip(origin + way * enters, 0.0, shape),
        np.clip(origin + way * leaves, 0.0, shape),
    )


def _passed(
    grid: VoxelGrid, starts: FloatArray, ends: FloatArray, last: Indices
) -> Iterator[Indices]:
    """Flat numbers of the voxels that lie on ways, those in which they end left out.

    A way enters a voxel through one of its faces. So along each axis, the planes between voxels
    that it crosses name all voxels that it enters that way.
    """
    most = np.array(grid.shape) - 1
    first = np.minimum(starts.astype(np.int64), most)
    yield grid.flat(*first.T)
    way = ends - starts
    for axis in range(3):
        count = np.abs(last[:, axis] - first[:, axis])
        owner, step = runs(count)
        rises = (last[:, axis] > first[:, axis])[owner]
        plane = first[owner, axis] + np.where(rises, step + 1, -step)
        share = (plane - starts[owner, axis]) / way[owner, axis]
        place = [np.zeros(0, np.int64)] * 3
        for other in range(3):
            if other == axis:
                place[other] = plane - ~rises
            else:
                at = starts[owner, other] + share * way[owner, other]
                place[other] = np.clip(at.astype(np.int64), 0, most[other])
        yield grid.flat(*place)
