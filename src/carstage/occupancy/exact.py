"""One frame's voxels from what the embedded simulator says of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, invert_pose
from carstage.occupancy.grid import FREE, VoxelGrid, grid_from_world, placed
from carstage.occupancy.objects import MOVABLE_TAGS, RIDER_TAG, RoadUser, owners, road_users
from carstage.occupancy.placing import Voxels, motion

_AXES: Final = (("x", 1.0), ("y", -1.0), ("z", 1.0))
_IS_MOVABLE: Final = np.isin(np.arange(256), MOVABLE_TAGS)


def exact_voxels(
    grid: VoxelGrid,
    world_from_frame: FloatArray,
    objects: Iterable[Mapping[str, Any]],
    points: NDArray[Any],
) -> Voxels:
    """The voxels of a frame from a record of kind ``occupancy``.

    A road user goes before the town; of several, the one with most surface in the voxel. What is
    tagged as a road user and has no box is left out, and so is the ego.

    Args:
        grid: the voxels.
        world_from_frame: ``(4, 4)`` pose of what they are around.
        objects: rows of ``objects.parquet`` of the frame.
        points: ``(N,)`` of ``x``, ``y``, ``z``, ``object_idx`` and ``object_tag``: middles of
            voxels in the frame's axes, CARLA's; of one voxel, what has most surface in it first.

    Raises:
        ValueError: a point is not in the grid.
    """
    users = [user for user in road_users(objects) if not user.row["is_ego"]]
    cells = _cells(grid, points)
    tags, ids = points["object_tag"].astype(np.uint8), points["object_idx"]
    movable = _IS_MOVABLE[tags]
    owner = np.full(len(points), -1, np.int64)
    actors = np.flatnonzero(ids)
    owner[actors] = _by_id(ids[actors], users)
    loose = np.flatnonzero(movable & (ids == 0))
    world_from_grid = invert_pose(grid_from_world(world_from_frame))
    world = placed(world_from_grid, grid.centres(cells[loose]))
    owner[loose] = owners(world, users, grid.side_m * np.sqrt(3.0) / 2.0)
    semantic: NDArray[np.uint8] = np.full(grid.count, FREE, np.uint8)
    of_town = np.flatnonzero((owner < 0) & ~movable)[::-1]
    semantic[cells[of_town]] = tags[of_town]  # of one voxel, what comes first is written last
    of_users = np.flatnonzero(owner >= 0)
    taken, first = np.unique(cells[of_users], return_index=True)
    best = of_users[first]
    own_tags = np.array([user.tag for user in users], np.uint8)
    semantic[taken] = np.where(tags[best] == RIDER_TAG, RIDER_TAG, own_tags[owner[best]])
    kept, places = np.unique(owner[best], return_inverse=True)
    instance: NDArray[np.uint16] = np.zeros(grid.count, np.uint16)
    instance[taken] = places + 1
    shown = [users[index] for index in kept.tolist()]
    return Voxels(
        semantic.reshape(grid.shape),
        instance.reshape(grid.shape),
        np.array([user.track_id for user in shown], np.int64),
        **motion(world_from_frame, shown),
    )


def _cells(grid: VoxelGrid, points: NDArray[Any]) -> NDArray[np.int64]:
    """``(N,)`` flat numbers of the voxels that points are the middles of."""
    cells: NDArray[np.int64] = np.zeros(len(points), np.int64)
    outside: NDArray[np.bool_] = np.zeros(len(points), np.bool_)
    for axis, (name, sign) in enumerate(_AXES):
        place = (points[name] * np.float32(sign) - grid.low_m[axis]) / grid.side_m
        cell = np.floor(place).astype(np.int64)
        outside |= (cell < 0) | (cell >= grid.shape[axis])
        cells = cells * grid.shape[axis] + cell
    if outside.any():
        raise ValueError(f"{np.count_nonzero(outside)} voxels are outside of the grid")
    return cells


def _by_id(ids: NDArray[np.uint32], users: Sequence[RoadUser]) -> NDArray[np.int64]:
    """``(N,)`` which road user, ascending by track, has each id; -1: none."""
    if not users:
        return np.full(len(ids), -1, np.int64)
    tracks = np.array([user.track_id for user in users], np.int64)
    place = np.minimum(np.searchsorted(tracks, ids), len(tracks) - 1)
    return np.where(tracks[place] == ids, place, -1)
