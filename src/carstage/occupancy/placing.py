"""One frame's voxels from what was gathered over the episode."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, multiply, rotate
from carstage.occupancy.gathering import Gathered
from carstage.occupancy.grid import FREE, VoxelGrid, grid_from_world, placed
from carstage.occupancy.objects import RIDER_TAG, RoadUser, road_users
from carstage.occupancy.seeing import FINE

_MOST_TAGS: Final = 64


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """``(X, Y, Z)`` voxels of one frame, and the ``N`` road users in them.

    Attributes:
        semantic: uint8, the tag of what is there; ``FREE``: nothing is known to be.
        instance: uint16, from 1 the place of a track in ``track_id``; 0: no road user.
        track_id: ``(N,)`` int64, ascending.
        pivot_m: ``(N, 3)`` float32, where the actors' pivots are: forward, left, up.
        velocity_m_s: ``(N, 3)`` float32 of the pivots over the ground, along the same axes.
        angular_velocity_rad_s: ``(N, 3)`` float32 about the same axes, right-handed.
    """

    semantic: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    track_id: NDArray[np.int64]
    pivot_m: NDArray[np.float32]
    velocity_m_s: NDArray[np.float32]
    angular_velocity_rad_s: NDArray[np.float32]


class Placer:
    """Puts what was gathered over the episode where it is in single frames.

    A voxel of the town has the tag that was seen most often in it, of several the lowest. A road
    user goes before the town; of two in a voxel, the one that has more surface there.

    Args:
        grid: the voxels.
        gathered: of the whole episode, or of the part of it around the frames.
    """

    def __init__(self, grid: VoxelGrid, gathered: Gathered) -> None:
        side_m = grid.side_m / FINE
        self._grid = grid
        self._points = gathered.still.points(side_m)
        tags, self._counts = gathered.still.tags, gathered.still.counts
        occurs = np.bincount(tags, minlength=_MOST_TAGS) > 0
        self._known = np.flatnonzero(occurs).astype(np.uint8)
        self._tags = (np.cumsum(occurs) - 1)[tags]
        self._moving = {
            track: (cells.points(side_m), cells.tags == RIDER_TAG)
            for track, cells in gathered.moving.items()
        }

    def place(self, world_from_frame: FloatArray, objects: Iterable[Mapping[str, Any]]) -> Voxels:
        """The voxels of a frame.

        Args:
            world_from_frame: ``(4, 4)`` pose of what they are around.
            objects: rows of ``objects.parquet`` of the frame.
        """
        grid = self._grid
        units = grid.units_from(grid_from_world(world_from_frame))
        semantic: NDArray[np.uint8] = np.full(grid.count, FREE, np.uint8)
        cells, inside = grid.cells(placed(units, self._points))
        voxels, most = _most_seen(
            grid, cells, self._tags[inside], self._counts[inside], max(len(self._known), 1)
        )
        semantic[voxels] = self._known[most]
        users = [user for user in road_users(objects) if not user.row["is_ego"]]
        instance, kept = self._place_users(units, users, semantic)
        tracks = np.array([user.track_id for user in kept], np.int64)
        return Voxels(
            semantic.reshape(grid.shape),
            instance.reshape(grid.shape),
            tracks,
            **motion(world_from_frame, kept),
        )

    def _place_users(
        self, units: FloatArray, users: list[RoadUser], semantic: NDArray[np.uint8]
    ) -> tuple[NDArray[np.uint16], list[RoadUser]]:
        """Put road users into the voxels; gives ``(cells,)`` instances, and who has any."""
        grid = self._grid
        instance: NDArray[np.uint16] = np.zeros(grid.count, np.uint16)
        pairs, rides = [np.zeros(0, np.int64)], [np.zeros(0, np.bool_)]
        for number, user in enumerate(users):
            if user.track_id in self._moving:
                points, riding = self._moving[user.track_id]
                cells, inside = grid.cells(placed(multiply(units, user.world_from_box), points))
                pairs.append(cells * len(users) + number)
                rides.append(riding[inside])
        both, at, amount = np.unique(np.concatenate(pairs), return_inverse=True, return_counts=True)
        riders = np.bincount(at[np.concatenate(rides)], minlength=len(both))
        cells, owner = np.divmod(both, max(len(users), 1))
        order = np.lexsort((owner, -amount, cells))
        best = order[np.append(True, np.diff(cells[order]) > 0)[: len(order)]]
        cells, owner = cells[best], owner[best]
        tags = np.array([user.tag for user in users], np.uint8)
        semantic[cells] = np.where(2 * riders[best] > amount[best], RIDER_TAG, tags[owner])
        kept, places = np.unique(owner, return_inverse=True)
        instance[cells] = places + 1
        return instance, [users[index] for index in kept.tolist()]


def ground_bounds(grid: VoxelGrid, world_from_frame: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(2,)`` least and ``(2,)`` largest x and y of the grid's corners in the world."""
    matrix = grid_from_world(world_from_frame)
    low = np.array(grid.low_m)
    high = low + grid.lengths_m
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1])
                        for z in (low[2], high[2])])  # fmt: skip
    world = rotate(matrix[:3, :3].T, corners - matrix[:3, 3])
    return world.min(axis=0)[:2], world.max(axis=0)[:2]


def _most_seen(
    grid: VoxelGrid,
    cells: NDArray[np.int64],
    tags: NDArray[np.int64],
    counts: NDArray[np.int64],
    known: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The voxels that something is in, and the tag of each, from 0 to ``known``."""
    taken = np.zeros(grid.count, np.bool_)
    taken[cells] = True
    voxels = np.flatnonzero(taken)
    number: NDArray[np.int64] = np.empty(grid.count, np.int64)  # only what is written is read
    number[voxels] = np.arange(len(voxels))
    votes = np.bincount(
        number[cells] * known + tags, weights=counts, minlength=len(voxels) * known
    ).reshape(-1, known)
    return voxels, votes.argmax(axis=1)


def motion(
    world_from_frame: FloatArray, users: Sequence[RoadUser]
) -> dict[str, NDArray[np.float32]]:
    """``(N, 3)`` pivots, velocities and angular velocities of road users, as in :class:`Voxels`.

    The angular velocity of pedestrians is not known: 0.
    """
    matrix = grid_from_world(world_from_frame)
    rows = [user.row for user in users]
    pivot = np.array([row["actor_location"] for row in rows]).reshape(-1, 3)
    velocity = np.array([row["velocity"] for row in rows]).reshape(-1, 3)
    turning = np.array([row["angular_velocity"] or [0.0] * 3 for row in rows]).reshape(-1, 3)
    # CARLA's axes are left-handed, these are right-handed: what turns changes its sign.
    vectors = {
        "pivot_m": placed(matrix, pivot),
        "velocity_m_s": rotate(matrix[:3, :3], velocity),
        "angular_velocity_rad_s": -rotate(matrix[:3, :3], turning),
    }
    return {name: values.astype(np.float32) for name, values in vectors.items()}
