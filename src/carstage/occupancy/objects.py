"""Which road user a point is of: the one whose box it is in, or nearly."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, invert_pose, pose_matrix
from carstage.occupancy.grid import placed

_PEDESTRIAN, RIDER_TAG = 12, 13
_VEHICLE_TAGS: Final = MappingProxyType(
    {
        "car": 14, "van": 14, "truck": 15, "bus": 16, "train": 17, "motorcycle": 18, "bicycle": 19,
    }
)  # fmt: skip
MOVABLE_TAGS: Final = (_PEDESTRIAN, RIDER_TAG, *sorted(set(_VEHICLE_TAGS.values())))
"""Tags of what may move: pedestrians, riders, vehicles."""
VEHICLE_REACH_M: Final = 0.3
"""Mirrors and antennas may leave a vehicle's box so far."""
PEDESTRIAN_REACH_M: Final = 0.5
"""Arms and legs leave a walker's box, which is CARLA's capsule."""


def object_tag(object_class: str) -> int | None:
    """The semantic tag of a road user's voxels by its class; None: it is part of the town."""
    if object_class.startswith("walker"):
        return _PEDESTRIAN
    return _VEHICLE_TAGS.get(object_class)


def box_tags(object_class: str) -> tuple[int, ...]:
    """Tags that voxels of a road user may have; a two-wheeler's rider has its own."""
    tag = object_tag(object_class)
    return () if tag is None else (tag, RIDER_TAG)


@dataclass(frozen=True, slots=True, eq=False)
class RoadUser:
    """A road user of a frame.

    Attributes:
        row: of ``objects.parquet``.
        tag: of its voxels.
        world_from_box, box_from_world: ``(4, 4)``.
        extent_m: ``(3,)`` half sizes.
        reach_m: how far outside of its box it may be.
    """

    row: Mapping[str, Any]
    tag: int
    world_from_box: FloatArray
    box_from_world: FloatArray
    extent_m: FloatArray
    reach_m: float

    @property
    def track_id(self) -> int:
        """Its id in the label tables."""
        return int(self.row["track_id"])


def road_users(objects: Iterable[Mapping[str, Any]]) -> list[RoadUser]:
    """The vehicles and pedestrians with a box of a frame's rows, ascending track; the ego too."""
    rows = [row for row in objects if row["box_center"] is not None]
    tagged = [(row, tag) for row in rows if (tag := object_tag(row["class"])) is not None]
    tagged.sort(key=lambda pair: pair[0]["track_id"])
    if not tagged:
        return []
    poses = pose_matrix(
        [row["box_center"] for row, _ in tagged], [row["box_rotation_deg"] for row, _ in tagged]
    )
    return [
        RoadUser(
            row,
            tag,
            pose,
            inverse,
            np.array(row["box_extent"]),
            PEDESTRIAN_REACH_M if tag == _PEDESTRIAN else VEHICLE_REACH_M,
        )
        for (row, tag), pose, inverse in zip(tagged, poses, invert_pose(poses), strict=True)
    ]


def owners(
    points: FloatArray, users: Sequence[RoadUser], slack_m: float = 0.0
) -> NDArray[np.int64]:
    """``(N,)`` which road user each point ``(N, 3)`` of the world is of; -1: of none.

    Of several boxes, the one that it is deepest in or nearest to.

    Args:
        points: in the world.
        users: whose they may be.
        slack_m: how far from a surface the points may be.
    """
    owner = np.full(len(points), -1, np.int64)
    if not len(points) or not users:
        return owner
    outside = np.full(len(points), np.inf)
    columns = [np.ascontiguousarray(column) for column in points.T]
    low, high = (np.array([end(column) for column in columns]) for end in (np.min, np.max))
    middle = np.array([user.world_from_box[:3, 3] for user in users])
    half = np.array([user.extent_m for user in users])
    reach = np.array([user.reach_m + slack_m for user in users])
    far = np.sqrt((half * half).sum(axis=1)) + 2.0 * reach
    among = (middle + far[:, None] >= low).all(axis=1) & (middle - far[:, None] <= high).all(axis=1)
    for number in np.flatnonzero(among).tolist():
        user = users[number]
        close = np.abs(columns[0] - middle[number, 0]) <= far[number]
        close &= np.abs(columns[1] - middle[number, 1]) <= far[number]
        near = np.flatnonzero(close)
        if not len(near):
            continue
        local = placed(user.box_from_world, points[near])
        depth = (np.abs(local) - user.extent_m).max(axis=1)
        taken = (depth <= reach[number]) & (depth < outside[near])
        owner[near[taken]], outside[near[taken]] = number, depth[taken]
    return owner
